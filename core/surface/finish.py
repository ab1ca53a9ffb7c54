"""From finished tiles to the rasters: masks, holes, tags, the numbers, and thumbnails for the report."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj import CRS

from .. import __version__
from ..contract import encode
from ..errors import NotEnoughData
from ..progress import Progress
from ..raster import CogWriter, Grid, Patch
from .filling import fill, margin
from .holdout import Check, Comparison
from .mosaic import Mosaic, Tile
from .plan import Plan
from .points import Cells, PointWriter
from .thumbnails import Thumbnails

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

FINGERPRINT = "STRANDLINE_FINGERPRINT"
_NOT_FILLED = 255  # nodata of the raster of filled cells: no height at all
_BINS = np.concatenate([[0.0], np.geomspace(1e-6, 1e3, 4000)])  # metres: bins of half a per cent for the median


@dataclass(frozen=True)
class Wanted:
    """What to write: files by output name, AREA and IGNORE (polygons), the largest hole to fill (cells), the colours' bits."""

    outputs: dict[str, str]
    area: list[Any]
    ignore: list[Any]
    fill: int
    depth: int


@dataclass(frozen=True)
class Summary:
    """The numbers and pictures of a surface; pictures are thinned, values NaN (alpha 0) where there are none."""

    cells: int
    filled: int
    coverage_percent: float
    median_precision: float | None
    mean_score: float | None
    comparison: Comparison
    thinning: int
    height: Floats
    score: Floats
    sigma: Floats
    views: NDArray[np.uint8]
    colour: NDArray[np.uint8]


@dataclass
class _Count:
    covered: int = 0
    cells: int = 0
    filled: int = 0
    score: float = 0.0


def finish(
    plan: Plan,
    computed: list[Tile],
    wanted: Wanted,
    left_out: NDArray[np.float64],
    fingerprint: str,
    georeferencing: dict[str, Any],
    parameters: dict[str, Any],
    progress: Progress,
    *,
    flown: str | None = None,
) -> Summary:
    """Write the rasters from the ``computed`` tiles and return the summary; the DSM takes its place last.

    ``left_out`` are the tie points (n, 3: easting, northing, height) to compare with.

    ``flown`` (ISO 8601) is the time of the first photograph, by which steps on several dates tell them apart.

    Raises
    ------
    NotEnoughData
        When no cell has a height; then nothing is written.
    """
    grid, level = plan.grid, plan.levels[-1]
    mosaic = Mosaic(plan.scratch, level, computed[0].core, computed[0].overlap, only=computed)
    tags = {
        "STRANDLINE_VERSION": __version__,
        "STRANDLINE_PARAMETERS": json.dumps(encode(parameters)),
        FINGERPRINT: fingerprint,
    }
    if flown:
        tags["STRANDLINE_DATE"] = flown
    located = {
        **tags,
        "VERTICAL_DATUM": vertical_datum(georeferencing["heights"], grid.crs),
        "STRANDLINE_GEOREFERENCING": json.dumps(encode(georeferencing)),
    }
    thumbs, check, count = Thumbnails(grid), Check(left_out), _Count()
    histogram = np.zeros(len(_BINS) - 1, np.int64)
    with ExitStack() as stack:
        # The last to open is the first to close: the DSM, opened first, takes its place when all others have.
        writers: dict[str, CogWriter] = {}
        for name, path in wanted.outputs.items():
            if name == "points":
                continue
            options = _KINDS[name] if name != "ortho" or wanted.depth == 8 else {**_KINDS[name], "dtype": "uint16"}
            writers[name] = stack.enter_context(CogWriter(path, grid, tags=located if name == "output" else tags, **options))
        cloud = None
        if "points" in wanted.outputs:
            cloud = stack.enter_context(PointWriter(wanted.outputs["points"], grid, plan.datum))
        for tile in progress.over(computed):
            row, column, rows, columns = tile.core_window
            patch = grid.window(column, row, columns, rows)
            layers = _patch(plan, mosaic, tile, wanted, check)
            cells, colour = layers.cells, layers.cells.colour
            number = np.where(layers.wanted, cells.views, 0).astype(np.uint8)
            colour[~layers.wanted] = 0
            shades = _eight(colour)
            known = np.isfinite(cells.height)
            filled = np.where(known, cells.filled, _NOT_FILLED).astype(np.uint8)
            score = np.where(layers.wanted & (number >= 2), layers.score, np.nan).astype(np.float32)
            values: dict[str, NDArray[Any]] = {
                "output": cells.height[None],
                "precision": cells.sigma[None],
                "correlation": score[None],
                "views": number[None],
                "filled": filled[None],
                "ortho": np.moveaxis(shades if wanted.depth == 8 else colour, 2, 0),
            }
            for name, writer in writers.items():
                writer.write(Patch(column, row, values[name]))
            if cloud is not None:
                cloud.write(column, row, cells)
            thumbs.put(row, column, cells.height, np.where(known, score, np.nan), cells.sigma, number, shades)
            allowed = layers.wanted & ~inside(wanted.ignore, patch)
            count.covered += int((mosaic.read("covered", row, column, rows, columns) & allowed).sum())
            count.cells += int(known.sum())
            count.filled += int(cells.filled.sum())
            count.score += float(np.nansum(np.where(known & ~cells.filled, score, np.nan), dtype=np.float64))
            histogram += np.histogram(cells.sigma[np.isfinite(cells.sigma)], _BINS)[0]
        if not count.cells:
            raise NotEnoughData(
                "No cell of the area has a height, for photographs agree nowhere in it: check AREA, IGNORE and the orientation."
            )
    size = float(count.covered)
    if wanted.area:
        size = shapely.area(shapely.difference(shapely.union_all(wanted.area), shapely.union_all(wanted.ignore))) / grid.cell_area
    measured = count.cells - count.filled
    return Summary(
        cells=count.cells,
        filled=count.filled,
        coverage_percent=min(100.0, 100.0 * count.cells / size) if size else 0.0,
        median_precision=_median(histogram),
        mean_score=count.score / measured if measured else None,
        comparison=check.result(),
        thinning=thumbs.thinning,
        **thumbs.layers(),
    )


_KINDS: dict[str, dict[str, Any]] = {
    "output": {"names": ("height (m)",), "unit": "m"},
    "precision": {"names": ("sigma of matching (m)",), "unit": "m"},
    "correlation": {"names": ("correlation",)},
    "views": {"dtype": "uint8", "names": ("photographs",), "nodata": 0, "overviews": "mode"},
    "filled": {"dtype": "uint8", "names": ("filled",), "nodata": _NOT_FILLED, "overviews": "mode"},
    "ortho": {"dtype": "uint8", "bands": 4, "names": ("red", "green", "blue", "alpha")},
}


@dataclass(frozen=True)
class _Layers:
    cells: Cells
    score: Floats
    wanted: Mask


def _patch(plan: Plan, mosaic: Mosaic, tile: Tile, wanted: Wanted, check: Check) -> _Layers:
    """Return a tile's core with its holes filled and what is not wanted left out."""
    grid, level = plan.grid, tile.level
    row, column, rows, columns = tile.core_window
    reach = max(margin(wanted.fill), 1)
    r0, c0 = max(0, row - reach), max(0, column - reach)
    r1, c1 = min(level.rows, row + rows + reach), min(level.columns, column + columns + reach)
    wide = r0, c0, r1 - r0, c1 - c0
    around = grid.window(c0, r0, c1 - c0, r1 - r0)
    core = slice(row - r0, row - r0 + rows), slice(column - c0, column - c0 + columns)
    height = mosaic.blend("height", *wide, tolerance=2 * level.step)
    good = mosaic.read("good", *wide)
    sigma = np.where(good, mosaic.read("sigma", *wide), np.nan).astype(np.float32)
    lies = inside(wanted.area, around) if wanted.area else np.ones(good.shape, bool)
    barred = ~lies | inside(wanted.ignore, around)
    height, sigma, filled = fill(height, sigma, good, wanted.fill, barred)
    filled &= ~barred
    valid = (good | filled) & ~barred
    measured = np.where(valid & ~filled, height.astype(np.float64) + plan.datum, np.nan)
    check.put(grid.window(column, row, columns, rows), measured, sigma, around)
    cells = Cells(
        height=np.where(valid, height.astype(np.float64) + plan.datum, np.nan).astype(np.float32)[core],
        sigma=np.where(valid, sigma, np.nan)[core],
        views=mosaic.read("views", row, column, rows, columns),
        filled=filled[core],
        colour=mosaic.read("colour", row, column, rows, columns),
    )
    return _Layers(cells, mosaic.read("score", row, column, rows, columns), lies[core])


def inside(shapes: list[Any], window: Grid) -> Mask:
    """Tell which cells (rows, columns) of a window have their centre in one of the polygons."""
    out = np.zeros((window.height, window.width), bool)
    box = shapely.box(*window.bounds)
    near = [s for s in shapes if shapely.intersects(s, box)]
    if any(shapely.contains_properly(s, box) for s in near):
        return ~out
    if near:
        x = window.west + (np.arange(window.width) + 0.5) * window.cell
        y = window.north - (np.arange(window.height) + 0.5) * window.cell
        for shape in near:
            shapely.prepare(shape)
            out |= shapely.contains_xy(shape, x[None, :], y[:, None])
    return out


def vertical_datum(heights: str, crs: str) -> str:
    """Return in words what heights stand on; the CRS is horizontal, so that QGIS 3.22 can read it.

    >>> vertical_datum("ellipsoidal", "EPSG:32630")
    'ellipsoidal heights above WGS 84'
    """
    if heights == "ellipsoidal":
        ellipsoid = CRS.from_user_input(crs).ellipsoid
        return f"ellipsoidal heights above {ellipsoid.name if ellipsoid else 'the ellipsoid of the CRS'}"
    if heights == "orthometric":
        return "orthometric heights, of the ground control or by the geoid that georeferencing was given"
    return "unknown"


def _eight(colour: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return 16-bit colours as 8-bit ones: 65535 is 255."""
    return ((colour.astype(np.uint32) * 255 + 32767) // 65535).astype(np.uint8)


def _median(histogram: NDArray[np.int64]) -> float | None:
    total = int(histogram.sum())
    if not total:
        return None
    place = int(np.searchsorted(np.cumsum(histogram), 0.5 * total))
    return float(np.sqrt(max(_BINS[place], 1e-7) * _BINS[place + 1]))
