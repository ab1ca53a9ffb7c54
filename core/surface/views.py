"""Photographs as a tile sees them, and the choice of those that measure it best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..block import View
from ..frames import LocalFrame
from .sampling import inside

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class TileView:
    """A photograph in a tile's coordinates (metres east, north, up of the tile's origin in the CRS)."""

    index: int  # in the block's views
    matrix: Array  # camera_from_tile (3, 4)
    centre: Array  # the projection centre (3,)
    brown: Array  # (12,)
    fold2: float
    size: Array  # width, height in pixels

    def slopes(self, points: Array) -> Array:
        """Return how far the rays to points (n, 3) lean: horizontal over vertical distance to the camera (n, 2)."""
        rays = self.centre - points
        return rays[:, :2] / np.maximum(rays[:, 2:], 1e-3)

    def ground_pixel(self, points: Array) -> Array:
        """Return the pixel's size (m) at points (n, 3), across the ray."""
        depth = points @ self.matrix[2, :3] + self.matrix[2, 3]
        return depth / (0.5 * (self.brown[0] + self.brown[1]))

    def inside(self, west: float, north: float, cell: float, height: Floats) -> NDArray[np.bool_]:
        """Tell which cells of a surface fall into the frame."""
        return inside(self.size, self.matrix, self.brown, self.fold2, west, north, cell, height)


def tile_views(views: tuple[View, ...], frame: LocalFrame, origin: Array, reach: float) -> list[TileView]:
    """Return all ``views`` in coordinates relative to ``origin`` (easting, northing, height), good to ``reach`` metres around."""
    linear, offset = frame.affine(origin, reach)
    inverse = np.linalg.inv(linear)
    tiled = []
    for index, view in enumerate(views):
        matrix = np.column_stack([view.rotation @ linear, view.rotation @ offset + view.translation])
        camera = view.camera
        size = np.array([camera.width, camera.height], float)
        centre = inverse @ (view.centre - offset)
        tiled.append(TileView(index, matrix, centre, camera.brown(), camera.fold_radius() ** 2, size))
    return tiled


# Rays that lean more than this (tangent) see a surface too obliquely to measure its height.
STEEPEST = 1.4
# Two views closer than this (base over height) tell little that one does not.
_DISTINCT = 0.1


def choose(views: list[TileView], west: float, north: float, cell: float, height: Floats, most: int) -> list[TileView]:
    """Return the views that together measure a surface (rows, columns; no NaN) best: at each place ``most``, if that many see it.

    Chosen one by one: what a view gains at a place falls with the number of views already there, with its obliqueness,
    with its pixel against the finest one, and when it stands close to a chosen one; where ``most`` are chosen there is nothing
    more to gain. So a tile that reaches over the whole survey, as coarse ones do, takes views all over it. ``cell`` is the
    lattice's.
    """
    rows, columns = height.shape
    y, x = np.mgrid[0:rows, 0:columns]
    points = np.stack([west + (x + 0.5) * cell, north - (y + 0.5) * cell, height], axis=-1).reshape(-1, 3).astype(float)
    worth, slopes, kept = [], [], []
    for view in views:
        seen = view.inside(west, north, cell, height).ravel()
        if not seen.any():
            continue
        slope = view.slopes(points)
        lean2 = (slope**2).sum(axis=1)
        pixel = view.ground_pixel(points)
        worth.append(np.where(seen & (lean2 < STEEPEST**2), np.exp(-lean2), 0.0) / np.maximum(pixel, 1e-9) ** 2)
        slopes.append(slope)
        kept.append(view)
    if not kept:
        return []
    gain = np.array(worth)
    finest = gain.max(axis=0)
    gain = gain / np.where(finest > 0, finest, 1.0)
    there = np.zeros(len(points))
    chosen: list[int] = []
    while len(chosen) < len(kept):
        value = (gain * (there < most) / (1.0 + there) ** 2).sum(axis=1)
        value[chosen] = 0.0
        best = int(np.argmax(value))
        if value[best] < 1e-3 * len(points):
            break
        chosen.append(best)
        there += gain[best] > 0
        for i, slope in enumerate(slopes):
            apart = np.sqrt(((slope - slopes[best]) ** 2).sum(axis=1))
            gain[i] *= np.clip(apart / _DISTINCT, 0.2, 1.0)
    return [kept[i] for i in sorted(chosen)]
