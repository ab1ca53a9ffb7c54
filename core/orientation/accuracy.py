"""Numbers that say how well a block lies on the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]

DOMING_POINTS = 8  # with fewer, the test of the quadratic term has next to no power
_CONFIDENCE = 0.95
_NORMAL = float(stats.norm.ppf(0.5 + _CONFIDENCE / 2))


@dataclass(frozen=True)
class Doming:
    """The rise (m) of a radially quadratic height error from the points' middle to the outermost of them, and its sigma.

    Positive where the block lies too high at its edges. ``significant`` tells whether it is beyond chance and large enough to
    matter; the number alone is not.
    """

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


def doming(places: Array, heights: Array, sigmas: Array | None, limit: float, common: Array | None = None) -> Doming | None:
    """Fit ``dU = a0 + a1 E + a2 N + a3 r^2`` to height errors (n,) at places (n, 2); r counts from the places' mean.

    Parameters
    ----------
    places, heights
        Where the errors were found, and the errors, computed minus given (m). They may be residuals of a georeferencing: its
        shift and tilt are a0 to a2, which are free here, so that they leave a3 and its sigma as they are.
    sigmas
        Of each error of its own (n,): surveying and marks, without what the georeferencing adds. Errors of their own are
        independent of each other, while leave-one-out errors are not. None when they are alike and not known.
    common
        The covariance (n, n) of what the errors have in common because the block may be bent as its own covariance says: a bend
        that is expected is no alarm. Shift and tilt in it count for nothing.
    limit
        The amplitude (m) below which a dome does not matter.

    Returns
    -------
    None with fewer than eight points, or when they do not determine it. The amplitude is ``a3 r_max^2``, with weights
    1 / sigma^2. It is significant when it exceeds ``limit`` AND its sigma times Student's quantile at 95 % with n - 4 degrees of
    freedom. Known sigmas are enlarged by what the residuals say, never made smaller: they may be far too small, but eight points
    that happen to fit well say little.
    """
    places, heights = np.asarray(places, float).reshape(-1, 2), np.asarray(heights, float)
    if len(places) < DOMING_POINTS:
        return None
    d = places - places.mean(axis=0)
    r2 = np.sum(d**2, axis=1)
    reach = float(r2.max())
    if reach == 0.0:
        return None
    design = np.column_stack([np.ones(len(d)), d / np.sqrt(reach), r2 / reach])
    # Judged without the weights: a point of next to no weight must not make the rest look like a shape.
    if np.linalg.matrix_rank(design, tol=1e-6 * np.sqrt(len(d))) < 4:
        return None
    own = np.ones(len(d)) if sigmas is None else np.asarray(sigmas, float)
    weighted, right = design / own[:, None], heights / own
    solved, *_ = np.linalg.lstsq(weighted, right, rcond=None)
    left, free = right - weighted @ solved, len(d) - 4
    factor = max(float(left @ left) / free, 0.0 if sigmas is None else 1.0)
    fit = np.linalg.solve(weighted.T @ weighted, weighted.T)[3] / own
    expected = 0.0 if common is None else max(float(fit @ common @ fit), 0.0)
    amplitude, variance = float(solved[3]), factor * float(np.linalg.inv(weighted.T @ weighted)[3, 3])
    # Student's quantile is for a variance that residuals tell; what the block's covariance expects is known.
    bound = np.sqrt(float(stats.t.ppf(0.5 + _CONFIDENCE / 2, free)) ** 2 * variance + _NORMAL**2 * expected)
    return Doming(amplitude, float(np.sqrt(variance + expected)), abs(amplitude) > max(float(bound), limit))
