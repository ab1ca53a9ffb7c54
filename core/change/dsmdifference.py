"""Step ``dsmdifference``: erosion and deposition between two surface models, with their uncertainty."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import shapely

from ..contract import RasterSource, VectorSource
from ..errors import InputError
from ..progress import SILENT, Progress
from .alignment import Aligned, common_grid, link_accuracy
from .coregistration import Method, Shift, statistics
from .difference import Pair, Sigma, difference, stable_ground
from .errormodel import error_model, height_error, systematic_error
from .georeferencing import require_one_reference
from .heard import Heard
from .heights import Heights, open_heights
from .planshift import PlanShift, WithPlan, plan_shift
from .report import Findings, write_report
from .units import true_area
from .validation import validate
from .volumes import Volume, without_precision
from .volumetable import write_volumes
from .zones import Zone, read_zones, union

_LINK = 0.1  # metres between two datums that are worth a warning


@dataclass(frozen=True)
class Request:
    """Sigmas and ranges in metres; ``output``, ``significant`` are rasters and ``volumes`` a GeoPackage to write."""

    before: RasterSource
    after: RasterSource
    output: str
    nodata: float | None = None
    before_precision: RasterSource | None = None
    after_precision: RasterSource | None = None
    before_sigma: float | None = None
    after_sigma: float | None = None
    stable: VectorSource | None = None
    zones: VectorSource | None = None
    zone_field: str | None = None
    ignore: VectorSource | None = None
    coregister: Literal["auto", "none", "vertical", "plane", "horizontal"] = "auto"
    registration_sigma: float | None = None
    horizontal_sigma: float | None = None
    correlation_range: float | None = None
    lod: Literal["cell", "uniform", "coherent"] = "cell"
    confidence: float = 0.95
    significant: str | None = None
    volumes: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Volumes in m3 over the union of the zones, ``area`` in m2; None is "not known"."""

    output: str
    net: float | None
    net_sigma: float | None
    net_random: float | None
    net_correlated: float | None
    net_systematic: float | None
    erosion: float | None
    erosion_sigma: float | None
    deposition: float | None
    deposition_sigma: float | None
    erosion_significant: float | None
    deposition_significant: float | None
    net_significant: float | None
    area: float
    covered_percent: float
    significant: str | None = None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Compute the difference and the volumes."""
    validate(request)
    heard = Heard(progress)
    progress = Progress(heard)
    with ExitStack() as files:
        heights = [
            files.enter_context(open_heights(source, label, request.nodata, progress.part(start, start + 0.1)))
            for source, label, start in ((request.before, "BEFORE", 0.0), (request.after, "AFTER", 0.1))
        ]
        before, after = heights
        require_one_reference(before.file.tags, after.file.tags)
        grid, shared = common_grid(before, after)
        if (accuracy := link_accuracy(before, after)) > _LINK:
            progress.warn(
                f"The datums of BEFORE and AFTER are linked to {accuracy:g} m only: one may lie that far beside the other; "
                "put both in the CRS in which they were surveyed."
            )
        _, areas = true_area(grid.crs, *shapely.get_coordinates(shapely.point_on_surface(shared))[0])
        if areas:
            progress.warn(areas)
        zones = read_zones(request.zones, "ZONES", request.zone_field, grid.crs) if request.zones else [Zone("overlap", shared)]
        if not any(shapely.intersects(zone.shape, shared) for zone in zones):
            raise InputError("No zone of ZONES lies where BEFORE and AFTER overlap: draw zones there, and check the layer's CRS.")
        stable = _shapes(request.stable, "STABLE", grid.crs)
        if stable and not any(shapely.intersects(s, shared) for s in stable):
            raise InputError("STABLE does not lie where BEFORE and AFTER overlap: draw it there, and check the layer's CRS.")
        pair = Pair(Aligned(before, grid), Aligned(after, grid), _shapes(request.ignore, "IGNORE", grid.crs))
        if _same_file(request.before.path, request.after.path):
            progress.warn("BEFORE and AFTER are the same file: there is no change to see.")

        precisions = [
            open_heights(source, f"{label}_PRECISION", None, progress.part(start, start + 0.025)) if source else None
            for source, label, start in ((request.before_precision, "BEFORE", 0.2), (request.after_precision, "AFTER", 0.225))
        ]
        for precision in precisions:
            if precision:
                files.enter_context(precision)
        sigma = _given_sigma(request, pair, precisions)
        ground = stable_ground(pair, stable, sigma, progress.part(0.25, 0.3)) if stable else None
        first = None if ground is None else ground.change
        plan = plan_shift(request.coregister, pair, stable, request.horizontal_sigma, progress.part(0.3, 0.36))
        if plan is not None and plan.moved:
            pair = pair.moved(plan.applied)
            sigma = None if sigma is None else sigma.moved(plan.applied)
            ground = stable_ground(pair, stable, sigma, progress.part(0.36, 0.4))
        shift, known = height_error(_method(request), ground, (before, after), grid, zones, progress)
        if ground is not None and first is not None and len(ground.change):
            stats = statistics(first), statistics(ground.change - shift.at(ground.x, ground.y, ground.height))
            if sigma is None:
                sigma = Sigma(common=stats[1].nmad)
        else:
            stats = None
            if stable:
                progress.warn("STABLE covers no cell with a height in both rasters: it tells nothing.")
        if sigma is None and request.significant:
            raise InputError(
                "SIGNIFICANT needs a level of detection: give BEFORE_SIGMA and AFTER_SIGMA, the two PRECISION rasters, or STABLE."
            )
        if sigma is None:
            progress.warn(
                "The sigma of the heights is not known, so no change can be called significant: "
                "give BEFORE_SIGMA and AFTER_SIGMA, the two PRECISION rasters, or STABLE."
            )
        if ground is not None and ground.sigma is None and sigma is not None and sigma.common is not None:
            ground = ground.with_sigma(sigma.common)
        steps = (grid.step_north, grid.cell)
        expected = known.shift if known else shift
        model, variogram = error_model(request.correlation_range, ground, expected, sigma is not None, steps, progress)
        systematic = systematic_error(request.registration_sigma, shift, known)
        if plan is not None and known is not None:
            systematic = WithPlan(systematic, plan, 0 if shift.method == "none" else 1 if shift.method == "vertical" else 3)

        shapes = [zone.shape for zone in zones]
        whole = union(zones) if len(zones) > 1 else shapes[0]
        outcome = difference(
            pair,
            shift,
            sigma,
            [*shapes, whole] if len(zones) > 1 else shapes,
            registration=(request.registration_sigma or 0.0) if shift.method == "none" else 0.0,
            method=request.lod,
            confidence=request.confidence,
            output=request.output,
            significant=request.significant,
            tags=_tags(request, shift, plan),
            progress=progress.part(0.4, 0.95),
        )
    if outcome.moved == 0:
        progress.warn("BEFORE and AFTER are identical: no cell differs.")
    volumes = [tally.volume(model, systematic) for tally in outcome.tallies]
    total = volumes[-1]
    if outcome.without_sigma:
        names = [zone.name for zone in zones] + ["all zones"]
        progress.warn(without_precision(outcome.without_sigma, names, outcome.tallies))
    empty = [zone.name for zone, volume in zip(zones, volumes, strict=False) if volume.net is None]
    if empty:
        progress.warn(f"No cell of {', '.join(empty)} has a height in both rasters: their volumes are not known.")
    if request.volumes:
        write_volumes(request.volumes, zones, volumes[: len(zones)], grid.crs, request.confidence)
    if request.output_html_file:
        write_report(
            request.output_html_file,
            Findings(
                before=before,
                after=after,
                grid=grid,
                outcome=outcome,
                zones=zones,
                volumes=volumes[: len(zones)],
                total=total,
                confidence=request.confidence,
                method=request.lod,
                shift=shift,
                known=known,
                plan=plan,
                stable=stats,
                model=model,
                variogram=variogram,
                sigma=_sigma_words(request, sigma),
                warnings=tuple(heard.warnings),
            ),
        )
    progress.at(1.0)
    return _result(request, total)


def _same_file(first: str, second: str) -> bool:
    return Path(first).resolve() == Path(second).resolve()


def _shapes(source: VectorSource | None, label: str, crs: str) -> list[shapely.Geometry]:
    return [zone.shape for zone in read_zones(source, label, None, crs)] if source else []


def _given_sigma(request: Request, pair: Pair, precisions: list[Heights | None]) -> Sigma | None:
    """Return the sigma that the user gave for both models, None unless it is complete."""
    numbers = (request.before_sigma, request.after_sigma)
    before, after = (Aligned(p, pair.grid) if p else number for p, number in zip(precisions, numbers, strict=True))
    if before is None or after is None:
        return None
    if request.lod == "uniform":
        squares = [p.mean_square if p else float(n or 0.0) ** 2 for p, n in zip(precisions, numbers, strict=True)]
        return Sigma(common=float(np.sqrt(sum(squares))))
    return Sigma(before, after)


def _method(request: Request) -> Method | None:
    """Return the correction that is asked for, None to take off what is expected."""
    return None if request.coregister == "auto" or request.coregister == "horizontal" else request.coregister


def _sigma_words(request: Request, sigma: Sigma | None) -> str:
    if sigma is None:
        return "not known"
    given = [
        "precision raster" if precision else f"{number:g} m" if number is not None else None
        for precision, number in (
            (request.before_precision, request.before_sigma),
            (request.after_precision, request.after_sigma),
        )
    ]
    if None not in given:
        return f"BEFORE: {given[0]}; AFTER: {given[1]}"
    return f"{sigma.common:.4f} m for the difference, the NMAD of stable ground"


def _tags(request: Request, shift: Shift, plan: PlanShift | None) -> dict[str, str]:
    moved = f"in plan {plan.applied[0]:+.3f}, {plan.applied[1]:+.3f} m; " if plan and plan.moved else ""
    return {
        "STRANDLINE_BEFORE": Path(request.before.path).name,
        "STRANDLINE_AFTER": Path(request.after.path).name,
        "STRANDLINE_DIFFERENCE": "after minus before, metres",
        "STRANDLINE_COREGISTRATION": f"{moved}{shift.method}: {shift.describe()}",
    }


def _result(request: Request, total: Volume) -> Result:
    return Result(
        output=request.output,
        net=total.net,
        net_sigma=total.sigma.total,
        net_random=total.sigma.random,
        net_correlated=total.sigma.correlated,
        net_systematic=total.sigma.systematic,
        erosion=total.erosion,
        erosion_sigma=total.erosion_sigma.total,
        deposition=total.deposition,
        deposition_sigma=total.deposition_sigma.total,
        erosion_significant=total.erosion_significant,
        deposition_significant=total.deposition_significant,
        net_significant=total.net_significant,
        area=total.area,
        covered_percent=total.covered_percent,
        significant=request.significant,
    )
