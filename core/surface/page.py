"""The report of ``exportdsm``: the surface to look at, and how far to trust it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..report.html import Report, new_figure
from ..report.relief import exaggeration, heights_drawn, hillshade
from .finish import Summary
from .plan import Plan


def write_page(path: Path, copy: str | None, plan: Plan, summary: Summary, parameters: dict[str, Any]) -> None:
    """Write the page to ``path`` and, when given, to ``copy``."""
    precision = summary.median_precision
    told = (
        "its precision is not known"
        if precision is None
        else f"the noise of a height is {100 * precision:.2g} cm (median, 1 sigma)"
    )
    report = Report(
        "Surface model",
        f"{summary.coverage_percent:.1f} % of the area has a height, on cells of {100 * plan.grid.cell:.3g} cm; {told}.",
    )
    if summary.coverage_percent < 50:
        report.warning(
            "More than half of the area is empty. Water, moving trees and surfaces without contrast cannot be measured and are "
            "not invented; the map of the correlation tells which photographs disagree where."
        )
    report.heading("Surface")
    cell = plan.grid.cell * summary.thinning
    factor = exaggeration(summary.height, cell)
    light = hillshade(summary.height, cell, factor)
    seen = np.isfinite(light)
    report.picture(
        _over(np.where(seen, 255 * light, 0).astype(np.uint8)[..., None], seen),
        f"Light from the north-west, {heights_drawn(factor)}. White: no height.",
    )
    report.picture(_over(summary.colour[..., :3], summary.colour[..., 3] > 0), "Orthophoto.")
    report.figure(_map(plan, summary.height, "terrain", "height (m)", 0.5), "Height.")
    report.heading("Trust")
    report.figure(_map(plan, summary.score, "viridis", "correlation", 0.0), "Mean correlation between the photographs of a cell.")
    if precision is not None:
        report.figure(_map(plan, 100 * summary.sigma, "magma_r", "sigma (cm)", 2.0), "Precision of matching, 1 sigma.")
    report.text(
        "The precision is that of matching alone, cell by cell. The georeferencing's error is common to all cells (shift, tilt, "
        "scale): it stands in the report of georeferencing and travels in the raster's tags to the volumes."
    )
    report.heading("Numbers")
    grid = plan.grid
    report.table(
        ["", ""],
        [
            ["cells with a height", summary.cells],
            ["of these filled by interpolation", summary.filled],
            ["share of the area with a height (%)", summary.coverage_percent],
            ["mean correlation", summary.mean_score],
            ["median precision (m)", precision],
            ["ground pixel (m)", plan.gsd],
            ["grid", f"{grid.width} x {grid.height} cells of {grid.cell:g} m"],
            ["photographs", len(plan.views)],
            ["heights searched about the ground's plane (m)", f"{plan.relief[0]:.1f} to {plan.relief[1]:+.1f}"],
            *([name.upper(), value] for name, value in parameters.items()),
        ],
    )
    report.text(
        "Each height is the one at which up to eight photographs agree best, regularised along eight directions from coarse to "
        "fine. A cell stays empty when fewer than two photographs see it, when they do not agree better than chance, when the "
        "best height without regularisation lies elsewhere, or when it belongs to a small island."
    )
    report.save(path, copy)


def _over(picture: NDArray[np.uint8], where: NDArray[np.bool_]) -> NDArray[np.uint8]:
    return np.where(where[..., None], np.broadcast_to(picture, (*picture.shape[:2], 3)), 255).astype(np.uint8)


def _map(plan: Plan, values: NDArray[np.float32], colours: str, label: str, clip: float) -> Any:
    figure = new_figure(9.0, 6.5)
    axes = figure.add_subplot()
    west, south, east, north = plan.grid.bounds
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, [clip, 100 - clip]) if len(known) else (0.0, 1.0)
    picture = axes.imshow(values, cmap=colours, vmin=low, vmax=high, extent=(west, east, south, north), interpolation="nearest")
    axes.set(xlabel="easting (m)", ylabel="northing (m)", aspect="equal")
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.tick_params(labelsize=8)
    figure.colorbar(picture, label=label, shrink=0.8)
    return figure
