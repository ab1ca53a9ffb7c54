"""The report of ``dsmdifference``: what changed, how sure that is, and on what it rests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..raster import Grid
from ..report.html import Report, new_figure
from ..report.relief import exaggeration, heights_drawn, hillshade
from .coregistration import Shift, Statistics
from .difference import Outcome
from .heighterror import HeightError
from .heights import Heights
from .planshift import PlanShift
from .significance import coverage_factor
from .terms import BENT_AT, COUNT, IN_METRES
from .uncertainty import ErrorModel
from .variogram import Variogram
from .volumes import Parts, Volume
from .zones import Zone

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Findings:
    """Everything that the report tells."""

    before: Heights
    after: Heights
    grid: Grid
    outcome: Outcome
    zones: list[Zone]
    volumes: list[Volume]
    total: Volume
    confidence: float
    method: str
    shift: Shift
    known: HeightError | None
    plan: PlanShift | None
    stable: tuple[Statistics, Statistics] | None
    model: ErrorModel
    variogram: Variogram | None
    sigma: str
    warnings: tuple[str, ...]


def verdict(total: Volume, confidence: float) -> str:
    """Return the result in one or two sentences."""
    if total.net is None:
        return "No cell of the zones has a height in both rasters: no volume is known."
    sure = f"{100 * confidence:g} %"
    where = f"on {total.area:,.0f} m2, {total.covered_percent:.1f} % of which both models cover"
    sigma = total.sigma.total
    if sigma is None:
        missing = [
            name for name, part in zip(("random", "correlated", "systematic"), _three(total.sigma), strict=True) if part is None
        ]
        return (
            f"Net {total.net:+,.1f} m3 {where}. Its uncertainty is not known: nothing tells the {' and '.join(missing)} "
            f"part{'s' if len(missing) > 1 else ''} of the error."
        )
    half = coverage_factor(confidence) * sigma
    kind = "not distinguishable from no change" if abs(total.net) <= half else "a gain" if total.net > 0 else "a loss"
    return f"Net {total.net:+,.1f} +- {half:,.1f} m3 ({sure}) {where}: {kind}."


def write_report(path: str, findings: Findings) -> None:
    """Write the page."""
    f = findings
    report = Report("Difference of surface models", verdict(f.total, f.confidence))
    for warning in f.warnings:
        report.warning(warning)
    _volumes(report, f)
    report.heading("Map")
    cells = f.outcome.thinning * f.grid.step_north, f.outcome.thinning * f.grid.cell
    factor = exaggeration(f.outcome.height, cells)
    report.figure(
        _map(f, hillshade(f.outcome.height, cells, factor)),
        f"Change over the relief of BEFORE (light from the north-west, {heights_drawn(factor)}); red: erosion, blue: deposition. "
        "Outlines: zones.",
    )
    report.figure(_histogram(f), "Change of all cells, thinned.")
    _stable(report, f)
    report.heading("Inputs")
    report.table(
        ["", "file", "cell (m)", "size (cells)", "CRS", "no data"],
        [
            [
                h.label,
                h.file.path,
                h.cell,
                f"{h.file.width} x {h.file.height}",
                h.units.crs.split('"')[1],
                ", ".join(f"{v:g}" for v in dict.fromkeys(h.nodata)) or "none declared",
            ]
            for h in (f.before, f.after)
        ],
    )
    g = f.grid
    report.text(
        f"Common grid: {g.width} x {g.height} cells of {g.cell:.6g} x {g.step_north:.6g} m, the coarser one's. A model is read "
        "by bilinear interpolation, a finer one by the mean over the cell; a cell that would need a height from a hole has none. "
        "A cell that IGNORE touches has none either. Zones count boundary cells by the share inside."
    )
    report.save(path)


def _volumes(report: Report, f: Findings) -> None:
    report.heading("Volumes")
    rows = [(zone.name, volume) for zone, volume in zip(f.zones, f.volumes, strict=True)]
    if len(rows) > 1:
        rows.append(("all zones (union)", f.total))
    factor = coverage_factor(f.confidence)
    report.table(
        ["zone", "net (m3)", f"+- ({100 * f.confidence:g} %)", "random", "correlated", "systematic", "area (m2)", "covered %"],
        [
            [name, v.net, None if v.sigma.total is None else factor * v.sigma.total, *_three(v.sigma), v.area, v.covered_percent]
            for name, v in rows
        ],
    )
    report.text("Random, correlated and systematic are one sigma in m3. A dash means: not known.")
    report.table(
        ["zone", "erosion", "sigma", "deposition", "sigma", "significant erosion", "significant deposition", "noise in each"],
        [
            [
                name,
                v.erosion,
                v.erosion_sigma.total,
                v.deposition,
                v.deposition_sigma.total,
                v.erosion_significant,
                v.deposition_significant,
                v.noise,
            ]
            for name, v in rows
        ],
    )
    report.text(
        "Erosion and deposition add up noise as well as change: where nothing moved each gains 0.4 sigma per cell, together "
        "about what the last column says. Quote the net volume and the significant volumes only. Leaving out what is below the "
        "level of detection also biases the net: the first table is over all cells."
    )
    report.text(f"Sigma of the heights: {f.sigma}. Level of detection: {f.method}, {100 * f.confidence:g} %, two-sided.")
    m = f.model
    if m.random is not None and m.structures is not None:
        parts = [f"{m.random:.3f} random"]
        for factor, reach in m.structures:
            over = f"over {reach:.3g} m" if np.isfinite(reach) else "over the whole area (a bound: the range is not resolved)"
            parts.append(f"{factor:.3f} correlated {over}")
        report.text(f"Times each cell's sigma: {', '.join(parts)}.")


def _stable(report: Report, f: Findings) -> None:
    report.heading("Co-registration and stable ground")
    report.text(f"Taken off the difference: {f.shift.method}, {f.shift.describe()}.")
    if f.known is None or not f.known.bends:
        report.text(
            "The systematic part knows of no dome, which self-calibrated cameras leave in a block (a centimetre or two at its "
            "edge is common, and it differs from flight to flight): not both models carry the georeferencing of an adjustment, "
            "which tells how far a block may be bent. Where zones lie far from STABLE, look at the map for change that rises "
            "with the distance from the middle, and put stable ground on all sides."
        )
    if f.known is not None and f.known.covariance is not None:
        _known(report, f.known)
    if f.stable is None:
        report.text("No stable ground was given.")
        return
    report.table(
        ["change on stable ground (m)", "cells", "mean", "median", "std", "NMAD", "68.3 % below", "95 % below"],
        [
            [name, s.count, s.mean, s.median, s.std, s.nmad, s.q68, s.q95]
            for name, s in zip(("before co-registration", "after"), f.stable, strict=True)
        ],
    )
    if f.variogram is not None and f.variogram.lags:
        report.figure(_variogram(f.variogram), "Variogram of the standardised change on stable ground.")


def _known(report: Report, known: HeightError) -> None:
    rows: list[list[object]] = []
    if known.prior is not None:
        rows.append(["the georeferencings (expected, sigma)", *_pairs((0.0,) * COUNT, known.prior)])
    if known.stable is not None:
        rows.append(["stable ground (fitted, sigma)", *_pairs(known.stable[0].coefficients, known.stable[1])])
    if known.covariance is not None:
        rows.append(["taken as known (expected, sigma)", *_pairs(known.shift.coefficients, known.covariance)])
    bent = [f"bending at {BENT_AT:g} m to the {where} (mm)" for where in ("east", "north", "north-east")]
    names = ("level (mm)", "tilt to the east (mm/m)", "tilt to the north (mm/m)", "height's scale (mm/m)", *bent)
    report.table(["error of AFTER against BEFORE", *names], rows)
    report.text(
        "What is taken as known joins both by generalised least squares; its covariance, and what was not taken off, make the "
        "systematic part. Bending rises as the square of the distance. A dash: not known, and not counted."
    )


def _pairs(values: tuple[float, ...], covariance: Array) -> list[str | None]:
    """Return seven texts "value +- sigma" in mm; a sigma of 0 is that of what nothing observes."""
    count = len(values)
    units = 1e3 * IN_METRES[:count, :count]
    units[1:4] /= BENT_AT  # per metre
    told: list[str | None] = [
        f"{value:+.3g} +- {sigma:.2g}"
        for value, sigma in zip(units @ values, np.sqrt(np.diag(units @ covariance @ units.T)), strict=True)
    ]
    return told + [None] * (COUNT - count)


def _map(f: Findings, light: NDArray[np.float32]) -> Any:
    figure = new_figure(9.0, 7.0)
    axes = figure.add_subplot()
    west, south, east, north = f.grid.bounds
    step = f.outcome.thinning
    height, width = f.outcome.change.shape
    box = (west, west + width * step * f.grid.cell, north - height * step * f.grid.step_north, north)
    axes.imshow(light, cmap="gray", vmin=0, vmax=1, extent=box)
    limit = _limit(f.outcome.change)
    picture = axes.imshow(f.outcome.change, cmap="RdBu", vmin=-limit, vmax=limit, extent=box, alpha=0.75, interpolation="nearest")
    for zone in f.zones:
        for part in shapely.get_parts(zone.shape):
            for ring in (shapely.get_exterior_ring(part), *part.interiors):
                axes.plot(*shapely.get_coordinates(ring).T, color="black", linewidth=0.8)
    axes.set(xlim=(west, east), ylim=(south, north), xlabel="easting (m)", ylabel="northing (m)", aspect="equal")
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.tick_params(labelsize=8)
    figure.colorbar(picture, label="change (m)", shrink=0.8)
    return figure


def _limit(change: Array) -> float:
    sizes = np.abs(change[np.isfinite(change)])
    limit = float(np.quantile(sizes, 0.95)) if len(sizes) else 0.0
    return limit if limit > 0 else 1.0


def _histogram(f: Findings) -> Any:
    figure = new_figure(9.0, 3.2)
    axes = figure.add_subplot()
    change = f.outcome.change[np.isfinite(f.outcome.change)]
    limit = 1.5 * _limit(change)
    axes.hist(np.clip(change, -limit, limit), bins=121, range=(-limit, limit), color="#8a7a55")
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set(xlabel="change (m)", ylabel="cells")
    return figure


def _variogram(v: Variogram) -> Any:
    figure = new_figure(9.0, 3.2)
    axes = figure.add_subplot()
    lags = np.asarray(v.lags)
    axes.plot(lags, v.gamma, "o", color="#8a7a55", label="stable ground")
    h = np.geomspace(lags[0], lags[-1], 200)
    ranges = ", ".join(f"{reach:.3g} m" if np.isfinite(reach) else "not resolved" for _, reach in v.structures) or "none"
    if np.isfinite(v.reach):
        axes.plot(h, v.at(h), color="black", label=f"spherical, range {ranges}")
    axes.set(xscale="log", xlabel="distance (m)", ylabel="half squared difference (sigma^2)", ylim=(0, None))
    axes.legend()
    return figure


def _three(parts: Parts) -> tuple[float | None, float | None, float | None]:
    return parts.random, parts.correlated, parts.systematic
