"""What the comparison says, in one sentence, and the numbers it says it with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from .cases import Outcome

Array = NDArray[np.float64]

_ALIKE = 0.05  # a ratio of tie points nearer to 1 than this makes no difference
_CHANCE = 0.05  # of calling two cases different that are not
_FEW = 6  # pairs below which Wilcoxon's test cannot tell anything at that level


@dataclass(frozen=True)
class Statement:
    """Mean tie points per photograph, the share (%) kept, those of three or more rays, the share kept, residual (px)."""

    mtp: float
    mtp_percent: float
    mmtp: float
    mmtp_percent: float
    mse: float


# Rosu et al. 2015, table 1: Les Baronnets, RAW of 12 bits and JPG of the same flight.
PAPER = {
    "JPG": Statement(10385.9, 99.57, 8407.3, 99.57, 0.77),
    "RAW": Statement(15344.3, 99.69, 12659.0, 99.71, 0.70),
    "CeJPG": Statement(24332.1, 99.66, 19092.7, 99.65, 0.88),
    "CeRAW": Statement(30598.0, 99.35, 24603.8, 99.76, 0.80),
}


def verdict(outcomes: Sequence[Outcome]) -> str:
    """Return which case is best in what, and whether enhancement and RAW helped."""
    by_case = {o.case: o for o in outcomes}
    oriented = [o for o in outcomes if o.oriented]
    if not oriented:
        return f"None of the {len(outcomes)} cases can be oriented: {outcomes[-1].note}"
    parts = [_most_tied(oriented, by_case["JPG"]), _best_covered(oriented)]
    if checked := [o for o in oriented if o.checks]:
        parts.append(_smallest_errors(checked))
    worth = [("enhancement", [("with the JPG", "JPG", "CeJPG"), ("with the RAW", "RAW", "CeRAW")])]
    worth += [("RAW", [("without enhancement", "JPG", "RAW"), ("with enhancement", "CeJPG", "CeRAW")])]
    told = []
    for what, changes in worth:
        judged = [(where, *_worth(by_case[a], by_case[b])) for where, a, b in changes if a in by_case and b in by_case]
        if judged:
            told.append(f"{what} {_joined(judged)}")
    return f"{', '.join(parts)}; {'; '.join(told)}."


def ratio(outcome: Outcome, base: Outcome, number: Callable[[Outcome], float | None]) -> float | None:
    """Return a case's number over that of ``base``, None where one of them is not oriented or the base has nothing."""
    if not outcome.oriented or not base.oriented:
        return None
    above, below = number(outcome), number(base)
    return above / below if above is not None and below else None


def mtp(outcome: Outcome) -> float | None:
    """Return the mean tie points per oriented photograph."""
    return outcome.oriented.mtp if outcome.oriented else None


def mmtp(outcome: Outcome) -> float | None:
    """Return the mean tie points of three or more rays per oriented photograph."""
    return outcome.oriented.mmtp if outcome.oriented else None


def rms(errors: Mapping[str, Array]) -> tuple[float, float]:
    """Return the root mean square error (m) in plan and in height of points (dE, dN, dU) by name."""
    all_of_them = np.array(list(errors.values()))
    return float(np.sqrt(np.mean(np.sum(all_of_them[:, :2] ** 2, axis=1)))), float(np.sqrt(np.mean(all_of_them[:, 2] ** 2)))


def differs(first: Mapping[str, Array], second: Mapping[str, Array]) -> float | None:
    """Return by how much the second's errors are larger (median difference of lengths, m), None when that may be chance.

    The lengths of the errors of the same points are compared by Wilcoxon's signed-rank test (1945) at 95 %. With fewer than six
    points it cannot tell.
    """
    names = sorted(set(first) & set(second))
    if len(names) < _FEW:
        return None
    longer = np.array([np.linalg.norm(second[n]) - np.linalg.norm(first[n]) for n in names])
    if not longer.any() or stats.wilcoxon(longer).pvalue > _CHANCE:
        return None
    return float(np.median(longer))


def _most_tied(oriented: Sequence[Outcome], jpg: Outcome) -> str:
    best = max(oriented, key=lambda o: (o.oriented.oriented_count if o.oriented else 0, mtp(o) or 0.0))
    share = ratio(best, jpg, mtp)
    beside = ""
    if best is not jpg:
        beside = f", {share:.2f} times those of the JPG" if share else ", where the JPG cannot be oriented"
    count = (
        "" if all_oriented(best) else f", with {best.oriented.oriented_count if best.oriented else 0} of {best.images} oriented"
    )
    return f"{best.case} gives the most tie points ({mtp(best) or 0.0:,.0f} per photograph{beside}{count})"


def all_oriented(outcome: Outcome) -> bool:
    """Tell whether every photograph of a case is oriented."""
    return outcome.oriented is not None and outcome.oriented.oriented_count == outcome.images


def _best_covered(oriented: Sequence[Outcome]) -> str:
    best = max(oriented, key=lambda o: o.mean_coverage or 0.0)
    return f"{best.case} covers the photographs best ({best.mean_coverage:.0f} % of their cells)"


def _smallest_errors(checked: Sequence[Outcome]) -> str:
    best = min(checked, key=lambda o: float(np.hypot(*rms(o.checks))))
    plan, height = rms(best.checks)
    count = f"{len(best.checks)} check point{'s' * (len(best.checks) != 1)}"
    size = f"{100 * plan:.1f} cm in plan, {100 * height:.1f} cm in height"
    alike = [o.case for o in checked if o is not best and differs(best.checks, o.checks) is None]
    if alike and len(alike) == len(checked) - 1:
        return f"errors on {count} differ by no more than chance (smallest for {best.case}: {size})"
    beside = f"; {listed(alike)} may differ from it by chance only" if alike else ""
    return f"{best.case} has the smallest errors on {count} ({size}{beside})"


def _worth(plain: Outcome, changed: Outcome) -> tuple[str, str]:
    """Return what a change did, and the numbers that say so."""
    if not changed.oriented:
        return "did not help", f"{changed.case} cannot be oriented"
    if not plain.oriented:
        return "made orientation possible", f"{plain.case} cannot be oriented"
    share = ratio(changed, plain, mtp) or 0.0
    more = changed.oriented.oriented_count - plain.oriented.oriented_count
    helped, hurt = (more, share) > (0, 1 + _ALIKE), (more, share) < (0, 1 - _ALIKE)
    told = f"{share:.2f} times the tie points"
    if more:
        told += f", {abs(more)} {'more' if more > 0 else 'fewer'} photographs oriented"
    change = differs(plain.checks, changed.checks)
    if change is not None:
        told += f", check points {100 * abs(change):.1f} cm {'worse' if change > 0 else 'better'}"
    return ("helped" if helped else "did harm" if hurt else "made no difference"), told


def _joined(judged: Sequence[tuple[str, str, str]]) -> str:
    """Return judgements (where, word, numbers) as one phrase, a word that stands for several said once."""
    first = judged[0][1]
    if all(word == first for _, word, _ in judged):
        return f"{first} {' and '.join(f'{where} ({told})' for where, _, told in judged)}"
    return ", but ".join(f"{word} {where} ({told})" for where, word, told in judged)


def listed(names: Sequence[str]) -> str:
    """Return names as a phrase."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
