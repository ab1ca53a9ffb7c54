"""The report of ``profiles``: one chart per transect, the change per metre of beach, and on what it rests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..report.html import Report, new_figure
from .epocherror import EpochError
from .series import Series
from .seriesreport import colours, dates_told
from .significance import coverage_factor
from .transects import Transect

if TYPE_CHECKING:
    from .profiles import Change, Request, Section

_CHARTS = 120  # transects that are drawn: some 4 MB


@dataclass(frozen=True)
class ProfileFindings:
    """Everything that the report tells."""

    request: Request
    series: Series
    errors: list[EpochError]
    transects: list[Transect]
    sections: list[list[Section]]
    rows: list[dict[str, Any]]
    mean: Change
    spacing: float
    scale: float
    warnings: tuple[str, ...]


def verdict(f: ProfileFindings) -> str:
    """Return the result in a sentence or two."""
    first, last = f.series.epochs[0].name, f.series.epochs[-1].name
    if f.mean.volume is None:
        return f"{len(f.transects)} transects at {len(f.series.epochs)} date(s); no change is known."
    told = f"From {first} to {last} the beach changed by {f.mean.volume:+.2f}"
    if f.mean.sigma is None:
        return f"{told} m3 per metre, the mean over the transects; its uncertainty is not known."
    half = coverage_factor(f.request.confidence) * f.mean.sigma
    kind = "not distinguishable from no change" if abs(f.mean.volume) <= half else "a gain" if f.mean.volume > 0 else "a loss"
    return f"{told} +- {half:.2f} m3 per metre ({100 * f.request.confidence:g} %), the mean over the transects: {kind}."


def write_report(path: str, f: ProfileFindings) -> None:
    """Write the page."""
    report = Report("Beach profiles", verdict(f))
    for warning in f.warnings:
        report.warning(warning)
    if len(f.series.epochs) > 1:
        report.heading("Change per metre of beach")
        report.figure(_along(f), f"Sand above {f.request.datum:g} m against the first date, by transect in the layer's order.")
    report.heading("Transects")
    percent = f"{100 * f.request.confidence:g} %"
    report.table(
        ["transect", "date", "sand (m3/m)", "sigma", "covered %", "since first (m3/m)", "sigma", f"low ({percent})", "high",
         "since previous (m3/m)", "sigma", "width (m)", "sigma"],
        [
            [r[key] for key in (
                "transect", "date", "volume", "volume_sigma", "covered_percent", "change_first", "change_first_sigma",
                "change_first_low", "change_first_high", "change_previous", "change_previous_sigma", "width", "width_sigma",
            )]
            for r in f.rows
        ],
    )  # fmt: skip
    report.text(
        f"Sand above DATUM {f.request.datum:g} m per metre of beach, from {f.request.start:g} m to "
        f"{'the end' if f.request.end is None else f'{f.request.end:g} m'} of each transect, points every {f.spacing:.3g} m. "
        "Gaps are not filled: a volume is that of the share covered, and a change is taken over what both dates cover. "
        "Width: from START to the most seaward fall through DATUM; its sigma is that of the height by the slope over "
        f"{f.scale:.3g} m."
    )
    seen = [
        (transect, row)
        for transect, row in zip(f.transects, f.sections, strict=True)
        if any(np.isfinite(section.line.height).any() for section in row)
    ]
    report.text(
        f"Charts of {min(len(seen), _CHARTS)} transects, bands of {percent}; {len(f.transects) - len(seen)} have no height "
        "at any date" + (f", {len(seen) - _CHARTS} are not drawn here (POINTS holds all)." if len(seen) > _CHARTS else ".")
    )
    for transect, row in seen[:_CHARTS]:
        report.figure(_chart(f, row), f"Transect {transect.name}.")
    dates_told(report, f.series, f.errors, f.request.stable is not None)
    report.save(path)


def _chart(f: ProfileFindings, row: list[Section]) -> Any:
    from .profiles import height_sigma

    figure = new_figure(8.0, 2.8)
    axes = figure.add_subplot()
    factor = coverage_factor(f.request.confidence)
    for epoch, section, error, colour in zip(f.series.epochs, row, f.errors, colours(len(row)), strict=True):
        line = section.line
        axes.plot(line.distance, line.height, color=colour, linewidth=1.2, label=epoch.name)
        half = factor * height_sigma(line, error)
        if np.isfinite(half).any():
            axes.fill_between(line.distance, line.height - half, line.height + half, color=colour, alpha=0.15, linewidth=0)
        if section.crossing is not None:
            axes.plot(section.crossing.distance, f.request.datum, "o", color=colour, markersize=4)
    axes.axhline(f.request.datum, color="#888888", linewidth=0.8, linestyle="--")
    axes.set(xlabel="distance from the landward end (m)", ylabel="height (m)", xlim=(0, float(row[0].line.distance[-1])))
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _along(f: ProfileFindings) -> Any:
    figure = new_figure(9.0, 3.6)
    axes = figure.add_subplot()
    n = len(f.series.epochs)
    factor = coverage_factor(f.request.confidence)
    nothing = float("nan")
    for k, colour in enumerate(colours(n)):
        if k == 0:
            continue
        rows = f.rows[k::n]
        value = [nothing if r["change_first"] is None else r["change_first"] for r in rows]
        half = [nothing if r["change_first_sigma"] is None else factor * r["change_first_sigma"] for r in rows]
        x = np.arange(len(rows))
        axes.plot(x, value, color=colour, linewidth=1.2, marker=".", label=f.series.epochs[k].name)
        if k == n - 1 and np.isfinite(half).any():
            axes.fill_between(x, np.subtract(value, half), np.add(value, half), color=colour, alpha=0.2, linewidth=0)
    axes.axhline(0.0, color="black", linewidth=0.8)
    step = max(1, len(f.transects) // 20)
    axes.set(xlabel="transect", ylabel="change since first date (m3/m)")
    axes.set_xticks(range(0, len(f.transects), step), [t.name for t in f.transects[::step]], fontsize=8)
    axes.legend(
        fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5), title=f"band: {100 * f.request.confidence:g} %, last date"
    )
    return figure
