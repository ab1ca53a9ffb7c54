"""The report of ``exportdsm``: the surface to look at, and how far to trust it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..report.html import Report, new_figure
from ..report.maps import picture_map, value_map
from ..report.relief import exaggeration, heights_drawn, hillshade
from ..report.section import Profile, steepest_profile
from .finish import Summary
from .holdout import Comparison
from .plan import Plan
from .work import Stage

_FEW = 20  # tie points below which their statistics say little
_SAND = ["#22577a", "#6f9aa0", "#e6d6a6", "#d0a665", "#96683c", "#f2efe9"]


def write_page(
    path: Path, copy: str | None, plan: Plan, summary: Summary, parameters: dict[str, Any], stages: Sequence[Stage]
) -> None:
    """Write the page to ``path`` and, when given, to ``copy``."""
    report = Report("Surface model", _verdict(plan, summary))
    for warning in _warnings(summary):
        report.warning(warning)
    _surface(report, plan, summary)
    _trust(report, plan, summary)
    report.heading("What these numbers do not say")
    for caveat in _CAVEATS:
        report.text(caveat)
    _numbers(report, plan, summary, parameters)
    _cost(report, stages)
    report.save(path, copy)


_CAVEATS = (
    "The precision is that of matching alone, cell by cell. The georeferencing's error is common to all cells (level, tilt, "
    "scale, bending): it stands in the report of georeferencing, travels in the DSM's metadata and enters each volume from "
    "there. Before you quote a height, look at the check points there.",
    "Neighbouring cells share a correlation window of five to nine cells, so that their errors are alike: the mean over a "
    "hundred cells is not ten times better than one of them.",
    "The surface is what the photographs see from above: plants, cars and people are on it, and the ground under them is not.",
    "A filled cell is a guess from its surroundings. Its sigma says how the ground around it varies, not that it was measured.",
)


def _verdict(plan: Plan, summary: Summary) -> str:
    told = (
        "its precision is not known"
        if summary.median_precision is None
        else f"the noise of a height is {_centimetres(summary.median_precision)} (median, 1 sigma)"
    )
    verdict = f"{summary.coverage_percent:.1f} % of the area has a height, on cells of {100 * plan.grid.cell:.3g} cm; {told}."
    comparison = summary.comparison
    if comparison.nmad is not None and comparison.median is not None and len(comparison.differences) >= _FEW:
        verdict += (
            f" Against {len(comparison.differences)} tie points that took no part it lies {_centimetres(comparison.median)} "
            f"off in the median and scatters by {_centimetres(comparison.nmad)} (NMAD)."
        )
    return verdict


def _warnings(summary: Summary) -> list[str]:
    out = []
    if summary.coverage_percent < 50:
        out.append(
            "More than half of the area is empty. Water, moving trees and surfaces without contrast cannot be measured and are "
            "not invented; the map of the correlation tells which photographs disagree where."
        )
    if summary.filled > 0.05 * summary.cells:
        out.append(
            f"{100 * summary.filled / summary.cells:.0f} % of the heights were interpolated, not measured: the raster of filled "
            "cells tells which."
        )
    return out


def _surface(report: Report, plan: Plan, summary: Summary) -> None:
    report.heading("The surface")
    cell, bounds = plan.grid.cell * summary.thinning, _bounds(plan, summary)
    factor = exaggeration(summary.height, cell)
    profile = steepest_profile(summary.height, summary.sigma, cell)
    ends = None
    if profile is not None:
        (r0, c0), (r1, c1) = profile.start, profile.end
        ends = ((bounds[0] + (c0 + 0.5) * cell, bounds[3] - (r0 + 0.5) * cell),
                (bounds[0] + (c1 + 0.5) * cell, bounds[3] - (r1 + 0.5) * cell))  # fmt: skip
    light = hillshade(summary.height, cell, factor)
    seen = np.isfinite(light)
    shade = np.where(seen, 255 * np.nan_to_num(light), 0).astype(np.uint8)
    line = " The line A to B is the profile below." if ends else ""
    report.figure(
        picture_map(np.dstack([shade, shade, shade, 255 * seen.astype(np.uint8)]), bounds, ends),
        f"Hillshade: light from the north-west, {heights_drawn(factor)}. Pale grey: no height. Sand should be smooth, edges "
        f"sharp, and nothing should run along straight lines.{line}",
        dense=True,
    )
    report.figure(picture_map(summary.colour, bounds), "Orthophoto, of the photographs brought to one brightness.", dense=True)
    report.figure(
        value_map(summary.height, bounds, colours=_terrain(), label="height (m)", clip=0.5), "Height above the block's datum."
    )
    if profile is not None:
        report.figure(_profile(profile), _told_of(profile))


def _trust(report: Report, plan: Plan, summary: Summary) -> None:
    report.heading("How far to trust it")
    bounds, comparison = _bounds(plan, summary), summary.comparison
    if len(comparison.differences):
        report.figure(_histogram(comparison, plan), _compared(comparison, plan))
    else:
        report.text("No tie point of three rays or more could be left out to check the surface by.")
    if summary.median_precision is not None:
        report.figure(
            value_map(100 * summary.sigma, bounds, colours="magma_r", label="sigma (cm)", clip=2.0),
            "Precision of matching, one standard deviation of each height. It grows where the ground is plain, where "
            "photographs are few, and towards the block's edge.",
        )
    report.figure(
        value_map(summary.score, bounds, colours="viridis", label="correlation", limits=(0.0, 1.0)),
        "Mean correlation between the photographs of a cell: 1 is alike in all, below 0.3 the cell is hardly told from noise.",
    )
    views = np.where(summary.views > 0, summary.views, np.nan).astype(float)
    most = int(np.nanmax(views)) if np.isfinite(views).any() else 1
    report.figure(
        value_map(views, bounds, colours="YlGnBu", label="photographs", whole=most),
        "Photographs that see each cell. Two are one height without a check; five or more make it four times better.",
    )


def _numbers(report: Report, plan: Plan, summary: Summary, parameters: dict[str, Any]) -> None:
    report.heading("Numbers")
    grid, comparison = plan.grid, summary.comparison
    report.table(
        ["", ""],
        [
            ["cells with a height", summary.cells],
            ["of these filled by interpolation", summary.filled],
            ["share of the area with a height (%)", summary.coverage_percent],
            ["mean correlation", summary.mean_score],
            ["median precision (m)", summary.median_precision],
            ["tie points left out, of these compared", f"{comparison.left_out}, {len(comparison.differences)}"],
            ["surface less tie points, median (m)", comparison.median],
            ["surface less tie points, NMAD (m)", comparison.nmad],
            ["ground pixel (m)", plan.gsd],
            ["grid", f"{grid.width} x {grid.height} cells of {grid.cell:g} m"],
            ["photographs", len(plan.views)],
            ["heights searched about the ground's plane (m)", f"{plan.relief[0]:.1f} to {plan.relief[1]:+.1f}"],
            *([name.upper(), value] for name, value in parameters.items()),
        ],
    )
    report.text(
        "Each height is the one at which the best eight photographs agree most, regularised along eight directions from coarse "
        "to fine. A cell stays empty when fewer than two photographs see it, when they do not agree better than chance, when the "
        "best height without regularisation lies elsewhere, or when it belongs to a small island."
    )


def _cost(report: Report, stages: Sequence[Stage]) -> None:
    report.heading("Time and memory")
    total = Stage("together")
    for stage in stages:
        total.clock += stage.clock
        total.tiles += stage.tiles
        total.kept += stage.kept
        total.add(stage.processor, stage.memory)
    report.table(
        ["stage", "by the clock (s)", "processors (s)", "most memory of a process (MB)", "tiles", "kept from an earlier run"],
        [
            [s.name, round(s.clock, 1), round(s.processor, 1), s.memory and round(s.memory), s.tiles or None, s.kept or None]
            for s in (*stages, total)
        ],
    )


def _bounds(plan: Plan, summary: Summary) -> tuple[float, float, float, float]:
    """Return the bounds of the thumbnails: their last cells may reach beyond the grid."""
    west, _, _, north = plan.grid.bounds
    cell = plan.grid.cell * summary.thinning
    rows, columns = summary.height.shape
    return west, north - rows * cell, west + columns * cell, north


def _compared(comparison: Comparison, plan: Plan) -> str:
    n = len(comparison.differences)
    assert comparison.median is not None
    assert comparison.nmad is not None
    far = 100 * float(np.mean(np.abs(comparison.differences - comparison.median) > 5 * plan.gsd))
    few = f" Only {n} points: their statistics say little." if n < _FEW else ""
    return (
        f"The surface less {n} tie points of three rays or more that took no part in it, of {comparison.left_out} left out "
        f"(every tenth): median {100 * comparison.median:+.2g} cm, NMAD {_centimetres(comparison.nmad)}, {far:.1f} % more "
        "than five ground pixels from the median. The points' own error is in this, and they share the orientation: it is "
        f"not the error of heights; it tells faults of matching.{few}"
    )


def _histogram(comparison: Comparison, plan: Plan) -> Any:
    values = 100 * comparison.differences
    assert comparison.median is not None
    assert comparison.nmad is not None
    middle, spread = 100 * comparison.median, 100 * max(comparison.nmad, 0.05 * plan.gsd)
    reach = 5 * spread
    figure = new_figure(9.0, 3.4)
    axes = figure.add_subplot()
    edges = np.linspace(middle - reach, middle + reach, 61)
    axes.hist(np.clip(values, edges[0], edges[-1]), bins=edges.tolist(), color="#c9a45c", edgecolor="white", linewidth=0.4)
    axes.axvspan(middle - spread, middle + spread, color="#2a6f97", alpha=0.12, label=f"± NMAD, {spread:.2g} cm")
    axes.axvline(middle, color="#2a6f97", linewidth=1.5, label=f"median, {middle:+.2g} cm")
    axes.axvline(0.0, color="#222222", linewidth=0.8, linestyle=":")
    axes.set(xlabel="surface less tie point (cm); the outermost bars hold all beyond", ylabel="tie points", xlim=edges[[0, -1]])
    axes.legend(fontsize=9, frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def _profile(profile: Profile) -> Any:
    figure = new_figure(9.0, 3.2)
    axes = figure.add_subplot()
    band = 2 * np.nan_to_num(profile.sigma)
    axes.fill_between(
        profile.distance,
        profile.height - band,
        profile.height + band,
        color="#2a6f97",
        alpha=0.25,
        linewidth=0,
        label="± 2 sigma",
    )
    axes.plot(profile.distance, profile.height, color="#22577a", linewidth=1.2)
    for side, name, at in (("left", "A", 0.0), ("right", "B", 1.0)):
        axes.text(at, 1.02, name, transform=axes.transAxes, ha=side, fontweight="bold", color="#b2182b")
    axes.set(xlabel="distance from A (m)", ylabel="height (m)", xlim=(0, profile.distance[-1]))
    axes.ticklabel_format(useOffset=False, axis="y")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9, frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def _told_of(profile: Profile) -> str:
    known = np.isfinite(profile.height)
    rise = float(profile.height[known].max() - profile.height[known].min())
    return (
        f"Profile down the steepest slope, from A to B: {profile.distance[-1]:.3g} m long, {rise:.2g} m between its lowest and "
        "highest height. Gaps are cells without a height."
    )


def _terrain() -> Any:
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("terrain", _SAND)


def _centimetres(value: float) -> str:
    return f"{100 * value:.2g} cm"
