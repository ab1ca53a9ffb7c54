"""The report of ``shoreline``: the lines on a map, how they moved along the transects, and on what it rests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from ..report.html import Report, new_figure
from .epocherror import EpochError
from .series import Series
from .seriesreport import colours, dates_told
from .shorelinemoves import Moves
from .transects import Transect

if TYPE_CHECKING:
    from .shoreline import Position, Request, Shoreline


@dataclass(frozen=True)
class ShorelineFindings:
    """Everything that the report tells."""

    request: Request
    series: Series
    errors: list[EpochError]
    shores: list[Shoreline]
    transects: list[Transect]
    positions: list[list[Position | None]]
    moves: list[Moves]
    scale: float
    warnings: tuple[str, ...]


def verdict(f: ShorelineFindings) -> str:
    """Return the result in a sentence or two."""
    dates = f"{f.series.epochs[0].name} to {f.series.epochs[-1].name}"
    nsm = [m.nsm for m in f.moves if m.nsm is not None]
    if not nsm:
        return f"Shorelines at {f.request.datum:g} m of {len(f.series.epochs)} date(s), {dates}."
    told = f"From {dates} the shoreline at {f.request.datum:g} m moved by {np.mean(nsm):+.2f} m, the mean of {len(nsm)} transects"
    tested = [m for m in f.moves if m.nsm_sigma is not None and m.nsm is not None]
    if tested:
        out = sum(m.nsm > m.factor * m.nsm_sigma for m in tested if m.nsm is not None and m.nsm_sigma is not None)
        back = sum(-m.nsm > m.factor * m.nsm_sigma for m in tested if m.nsm is not None and m.nsm_sigma is not None)
        still = len(tested) - out - back
        told += f"; at {100 * f.request.confidence:g} % {out} advanced, {back} retreated and {still} show no change"
    return told + " (seaward is positive)."


def write_report(path: str, f: ShorelineFindings) -> None:
    """Write the page."""
    report = Report("Shorelines", verdict(f))
    for warning in f.warnings:
        report.warning(warning)
    report.heading("Map")
    report.figure(_map(f), f"Shorelines at {f.request.datum:g} m; transects from the land (dot) to the sea.")
    report.table(
        [
            "date",
            "length (m)",
            "parts",
            "pieces left out",
            "slope",
            "sigma of height (m)",
            "sigma across the shore (m)",
            "95 % below",
        ],
        [
            [
                e.name,
                s.length,
                len(s.lines),
                s.removed,
                *(_median(v) for v in (s.slope, s.height_sigma, s.sigma)),
                _median(s.sigma, 0.95),
            ]
            for e, s in zip(f.series.epochs, f.shores, strict=True)
        ],
    )
    report.text(
        f"The sigma across the shore is that of the height by the slope, of a robust plane over {f.scale:.3g} m; medians "
        f"along the line. Pieces shorter than {f.request.min_length:g} m are left out (KEEP={f.request.keep}). No line is "
        "drawn through gaps. A surface model of a beach shows dry and wet sand alike: DATUM must lie above the water of "
        "every date."
    )
    if f.transects:
        _moves(report, f)
    dates_told(report, f.series, f.errors, f.request.stable is not None)
    report.save(path)


def _moves(report: Report, f: ShorelineFindings) -> None:
    report.heading("Movement along the transects")
    report.figure(_along(f), f"Net shoreline movement (NSM) and its {100 * f.request.confidence:g} % interval, seaward positive.")
    report.figure(
        _series(f), "Position against the first one of each transect, seaward positive; black: the mean of what each date has."
    )
    percent = f"{100 * f.request.confidence:g} %"
    report.table(
        ["transect", "dates", "NSM (m)", "sigma", "SCE (m)", "EPR (m/year)", "sigma", "LRR (m/year)", f"+- ({percent})",
         "WLR (m/year)", "sigma", f"+- ({percent})"],
        [
            [t.name, m.count, m.nsm, m.nsm_sigma, m.sce, m.epr, m.epr_sigma, m.lrr, m.lrr_half, m.wlr, m.wlr_sigma, m.wlr_half]
            for t, m in zip(f.transects, f.moves, strict=True)
        ],
    )  # fmt: skip
    report.text(
        "NSM: net shoreline movement, youngest minus oldest position. SCE: shoreline change envelope, the largest distance "
        "between any two. EPR: end point rate, NSM by the years between. LRR: linear regression rate, all dates alike. WLR: "
        "weighted by 1 / sigma^2. Rates need three positions. Their intervals are the wider of what the sigmas of the "
        "positions and what the scatter about the line (with Student's quantile, which is wide for few dates) tell. A dash: "
        "not known."
    )


def _map(f: ShorelineFindings) -> Any:
    figure = new_figure(9.0, 7.0)
    axes = figure.add_subplot()
    for transect in f.transects:
        x, y = shapely.get_coordinates(transect.line).T
        axes.plot(x, y, color="#bbbbbb", linewidth=0.7)
        axes.plot(x[0], y[0], ".", color="#888888", markersize=3)
    for epoch, shore, colour in zip(f.series.epochs, f.shores, colours(len(f.shores)), strict=True):
        for i, line in enumerate(shore.lines):
            axes.plot(*shapely.get_coordinates(line).T, color=colour, linewidth=1.2, label=None if i else epoch.name)
    axes.set(xlabel="easting (m)", ylabel="northing (m)", aspect="equal")
    west, south, east, north = shapely.total_bounds([line for shore in f.shores for line in shore.lines])
    margin = 0.05 * max(east - west, north - south) + 20.0
    axes.set(xlim=(west - margin, east + margin), ylim=(south - margin, north + margin))
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.locator_params(axis="x", nbins=4)
    axes.tick_params(labelsize=8)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _along(f: ShorelineFindings) -> Any:
    figure = new_figure(9.0, 3.2)
    axes = figure.add_subplot()
    places = [i for i, m in enumerate(f.moves) if m.nsm is not None]
    for i in places:
        m = f.moves[i]
        half = None if m.nsm_sigma is None else m.factor * m.nsm_sigma
        colour = "#888888" if half is None or m.nsm is None or abs(m.nsm) <= half else "#2166ac" if m.nsm > 0 else "#b2182b"
        axes.errorbar(i, float(m.nsm or 0.0), yerr=half, fmt="o", color=colour, markersize=4, linewidth=1.0)
    axes.axhline(0.0, color="black", linewidth=0.8)
    step = max(1, len(f.transects) // 20)
    axes.set(xlabel="transect", ylabel="NSM (m)")
    axes.set_xticks(range(0, len(f.transects), step), [t.name for t in f.transects[::step]], fontsize=8)
    return figure


def _series(f: ShorelineFindings) -> Any:
    figure = new_figure(9.0, 3.2)
    axes = figure.add_subplot()
    dates: Any = [epoch.date for epoch in f.series.epochs]
    table = np.full((len(f.positions), len(dates)), np.nan)
    for i, row in enumerate(f.positions):
        first = next((p.distance for p in row if p is not None), None)
        for k, place in enumerate(row):
            if place is not None and first is not None:
                table[i, k] = place.distance - first
        axes.plot(dates, table[i], color="#8a7a55", linewidth=0.6, alpha=0.5)
    some = np.isfinite(table).any(axis=0)
    axes.plot(np.array(dates)[some], np.nanmean(table[:, some], axis=0), color="black", marker="o", linewidth=1.6)
    axes.axhline(0.0, color="#888888", linewidth=0.8)
    axes.set(xlabel="date", ylabel="position against first (m)")
    return figure


def _median(values: Any, share: float = 0.5) -> float | None:
    values = values[np.isfinite(values)]
    return float(np.quantile(values, share)) if len(values) else None
