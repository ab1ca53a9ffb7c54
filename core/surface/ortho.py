"""The orthophoto: each cell's colour from the photographs that look down on it most steeply, blended without seams."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from .pictures import Pictures
from .sampling import project
from .views import TileView

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

# Views that lean this much more (tangent) than the steepest weigh a third: a narrow blend, for things that moved.
_BLEND = 0.02
_HIDDEN = 100.0  # added to the lean of a view that something hides the cell from
_TAPER = 0.06  # share of the frame over which a photograph fades out towards its edge


@nb.njit(cache=True, error_model="numpy")
def _lean(
    size: Array, matrix: Array, brown: Array, fold2: float, centre: Array, west: float, north: float, cell: float,
    height: Floats, free: NDArray[np.bool_], lean: Floats, fade: Floats,
) -> None:  # fmt: skip
    """Write how far the rays lean (tangent; NaN where not seen) and how far from the frame's edge (0..1) they fall."""
    rows, columns = height.shape
    for r in range(rows):
        y = north - (r + 0.5) * cell
        for c in range(columns):
            x, z = west + (c + 0.5) * cell, height[r, c]
            px, py = project(matrix, brown, fold2, x, y, z)
            lean[r, c] = np.nan
            if not (px >= 1.0 and py >= 1.0 and px <= size[0] - 1.0 and py <= size[1] - 1.0):
                continue
            up = centre[2] - z
            if up <= 0.0:
                continue
            # Where every view is hidden the steepest still paints: a wrong shadow is better to look at than a hole.
            hidden = 0.0 if free[r, c] else _HIDDEN
            lean[r, c] = np.sqrt((centre[0] - x) ** 2 + (centre[1] - y) ** 2) / up + hidden
            edge = min(min(px, size[0] - px) / size[0], min(py, size[1] - py) / size[1])
            fade[r, c] = min(edge / _TAPER, 1.0)


@nb.njit(cache=True, error_model="numpy")
def _add(
    picture: NDArray[Any], scale: float, matrix: Array, brown: Array, fold2: float, west: float, north: float, cell: float,
    height: Floats, weight: Floats, colour: Floats, total: Floats,
) -> None:  # fmt: skip
    """Add a photograph's colours (bilinear) times ``weight`` to ``colour`` (rows, columns, 3), and the weight to ``total``."""
    rows, columns = height.shape
    last_row, last_column = picture.shape[0] - 1, picture.shape[1] - 1
    for r in range(rows):
        for c in range(columns):
            w = weight[r, c]
            if not w > 0.0:
                continue
            px, py = project(matrix, brown, fold2, west + (c + 0.5) * cell, north - (r + 0.5) * cell, height[r, c])
            px = min(max(px * scale - 0.5, 0.0), last_column - 0.001)
            py = min(max(py * scale - 0.5, 0.0), last_row - 0.001)
            j, i = int(px), int(py)
            fx, fy = np.float32(px - j), np.float32(py - i)
            for b in range(3):
                upper = picture[i, j, b] * (1 - fx) + picture[i, j + 1, b] * fx
                lower = picture[i + 1, j, b] * (1 - fx) + picture[i + 1, j + 1, b] * fx
                colour[r, c, b] += w * (upper * (1 - fy) + lower * fy)
            total[r, c] += w


def paint(
    layers: Sequence[tuple[TileView, NDArray[np.bool_], str, int]],
    pictures: Pictures,
    height: Floats,
    west: float,
    north: float,
    cell: float,
) -> NDArray[np.uint8]:
    """Return red, green, blue, alpha (rows, columns, 4) of the surface ``height``; alpha 0 where no photograph sees it.

    ``layers`` are photographs with where nothing hides the surface from them, their path and reduction. Weights depend on
    geometry alone, so neighbouring tiles paint alike.
    """
    rows, columns = height.shape
    leans = np.full((len(layers), rows, columns), np.nan, np.float32)
    fades = np.zeros_like(leans)
    for n, (view, free, _, _) in enumerate(layers):
        _lean(view.size, view.matrix, view.brown, view.fold2, view.centre, west, north, cell, height, free, leans[n], fades[n])
    steepest = np.full((rows, columns), np.inf, np.float32)
    for lean in leans:
        steepest = np.fmin(steepest, lean)
    colour, total = np.zeros((rows, columns, 3), np.float32), np.zeros((rows, columns), np.float32)
    for (view, _, path, level), lean, fade in zip(layers, leans, fades, strict=True):
        with np.errstate(invalid="ignore", over="ignore"):
            weight = np.exp(-np.minimum((lean - steepest) / _BLEND, 60.0)) * (fade + 1e-4)
        weight[np.isnan(weight) | (weight < 1e-12)] = 0.0
        if not weight.any():
            continue
        picture = pictures.colour(path, level)
        _add(
            picture, 0.5**level, view.matrix, view.brown, view.fold2, west, north, cell, height,
            weight.astype(np.float32), colour, total,
        )  # fmt: skip
        bright = 255.0 / np.iinfo(picture.dtype).max
    out = np.zeros((rows, columns, 4), np.uint8)
    painted = total > 0
    out[..., :3][painted] = np.clip(np.rint(colour[painted] / total[painted, None] * bright), 0, 255) if painted.any() else 0
    out[..., 3] = np.where(painted, 255, 0)
    return out
