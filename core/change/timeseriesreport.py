"""The report of ``timeseries``: the volumes' curves, the map of rates, the table, and on what they rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from ..report.html import Report, new_figure
from .epocherror import EpochError
from .series import Series
from .seriesreport import dates_told
from .seriesvolumes import ZoneSeries, rate_columns, rows_of
from .significance import coverage_factor
from .trend import LEAST

if TYPE_CHECKING:
    from .timeseries import RateMap, Request

_CURVES = 60  # zones that are drawn


@dataclass(frozen=True)
class SeriesFindings:
    """Everything that the report tells."""

    request: Request
    series: Series
    errors: list[EpochError]
    zones: list[ZoneSeries]
    total: ZoneSeries
    map: RateMap
    warnings: tuple[str, ...]


def verdict(f: SeriesFindings) -> str:
    """Return the result in a sentence or two."""
    first, last = f.series.epochs[0].name, f.series.epochs[-1].name
    net, sigma = f.total.change(0, len(f.series.epochs) - 1)
    where = f"on {f.total.area:,.0f} m2, {f.total.covered_percent:.1f} % of which have a height at every date"
    sure = f"{100 * f.request.confidence:g} %"
    if not np.isfinite(sigma):
        told = f"From {first} to {last} net {net:+,.1f} m3 {where}; its uncertainty is not known."
    else:
        half = coverage_factor(f.request.confidence) * sigma
        kind = "not distinguishable from no change" if abs(net) <= half else "a gain" if net > 0 else "a loss"
        told = f"From {first} to {last} net {net:+,.1f} +- {half:,.1f} m3 ({sure}) {where}: {kind}."
    if np.isfinite(f.total.trend.half):
        rate, width = float(f.total.trend.rate), float(f.total.trend.half)
        told += f" Rate of {len(f.series.epochs)} dates: {rate:+,.1f} +- {width:,.1f} m3 per year."
    return told


def write_report(path: str, f: SeriesFindings) -> None:
    """Write the page."""
    report = Report("Volumes through time", verdict(f))
    for warning in f.warnings:
        report.warning(warning)
    percent = f"{100 * f.request.confidence:g} %"
    factor = coverage_factor(f.request.confidence)
    report.heading("Volumes since the first date")
    shown = f.zones if len(f.zones) == 1 else [f.total, *f.zones[:_CURVES]]
    for zone in shown:
        if np.isfinite(zone.net).all():
            report.figure(_curve(f, zone), f"{zone.zone.name}: net volume since the first date with its {percent} interval.")
    if len(f.zones) > _CURVES:
        report.text(f"Curves of the first {_CURVES} of {len(f.zones)} zones; the table holds all.")
    rows = [row for zone in (f.zones if len(f.zones) == 1 else [f.total, *f.zones]) for row in rows_of(f.series, zone, factor)]
    report.table(
        ["zone", "date", "net since first (m3)", "sigma", f"low ({percent})", "high", "erosion", "deposition",
         "net since previous (m3)", "sigma", f"low ({percent})", "high", "erosion", "deposition", "covered %"],
        [
            [row[key] for key in (
                "zone", "date", "net", "sigma", "low", "high", "erosion", "deposition", "net_previous", "sigma_previous",
                "low_previous", "high_previous", "erosion_previous", "deposition_previous", "covered_percent",
            )]
            for row in rows
        ],
    )  # fmt: skip
    report.text(
        "Volumes are of the ground that has a height at every date, so that changes add up. Consecutive changes share a "
        "date and its error: their sigmas must not be added, neither plainly nor in quadrature; the change since the first "
        "date has its own. Erosion and deposition add up noise as well as change: quote the net."
    )
    report.heading("Rates")
    if f.map.cells:
        report.figure(
            _map(f),
            f"Rate of each cell with heights at {LEAST} dates or more; strong colours: significant at {percent}. Red: "
            "falling, blue: rising. Outlines: zones.",
        )
        report.text(
            f"{f.map.cells:,} cells have a rate; {f.map.rising:,} rise and {f.map.falling:,} fall significantly. Where "
            f"nothing moved about {100 * (1 - f.request.confidence):.2g} % would by chance."
        )
    columns = [rate_columns(zone) for zone in f.zones]
    report.table(
        [
            "zone",
            "rate (m3/year)",
            "sigma",
            f"low ({percent})",
            "high",
            "mean height (m/year)",
            "dates",
            "area (m2)",
            "covered %",
        ],
        [
            [
                row[key]
                for key in (
                    "zone",
                    "rate",
                    "rate_sigma",
                    "rate_low",
                    "rate_high",
                    "height_rate",
                    "dates",
                    "area",
                    "covered_percent",
                )
            ]
            for row in columns
        ],
    )
    report.text(
        "Rates are of weighted least squares. Their intervals are the wider of what the sigmas of the dates and what the scatter "
        f"about the line (with Student's quantile, which is wide for few dates) tell; {LEAST} dates are needed."
    )
    dates_told(report, f.series, f.errors, f.request.stable is not None)
    report.save(path)


def _curve(f: SeriesFindings, zone: ZoneSeries) -> Any:
    figure = new_figure(8.0, 2.8)
    axes = figure.add_subplot()
    days: Any = [epoch.date for epoch in f.series.epochs]
    half = np.array([0.0] + [zone.change(0, k)[1] for k in range(1, len(days))]) * coverage_factor(f.request.confidence)
    axes.errorbar(
        days, zone.net, yerr=np.where(np.isfinite(half), half, 0.0), fmt="o-", color="#2a6f97", capsize=3, linewidth=1.4
    )
    trend = zone.trend
    if np.isfinite(trend.rate):
        sigmas = zone.sigmas
        weight = 1.0 / sigmas**2 if np.isfinite(sigmas).all() and (sigmas > 0).all() else np.ones(len(days))
        years = f.series.years
        mean_year, mean_net = np.average(years, weights=weight), np.average(zone.net, weights=weight)
        axes.plot(days, mean_net + float(trend.rate) * (years - mean_year), "--", color="#8a7a55", linewidth=1.0)
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set(xlabel="date", ylabel="net since first (m3)", title=zone.zone.name)
    axes.tick_params(labelsize=8)
    return figure


def _map(f: SeriesFindings) -> Any:
    figure = new_figure(9.0, 7.0)
    axes = figure.add_subplot()
    grid, step = f.series.grid, f.map.thinning
    rows, columns = f.map.rate.shape
    box = (grid.west, grid.west + columns * step * grid.cell, grid.north - rows * step * grid.step_north, grid.north)
    sizes = np.abs(f.map.rate[np.isfinite(f.map.rate)])
    limit = float(np.quantile(sizes, 0.95)) if len(sizes) else 1.0
    limit = limit or 1.0
    for values, alpha in ((f.map.rate, 0.3), (f.map.kept, 1.0)):
        picture = axes.imshow(values, cmap="RdBu", vmin=-limit, vmax=limit, extent=box, alpha=alpha, interpolation="nearest")
    for zone in f.zones:
        for part in shapely.get_parts(zone.zone.shape):
            axes.plot(*shapely.get_coordinates(shapely.get_exterior_ring(part)).T, color="black", linewidth=0.8)
    west, south, east, north = grid.bounds
    axes.set(xlim=(west, east), ylim=(south, north), xlabel="easting (m)", ylabel="northing (m)", aspect="equal")
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.locator_params(axis="x", nbins=5)
    axes.tick_params(labelsize=8)
    figure.colorbar(picture, label="rate (m/year)", shrink=0.8)
    return figure
