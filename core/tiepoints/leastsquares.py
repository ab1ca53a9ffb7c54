"""Least-squares matching: a patch of one photograph is laid on another to a fraction of a pixel (Foerstner 1982; Gruen 1985).

The patch is warped by a given affine map; its shift is found by Gauss-Newton's method on grey values whose gain and offset are
free. The gradients are the patch's own, so that the normal matrix is made once (inverse compositional: Baker & Matthews 2004).
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

HALF = 10  # pixels from the middle of a patch to its sides
_SPREAD = 5.0  # pixels, sigma of the Gaussian that weighs them
_BORDER = HALF + 1  # with a pixel more on each side, for the gradients
SIDE = 2 * _BORDER + 1
_ITERATIONS = 30  # noise in the gradients makes the steps too short by the share of it: on bare sand a third need more than 12
_STILL = 0.02  # pixels: the last step is smaller
_AWAY = 6.0  # pixels from the start at which the search is given up
_FLAT = 1e-3  # determinant against squared trace of the normal matrix: below, the patch holds the shift in one direction only


def cut_patches(image: NDArray[np.uint8], xy: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return the pixels around the points ``xy`` (n, 2), (n, SIDE, SIDE); all zero where ``holds_patch`` is False."""
    rows, columns = image.shape
    inside = holds_patch(xy, (columns, rows))
    patches = np.zeros((len(xy), SIDE, SIDE), np.uint8)
    for k, (x, y) in zip(np.flatnonzero(inside), np.floor(xy[inside]).astype(int).tolist(), strict=True):
        patches[k] = image[y - _BORDER : y + _BORDER + 1, x - _BORDER : x + _BORDER + 1]
    return patches


def holds_patch(xy: NDArray[np.floating], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Tell for which points (n, 2) a photograph of ``size`` (width, height) holds a whole patch."""
    pixel = np.floor(xy)
    inside = (pixel >= _BORDER) & (pixel < np.array(size) - _BORDER)
    return np.asarray(inside.all(axis=1))


def match_patches(
    image: NDArray[np.uint8], patches: NDArray[np.uint8], centre: Array, affinity: Array, start: ArrayLike
) -> tuple[Array, NDArray[np.float32]]:
    """Return where points of patches lie in ``image`` (n, 2), and the correlation there (n,).

    Parameters
    ----------
    image
        Grey values (rows, columns).
    patches
        What ``cut_patches`` cut around the points of another photograph, (n, SIDE, SIDE).
    centre
        Those points (n, 2) in that photograph.
    affinity
        The map (n, 2, 2) of a step in that photograph to one in ``image``.
    start
        Where they are about, to two pixels or so, (n, 2).

    Returns
    -------
    place, correlation
        Both NaN where a patch is flat, runs over the edge of the image, or does not come to rest near its start. The weighted
        correlation coefficient is that of the last step but one.
    """
    offset = np.arange(-HALF, HALF + 1)
    weight = np.exp(-(offset[:, None] ** 2 + offset**2) / (2 * _SPREAD**2))
    shift = centre - np.floor(centre) - 0.5
    place, correlation = _match(image, patches, shift, affinity, np.asarray(start, np.float64), weight / weight.sum())
    return place, correlation


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _match(image: Any, patches: Any, shift: Any, affinity: Any, start: Any, weight: Any) -> Any:
    rows, columns = image.shape
    side = 2 * HALF + 1
    place = np.full((len(patches), 2), np.nan)
    correlation = np.full(len(patches), np.nan, np.float32)
    template, grey = np.empty((side, side)), np.empty((side, side))
    steep_x, steep_y = np.empty((side, side)), np.empty((side, side))
    for n in range(len(patches)):
        mean = 0.0
        for v in range(side):
            for u in range(side):
                template[v, u] = patches[n, v + 1, u + 1]
                mean += weight[v, u] * template[v, u]
        variance, xx, xy, yy, own_x, own_y = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for v in range(side):
            for u in range(side):
                w = weight[v, u]
                template[v, u] -= mean
                gx = 0.5 * (np.float64(patches[n, v + 1, u + 2]) - np.float64(patches[n, v + 1, u]))
                gy = 0.5 * (np.float64(patches[n, v + 2, u + 1]) - np.float64(patches[n, v, u + 1]))
                variance += w * template[v, u] ** 2
                xx += w * gx * gx
                xy += w * gx * gy
                yy += w * gy * gy
                steep_x[v, u], steep_y[v, u] = w * gx, w * gy
                own_x += w * gx * template[v, u]
                own_y += w * gy * template[v, u]
        determinant = xx * yy - xy * xy
        if not determinant > _FLAT * (xx + yy) ** 2:
            continue
        a, b, c, d = affinity[n, 0, 0], affinity[n, 0, 1], affinity[n, 1, 0], affinity[n, 1, 1]
        # From the point to the middle of its pixel, and to where pixels count from.
        first_x = start[n, 0] - a * shift[n, 0] - b * shift[n, 1] - 0.5
        first_y = start[n, 1] - c * shift[n, 0] - d * shift[n, 1] - 0.5
        x, y = first_x, first_y
        reach_x, reach_y = (abs(a) + abs(b)) * HALF, (abs(c) + abs(d)) * HALF
        for _ in range(_ITERATIONS):
            if not (reach_x <= x < columns - 1 - reach_x and reach_y <= y < rows - 1 - reach_y):
                break
            mean = 0.0
            for v in range(side):
                for u in range(side):
                    px = x + a * (u - HALF) + b * (v - HALF)
                    py = y + c * (u - HALF) + d * (v - HALF)
                    column, row = min(int(px), columns - 2), min(int(py), rows - 2)
                    tx, ty = px - column, py - row
                    above = image[row, column] + tx * (np.float64(image[row, column + 1]) - image[row, column])
                    below = image[row + 1, column] + tx * (np.float64(image[row + 1, column + 1]) - image[row + 1, column])
                    grey[v, u] = above + ty * (below - above)
                    mean += weight[v, u] * grey[v, u]
            spread, product, ex, ey = 0.0, 0.0, 0.0, 0.0
            for v in range(side):
                for u in range(side):
                    difference = grey[v, u] - mean
                    spread += weight[v, u] * difference**2
                    product += weight[v, u] * difference * template[v, u]
                    ex += steep_x[v, u] * difference
                    ey += steep_y[v, u] * difference
            if not product > 0.0:
                break
            gain = product / spread
            ex, ey = gain * ex - own_x, gain * ey - own_y
            sx, sy = (yy * ex - xy * ey) / determinant, (xx * ey - xy * ex) / determinant
            x -= a * sx + b * sy
            y -= c * sx + d * sy
            if abs(x - first_x) > _AWAY or abs(y - first_y) > _AWAY:
                break
            if sx * sx + sy * sy < _STILL**2:
                place[n, 0] = x + a * shift[n, 0] + b * shift[n, 1] + 0.5
                place[n, 1] = y + c * shift[n, 0] + d * shift[n, 1] + 0.5
                correlation[n] = product / np.sqrt(spread * variance)
                break
    return place, correlation
