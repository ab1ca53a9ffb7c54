"""Whether a solution is bent: the dome of its height errors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .accuracy import Doming, doming
from .common import bending_design
from .findings import ground_pixel
from .gnss import Gnss
from .solution import Solution

Array = NDArray[np.float64]


def dome_of(solution: Solution, gnss: Gnss) -> Doming | None:
    """Test for a dome on the errors of control and check points, or with too few of them on GNSS heights.

    An adjustment bends towards its control points: there their errors when left out take the place of their residuals. The worst
    blunder in height is left out: one in the middle looks like a dome. Others stay, for a dome makes blunders of many. What the
    block's own covariance expects of bending is part of the sigma: the test is of domes beyond it, as a camera that is held and
    wrong makes them.
    """
    limit = ground_pixel(solution.block)
    worst = max((b for b in solution.blunders if b.part == "height"), key=lambda b: b.ratio, default=None)
    used = np.array([s.found is not None and (worst is None or s.point.name != worst.name) for s in solution.seen], bool)
    places = np.array([s.point.coordinates for s in solution.seen], float).reshape(-1, 3)[:, :2]
    heights, sigmas = solution.errors[:, 2], solution.sigmas[:, 2]
    if solution.method == "adjustment":
        left_out = np.isfinite(solution.loo[:, 2])
        heights = np.where(left_out, solution.loo[:, 2], heights)
        sigmas = np.where(left_out, solution.loo_sigma[:, 2], sigmas)
    used &= np.isfinite(heights) & np.isfinite(sigmas)
    dome = doming(places[used], heights[used], sigmas[used], limit, _expected(solution)[np.ix_(used, used)])
    if dome is None and len(gnss):
        declared = gnss.sigmas[:, 1] if gnss.declared else None
        dome = doming(gnss.coordinates[:, :2], solution.gnss_errors[:, 2], declared, limit)
    return dome


def _expected(solution: Solution) -> Array:
    """Return the covariance (n, n) that the block's common error gives to the heights of check points.

    A free focal length and distortion may bend a block that only positions hold by decimetres, and its covariance says so. A
    control point that is left out has the block's error in its own sigma already.
    """
    given = np.array([s.point.coordinates for s in solution.seen], float).reshape(-1, 3)
    if not len(given):
        return np.zeros((0, 0))
    heights = bending_design(solution.frame.from_crs(given), solution.common.pivot)[:, 2]
    heights[[not s.point.check for s in solution.seen]] = 0.0
    return np.asarray(heights @ solution.common.covariance @ heights.T)
