"""Step ``exportdsm``: a surface model and an orthophoto from the original photographs."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..contract import VectorSource, decode
from ..errors import InputError, NotEnoughData
from ..files import copy_file, digest, remove
from ..georef import FOLDER, Georef
from ..orientation.sparse import read_block
from ..parallel import run_calls
from ..progress import SILENT, Progress
from ..raster import RasterFile, check_destination
from ..survey import Survey, held
from ..vector import polygons
from .finish import FINGERPRINT, Summary, finish
from .match import match_tile
from .mosaic import tiles
from .page import write_page
from .plan import Plan, base_over_height, covered_bounds, fit_trend, ground_pixel, make_levels, search_range, snapped_grid
from .points import check_points_destination

_VERSION = 2  # of the algorithms; raised when the same request gives another surface
_SCRATCH = "dense"
_FINEST = 1e-4  # m
_RASTERS = ("output", "precision", "correlation", "views", "filled", "ortho")
_POOL = 4  # tiles from which on a pool of processes is worth its start


@dataclass(frozen=True)
class Request:
    """``resolution`` in metres (0 = two ground pixels), ``window`` in cells (0 = adaptive), ``fill`` in m2.

    The outputs are files to write.
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
    _check(request)
    with held(request.survey, "exportdsm"):
        survey = Survey.open(request.survey)
        standing = survey.require("georeference")
        georef = Georef.read(survey)
        crs = georef.frame.crs
        area = polygons(request.area, crs) if request.area else []
        ignore = polygons(request.ignore, crs) if request.ignore else []
        shapes = [[shapely.to_wkb(g, hex=True) for g in layer] for layer in (area, ignore)]
        surface_key = [_VERSION, standing.fingerprint, request.resolution, request.window, request.regularity, shapes[0]]
        fingerprint = digest(surface_key, shapes[1], request.fill)
        again = _standing(survey, request, fingerprint)
        if again is not None:
            progress.info("The rasters stand already, made from the same survey under the same parameters.")
            progress.at(1.0)
            return again
        scratch = survey.folder / _SCRATCH / digest(surface_key)
        plan = _plan(survey, georef, request, area, str(scratch), progress)
        _match(plan, request, progress.part(0.02, 0.9))
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
        }
        outputs = {name: path for name in (*_RASTERS, "points") if (path := getattr(request, name))}
        summary = finish(
            plan, outputs, area, ignore, request.fill, fingerprint, georeferencing, parameters, progress.part(0.9, 0.99)
        )
        result = Result(
            gsd=plan.gsd,
            coverage_percent=summary.coverage_percent,
            median_precision=summary.median_precision,
            **outputs,
        )
        write_page(survey.report_path("exportdsm"), request.output_html_file, plan, summary, parameters)
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


def _check(request: Request) -> None:
    for name in _RASTERS:
        if path := getattr(request, name):
            check_destination(path)
    if request.points:
        check_points_destination(request.points)
    if request.window and not (3 <= request.window <= 31 and request.window % 2):
        raise InputError(f"WINDOW={request.window} is not an odd number from 3 to 31: choose one, or 0 to adapt it.")
    for name in ("resolution", "regularity", "fill"):
        if getattr(request, name) < 0:
            raise InputError(f"{name.upper()}={getattr(request, name):g} is negative: give 0 or more.")
    if 0 < request.resolution < _FINEST:
        raise InputError(f"RESOLUTION={request.resolution:g} m is finer than any photograph: give metres, or 0 for two pixels.")
    outputs = [str(Path(path).absolute()) for name in (*_RASTERS, "points") if (path := getattr(request, name))]
    twice = sorted({path for path in outputs if outputs.count(path) > 1})
    if twice:
        raise InputError(f"{twice[0]} is named for two outputs: give each a name of its own.")


def _plan(survey: Survey, georef: Georef, request: Request, area: list[Any], scratch: str, progress: Progress) -> Plan:
    block = read_block(survey.folder / FOLDER)
    if len(block.views) < 2:
        raise NotEnoughData(
            f"The georeferenced block of {survey.folder} has fewer than two photographs: no height can be measured."
        )
    listed = {p.name: p for p in survey.photographs}
    missing = [v.name for v in block.views if v.name not in listed]
    if missing:
        raise InputError(f"{missing[0]} is oriented but not in the survey {survey.folder}: run strandline:orient again.")
    paths = tuple(str(survey.path(listed[v.name])) for v in block.views)
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
    levels = make_levels(grid, relief, base)
    return Plan(block.views, paths, georef.frame, grid, plane, relief, levels, gsd, request.window, request.regularity, scratch)


def _match(plan: Plan, request: Request, progress: Progress) -> None:
    """Compute all tiles of all levels; a level needs the one before it."""
    work = [level.rows * level.columns for level in plan.levels]
    done = 0
    for level, cells in zip(plan.levels, work, strict=True):
        part = progress.part(done / sum(work), (done + cells) / sum(work))
        cut = tiles(level)
        for _ in run_calls(
            match_tile,
            ((plan, tile) for tile in cut),
            workers=request.workers if len(cut) >= _POOL else 1,
            scheduler=request.scheduler,
            progress=part,
            total=len(cut),
        ):
            pass
        done += cells


def _standing(survey: Survey, request: Request, fingerprint: str) -> Result | None:
    """Return the result of the last run if it had this fingerprint and its files stand where they are wanted now."""
    record = survey.record("exportdsm")
    if record is None or record.fingerprint != fingerprint or survey.is_stale("exportdsm"):
        return None
    sizes = record.result.get("bytes", {})
    for name in (*_RASTERS, "points"):
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
    unwanted: dict[str, Any] = {name: None for name in (*_RASTERS, "points") if not getattr(request, name)}
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
