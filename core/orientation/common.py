"""The error that a georeferencing gives to all that is measured in its block: shift, rotation, scale, and bending in height.

Ten numbers about a pivot: shift E N U (m), rotations about E N U (rad), scale, and the height's quadratic terms in E^2, E N and
N^2 (1/m), which hold a dome (equal E^2 and N^2) and the bow of a strip. They travel with the surface model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .adjusted import Adjusted
from .similarity import design_matrix

Array = NDArray[np.float64]

TERMS = 10
_SAMPLE = 400  # tie points, enough for ten numbers
_WELL_SEEN = 3  # rays


@dataclass(frozen=True)
class Common:
    """Covariance (10, 10) of the common error about ``pivot`` (3,), local; ``rest`` (m) is what it leaves in height."""

    pivot: Array
    covariance: Array
    rest: float = 0.0

    def uncertainty(self, points: Array) -> Array:
        """Return the covariances (n, 3, 3) that the georeferencing gives to ground points (n, 3)."""
        design = bending_design(points, self.pivot)
        return np.asarray(design @ self.covariance @ design.transpose(0, 2, 1))


def bending_design(points: Array, pivot: Array) -> Array:
    """Return the derivatives (n, 3, 10) of ground points (n, 3) by the ten numbers."""
    east, north, _ = (np.asarray(points, float) - pivot).T
    design = np.zeros((len(points), 3, TERMS))
    design[:, :, :7] = design_matrix(points, pivot)
    design[:, 2, 7:] = np.column_stack([east**2, east * north, north**2])
    return design


def rigid(pivot: Array, covariance: Array) -> Common:
    """Return the common error of a similarity, whose covariance is (7, 7)."""
    wide = np.zeros((TERMS, TERMS))
    wide[:7, :7] = covariance
    return Common(pivot, wide)


def of_adjustment(adjusted: Adjusted) -> Common:
    """Return the ten numbers' covariance that fits the adjusted tie points' best.

    Each sampled point errs by ``F da`` when the unknowns err by ``da``; the least-squares fit of the ten numbers to these is
    linear in ``da`` too, so that its covariance is exact. What the fit leaves is the ``rest``.
    """
    rays = np.diff(adjusted.network.ties.start)
    seen = np.flatnonzero(rays >= _WELL_SEEN) if np.any(rays >= _WELL_SEEN) else np.arange(len(rays))
    chosen = seen[:: max(1, len(seen) // _SAMPLE)].astype(np.int64)
    follows, held = adjusted.influence(chosen)
    good = np.isfinite(held[:, 0, 0])
    points = adjusted.network.points[chosen][good]
    flat = follows[good].reshape(-1, follows.shape[2])
    pivot = np.asarray(np.median(points, axis=0))
    design = bending_design(points, pivot)
    matrix = design.reshape(-1, TERMS)
    scale = np.linalg.norm(matrix, axis=0)
    # A level line of points tells neither all tilts nor all terms: the least of the numbers that fit.
    fit = np.linalg.pinv(matrix / scale, rcond=1e-9) / scale[:, None]
    by_unknowns = fit @ flat
    covariance = by_unknowns @ adjusted.cofactor @ by_unknowns.T
    left = (flat - matrix @ by_unknowns)[2::3]
    rest = np.sqrt(np.mean(np.einsum("ni,ij,nj->n", left, adjusted.cofactor, left, optimize=True)))
    return Common(pivot, (covariance + covariance.T) / 2, float(rest))
