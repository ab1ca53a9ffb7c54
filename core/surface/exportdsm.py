"""Step ``exportdsm``: a surface model and an orthophoto from the original photographs."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from ..block import Block
from ..contract import VectorSource, decode
from ..errors import InputError, NotEnoughData
from ..files import copy_file, digest, remove
from ..georef import FOLDER, Georef
from ..orientation.sparse import read_block
from ..progress import SILENT, Progress
from ..raster import RasterFile
from ..survey import Survey, held
from ..vector import polygons
from .bands import coarser_window
from .checks import RASTERS, check_files, check_numbers, check_photographs, check_room, holes
from .exposure import Balance, find_balance
from .finish import FINGERPRINT, Summary, Wanted, finish
from .holdout import split
from .mosaic import Tile, needed, save, tiles
from .page import write_page
from .plan import Plan, base_over_height, covered_bounds, fit_trend, ground_pixel, make_levels, search_range, snapped_grid
from .work import Sharing, Stages, compute_levels

Array = NDArray[np.float64]

_VERSION = 3  # of the algorithms; raised when the same request gives another surface
_SCRATCH = "dense"
_POOL = 12  # photographs from which on a pool of processes is worth its start, for a glance at each


@dataclass(frozen=True)
class Request:
    """``resolution`` in metres (0 = two ground pixels), ``window`` in cells (0 = adaptive), ``fill`` in m2.

    The outputs are files to write; ``ortho_depth`` is 8 or 16, the bits of a colour.
    """

    survey: str
    output: str
    resolution: float = 0.0
    area: VectorSource | None = None
    ignore: VectorSource | None = None
    window: int = 0
    regularity: float = 1.0
    fill: float = 0.0
    precision: str | None = None
    correlation: str | None = None
    views: str | None = None
    filled: str | None = None
    ortho: str | None = None
    ortho_depth: Literal["8", "16"] = "8"
    points: str | None = None
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """``gsd`` is the mean ground pixel (m); ``coverage_percent`` the share of the area's cells with a height.

    The area is AREA without IGNORE, or, without AREA, the cells that lie in the frames of two photographs.
    """

    output: str
    gsd: float
    coverage_percent: float
    median_precision: float | None
    precision: str | None = None
    correlation: str | None = None
    views: str | None = None
    filled: str | None = None
    ortho: str | None = None
    points: str | None = None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Compute the surface.

    Finished tiles are kept in the survey until the rasters are written, so a run that was stopped goes on where it was.

    Raises
    ------
    InputError
        When a parameter, a layer, a photograph or the survey cannot be used.
    NotEnoughData
        When the photographs do not see any ground twice.
    """
    outputs = {name: path for name in (*RASTERS, "points") if (path := getattr(request, name))}
    check_numbers(
        request.window, request.ortho_depth, resolution=request.resolution, regularity=request.regularity, fill=request.fill
    )
    check_files(outputs, request.output_html_file)
    stages = Stages()
    with held(request.survey, "exportdsm"):
        survey = Survey.open(request.survey)
        standing = survey.require("georeference")
        georef = Georef.read(survey)
        crs = georef.frame.crs
        area = polygons(request.area, crs) if request.area else []
        ignore = polygons(request.ignore, crs) if request.ignore else []
        shapes = [[shapely.to_wkb(g, hex=True) for g in layer] for layer in (area, ignore)]
        surface_key = [_VERSION, standing.fingerprint, request.resolution, request.window, request.regularity, shapes[0]]
        fingerprint = digest(surface_key, shapes[1], request.fill, request.ortho_depth)
        again = _standing(survey, request, fingerprint)
        if again is not None:
            progress.info("The rasters stand already, made from the same survey under the same parameters.")
            progress.at(1.0)
            return again
        scratch = survey.folder / _SCRATCH / digest(surface_key)
        with stages.of("plan"):
            start = _start(survey, georef, request, area, str(scratch), progress)
        plan, sharing = start.plan, Sharing(request.workers, request.scheduler)
        check_photographs(outputs, plan.paths)
        wanted = Wanted(outputs, area, ignore, holes(request.fill, plan.grid.cell), int(request.ortho_depth))
        cut = _cut(plan, area, ignore)
        check_room(plan, cut, outputs)
        with stages.of("brightness of the photographs"):
            plan = replace(plan, balance=_balance(start, Path(scratch), sharing, progress.part(0.01, 0.03)))
        compute_levels(plan, cut, sharing, stages, progress.part(0.03, 0.93))
        georeferencing = {
            "frame": asdict(georef.frame),
            "pivot": georef.pivot,
            "covariance": georef.covariance,
            "heights": georef.heights,
        }
        parameters = {
            "resolution": plan.grid.cell,
            "window": request.window,
            "regularity": request.regularity,
            "fill": request.fill,
            "ortho_depth": int(request.ortho_depth),
        }
        flown = min((p.time for p in survey.photographs if p.time), default=None)
        with stages.of("finishing"):
            part = progress.part(0.93, 0.99)
            summary = finish(plan, cut[-1], wanted, start.left_out, fingerprint, georeferencing, parameters, part, flown=flown)
        result = Result(
            gsd=plan.gsd,
            coverage_percent=summary.coverage_percent,
            median_precision=summary.median_precision,
            **outputs,
        )
        write_page(survey.report_path("exportdsm"), request.output_html_file, plan, summary, parameters, stages.listed)
        sizes = {name: Path(path).stat().st_size for name, path in outputs.items()}
        survey.finish(
            "exportdsm",
            fingerprint,
            built_on=("georeference",),
            parameters=parameters,
            result={**asdict(result), "bytes": sizes},
        )
        remove(survey.folder / _SCRATCH)
    _tell(plan, summary, progress)
    progress.at(1.0)
    return result


@dataclass(frozen=True)
class _Start:
    """The plan, the block that it was made from, and the tie points left out (n, 3: easting, northing, height)."""

    plan: Plan
    block: Block
    left_out: Array


def _start(survey: Survey, georef: Georef, request: Request, area: list[Any], scratch: str, progress: Progress) -> _Start:
    block = read_block(survey.folder / FOLDER)
    if len(block.views) < 2:
        raise NotEnoughData(
            f"The georeferenced block of {survey.folder} has fewer than two photographs: no height can be measured."
        )
    listed = {p.name: p for p in survey.photographs}
    paths = []
    for view in block.views:
        photograph = listed.get(view.name)
        if photograph is None:
            raise InputError(f"{view.name} is oriented but not in the survey {survey.folder}: run strandline:orient again.")
        if (photograph.width, photograph.height) != (view.camera.width, view.camera.height):
            raise InputError(
                f"{view.name} has {photograph.width} x {photograph.height} pixels but was oriented with {view.camera.width} x "
                f"{view.camera.height}: run strandline:orient and strandline:georeference again."
            )
        paths.append(str(survey.path(photograph)))
    block, left_out = split(block)
    gsd, base = ground_pixel(block), base_over_height(block)
    resolution = request.resolution or 2.0 * gsd
    if resolution < 0.5 * gsd:
        progress.warn(
            f"RESOLUTION {resolution:g} m is finer than half a ground pixel ({gsd:.3g} m): cells show no more than pixels do."
        )
    points = georef.frame.to_crs(block.points[block.errors <= np.percentile(block.errors, 95)])
    bounds = covered_bounds(block, georef.frame, points)
    if area:
        west, south, east, north = shapely.total_bounds(area)
        bounds = max(bounds[0], west), max(bounds[1], south), min(bounds[2], east), min(bounds[3], north)
        if bounds[0] >= bounds[2] or bounds[1] >= bounds[3]:
            raise InputError("AREA lies outside what two photographs see: check its place and its CRS.")
    grid = snapped_grid(bounds, resolution, georef.frame.crs)
    plane, found = fit_trend(points, grid.west, grid.north)
    flying = float(np.median([v.centre[2] for v in block.views]) - np.median(block.points[:, 2]))
    relief = search_range(found, flying)
    plan = Plan(
        block.views,
        tuple(paths),
        georef.frame,
        grid,
        plane,
        relief,
        make_levels(grid, relief, base),
        gsd,
        request.window,
        request.regularity,
        scratch,
        Balance.none(len(block.views)),
    )
    return _Start(plan, block, georef.frame.to_crs(left_out) if len(left_out) else left_out)


def _cut(plan: Plan, area: list[Any], ignore: list[Any]) -> list[list[Tile]]:
    """Return the tiles to compute of each level: those that AREA without IGNORE touches, and what these need.

    Raises
    ------
    InputError
        When nothing is left of the area.
    """
    bounds = shapely.box(*plan.grid.bounds)
    left = shapely.difference(
        shapely.intersection(bounds, shapely.union_all(area)) if area else bounds, shapely.union_all(ignore)
    )
    if shapely.is_empty(left) or not shapely.area(left) > 0:
        raise InputError("IGNORE covers all that the photographs and AREA leave to measure: check its place.")
    shapely.prepare(left)
    finest = []
    for tile in tiles(plan.levels[-1]):
        row, column, rows, columns = tile.core_window
        if shapely.intersects(left, shapely.box(*plan.grid.window(column, row, columns, rows).bounds)):
            finest.append(tile)
    return needed(plan.levels, finest, coarser_window)


def _balance(start: _Start, scratch: Path, sharing: Sharing, progress: Progress) -> Balance:
    """Return how bright the photographs are, kept with the tiles because it takes a look at each photograph."""
    path = scratch / "balance.npz"
    if path.is_file():
        with np.load(path, allow_pickle=False) as data:
            return Balance(data["gain"], data["fall"])
    balance = find_balance(
        start.block,
        start.plan.paths,
        workers=sharing.workers if len(start.plan.paths) >= _POOL else 1,
        scheduler=sharing.scheduler,
        progress=progress,
    )
    save(path, gain=balance.gain, fall=balance.fall)
    return balance


def _standing(survey: Survey, request: Request, fingerprint: str) -> Result | None:
    """Return the result of the last run if it had this fingerprint and its files stand where they are wanted now."""
    record = survey.record("exportdsm")
    if record is None or record.fingerprint != fingerprint or survey.is_stale("exportdsm"):
        return None
    sizes = record.result.get("bytes", {})
    for name in (*RASTERS, "points"):
        path = getattr(request, name)
        if not path:
            continue
        if record.result.get(name) != path or not Path(path).is_file() or Path(path).stat().st_size != sizes.get(name):
            return None
        if name == "points":
            continue
        with RasterFile(path) as file:
            if file.tags.get(FINGERPRINT) != fingerprint:
                return None
    if request.output_html_file:
        page = survey.report_path("exportdsm")
        if not page.is_file():
            return None
        copy_file(page, request.output_html_file)
    recorded = decode(Result, {k: v for k, v in record.result.items() if k != "bytes"})
    unwanted: dict[str, Any] = {name: None for name in (*RASTERS, "points") if not getattr(request, name)}
    return replace(recorded, **unwanted)


def _tell(plan: Plan, summary: Summary, progress: Progress) -> None:
    precision = "not known" if summary.median_precision is None else f"{100 * summary.median_precision:.2g} cm"
    progress.info(
        f"{summary.cells} cells of {plan.grid.cell:g} m have a height, {summary.coverage_percent:.1f} % of the area; "
        f"ground pixel {100 * plan.gsd:.2g} cm, median precision of matching {precision}."
    )
    if summary.coverage_percent < 50 and not math.isnan(summary.coverage_percent):
        progress.warn(
            f"Only {summary.coverage_percent:.0f} % of the area has a height: water, trees and plain surfaces stay empty; "
            "look at the correlation in the report."
        )
