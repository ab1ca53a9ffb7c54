"""The report of ``tiepoints``: who is tied to whom, how well, and where on the photographs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..photographs.reading import decode_pixels, mean_level, read_channel_sum
from ..report.drawing import WIDTH, draw_coverage, draw_tie_points, side_by_side
from ..report.html import Report, new_figure
from ..survey import Photograph, Survey
from .features import read_features
from .matching import LEAST, LIMIT, PairMatches
from .pairs import Pair
from .statistics import CELLS
from .ties import SCALES, Ties

COVERAGES = 4  # photographs whose coverage is drawn

_PICTURE = 580  # pixels of the longer side of each of two pictures in a row
_CROP = 380  # pixels of a detail at full resolution
_LISTED = 30  # weakly tied photographs that are told of one by one
_NAMED = 12  # of these that are named in the graph
_METRES = 111_200.0  # of a degree of latitude, near enough to draw
_MATCHED, _OTHERS = "#0078ff", "#ff4800"


def write_report(
    survey: Survey,
    photographs: Sequence[Photograph],
    enhanced: Sequence[Path] | None,
    features: Sequence[Path],
    pairs: Mapping[Pair, PairMatches],
    ties: Ties,
    *,
    rule: str,
    notes: Sequence[str],
    copy: str | None,
) -> None:
    """Write the report.

    ``enhanced`` are the images searched, None when they were the photographs themselves; ``features`` the files of
    ``write_features``; ``rule`` tells how pairs were chosen, ``notes`` are warnings.
    """
    coverage = ties.coverage
    total = sum(len(pair.matches) for pair in pairs.values())
    report = Report(
        "Tie points",
        f"{len(photographs)} photographs with {ties.features.mean():.0f} features each on average; {len(pairs)} pairs share "
        f"{total} verified matches, which cover {coverage.mean():.0f} % of a photograph on average.",
    )
    for note in notes:
        report.warning(note)
    weak = ties.weak()
    report.text(
        f"{rule}. A match is verified when it agrees with one epipolar geometry (or homography) of its pair to "
        f"{LIMIT * 2000:.0f} pixels of a photograph 2000 pixels long; a pair needs {LEAST}. Coverage is the share of {CELLS} x "
        f"{CELLS} cells with one or more matched features."
    )
    report.heading("Weakest photographs")
    _tell_weak(report, survey, photographs, ties, weak)
    report.heading("Pairs")
    _draw_graph(report, photographs, pairs, ties, weak)
    _draw_matrix(report, len(photographs), pairs)
    report.heading("Features")
    _draw_histograms(report, ties)
    order = np.argsort(ties.matches, kind="stable")
    chosen = {"barest": int(order[0]), "median": int(order[(len(order) - 1) // 2]), "richest": int(order[-1])}
    for rank, i in chosen.items():
        xy = read_features(features[i]).xy
        tied = np.zeros(len(xy), bool)
        tied[ties.matched[i]] = True
        searched = enhanced[i] if enhanced else None
        _draw_photograph(report, f"The {rank} photograph", survey, photographs[i], searched, xy, tied, detail=rank == "median")
    report.heading("Photographs")
    report.table(
        ["name", "features", "matched", "pairs", "best partner", "matches with it", "coverage (%)"],
        [
            (
                p.name,
                int(ties.features[i]),
                int(ties.matches[i]),
                int(ties.pairs[i]),
                photographs[ties.partner[i]].name if ties.best[i] else None,
                int(ties.best[i]),
                float(coverage[i]),
            )
            for i, p in enumerate(photographs)
        ],
    )
    report.save(survey.report_path("tiepoints"), copy)


def _tell_weak(report: Report, survey: Survey, photographs: Sequence[Photograph], ties: Ties, weak: Mapping[int, str]) -> None:
    """Say which photographs are weakly tied and why, and draw the coverage of the least covered ones."""
    worst = np.lexsort((ties.matches, ties.coverage))
    if weak:
        listed = [int(i) for i in worst if int(i) in weak]
        report.table(["name", "why"], [(photographs[i].name, weak[i]) for i in listed[:_LISTED]])
        if len(listed) > _LISTED:
            report.text(f"{len(listed) - _LISTED} more are weakly tied; the last table has them all.")
    else:
        report.text("No photograph is weakly tied.")
    least = worst[:COVERAGES].tolist()
    draw_coverages(report, survey, [photographs[i] for i in least], ties.cells[least], "Matched features")


def draw_coverages(
    report: Report, survey: Survey, photographs: Sequence[Photograph], cells: NDArray[np.int64], what: str
) -> None:
    """Draw the least covered photographs two in a row; ``cells`` (n, rows, columns) count ``what``.

    Raises
    ------
    InputError
        When a photograph cannot be read.
    """
    for k in range(0, len(photographs), 2):
        row = range(k, min(k + 2, len(photographs)))
        pictures = [draw_coverage(tones(survey, photographs[i]), cells[i]) for i in row]
        named = "; ".join(f"{photographs[i].name}, {100 * np.mean(cells[i] > 0):.0f} % covered" for i in row)
        report.picture(side_by_side(*pictures), f"The least covered, left to right: {named}. {what} in each cell; red: none.")


def _draw_graph(
    report: Report, photographs: Sequence[Photograph], pairs: Mapping[Pair, PairMatches], ties: Ties, weak: Mapping[int, str]
) -> None:
    """Draw the pairs between the photographs' GNSS positions, when there are any."""
    from matplotlib.collections import LineCollection

    placed = {i: p.position for i, p in enumerate(photographs) if p.position}
    drawn = sorted((len(pair.matches), i, j) for (i, j), pair in pairs.items() if i in placed and j in placed)
    if not drawn:
        return
    degrees = np.array([(q.longitude, q.latitude) for q in placed.values()])
    metres = (degrees - degrees.mean(axis=0)) * _METRES * [np.cos(np.radians(degrees[:, 1].mean())), 1.0]
    place = dict(zip(placed, metres.tolist(), strict=True))
    extent = np.ptp(metres, axis=0)
    figure = new_figure(9.0, float(np.clip(7.6 * extent[1] / max(extent[0], 1e-6), 2.5, 6.5)) + 0.7)
    axes = figure.add_subplot()
    strength = np.array([n for n, _, _ in drawn], float)
    lines = LineCollection(
        [(place[i], place[j]) for _, i, j in drawn],
        linewidths=0.1 + min(3.0, 60.0 / np.sqrt(len(drawn))) * strength / strength.max(),
        array=np.log10(strength),
        cmap="YlGnBu",
        clim=(1.0, max(2.0, float(np.log10(strength.max())))),
        zorder=1,
    )
    axes.add_collection(lines)
    _log_bar(figure, lines, axes, float(np.log10(strength.max())))
    colours = ["#d62728" if i in weak else "black" for i in placed]
    axes.scatter(
        metres[:, 0], metres[:, 1], c=colours, s=22 if len(placed) < 200 else 7, edgecolors="white", linewidths=0.5, zorder=2
    )
    for i in [i for i in np.argsort(ties.matches, kind="stable").tolist() if i in weak and i in placed][:_NAMED]:
        axes.annotate(Path(photographs[i].name).stem, place[i], fontsize=7, textcoords="offset points", xytext=(4, 4))
    axes.set(xlabel="to the east (m)", ylabel="to the north (m)", aspect="equal")
    axes.margins(0.06)
    left = len(photographs) - len(placed)
    report.figure(
        figure,
        "Pairs between the photographs' GNSS positions, the wider and darker the more verified matches; red: weakly tied."
        + (f" Not drawn, for want of a position: {left}." if left else ""),
        dense=len(drawn) > 200,
    )


def _draw_matrix(report: Report, count: int, pairs: Mapping[Pair, PairMatches]) -> None:
    figure = new_figure(7.0, 6.0)
    axes = figure.add_subplot()
    shown = np.full((count, count), np.nan, np.float32)
    for (i, j), pair in pairs.items():
        shown[i, j] = shown[j, i] = np.log10(len(pair.matches))
    top = float(np.nanmax(shown))
    image: Any = axes.imshow(shown, cmap="YlGnBu", vmin=1.0, vmax=max(2.0, top), interpolation="nearest")
    _log_bar(figure, image, axes, top)
    axes.set_xlabel("photograph, in the order of the table below")
    axes.set_ylabel("photograph")
    report.figure(figure, "Verified matches of each pair of photographs; white: none.")


def _log_bar(figure: Any, mappable: Any, axes: Any, top: float) -> None:
    ticks = np.arange(1, max(2, int(top)) + 1)
    bar = figure.colorbar(mappable, ax=axes, label="verified matches", shrink=0.8)
    bar.set_ticks(ticks.tolist(), labels=[f"{10.0**t:.0f}" for t in ticks])


def _draw_histograms(report: Report, ties: Ties) -> None:
    figure = new_figure(9.0, 3.2)
    left, right = figure.subplots(1, 2)
    edges = np.linspace(0, max(1, int(ties.features.max())), 31)
    left.hist(ties.features, bins=edges.tolist(), color="#bbbbbb", label="all")
    left.hist(ties.matches, bins=edges.tolist(), color=_MATCHED, alpha=0.7, label="matched")
    left.set(xlabel="features of a photograph", ylabel="photographs", xlim=(0, edges[-1]))
    left.yaxis.get_major_locator().set_params(integer=True)
    left.legend(fontsize=8)
    for counts, colour, name in zip(ties.scales, (_OTHERS, _MATCHED), ("in no pair", "matched"), strict=True):
        right.stairs(counts, SCALES, color=colour, linewidth=1.4, label=name)
    full = np.flatnonzero(ties.scales.sum(axis=0))
    if len(full):
        right.set_xlim(SCALES[full[0]] / 1.1, SCALES[full[-1] + 1] * 1.1)
    right.set_xscale("log", base=2)
    right.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    right.set(xlabel="scale of a feature (sigma, px)", ylabel="features")
    right.legend(fontsize=8)
    figure.tight_layout()
    report.figure(figure, "Features per photograph, and the scales of those that are matched in some pair and in none.")


def _draw_photograph(
    report: Report,
    title: str,
    survey: Survey,
    photograph: Photograph,
    enhanced: Path | None,
    xy: NDArray[np.float32],
    tied: NDArray[np.bool_],
    *,
    detail: bool,
) -> None:
    """Draw the features on the photograph in its own tones and, beside it, on the enhanced image that was searched."""
    grounds = [tones(survey, photograph)]
    if enhanced is not None:
        grounds.append(decode_pixels(enhanced.read_bytes()))
    where = "on the photograph and on the enhanced image" if enhanced is not None else "on the photograph"
    good = int(tied.sum())
    report.heading(f"{title}: {photograph.name}")
    report.picture(
        side_by_side(*(draw_tie_points(ground, xy, tied, longer=_PICTURE if enhanced else WIDTH) for ground in grounds)),
        f"Features that are matched in some pair (blue, {good}) and in none (orange, {len(tied) - good}), {where}.",
    )
    if detail:
        corner = np.array([max(0, (photograph.width - _CROP) // 2), max(0, (photograph.height - _CROP) // 2)])
        crops = [ground[corner[1] : corner[1] + _CROP, corner[0] : corner[0] + _CROP] for ground in grounds]
        pictures = (draw_tie_points(crop, xy - corner, tied, longer=_PICTURE) for crop in crops)
        report.picture(side_by_side(*pictures), f"The same, {_CROP} pixels from the middle at full resolution.")


def tones(survey: Survey, photograph: Photograph) -> NDArray[np.uint8]:
    """Return a photograph (rows, columns) in its own tones: the mean of its channels at 8 bits."""
    return mean_level(read_channel_sum(survey.path(photograph), photograph))
