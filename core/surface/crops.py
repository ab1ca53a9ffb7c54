"""The parts of the photographs that a tile falls on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .bands import Band, Place
from .pictures import COARSEST, Pictures
from .plan import Plan
from .views import TileView

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

_SMOOTH_FROM = 1.3  # pixels a cell: below, there is nothing to take away
_SMOOTHING = 0.35  # pixels of standard deviation, per pixel a cell
_BORDER = 8  # cells and pixels more on every side


@dataclass(frozen=True)
class Crops:
    """Windows of reduced photographs, grey, one after the other in ``pixels``.

    ``starts`` (m,), ``shapes`` (m, 2: rows, columns), ``corners`` (m, 3: reduction, first column, first row).
    """

    pixels: Floats
    starts: NDArray[np.int64]
    shapes: NDArray[np.int64]
    corners: Array


def reduction(view: TileView, cell: float) -> int:
    """Return the level of a photograph whose pixel in the tile's middle comes closest to the cell, rather finer."""
    return int(np.clip(np.floor(np.log2(max(cell / _pixel(view), 1e-3)) + 0.4), 0, COARSEST))


def _pixel(view: TileView) -> float:
    return float(view.ground_pixel(np.zeros((1, 3)))[0])


def cut(plan: Plan, pictures: Pictures, views: list[TileView], band: Band, place: Place, cell: float, step: float) -> Crops:
    """Return the windows that any hypothesis of a band falls on.

    They are about twice as fine as the cells, and smoothed to the cells: interpolation between pixels as coarse as the cells
    would change the texture with the pixels' phase, which differs from view to view and pulls heights of few views.
    """
    windows, corners = [], []
    limits = band.limits(step)
    for view in views:
        level = max(0, reduction(view, cell) - 1)
        picture = pictures.grey(plan.paths[view.index], level)
        box = _pixel_box(view, place, cell, limits, band.first.shape)
        window, corner = _window(picture, 0.5**level, box)
        coarseness = cell / (_pixel(view) * 2**level)
        if coarseness > _SMOOTH_FROM:
            window = cv2.GaussianBlur(window, (0, 0), _SMOOTHING * coarseness)
        windows.append(window)
        corners.append(corner)
    sizes = [w.size for w in windows]
    return Crops(
        np.concatenate([w.ravel() for w in windows]),
        np.cumsum([0, *sizes], dtype=np.int64)[:-1],
        np.array([w.shape for w in windows], np.int64),
        np.array(corners, float),
    )


def _pixel_box(view: TileView, place: Place, cell: float, limits: tuple[float, float], shape: tuple[int, ...]) -> Array:
    """Return the full-size pixels (left, top, right, bottom) that a volume between two heights falls on, or more."""
    x = place.west + np.linspace(-_BORDER, shape[1] + _BORDER, 17) * cell
    y = place.north - np.linspace(-_BORDER, shape[0] + _BORDER, 17) * cell
    xyz = np.stack(np.meshgrid(x, y, limits), axis=-1).reshape(-1, 3)
    ray = xyz @ view.matrix[:, :3].T + view.matrix[:, 3]
    ray = ray[ray[:, 2] > 0]
    if not len(ray):
        return np.zeros(4)
    uv = ray[:, :2] / ray[:, 2:]
    # Without distortion, then wider by the most it can do inside the frame.
    pixels = uv * view.brown[:2] + view.brown[2:4]
    r2 = np.minimum((uv**2).sum(axis=1).max(), (view.size**2).sum() / view.brown[:2].min() ** 2)
    bend = np.abs(view.brown[4:]) @ np.array([r2, r2**2, 3 * r2**0.5, 3 * r2**0.5, r2**3, r2, r2**2, r2**3])
    slack = _BORDER + float(bend * np.sqrt(r2) * view.brown[0])
    low, high = pixels.min(axis=0) - slack, pixels.max(axis=0) + slack
    return np.concatenate([np.clip(low, 0, view.size), np.clip(high, 0, view.size)])


def _window(picture: NDArray[Any], scale: float, box: Array) -> tuple[Floats, tuple[float, float, float]]:
    rows, columns = picture.shape[:2]
    left, top = int(np.clip(box[0] * scale, 0, columns - 2)), int(np.clip(box[1] * scale, 0, rows - 2))
    right, bottom = int(np.clip(box[2] * scale + 2, left + 2, columns)), int(np.clip(box[3] * scale + 2, top + 2, rows))
    return picture[top:bottom, left:right].astype(np.float32) / np.float32(3.0), (scale, float(left), float(top))
