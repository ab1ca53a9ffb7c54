"""The stochastic model of an adjustment: sigmas that are not true are enlarged, and what is wrong is named and down-weighted.

Observations are tested one by one (``reliability``), the worst is given its own error as sigma, and the adjustment repeated,
until nothing stands out. Nothing is removed. When a third of the ground points would be wrong it is their sigmas that are, and
all are enlarged by what the residuals say; so are the sigmas of marks and of positions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from .adjusted import Adjusted
from .adjustment import adjust
from .network import Control, Network, Positions
from .reliability import Part, Test, tests

Array = NDArray[np.float64]

FALSE_ALARM = 0.01  # chance of naming anything at all when nothing is wrong
_ROUNDS = 60
_BOWL = 100.0
_FEW = 6  # tests from which a group's own scatter is told
_SETTLED = 1.15  # times the factor of a variance, or less: it stands
_YIELD = 1.08  # by which that grows each round, so that groups that share an error settle, too


@dataclass(frozen=True)
class Weighted:
    """An adjustment with weights that stand, ``named`` tests the worst first, and variance factors by part (1 for as given)."""

    adjusted: Adjusted
    named: tuple[Test, ...]
    factors: dict[Part, float]


def settle(
    network: Network,
    control: Sequence[Control],
    positions: Positions,
    *,
    declared: bool,
    sigma: float,
    scatter: float = 1.0,
    told: Callable[[], None] = lambda: None,
) -> Weighted:
    """Adjust until nothing stands out; ``declared`` tells whether the positions' sigmas are given or only their ratio is.

    ``scatter`` is a variance factor of the control points to begin with. Beyond what a bowl of the free block explains, it says
    that their sigmas are far too small, which would bend the block past where equations are linear.
    ``told`` is called before each adjustment, for progress and cancelling.
    """
    given, given_positions = tuple(control), positions
    factors: dict[Part, float] = dict.fromkeys(("mark", "plan", "height", "GNSS plan", "GNSS height"), 1.0)
    named: list[Test] = []
    effect = 1.0
    enlarged = scatter > _BOWL
    if enlarged:
        factors["plan"] = factors["height"] = scatter
    for round_ in range(_ROUNDS):
        told()
        weighted = _control(given, named, factors), _positions(given_positions, named, factors)
        adjusted = adjust(network, *weighted, sigma=sigma, effect=effect)
        network, sigma = adjusted.network, adjusted.sigma
        told_by_residuals, settled = adjusted.design_effect(), _SETTLED * _YIELD**round_
        if max(told_by_residuals / effect, effect / told_by_residuals) > settled:
            effect = told_by_residuals
            continue
        done = {(t.part, t.index, t.item) for t in named}
        found = [t for t in tests(adjusted) if (t.part, t.index, t.item) not in done]
        if _rescale(found, factors, declared=declared, ground=enlarged, settled=settled):
            continue  # what only seemed wrong by sigmas that were too small is none
        worst = min(found, key=lambda t: t.chance, default=None)
        if worst is None or worst.chance * len(found) > FALSE_ALARM:
            break
        named.append(worst)
        wrong_points = {t.index for t in named if t.part in ("plan", "height")}
        if not enlarged and len(wrong_points) > max(1, len(given) // 3):
            enlarged, named = True, []
    return Weighted(adjusted, tuple(named), factors)


def _rescale(found: Sequence[Test], factors: dict[Part, float], *, declared: bool, ground: bool, settled: float) -> bool:
    """Bring the variance factors of groups to what their tests say; tell whether one changed."""
    changed = False
    groups: list[tuple[Part, bool]] = [("mark", True), ("GNSS plan", declared), ("GNSS height", declared)]
    if ground:
        groups += [("plan", True), ("height", True)]
    for part, upward in groups:
        values = [t.statistic / stats.chi2.ppf(0.5, len(t.error)) for t in found if t.part == part]
        if len(values) < _FEW and not (ground and part in ("plan", "height") and values):
            continue
        new = factors[part] * float(np.median(values))
        if upward and new < 1.0 + 4.0 / np.sqrt(len(values)):  # what chance does to the median
            new = 1.0
        new = max(new, 1e-6)
        if max(new / factors[part], factors[part] / new) > settled:
            factors[part], changed = new, True
    return changed


def _control(given: Sequence[Control], named: Sequence[Test], factors: dict[Part, float]) -> list[Control]:
    scale = np.sqrt([factors["plan"], factors["plan"], factors["height"]])
    made = []
    for index, one in enumerate(given):
        marks = one.sighting.sigma * np.sqrt(factors["mark"])
        covariance = one.covariance * np.outer(scale, scale)
        for test in named:
            if test.index != index:
                continue
            if test.part == "mark":
                marks[test.item] = np.hypot(marks[test.item], test.size)
            elif test.part in ("plan", "height"):
                for axis in (0, 1) if test.part == "plan" else (2,):
                    covariance[axis, axis] += test.size**2
        made.append(Control(replace(one.sighting, sigma=marks), one.ground, covariance))
    return made


def _positions(given: Positions, named: Sequence[Test], factors: dict[Part, float]) -> Positions:
    sigma = given.sigma * np.sqrt([factors["GNSS plan"], factors["GNSS plan"], factors["GNSS height"]])
    for test in named:
        if test.part.startswith("GNSS"):
            for axis in (0, 1) if test.part == "GNSS plan" else (2,):
                sigma[test.index, axis] = np.hypot(sigma[test.index, axis], test.size)
    return replace(given, sigma=sigma)
