"""The report of ``compareinputs``: the paper's two tables and two figures, for this flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..photographs.enhance import enhanced_path
from ..photographs.enhancement import has_window
from ..photographs.reading import decode_pixels
from ..report.cloud import cloud_from_above, cloud_in_perspective
from ..report.drawing import Picture, draw_coverage, draw_tie_points, side_by_side
from ..report.html import Report, new_figure
from ..survey import Survey
from ..tiepoints.statistics import CELLS, cell_counts
from .cases import Outcome, Settings, places
from .clouds import case_blocks, case_clouds
from .verdict import PAPER, mmtp, mtp, ratio, rms, verdict

_COLOURS = {"JPG": "#b8b0a0", "RAW": "#7d7460", "CeJPG": "#e0a83c", "CeRAW": "#a85f12"}
_PICTURE = 640  # pixels of each of two pictures side by side


def write_report(
    path: str | Path, copy: str | None, outcomes: Sequence[Outcome], settings: Settings, notes: Sequence[str]
) -> None:
    """Write the report of all cases; ``notes`` are sentences on the photographs."""
    report = Report("JPG, RAW and their enhancement compared", verdict(outcomes))
    for note in notes:
        report.warning(note)
    for outcome in outcomes:
        if outcome.note:
            report.warning(f"{outcome.case}: {outcome.note}")
    report.text(_how(outcomes, settings))
    _tie_points(report, outcomes)
    _ground(report, outcomes)
    if any(o.oriented for o in outcomes):
        blocks = case_blocks(outcomes)
        seen = {case: places(block) for case, block in blocks.items()}
        _coverage(report, outcomes)
        _photographs(report, outcomes, seen)
        clouds, unit = case_clouds(outcomes, blocks)
        report.heading("The tie points on the ground")
        report.figure(
            cloud_from_above(clouds, unit=unit), "Tie points from above, coloured by height; triangles: photographs.", dense=True
        )
        report.figure(cloud_in_perspective(clouds, unit=unit), "The same in perspective (figure 4 of the paper).", dense=True)
    report.save(path, copy)


def _how(outcomes: Sequence[Outcome], settings: Settings) -> str:
    size = f"reduced to {settings.max_size} pixels" if settings.max_size else "at full size"
    above = "each photograph's own noise" if settings.threshold == "noise" else "one fixed contrast"
    window = f" in a window of {settings.window} pixels" if has_window(settings.method) else ""
    return (
        f"{outcomes[0].images} exposures, the same in every case, with the same positions, marks and settings: features sought "
        f"{size} above {above}, without a limit on their number. Ce: contrast enhanced by {settings.method}{window}; the "
        "others are only brought to 8 bits from the sum of their channels. Counts are those of MicMac (Rosu et al. 2015): MTP, "
        "tie points per oriented photograph that enter the final adjustment, and the share it keeps; MMTP, those in three or "
        "more photographs; MSE, the root mean square residual of the kept. The paper's numbers are of another beach, camera and "
        "detector: compare the ratios."
    )


def _tie_points(report: Report, outcomes: Sequence[Outcome]) -> None:
    report.heading("Tie points (table 1 of the paper)")
    jpg = outcomes[0]
    rows: list[list[Any]] = []
    for o in outcomes:
        paper, r = PAPER[o.case], o.oriented
        ours: list[Any] = [f"not oriented (0 of {o.images})", *[None] * 7]
        if r:
            ours = [f"{r.oriented_count} of {o.images}", round(r.mtp), _times(o, jpg, mtp), r.mtp_percent, round(r.mmtp)]
            ours += [_times(o, jpg, mmtp), r.mmtp_percent, _rounded(r.mse)]
        theirs = [round(paper.mtp), round(paper.mtp / PAPER["JPG"].mtp, 2), round(paper.mmtp), paper.mse]
        rows.append([o.case, *ours, *theirs])
    columns = ["case", "oriented", "MTP", "times JPG", "kept (%)", "MMTP", "times JPG", "kept (%)", "MSE (px)"]
    report.table([*columns, "paper: MTP", "paper: times JPG", "paper: MMTP", "paper: MSE (px)"], rows)
    figure = new_figure(8.0, 3.4)
    axes = figure.add_subplot()
    values = [mtp(o) or 0.0 for o in outcomes]
    bars = axes.bar([o.case for o in outcomes], values, color=[_COLOURS[o.case] for o in outcomes], width=0.6)
    axes.bar_label(bars, [f"{v:,.0f}" if v else "" for v in values], label_type="center", color="white", fontsize=9)
    axes.bar_label(bars, ["" if v else "not oriented" for v in values], fontsize=9)
    axes.set_ylabel("tie points per photograph (MTP)")
    axes.margins(y=0.15)
    if jpg.oriented:
        expected = [jpg.oriented.mtp * PAPER[o.case].mtp / PAPER["JPG"].mtp for o in outcomes]
        axes.plot(range(len(outcomes)), expected, "k_", markersize=40, label="the JPG's times the paper's ratio")
        axes.legend(frameon=False, fontsize=8, loc="upper left", markerscale=0.3)
    report.figure(figure, "Tie points per photograph.")


def _ground(report: Report, outcomes: Sequence[Outcome]) -> None:
    report.heading("On the ground (table 2 of the paper)")
    rows: list[list[Any]] = []
    for o in outcomes:
        g = o.ground
        given: list[Any] = [None] * 6
        if g:
            given = [
                g.control_count,
                _cm(g.plani_control),
                _cm(g.alti_control),
                g.check_count,
                _cm(g.plani_check),
                _cm(g.alti_check),
            ]
        coverage = sorted(o.coverage.values()) if o.oriented else []
        least = float(np.mean(coverage[: max(1, len(coverage) // 10)])) if coverage else None
        found = [round(o.tied.mean_features), o.tied.match_count] if o.tied else [None, None]
        rows.append([o.case, *given, _rounded(o.mean_coverage), _rounded(least), *found])
    report.table(
        ["case", "control points", "plan (cm)", "height (cm)", "check points", "plan (cm)", "height (cm)", "coverage (%)"]
        + ["coverage of the barest tenth (%)", "features per photograph", "matches"],
        rows,
    )
    if not any(o.ground for o in outcomes):
        report.text("There is no ground control, so that only tie points are compared: give GCPS and MARKS, with check points.")
    checked = [o for o in outcomes if o.checks]
    if not checked:
        return
    figure = new_figure(8.0, 3.4)
    for axes, name, part in zip(figure.subplots(1, 2), ("plan", "height"), (0, 1), strict=True):
        for i, o in enumerate(checked):
            errors = np.array(list(o.checks.values()))
            single = np.hypot(errors[:, 0], errors[:, 1]) if part == 0 else np.abs(errors[:, 2])
            value = rms(o.checks)[part]
            sigma = value / np.sqrt(2 * len(errors) * (2 - part))  # of a root mean square of as many normal numbers
            axes.bar(i, 100 * value, 0.6, yerr=100 * sigma, capsize=5, color=_COLOURS[o.case])
            axes.plot(i + np.linspace(-0.2, 0.2, len(single)), 100 * np.sort(single), "k.", markersize=4)
        axes.set_xticks(range(len(checked)), [o.case for o in checked])
        axes.set_ylabel(f"error in {name} (cm)")
    figure.tight_layout()
    report.figure(
        figure,
        f"Errors of the {len(checked[0].checks)} check points: root mean square (bars, with one sigma of what so few points "
        "tell) and each point (dots).",
    )


def _coverage(report: Report, outcomes: Sequence[Outcome]) -> None:
    report.heading("Coverage")
    figure = new_figure(8.0, 3.2)
    axes = figure.add_subplot()
    for o in outcomes:
        if o.oriented:
            share = sorted(o.coverage.values())
            axes.plot(np.arange(1, len(share) + 1), share, color=_COLOURS[o.case], label=o.case, linewidth=2, marker=".")
    axes.set_xlabel("photographs, from the least to the best covered in each case")
    axes.set_ylabel("cells with a tie point (%)")
    axes.set_ylim(0, 102)
    axes.legend(frameon=False, ncols=4, fontsize=8)
    report.figure(
        figure,
        f"Share of {CELLS} x {CELLS} cells that hold a tie point the adjustment kept; 0 for photographs that are not oriented.",
    )


def _photographs(report: Report, outcomes: Sequence[Outcome], seen: Mapping[str, Mapping[str, NDArray[np.float64]]]) -> None:
    """Draw the photograph that is covered least, and the one in which the cases differ most."""
    coverage = np.mean([list(o.coverage.values()) for o in outcomes if o.oriented], axis=0)
    counts = np.array([[len(seen.get(o.case, {}).get(name, ())) for name in o.names] for o in outcomes])
    report.heading("Tie points on the photographs (figure 3 of the paper)")
    least, apart = int(np.argmin(coverage)), int(np.argmax(np.ptp(counts, axis=0)))
    for index in dict.fromkeys((least, apart)):
        pictures = [_drawn(o, o.names[index], seen.get(o.case, {}).get(o.names[index])) for o in outcomes]
        stem = Path(outcomes[0].names[index]).stem
        why = "covered least in all cases together" if index == least else "in which the cases differ most"
        report.text(f"{stem} is the photograph {why}.")
        for i in range(0, len(outcomes), 2):
            told = [f"{o.case} ({n:,} tie points)" for o, n in zip(outcomes[i : i + 2], counts[i : i + 2, index], strict=True)]
            report.picture(
                side_by_side(*(p[0] for p in pictures[i : i + 2])), f"{stem}: {' and '.join(told)}, on the images searched."
            )
        for i in range(0, len(outcomes) if index == least else 0, 2):
            told = [o.case for o in outcomes[i : i + 2]]
            report.picture(
                side_by_side(*(p[1] for p in pictures[i : i + 2])),
                f"{stem} by cell: {' and '.join(told)}; red: none, yellow: 1,000 and more.",
            )


def _drawn(outcome: Outcome, name: str, places: NDArray[np.float64] | None) -> tuple[Picture, Picture]:
    """Return the image in which features were sought, with the tie points, and with their numbers by cell."""
    survey = Survey.open(outcome.survey)
    photograph = next(p for p in survey.photographs if p.name == name)
    pixels = decode_pixels(enhanced_path(survey, photograph).read_bytes())
    xy = np.zeros((0, 2)) if places is None else places
    dots = draw_tie_points(pixels, xy, np.ones(len(xy), bool), longer=_PICTURE)
    return dots, draw_coverage(pixels, cell_counts(xy, photograph.width, photograph.height))


def _times(outcome: Outcome, jpg: Outcome, number: Callable[[Outcome], float | None]) -> str | float:
    return "JPG not oriented" if (share := ratio(outcome, jpg, number)) is None else round(share, 2)


def _cm(metres: float | None) -> float | None:
    return None if metres is None else round(100 * metres, 2)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)
