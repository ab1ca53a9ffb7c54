"""Numbers that say how well a block lies on the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]

DOMING_POINTS = 8  # with fewer, the test of the quadratic term has next to no power
_CONFIDENCE = 0.95


@dataclass(frozen=True)
class Doming:
    """The rise of a radially quadratic error from the centre to the outermost point, and its sigma (m)."""

    amplitude: float
    sigma: float
    significant: bool


def plani(errors: Array) -> float | None:
    """Return ``sqrt(mean(dE^2 + dN^2))`` of errors (n, 3), None for none."""
    errors = np.asarray(errors, float).reshape(-1, 3)
    return float(np.sqrt(np.mean(np.sum(errors[:, :2] ** 2, axis=1)))) if len(errors) else None


def alti(errors: Array) -> float | None:
    """Return ``sqrt(mean(dU^2))`` of errors (n, 3), None for none."""
    errors = np.asarray(errors, float).reshape(-1, 3)
    return float(np.sqrt(np.mean(errors[:, 2] ** 2))) if len(errors) else None


def doming(places: Array, heights: Array, limit: float) -> Doming | None:
    """Fit ``dU = a0 + a1 E + a2 N + a3 r^2`` to height errors (n,) at places (n, 2); r counts from their mean.

    It is significant when ``|a3|`` exceeds Student's quantile at 95 % with n - 4 degrees of freedom AND its amplitude exceeds
    ``limit`` (m): the test alone alarms on millimetres. None with fewer than eight points, or when they do not determine it.
    """
    places, heights = np.asarray(places, float).reshape(-1, 2), np.asarray(heights, float)
    if len(places) < DOMING_POINTS:
        return None
    d = places - places.mean(axis=0)
    r2 = np.sum(d**2, axis=1)
    reach = float(r2.max())
    if reach == 0.0:
        return None
    scale = np.sqrt(reach)
    design = np.column_stack([np.ones(len(d)), d / scale, r2 / reach])
    if np.linalg.matrix_rank(design, tol=1e-6 * np.sqrt(len(d))) < 4:
        return None
    solved, *_ = np.linalg.lstsq(design, heights, rcond=None)
    left, free = heights - design @ solved, len(d) - 4
    covariance = np.linalg.inv(design.T @ design) * float(left @ left) / free
    amplitude, sigma = float(solved[3]), float(np.sqrt(covariance[3, 3]))
    bound = float(stats.t.ppf(0.5 + _CONFIDENCE / 2, free))
    return Doming(amplitude, sigma, abs(amplitude) > bound * sigma and abs(amplitude) > limit)
