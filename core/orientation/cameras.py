"""What an adjustment moves: cameras with their poses and interior orientations, and the rays of points that they saw.

A pose is a rotation R, changed to exp(w) R, and the projection centre C: ``x_camera = R (X - C)``. The columns of a system of
unknowns hold w and C of each view (6), then the free interior parameters of each camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

POSE = 6  # columns of a view: rotation (rad, about the camera's axes), projection centre (m)


@dataclass(frozen=True)
class Rays:
    """Observations of points, sorted by point: point ``p`` has the observations ``start[p]`` to ``start[p + 1]``.

    ``view`` (m,) indexes the views, ``xy`` (m, 2) are pixels.
    """

    start: Index
    view: Index
    xy: Array

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.start) - 1

    @property
    def point(self) -> Index:
        """The point (m,) of each observation."""
        return np.repeat(np.arange(len(self)), np.diff(self.start))

    @property
    def arrays(self) -> tuple[Index, Index, Array]:
        """What the kernels take."""
        return self.start, self.view, self.xy

    def only(self, points: NDArray[np.bool_]) -> Rays:
        """Return the rays of some points (n,)."""
        counts = np.diff(self.start)
        kept = np.repeat(points, counts)
        return Rays(np.concatenate([[0], np.cumsum(counts[points])]).astype(np.int64), self.view[kept], self.xy[kept])


@dataclass(frozen=True)
class Cameras:
    """Exterior and interior orientation: ``rotation`` (n, 3, 3), ``centre`` (n, 3), the ``camera`` (n,) of each view.

    ``brown`` (c, 12) are fx, fy, cx, cy, k1, k2, p1, p2, k3 to k6 of each camera; ``basis`` (c, 12, q) are their derivatives by
    the free interior parameters, padded with zero columns, of which the first ``free`` (c,) count.
    """

    rotation: Array
    centre: Array
    camera: Index
    brown: Array
    basis: Array
    free: Index

    @property
    def arrays(self) -> tuple[Array, Array, Index, Array, Array, Index]:
        """What the kernels take."""
        return self.rotation, self.centre, self.camera, self.brown, self.basis, self.free

    @property
    def interior_column(self) -> Index:
        """The first column (c,) of each camera's free parameters in the reduced system."""
        return np.asarray(POSE * len(self.centre) + np.concatenate([[0], np.cumsum(self.free)[:-1]]), np.int64)

    @property
    def columns(self) -> int:
        """The number of columns of the reduced system."""
        return POSE * len(self.centre) + int(self.free.sum())

    def moved(self, change: Array) -> Cameras:
        """Return the cameras after a change (columns,)."""
        n = len(self.centre)
        poses = change[: POSE * n].reshape(n, POSE)
        brown = self.brown.copy()
        for c, (column, free) in enumerate(zip(self.interior_column, self.free, strict=True)):
            brown[c] += self.basis[c, :, :free] @ change[column : column + free]
        turned = rotations(poses[:, :3]) @ self.rotation
        return Cameras(turned, self.centre + poses[:, 3:], self.camera, brown, self.basis, self.free)


def rotations(vectors: Array) -> Array:
    """Return the rotation matrices (n, 3, 3) of rotation vectors (n, 3), radians (Rodrigues 1840)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    cross = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross -= cross.transpose(0, 2, 1)
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    one = np.where(small, 1.0 - angle**2 / 6, np.sin(safe) / safe)
    two = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) + one * cross + two * cross @ cross)
