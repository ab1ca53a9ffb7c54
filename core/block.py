"""A block of oriented photographs as plain arrays, for rooms that need poses but not COLMAP."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import Camera

Array = NDArray[np.float64]


@dataclass(frozen=True)
class View:
    """An oriented photograph: ``x_camera = rotation @ x_world + translation``."""

    name: str
    camera: Camera
    rotation: Array  # (3, 3)
    translation: Array  # (3,)

    @property
    def centre(self) -> Array:
        """The projection centre (3,) in the world."""
        return -self.rotation.T @ self.translation

    def project(self, points: Array) -> Array:
        """Return pixels (n, 2) of world points (n, 3); NaN where the camera cannot see them (the frame is not tested)."""
        return self.camera.project(np.asarray(points, float) @ self.rotation.T + self.translation)


@dataclass(frozen=True)
class Block:
    """Oriented photographs and tie points.

    ``points`` (n, 3) are in the block's frame, ``errors`` (n,) their mean reprojection error in pixels, ``rays`` (n,) the
    number of photographs that see each. Observations are parallel arrays: ``observed_point`` (m,) and ``observed_view`` (m,)
    index ``points`` and ``views``.
    """

    views: tuple[View, ...]
    points: Array
    errors: Array
    rays: NDArray[np.int32]
    observed_point: NDArray[np.int32]
    observed_view: NDArray[np.int32]

    def only(self, kept: NDArray[np.bool_]) -> Block:
        """Return the block with some of its points (n,)."""
        if kept.all():
            return self
        seen = kept[self.observed_point]
        number = (np.cumsum(kept) - 1).astype(np.int32)[self.observed_point[seen]]
        return Block(self.views, self.points[kept], self.errors[kept], self.rays[kept], number, self.observed_view[seen])
