"""Marks of one ground point in several photographs, as the adjustment sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import bundle
from .cameras import POSE, Cameras
from .collinearity import project

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sighting:
    """The marks of a ground point: ``view`` (m,), pixels ``xy`` (m, 2) and their sigma (m,) per axis."""

    name: str
    view: NDArray[np.int64]
    xy: Array
    sigma: Array


def rows(cameras: Cameras, sighting: Sighting, point: Array, size: int) -> tuple[Array, Array, Array]:
    """Return the derivatives of marks by the unknowns (2m, size) and the point (2m, 3), and residuals (2m,) observed - computed.

    Residuals are NaN where the point cannot be seen.
    """
    count = len(sighting.view)
    jacobian, by_point, left = np.zeros((2 * count, size)), np.zeros((2 * count, 3)), np.full(2 * count, np.nan)
    at, one_point, one_pose, one_brown = np.empty(2), np.empty((2, 3)), np.empty((2, 6)), np.empty((2, 12))
    first = cameras.interior_column
    for i, (view, xy) in enumerate(zip(sighting.view, sighting.xy, strict=True)):
        c = cameras.camera[view]
        pose = cameras.rotation[view], cameras.centre[view]
        if not project(point, *pose, cameras.brown[c], at, one_point, one_pose, one_brown):
            continue
        part = slice(2 * i, 2 * i + 2)
        free = cameras.free[c]
        left[part], by_point[part] = xy - at, one_point
        jacobian[part, POSE * view : POSE * view + POSE] = one_pose
        jacobian[part, first[c] : first[c] + free] = one_brown @ cameras.basis[c, :, :free]
    return jacobian, by_point, left


def meet(cameras: Cameras, sighting: Sighting) -> Array:
    """Return where the marks of a sighting meet (3,), weighted by their sigmas; NaN where they do not."""
    start = np.array([0, len(sighting.view)], np.int64)
    first = _straight(cameras, sighting)
    if not np.isfinite(first).all():
        return first
    rays = start, sighting.view, sighting.xy
    points, residuals = bundle.intersect(rays, 1.0 / sighting.sigma**2, first[None], cameras.arrays, 10)
    return np.asarray(points[0] if np.isfinite(residuals).all() else np.full(3, np.nan))


def _straight(cameras: Cameras, sighting: Sighting) -> Array:
    """Return the point (3,) nearest to the rays of a sighting, weighted, distortion left out; NaN when they are parallel."""
    brown = cameras.brown[cameras.camera[sighting.view]]
    x = (sighting.xy - brown[:, 2:4]) / brown[:, :2]
    inside = np.column_stack([x, np.ones(len(x))])
    rays = np.einsum("nji,nj->ni", cameras.rotation[sighting.view], inside)
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    across = (np.eye(3) - rays[:, :, None] * rays[:, None, :]) / sighting.sigma[:, None, None] ** 2
    system = across.sum(axis=0)
    if np.linalg.cond(system) > 1e12:
        return np.full(3, np.nan)
    return np.asarray(np.linalg.solve(system, np.einsum("nij,nj->i", across, cameras.centre[sighting.view])))
