"""An adjustment that stands, and what follows from its covariance.

Every covariance here is that of the whole adjustment, never one with other unknowns held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import bundle
from .cameras import Cameras, Rays
from .independence import design_effect
from .network import Control, Network, Positions, antennas, tie_residuals
from .sightings import Sighting, meet, rows

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Adjusted:
    """An adjustment that stands.

    ``places`` (k, 3) are the adjusted control points; ``bias`` (3,) the positions' common error; ``sigma`` the tie points'
    sigma per axis (px), ``weight`` (m,) of their rays (px^-2). ``cofactor`` (u, u) is the covariance of the unknowns: poses,
    interior parameters, bias.
    """

    network: Network
    control: tuple[Control, ...]
    positions: Positions
    places: Array
    bias: Array
    sigma: float
    effect: float
    weight: Array
    cofactor: Array

    @property
    def cameras(self) -> Cameras:
        """The adjusted cameras."""
        return self.network.cameras

    def design_effect(self) -> float:
        """Return how much the tie points overstate themselves, by their residuals."""
        ties = self.network.ties
        return design_effect(tie_residuals(self.network), self.weight * self.sigma**2 * self.effect, ties.view, ties.xy)

    def position_residuals(self) -> Array:
        """Return antennas as given minus computed (g, 3), without the common error."""
        return self.positions.antenna - antennas(self.cameras, self.positions)

    def interior_covariance(self, camera: int) -> Array:
        """Return the covariance (q, q) of a camera's free parameters."""
        first = self.cameras.interior_column[camera]
        part = slice(first, first + self.cameras.free[camera])
        return self.cofactor[part, part]

    def intersect(self, sighting: Sighting, cofactor: Array | None = None, change: Array | None = None) -> tuple[Array, Array]:
        """Return where the marks of a point that took no part meet (3,), and the covariance (3, 3) of that.

        ``cofactor`` and ``change`` (u,) are those of an adjustment that differs a little from this one. NaN where they do not
        meet.
        """
        cameras = self.cameras if change is None else self.cameras.moved(change[: self.cameras.columns])
        point = meet(cameras, sighting)
        jacobian, by_point, residual = rows(cameras, sighting, point, len(self.cofactor))
        if not np.isfinite(residual).all():
            return np.full(3, np.nan), np.full((3, 3), np.nan)
        weight = np.repeat(1.0 / sighting.sigma**2, 2)
        held = np.linalg.inv(by_point.T @ (weight[:, None] * by_point))
        follow = -held @ by_point.T @ (weight[:, None] * jacobian)
        return point, held + follow @ (self.cofactor if cofactor is None else cofactor) @ follow.T

    def influence(self, chosen: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return how tie points (s,) follow the unknowns (s, 3, u), and their covariance with these held (s, 3, 3)."""
        c, t = self.cameras, self.network.ties
        follows, held = bundle.influence(
            t.arrays, self.weight, self.network.points, c.arrays, c.interior_column, c.columns, chosen
        )
        wide = np.zeros((len(chosen), 3, len(self.cofactor)))
        wide[:, :, : c.columns] = follows
        return wide, held

    def tie_covariances(self, rays: Rays, points: Array) -> Array:
        """Return the covariances (p, 3, 3) of points (p, 3) where their rays meet, whether they took part or not.

        A ray errs by the tie points' own sigma, however many of them count as one. NaN of points whose rays do not meet.
        """
        c = self.cameras
        weight = np.full(len(rays.view), 1.0 / self.sigma**2)
        covariances = bundle.covariances(rays.arrays, weight, points, c.arrays, c.interior_column, self.cofactor)
        return np.asarray(covariances)
