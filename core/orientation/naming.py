"""What an adjustment contradicts, by the names of the user's points and photographs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from .blunders import Blunder
from .observations import Seen
from .reliability import Test
from .sightings import Sighting
from .singles import Entering
from .solution import Solution, WrongMark
from .weighting import FALSE_ALARM, Weighted

Array = NDArray[np.float64]


def named(
    settled: Weighted, seen: Sequence[Seen], members: Sequence[int], start: Solution
) -> tuple[list[Blunder], list[WrongMark], list[Blunder]]:
    """Return wrong ground points, marks and positions, with the marks that were found wrong before the adjustment."""
    names = [view.name for view in start.block.views]
    points, marks, positions = [], [], []
    for test in settled.named:
        if test.part == "mark":
            sighting = settled.adjusted.control[test.index].sighting
            marks.append(_wrong_mark(test, sighting, names))
        elif test.part in ("plan", "height"):
            points.append(Blunder(seen[members[test.index]].point.name, test.part, test.size, test.ratio))
        else:
            part = "plan" if test.part == "GNSS plan" else "height"
            positions.append(Blunder(names[settled.adjusted.positions.view[test.index]], part, test.size, test.ratio))
    told_already = {(m.gcp, m.image) for m in marks}
    for one in seen:
        found = one.found
        if found is None:
            continue
        images = [m.image for m in one.point.marks if m.image in set(names)]
        for image, used, residual in zip(images, found.used, found.residuals, strict=True):
            if not used and (one.point.name, image) not in told_already:
                size = float(np.linalg.norm(residual))
                marks.append(WrongMark(one.point.name, image, size, np.inf))
    return points, marks, positions


def _wrong_mark(test: Test, sighting: Sighting, names: Sequence[str]) -> WrongMark:
    return WrongMark(sighting.name, names[sighting.view[test.item]], test.size, test.ratio)


def slipped(entering: Entering, singles: Sequence[Seen]) -> list[WrongMark]:
    """Return the wrong ones among the points with a single mark."""
    return [WrongMark(singles[s.index].point.name, singles[s.index].single or "", s.size, s.ratio) for s in entering.slips]


def wrong_checks(checks: Sequence[int], seen: Sequence[Seen], errors: Array, total: Array) -> list[Blunder]:
    """Return the check points (their numbers) whose errors (n, 3) are beyond their covariances (n, 3, 3)."""
    found = []
    for i in checks:
        for part, axes in (("plan", [0, 1]), ("height", [2])):
            left, spread = errors[i][axes], total[i][np.ix_(axes, axes)]
            statistic = float(left @ np.linalg.solve(spread, left))
            if stats.chi2.sf(statistic, len(axes)) * 2 * len(checks) < FALSE_ALARM:
                found.append(Blunder(seen[i].point.name, part, float(np.linalg.norm(left)), float(np.sqrt(statistic))))
    return found
