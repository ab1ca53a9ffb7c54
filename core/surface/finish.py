"""From finished tiles to the rasters: masks, holes, tags, the numbers, and thumbnails for the report."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from .. import __version__
from ..contract import encode
from ..errors import NotEnoughData
from ..progress import Progress
from ..raster import CogWriter, Grid, Patch
from .filling import fill, margin
from .mosaic import Mosaic, tiles
from .plan import Plan
from .points import PointWriter

Floats = NDArray[np.float32]

FINGERPRINT = "STRANDLINE_FINGERPRINT"
_THUMBNAIL = 1400  # pixels along the longer side
_HISTOGRAM = np.concatenate([[0.0], np.geomspace(1e-6, 1e3, 4000)])  # metres: bins of half a per cent for the median


@dataclass(frozen=True)
class Summary:
    """The numbers and pictures of a surface; pictures are thinned, values NaN (alpha 0) where there are none."""

    cells: int
    filled: int
    coverage_percent: float
    median_precision: float | None
    mean_score: float | None
    thinning: int
    height: Floats
    score: Floats
    sigma: Floats
    colour: NDArray[np.uint8]


def finish(
    plan: Plan,
    outputs: dict[str, str],
    area: list[Any],
    ignore: list[Any],
    fill_area: float,
    fingerprint: str,
    georeferencing: dict[str, Any],
    parameters: dict[str, Any],
    progress: Progress,
) -> Summary:
    """Write the rasters that ``outputs`` names and return the summary; the DSM takes its place last.

    Raises
    ------
    NotEnoughData
        When no cell has a height; then nothing is written.
    """
    grid, level = plan.grid, plan.levels[-1]
    mosaic = Mosaic(plan.scratch, level)
    most = int(fill_area / grid.cell**2)
    reach = max(margin(most), 1)
    tags = {
        "STRANDLINE_VERSION": __version__,
        "STRANDLINE_PARAMETERS": json.dumps(encode(parameters)),
        FINGERPRINT: fingerprint,
    }
    located = {**tags, "STRANDLINE_GEOREFERENCING": json.dumps(encode(georeferencing))}
    thinning = max(1, -(-max(grid.width, grid.height) // _THUMBNAIL))
    thumbs = _Thumbnails(grid, thinning)
    covered = cells = filled_cells = 0
    histogram = np.zeros(len(_HISTOGRAM) - 1, np.int64)
    score_sum = 0.0
    with ExitStack() as stack:
        # The last to open is the first to close: the DSM, opened first, takes its place when all others have.
        writers: dict[str, CogWriter] = {}
        for name, path in outputs.items():
            if name == "points":
                continue
            kind, bands, label, own = _KINDS[name]
            writers[name] = stack.enter_context(
                CogWriter(path, grid, dtype=kind, bands=bands, names=label, tags=located if own else tags)
            )
        cloud = stack.enter_context(PointWriter(outputs["points"], grid)) if "points" in outputs else None
        for tile in progress.over(tiles(level)):
            row, column, rows, columns = tile.core_window
            r0, c0 = max(0, row - reach), max(0, column - reach)
            r1, c1 = min(level.rows, row + rows + reach), min(level.columns, column + columns + reach)
            wide = r0, c0, r1 - r0, c1 - c0
            core = slice(row - r0, row - r0 + rows), slice(column - c0, column - c0 + columns)
            height = mosaic.blend("height", *wide, tolerance=2 * level.step)
            good = mosaic.read("good", *wide)
            sigma = np.where(good, mosaic.read("sigma", *wide), np.nan).astype(np.float32)
            height, sigma, filled = fill(height, sigma, good, most)
            valid = (good | filled)[core]
            height, sigma, filled = height[core], sigma[core], filled[core]
            wanted = inside(area, grid.window(column, row, columns, rows)) if area else np.ones((rows, columns), bool)
            ignored = inside(ignore, grid.window(column, row, columns, rows))
            valid &= wanted & ~ignored
            filled &= valid
            number = np.where(wanted, mosaic.read("views", row, column, rows, columns), 0).astype(np.uint8)
            colour = mosaic.read("colour", row, column, rows, columns)
            colour[~wanted] = 0
            score = mosaic.read("score", row, column, rows, columns)
            score = np.where(wanted & (number >= 2), score, np.nan).astype(np.float32)
            height = np.where(valid, height.astype(np.float64) + plan.datum, np.nan).astype(np.float32)
            sigma = np.where(valid, sigma, np.nan)
            layers = {
                "output": height[None],
                "precision": sigma[None],
                "correlation": score[None],
                "views": number[None],
                "filled": filled[None].astype(np.uint8),
                "ortho": np.moveaxis(colour, 2, 0),
            }
            for name, writer in writers.items():
                writer.write(Patch(column, row, layers[name]))
            if cloud is not None:
                cloud.write(column, row, height, colour)
            thumbs.put(row, column, height, np.where(valid, score, np.nan), sigma, colour)
            covered += int((mosaic.read("covered", row, column, rows, columns) & wanted & ~ignored).sum())
            cells += int(valid.sum())
            filled_cells += int(filled.sum())
            histogram += np.histogram(sigma[np.isfinite(sigma)], _HISTOGRAM)[0]
            score_sum += float(np.nansum(np.where(valid & ~filled, score, np.nan), dtype=np.float64))
        if not cells:
            raise NotEnoughData(
                "No cell of the area has a height, for photographs agree nowhere in it: check AREA, IGNORE and the orientation."
            )
    size = (
        shapely.area(shapely.difference(shapely.union_all(area), shapely.union_all(ignore))) / grid.cell**2 if area else covered
    )
    return Summary(
        cells,
        filled_cells,
        min(100.0, 100.0 * cells / size) if size else 0.0,
        _median(histogram),
        score_sum / (cells - filled_cells) if cells > filled_cells else None,
        thinning,
        **thumbs.layers(),
    )


_KINDS: dict[str, tuple[str, int, tuple[str, ...], bool]] = {
    "output": ("float32", 1, ("height (m)",), True),
    "precision": ("float32", 1, ("sigma of matching (m)",), False),
    "correlation": ("float32", 1, ("correlation",), False),
    "views": ("uint8", 1, ("photographs",), False),
    "filled": ("uint8", 1, ("filled",), False),
    "ortho": ("uint8", 4, ("red", "green", "blue", "alpha"), False),
}


def inside(shapes: list[Any], window: Grid) -> NDArray[np.bool_]:
    """Tell which cells (rows, columns) of a window have their centre in one of the polygons."""
    out = np.zeros((window.height, window.width), bool)
    west, south, east, north = window.bounds
    near = [s for s in shapes if shapely.intersects(s, shapely.box(west, south, east, north))]
    if near:
        x = west + (np.arange(window.width) + 0.5) * window.cell
        y = north - (np.arange(window.height) + 0.5) * window.cell
        for shape in near:
            shapely.prepare(shape)
            out |= shapely.contains_xy(shape, x[None, :], y[:, None])
    return out


def _median(histogram: NDArray[np.int64]) -> float | None:
    total = int(histogram.sum())
    if not total:
        return None
    place = int(np.searchsorted(np.cumsum(histogram), 0.5 * total))
    return float(np.sqrt(max(_HISTOGRAM[place], 1e-7) * _HISTOGRAM[place + 1]))


class _Thumbnails:
    def __init__(self, grid: Grid, thinning: int) -> None:
        rows, columns = -(-grid.height // thinning), -(-grid.width // thinning)
        self._step = thinning
        self._numbers = {name: np.full((rows, columns), np.nan, np.float32) for name in ("height", "score", "sigma")}
        self._colour = np.zeros((rows, columns, 4), np.uint8)

    def put(self, row: int, column: int, height: Floats, score: Floats, sigma: Floats, colour: NDArray[np.uint8]) -> None:
        s = self._step
        first = -row % s, -column % s
        r, c = (row + first[0]) // s, (column + first[1]) // s
        if s > 1:
            colour = cv2.blur(colour, (s, s))
        for name, layer in (("height", height), ("score", score), ("sigma", sigma)):
            thin = layer[first[0] :: s, first[1] :: s]
            self._numbers[name][r : r + thin.shape[0], c : c + thin.shape[1]] = thin
        part = colour[first[0] :: s, first[1] :: s]
        self._colour[r : r + part.shape[0], c : c + part.shape[1]] = part

    def layers(self) -> dict[str, Any]:
        return {**self._numbers, "colour": self._colour}
