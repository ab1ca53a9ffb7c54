"""Profiles through a surface: where it is steepest, and what it looks like there."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SHARE = 1 / 40  # of the longer side: what smooths away single trees, kerbs and stones before slopes are compared
_LENGTH = 0.35  # of the longer side
_WHOLE = 0.85  # of the neighbourhood that must be known
_STEEP = 1.2  # slopes beyond are walls and trees, not ground


@dataclass(frozen=True)
class Profile:
    """A line over a surface: its ends (row, column; in cells), distances (m) and the values of two layers along it."""

    start: tuple[float, float]
    end: tuple[float, float]
    distance: Array
    height: Array
    sigma: Array


def steepest_profile(height: NDArray[np.floating], sigma: NDArray[np.floating], cell: float) -> Profile | None:
    """Return the profile down the steepest slope of a surface (rows, columns; NaN: none), None when there is no slope.

    The slope is that of the surface smoothed to a fortieth of its length, where nearly all of the neighbourhood is known; the
    profile runs along it, downhill, over up to a third of the surface's length.
    """
    rows, columns = height.shape
    longer = max(rows, columns)
    known = np.isfinite(height)
    if min(rows, columns) < 8 or not known.any():
        return None
    spread = max(1.5, _SHARE * longer)
    middle = float(np.median(height[known]))
    share = cv2.GaussianBlur(known.astype(np.float64), (0, 0), spread)
    smooth = cv2.GaussianBlur(np.where(known, height - middle, 0.0).astype(np.float64), (0, 0), spread) / np.maximum(share, 1e-9)
    down, right = np.gradient(smooth, cell)
    slope = np.hypot(down, right)
    slope[(share < _WHOLE) | (slope > _STEEP) | ~known] = 0.0
    if slope.max() <= 1e-6:
        return None
    r, c = np.unravel_index(int(np.argmax(slope)), slope.shape)
    direction = -np.array([down[r, c], right[r, c]]) / slope[r, c]
    reach = np.arange(-0.5 * _LENGTH * longer, 0.5 * _LENGTH * longer + 0.5)
    line = np.array([r, c]) + reach[:, None] * direction
    inside = ((line >= 0) & (line <= [rows - 1, columns - 1])).all(axis=1)
    line = line[inside]
    heights, sigmas = (_along(layer, line) for layer in (height, sigma))
    found = np.flatnonzero(np.isfinite(heights))
    if len(found) < 8:
        return None
    cut = slice(found[0], found[-1] + 1)
    line, heights, sigmas = line[cut], heights[cut], sigmas[cut]
    return Profile(
        (float(line[0, 0]), float(line[0, 1])),
        (float(line[-1, 0]), float(line[-1, 1])),
        cell * np.arange(len(line), dtype=float),
        heights,
        sigmas,
    )


def _along(layer: NDArray[np.floating], line: Array) -> Array:
    """Return a layer bilinearly along a line (n, 2: row, column); NaN beside cells without a value."""
    x, y = line[:, 1].astype(np.float32), line[:, 0].astype(np.float32)
    found = cv2.remap(layer.astype(np.float32), x[None], y[None], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found[0], np.float64)
