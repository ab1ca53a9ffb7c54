"""Control points with a single mark: two equations each, which are tested against the block before they enter it.

A mark fixes its photograph's ray to the surveyed point, whether or not another ray meets it there. What it lacks is a second mark
to contradict it, so that a slip would pull the block before any test sees it. It is therefore tested first against an
adjustment in which it took no part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from .network import Control
from .sightings import rows
from .weighting import FALSE_ALARM, Weighted

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Slip:
    """A single mark, by its ``index`` among those tested, that the block contradicts by ``size`` px, ``ratio`` of its sigmas."""

    index: int
    size: float
    ratio: float


@dataclass(frozen=True)
class Entering:
    """What may enter of the points tested: ``members`` are their numbers, ``control`` as it enters, ``slips`` what is wrong."""

    members: tuple[int, ...]
    control: tuple[Control, ...]
    slips: tuple[Slip, ...]


def tested(settled: Weighted, singles: Sequence[Control]) -> Entering:
    """Return what may enter the adjustment of single-marked points, and which of them an adjustment without them contradicts.

    With r the mark minus where the block sees the point, ``r^T S^-1 r`` is chi-squared of two degrees when
    ``S = S_mark + Jp S_G Jp^T + Ja Q Ja^T``. What is contradicted gets its own size as sigma, and what is not seen stays out.
    """
    adjusted, factors = settled.adjusted, settled.factors
    scale = np.sqrt([factors["plan"], factors["plan"], factors["height"]])
    members, entering, slips = [], [], []
    for index, one in enumerate(singles):
        jacobian, by_point, left = rows(adjusted.cameras, one.sighting, one.ground, len(adjusted.cofactor))
        if not np.isfinite(left).all():
            continue
        ground = one.covariance * np.outer(scale, scale)
        spread = np.diag(np.repeat(one.sighting.sigma**2, 2)) * factors["mark"] + by_point @ ground @ by_point.T
        statistic = float(left @ np.linalg.solve(spread + jacobian @ adjusted.cofactor @ jacobian.T, left))
        if stats.chi2.sf(statistic, 2) * len(singles) < FALSE_ALARM:
            size = float(np.linalg.norm(left))
            slips.append(Slip(index, size, float(np.sqrt(statistic))))
            one = replace(one, sighting=replace(one.sighting, sigma=np.hypot(one.sighting.sigma, size)))
        members.append(index)
        entering.append(one)
    return Entering(tuple(members), tuple(entering), tuple(slips))
