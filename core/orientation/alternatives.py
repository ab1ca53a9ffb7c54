"""What other choices would have given: each method with fewer control points, judged by the same check points."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..errors import NotEnoughData
from ..frames import LocalFrame
from .accuracy import alti, plani
from .adjusted import Adjusted
from .adjustment import adjust
from .gnss import SHARED, Gnss
from .observations import Seen, Solver, undetermined
from .sightings import Sighting
from .solution import Alternative, Solution
from .weighting import Weighted

Array = NDArray[np.float64]

_COUNTS = (0, 1, 3, 5)


def alternatives(
    settled: Weighted,
    block: Block,
    solution: Solution,
    gnss: Gnss,
    sightings: Sequence[Sighting],
    *,
    comparable: bool,
    step: Callable[[], None],
) -> list[Alternative]:
    """Return the adjustment with 0, 1, 3, 5 and all control points, under the weights that stand, judged by the check points.

    Control points are taken in an order that spreads them: the first in the middle, each next one farthest from those taken. What
    a choice does not determine is left out. Without check points errors are None and only predictions are given, at all ground
    points.
    """
    adjusted, seen = settled.adjusted, solution.seen
    checks = [i for i, s in enumerate(seen) if s.point.check and s.found is not None]
    judged = checks or [i for i, s in enumerate(seen) if s.found is not None]
    if not judged:
        return []
    order = _spread(np.array([c.ground for c in adjusted.control]).reshape(-1, 3))
    order.sort(key=lambda k: len(adjusted.control[k].sighting.view) < 2)  # a point with one mark comes last
    counts = [n for n in _COUNTS if n < len(order)] + [len(order)]
    choices = [[adjusted.control[k].sighting.name for k in order[:count]] for count in counts]
    found = list(_similarities(block, solution, gnss, choices, checks))
    frame = solution.frame
    for count in counts:
        step()
        control = [adjusted.control[k] for k in order[:count]]
        positions = adjusted.positions
        if not control:
            if not len(gnss) or not comparable:
                continue
            alone = np.zeros(3) if gnss.declared else np.array([SHARED[0], SHARED[0], SHARED[1]])
            positions = replace(positions, shared=alone)
        try:
            other = adjust(adjusted.network, control, positions, sigma=adjusted.sigma, fixed_sigma=True, effect=adjusted.effect)
        except NotEnoughData:
            continue
        names = tuple(c.sighting.name for c in control)
        numbers = _judged(other, seen, judged, sightings, frame, errors=bool(checks))
        found.append(Alternative("adjustment", count, names, *numbers))
    return found


def _similarities(
    block: Block, solution: Solution, gnss: Gnss, choices: Sequence[Sequence[str]], checks: Sequence[int]
) -> Iterator[Alternative]:
    """Yield the similarity on each choice of control points, on GNSS too where these are fewer than three."""
    meet = {s.point.name for s in solution.seen if s.found is not None}  # a point with one mark is no use to a similarity
    for names in dict.fromkeys(tuple(name for name in choice if name in meet) for choice in choices):
        solver = Solver(block, solution.seen, gnss, solution.frame)
        solver.with_gnss = len(names) < 3
        if solver.with_gnss and not len(gnss):
            continue
        used = np.array([s.point.name in names and not s.point.check for s in solution.seen], bool)
        try:
            solved = solver.fit(used)
        except NotEnoughData:
            continue
        if undetermined(solved, "-"):
            continue
        errors = solver.errors(solved)[list(checks)]
        predicted = [np.sqrt(np.diag(solver.predicted(solved, i))) for i in checks]
        numbers = [plani(errors), alti(errors)] if checks else [None, None]
        numbers += [plani(np.array(predicted)), alti(np.array(predicted))] if checks else [None, None]
        yield Alternative("similarity", len(names), names, *numbers)


def _judged(
    adjusted: Adjusted,
    seen: Sequence[Seen],
    judged: Sequence[int],
    sightings: Sequence[Sighting],
    frame: LocalFrame,
    *,
    errors: bool,
) -> Iterator[float | None]:
    found, variances = [], []
    for i in judged:
        place, covariance = adjusted.intersect(sightings[i])
        point = seen[i].point
        found.append(frame.to_crs(place[None])[0] - point.coordinates)
        variances.append(np.diag(covariance) + [point.sigma_h**2, point.sigma_h**2, point.sigma_v**2])
    predicted = np.sqrt(np.array(variances))
    yield plani(np.array(found)) if errors else None
    yield alti(np.array(found)) if errors else None
    yield plani(predicted)
    yield alti(predicted)


def _spread(places: Array) -> list[int]:
    """Return the order (k,) of places (k, 3) that spreads them."""
    if not len(places):
        return []
    order = [int(np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1)))]
    nearest = np.linalg.norm(places - places[order[0]], axis=1)
    while len(order) < len(places):
        order.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(places - places[order[-1]], axis=1))
    return order
