"""The report of ``tiepoints``: who is tied to whom, how well, and where on the photographs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..photographs.listing import some
from ..photographs.reading import decode_pixels
from ..report.html import Report, new_figure
from ..survey import Photograph, Survey
from .matching import LEAST, LIMIT, PairMatches
from .pairs import Pair
from .statistics import CELLS, coverage_percent

_WEAK_MATCHES = 200  # fewer verified matches with its best partner than this, and a photograph is weakly tied
_WEAK_COVERAGE = 30.0  # percent of the cells
_PICTURE = 900  # pixels of a picture's longer side


def write_report(
    survey: Survey,
    photographs: Sequence[Photograph],
    images: Sequence[Path],
    xy: Sequence[NDArray[np.float32]],
    pairs: Mapping[Pair, PairMatches],
    *,
    rule: str,
    notes: Sequence[str],
    copy: str | None,
) -> None:
    """Write the report; ``images`` are those searched, ``xy`` the features' places (n, 2), ``rule`` how pairs were chosen."""
    count = len(photographs)
    matrix = np.zeros((count, count), np.int64)
    tied: list[NDArray[np.bool_]] = [np.zeros(len(points), bool) for points in xy]
    for (i, j), pair in pairs.items():
        matrix[i, j] = matrix[j, i] = len(pair.matches)
        tied[i][pair.matches[:, 0]] = True
        tied[j][pair.matches[:, 1]] = True
    covered = [coverage_percent(p[t], q.width, q.height) for p, t, q in zip(xy, tied, photographs, strict=True)]
    total = int(matrix.sum() // 2)
    report = Report(
        "Tie points",
        f"{count} photographs with {np.mean([len(p) for p in xy]):.0f} features each on average; {len(pairs)} pairs share "
        f"{total} verified matches, which cover {np.mean(covered):.0f} % of a photograph on average.",
    )
    for note in notes:
        report.warning(note)
    best = matrix.max(axis=1)
    weak = [p.name for i, p in enumerate(photographs) if best[i] < _WEAK_MATCHES or covered[i] < _WEAK_COVERAGE]
    if weak:
        report.warning(f"Weakly tied: {some(weak)}. Their orientation may be uncertain or fail.")
    report.text(
        f"{rule}. A match is verified when it agrees with one epipolar geometry (or homography) of its pair to "
        f"{LIMIT * 2000:.0f} pixels of a photograph 2000 pixels long; a pair needs {LEAST}. Coverage is the share of {CELLS} x "
        f"{CELLS} cells with one or more matched features."
    )
    _draw_matrix(report, matrix)
    order = np.argsort([matrix[i].sum() for i in range(count)], kind="stable")
    for i in dict.fromkeys((int(order[0]), int(order[count // 2]))):
        _draw_photograph(report, photographs[i], images[i], xy[i], tied[i])
    report.heading("Photographs")
    report.table(
        ["name", "features", "matched", "pairs", "matches with the best partner", "coverage (%)"],
        [
            (p.name, len(xy[i]), int(tied[i].sum()), int((matrix[i] > 0).sum()), int(matrix[i].max()), covered[i])
            for i, p in enumerate(photographs)
        ],
    )
    report.save(survey.report_path("tiepoints"), copy)


def _draw_matrix(report: Report, matrix: NDArray[np.int64]) -> None:
    report.heading("Pairs")
    figure = new_figure(7.0, 6.0)
    axes = figure.add_subplot()
    shown = np.where(matrix > 0, np.log10(np.maximum(matrix, 1)), np.nan)
    image: Any = axes.imshow(shown, cmap="YlGnBu", vmin=1.0, interpolation="nearest")
    bar = figure.colorbar(image, ax=axes, label="verified matches")
    ticks = np.arange(1, max(2, int(np.ceil(np.nanmax(shown)))) + 1)
    bar.set_ticks(ticks.tolist(), labels=[f"{10.0**t:.0f}" for t in ticks])
    axes.set_xlabel("photograph, in the order of the table below")
    axes.set_ylabel("photograph")
    report.figure(figure, "Verified matches of each pair of photographs; white: none.")


def _draw_photograph(
    report: Report, photograph: Photograph, image: Path, xy: NDArray[np.float32], tied: NDArray[np.bool_]
) -> None:
    pixels = decode_pixels(image.read_bytes())
    if pixels.dtype != np.uint8:
        pixels = (pixels >> 8).astype(np.uint8)
    factor = min(1.0, _PICTURE / max(pixels.shape[:2]))
    small = cv2.resize(pixels, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    canvas = cv2.cvtColor(small, cv2.COLOR_GRAY2RGB if small.ndim == 2 else cv2.COLOR_BGR2RGB)
    canvas = (canvas.astype(np.uint16) * 2 // 3).astype(np.uint8)
    for place, good in sorted(zip(xy.tolist(), tied.tolist(), strict=True), key=lambda item: item[1]):
        centre = (round(place[0] * factor), round(place[1] * factor))
        cv2.circle(canvas, centre, 1, (120, 230, 120) if good else (220, 90, 60), -1)
    good = int(tied.sum())
    report.picture(
        canvas,
        f"{photograph.name}: features that are matched in some pair (green, {good}) and in none (red, {len(tied) - good}).",
    )
