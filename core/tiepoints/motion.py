"""How the ground around each feature moves from one photograph to the other, told by the matches nearest to it.

A homography and an epipolar line leave a feature tens of pixels in which to find its match where the ground is not flat, and bare
sand offers a likeness in every one of them: of the matches of a noisy photograph a fifth are wrong, and agree with both. Their
neighbours tell them. The ground is continuous, so that the matches around a place move by nearly the same, and wrong ones
by anything. The median of a few is not moved by the wrong ones among them (motion consistency: Bian et al. 2017; Ma et al. 2019).

How far a match may lie from it is told by the same neighbours: on a slope, and at the step of a dune's edge where some of them
belong to the ground above and some to that below, they differ by more, and the search is as much wider.
"""

from __future__ import annotations

from typing import Any

import cv2
import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from .guided import Prediction

Array = NDArray[np.float64]

_NEIGHBOURS = 12
_LEAST = 2.5  # px: two detected places of one piece of ground differ by less, but for one in a hundred on the noisiest sand
_TIMES = 2.0  # the neighbours' median distance from their median: of normal errors 94 % are within that
_STRAY, _STRAY_LEAST = 3.0, 1.0  # of the neighbours' median distance, and px, beyond which a refined match strays
_SOME, _LIKE = 3, 0.5  # neighbours that move like a stray, to that share of what was allowed
_SPACING = 1.4  # of the matches' mean distance, between the places at which their motion is taken


def by_neighbours(xy: NDArray[np.float32], first: Array, second: Array, homography: Array, widest: float) -> Prediction:
    """Return where features lie in the other photograph, by the matches nearest to each.

    The motion is taken at places of a lattice half as many as the matches, and for a feature that of the nearest.

    Parameters
    ----------
    xy
        The features (n, 2), pixels.
    first, second
        Places of the matches (m, 2; m > 0) in this photograph and in the other.
    homography
        Matrix (3, 3) that maps this photograph to the other roughly: turn, zoom and perspective are taken off by it.
    widest
        Pixels beyond which no search reaches.
    """
    places = xy.astype(np.float64)
    low, high = first.min(axis=0), first.max(axis=0)
    spacing = max(_SPACING * float(np.sqrt(np.prod(high - low + 1) / len(first))), 1.0)
    columns, rows = ((high - low) // spacing).astype(int) + 1
    x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    lattice = low + spacing * np.column_stack([x.ravel(), y.ravel()])
    count = min(_NEIGHBOURS, len(first))
    near = KDTree(first).query(lattice, count)[1].reshape(len(lattice), count)
    shift, spread = _middle(second - _mapped(homography, first), near)
    column, row = np.clip(((places - low) // spacing).astype(int), 0, [columns - 1, rows - 1]).T
    node = row * columns + column
    reach = np.clip(_TIMES * spread, min(_LEAST, widest), widest)
    return Prediction(_mapped(homography, places) + shift[node], reach[node])


def consistent(first: Array, second: Array) -> NDArray[np.bool_]:
    """Tell which matches (m, 2; pixels, refined) move as the ground around them does; all, where they are too few to tell.

    A match does when it is as near to the median of its neighbours as these are, or when some of them move exactly as it does:
    at a step of the ground those on its smaller side are few, but they agree.
    """
    if len(first) <= _NEIGHBOURS:
        return np.ones(len(first), np.bool_)
    plane, _ = cv2.findHomography(first, second, 0)
    if plane is None:
        return np.ones(len(first), np.bool_)
    residual = second - _mapped(plane, first)
    _, near = KDTree(first).query(first, _NEIGHBOURS + 1)
    middle, spread = _middle(residual, near[:, 1:])
    allowed = np.maximum(_STRAY * spread, _STRAY_LEAST)
    strays = np.flatnonzero(np.linalg.norm(residual - middle, axis=1) > allowed)
    apart = np.linalg.norm(residual[near[strays, 1:]] - residual[strays, None], axis=2)
    agreeing = (apart <= _LIKE * allowed[strays, None]).sum(axis=1) >= _SOME
    result = np.ones(len(first), np.bool_)
    result[strays[~agreeing]] = False
    return result


def _mapped(homography: Array, xy: Array) -> Array:
    return np.asarray(cv2.perspectiveTransform(xy[None], homography)[0]) if len(xy) else xy


@numba.njit(cache=True, nogil=True)
def _median(values: Any) -> Any:
    # Sorted in place by insertion: they are a dozen.
    for k in range(1, len(values)):
        value, at = values[k], k
        while at > 0 and values[at - 1] > value:
            values[at] = values[at - 1]
            at -= 1
        values[at] = value
    return 0.5 * (values[(len(values) - 1) // 2] + values[len(values) // 2])


@numba.njit(cache=True, nogil=True)
def _middle(values: Any, near: Any) -> Any:
    """Return the median of values (m, 2) at the indices ``near`` (n, k), by coordinate, and their median distance from it."""
    count = near.shape[1]
    middle, spread = np.empty((len(near), 2)), np.empty(len(near))
    part = np.empty(count)
    for i in range(len(near)):
        for axis in range(2):
            for k in range(count):
                part[k] = values[near[i, k], axis]
            middle[i, axis] = _median(part)
        for k in range(count):
            part[k] = np.hypot(values[near[i, k], 0] - middle[i, 0], values[near[i, k], 1] - middle[i, 1])
        spread[i] = _median(part)
    return middle, spread
