"""Errors beyond chance: control points, check points and positions that the rest contradicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from .observations import Solver
from .similarity import Fit

Array = NDArray[np.float64]

TOO_FEW_TO_TELL = 4  # control points: a twist of four corners fits an error at any of them
_BLUNDER = 0.01  # probability that a clean set of points has one named


@dataclass(frozen=True)
class Blunder:
    """A point (or photograph) whose error (m) is beyond what chance gives; ``ratio`` to its predicted sigma."""

    name: str
    part: str  # "plan" or "height"
    error: float
    ratio: float


def wrong_control(solver: Solver, used: NDArray[np.bool_], whole: Fit) -> list[Blunder]:
    """Name the control points that the others contradict, the worst first, each tested without those already named."""
    named: list[Blunder] = []
    trusted = used.copy()
    while trusted.sum() >= 4:
        worst: tuple[float, int, Blunder] | None = None
        for i in map(int, np.flatnonzero(trusted)):
            solved = solver.fit_without(trusted, i, whole)
            if solved is None:
                continue
            error = solver.errors(solved)[i]
            for excess, blunder in _test(solver.seen[i].point.name, error, solver.predicted(solved, i), solved, trusted.sum()):
                if worst is None or excess > worst[0]:
                    worst = excess, i, blunder
        if worst is None or worst[0] <= 1.0:
            break
        named.append(worst[2])
        trusted[worst[1]] = False
    return named


def distrust(solver: Solver, blunders: Sequence[Blunder]) -> None:
    """Give each blunder its own size as sigma: it stays in, and says next to nothing."""
    axes = {"plan": (0, 1), "height": (2,)}
    for blunder in blunders:
        index = next(i for i, s in enumerate(solver.seen) if s.point.name == blunder.name)
        for axis in axes[blunder.part]:
            solver.covariance[index, axis, axis] = max(solver.covariance[index, axis, axis], blunder.error**2)


def _test(name: str, error: Array, covariance: Array, solved: Fit, count: int) -> list[tuple[float, Blunder]]:
    """Return, for plan and height, the test value over its limit, and the blunder it would be.

    The limit is Fisher's quantile with the redundancy behind the variance factor, for ``count`` points at once; when the given
    sigmas agree with the residuals they are taken as known.
    """
    free = solved.redundancy
    estimated = solved.estimated_factor
    known = estimated is None or estimated <= stats.chi2.ppf(0.95, free) / free
    level = 1 - _BLUNDER / (2 * count)
    plan = float(error[:2] @ np.linalg.solve(covariance[:2, :2], error[:2])) / 2
    height = float(error[2] ** 2 / covariance[2, 2])
    found = []
    for part, value, axes, size in (("plan", plan, 2, float(np.hypot(*error[:2]))), ("height", height, 1, abs(float(error[2])))):
        limit = float(stats.chi2.ppf(level, axes)) / axes if known else float(stats.f.ppf(level, axes, free))
        found.append((value / limit, Blunder(name, part, size, float(np.sqrt(value)))))
    return found


def wrong_checks(solver: Solver, solved: Fit) -> list[Blunder]:
    """Name the check points that the solution contradicts."""
    named, errors = [], solver.errors(solved)
    checks = [i for i, s in enumerate(solver.seen) if s.point.check and s.found is not None]
    for i in checks:
        tests = _test(solver.seen[i].point.name, errors[i], solver.predicted(solved, i), solved, len(checks))
        excess, blunder = max(tests, key=lambda t: t[0])
        if excess > 1.0:
            named.append(blunder)
    return named


def wrong_positions(solver: Solver, solved: Fit) -> list[Blunder]:
    """Name positions whose residual is beyond chance, by its own sigma."""
    count = len(solver.gnss)
    free = max(solved.redundancy, 1)
    errors = solver.gnss_errors(solved) + solved.shared
    own = solver.gnss.covariances(solver.gnss_factor * solved.factor)
    named = []
    for i in range(count):
        tests = _test(solver.block.views[solver.gnss.view[i]].name, errors[i], own[i], replace(solved, redundancy=free), count)
        excess, blunder = max(tests, key=lambda t: t[0])
        if excess > 1.0:
            named.append(blunder)
    return named
