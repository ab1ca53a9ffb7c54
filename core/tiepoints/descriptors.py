"""Orientation and RootSIFT descriptor of a feature (Lowe 2004; Arandjelovic & Zisserman 2012)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

UNIT = 512.0  # descriptor norm in 8 bits; no element of a RootSIFT reaches 255
_BINS = 36  # of the histogram of orientations
_WINDOW = 1.5  # sigma of its Gaussian weight, in sigmas of the feature
_CELL = 3.0  # side of a descriptor's cell, in sigmas of the feature
_SIDE, _TURNS = 4, 8  # cells along the side, orientations in a cell
_STRIDE = 2  # pixels between the gradients that are used: the layers are blurred by 1.8 pixels and more
_LIMIT = 0.2  # of an element of the unit descriptor: one strong edge must not outweigh the rest
SUPPORT = _CELL * _SIDE / 2  # half the side of a descriptor, in sigmas of the feature


def describe(
    layers: NDArray[np.float32],
    column: NDArray[np.float32],
    row: NDArray[np.float32],
    layer: NDArray[np.float32],
    sigma: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return orientation (n,; radians, x towards y) and descriptor (n, 128) of features in Gaussian layers (m, rows, columns).

    ``column``, ``row``, ``layer`` and ``sigma`` (n,) are in the layers' own pixels. The orientation is the highest peak,
    interpolated, of the smoothed histogram of the gradients' orientations around the feature.
    """
    angle = np.empty(len(column), np.float32)
    descriptors = np.empty((len(column), 128), np.uint8)
    _describe(layers, column, row, layer, sigma, angle, descriptors)
    return angle, descriptors


@njit(cache=True, nogil=True)
def _turn(y: Any, x: Any) -> Any:
    """Return the angle of (x, y) as a share of the full turn, in [0, 1], to 3e-7."""
    ax, ay = abs(x), abs(y)
    ratio = min(ax, ay) / (max(ax, ay) + np.float32(1e-20))
    s = ratio * ratio
    # atan on [0, 1], fitted to the least largest error, over 2 pi.
    a = np.float32(-0.00186516) * s + np.float32(0.00837908)
    a = a * s + np.float32(-0.01852984)
    a = a * s + np.float32(0.0308029)
    a = a * s + np.float32(-0.05293857)
    a = (a * s + np.float32(0.15915132)) * ratio
    a = np.float32(0.25) - a if ay > ax else a
    a = np.float32(0.5) - a if x < 0 else a
    return np.float32(1.0) - a if y < 0 else a


@njit(cache=True, nogil=True, error_model="numpy")
def _describe(layers: Any, column: Any, row: Any, layer: Any, sigma: Any, angle: Any, out: Any) -> None:
    for k in range(len(column)):
        image = layers[min(max(int(np.rint(layer[k])), 1), layers.shape[0] - 1)]
        turn = _orientation(image, column[k], row[k], sigma[k])
        angle[k] = np.float32(2 * math.pi) * turn
        _descriptor(image, column[k], row[k], sigma[k], turn, out[k])


@njit(cache=True, nogil=True, error_model="numpy")
def _orientation(image: Any, column: Any, row: Any, sigma: Any) -> Any:
    rows, columns = image.shape
    x0, y0 = int(np.rint(column)), int(np.rint(row))
    radius = int(np.rint(3 * _WINDOW * sigma))
    scale = np.float32(-0.5) / np.float32(_WINDOW * sigma) ** 2
    histogram = np.zeros(_BINS, np.float32)
    weights = np.exp(scale * np.arange(radius + 1).astype(np.float32) ** 2)
    low, high = max(1, x0 - radius), min(columns - 1, x0 + radius + 1)
    for y in range(max(1, y0 - radius), min(rows - 1, y0 + radius + 1), _STRIDE):
        for x in range(low, high, _STRIDE):
            dx, dy = image[y, x + 1] - image[y, x - 1], image[y + 1, x] - image[y - 1, x]
            weight = weights[abs(x - x0)] * weights[abs(y - y0)]
            b = int(_turn(dy, dx) * np.float32(_BINS) + np.float32(0.5))
            histogram[b % _BINS] += weight * np.sqrt(dx * dx + dy * dy)
    smooth = np.empty(_BINS, np.float32)
    best = 0
    for b in range(_BINS):
        outer = histogram[(b - 2) % _BINS] + histogram[(b + 2) % _BINS]
        inner = histogram[(b - 1) % _BINS] + histogram[(b + 1) % _BINS]
        smooth[b] = (outer + 4 * inner + 6 * histogram[b]) / 16
        if smooth[b] > smooth[best]:
            best = b
    left, right = smooth[(best - 1) % _BINS], smooth[(best + 1) % _BINS]
    curvature = left + right - 2 * smooth[best]
    turn = (best + (0.5 * (left - right) / curvature if curvature < 0 else 0.0)) / _BINS
    return np.float32(turn % 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _descriptor(image: Any, column: Any, row: Any, sigma: Any, turn: Any, out: Any) -> None:
    rows, columns = image.shape
    cell = np.float32(_CELL * sigma)
    cos, sin = np.float32(math.cos(2 * math.pi * turn)) / cell, np.float32(math.sin(2 * math.pi * turn)) / cell
    radius = int(np.rint(cell * np.float32(math.sqrt(0.5) * (_SIDE + 1))))
    x0, y0 = int(np.rint(column)), int(np.rint(row))
    # One row and column more on each side take what falls outside; so do two more orientations, folded back below.
    histogram = np.zeros((_SIDE + 2, _SIDE + 2, _TURNS + 2), np.float32)
    middle = np.float32(_SIDE / 2 + 0.5)
    scale = np.float32(-2.0 / _SIDE**2) / (cell * cell)
    low, high = max(1, x0 - radius), min(columns - 1, x0 + radius + 1)
    across = np.exp(scale * (np.arange(low, high, _STRIDE).astype(np.float32) - column) ** 2)
    for y in range(max(1, y0 - radius), min(rows - 1, y0 + radius + 1), _STRIDE):
        fy = np.float32(y) - row
        along = np.exp(scale * fy * fy)
        for x in range(low, high, _STRIDE):
            fx = np.float32(x) - column
            u, v = cos * fx + sin * fy, cos * fy - sin * fx
            cu, cv = u + middle, v + middle
            if not (cu > 0 and cu < _SIDE + 1 and cv > 0 and cv < _SIDE + 1):
                continue
            dx, dy = image[y, x + 1] - image[y, x - 1], image[y + 1, x] - image[y - 1, x]
            size = np.sqrt(dx * dx + dy * dy) * along * across[(x - low) // _STRIDE]
            t = _turn(dy, dx) - turn
            t = (t + np.float32(1.0) if t < 0 else t) * np.float32(_TURNS)
            iu, iv, it = int(cu), int(cv), int(t)
            ru, rv, rt = cu - iu, cv - iv, t - it
            s1 = size * rv
            s0 = size - s1
            s01, s11 = s0 * ru, s1 * ru
            s00, s10 = s0 - s01, s1 - s11
            histogram[iv, iu, it + 1] += s00 * rt
            histogram[iv, iu, it] += s00 - s00 * rt
            histogram[iv, iu + 1, it + 1] += s01 * rt
            histogram[iv, iu + 1, it] += s01 - s01 * rt
            histogram[iv + 1, iu, it + 1] += s10 * rt
            histogram[iv + 1, iu, it] += s10 - s10 * rt
            histogram[iv + 1, iu + 1, it + 1] += s11 * rt
            histogram[iv + 1, iu + 1, it] += s11 - s11 * rt
    values = np.empty(_SIDE * _SIDE * _TURNS, np.float32)
    square = np.float32(0.0)
    n = 0
    for v in range(1, _SIDE + 1):
        for u in range(1, _SIDE + 1):
            histogram[v, u, 0] += histogram[v, u, _TURNS]
            histogram[v, u, 1] += histogram[v, u, _TURNS + 1]
            for t in range(_TURNS):
                values[n] = histogram[v, u, t]
                square += values[n] * values[n]
                n += 1
    largest = np.float32(_LIMIT) * np.sqrt(square)
    total = np.float32(1e-20)
    for n in range(len(values)):
        values[n] = min(values[n], largest)
        total += values[n]
    for n in range(len(values)):
        out[n] = np.uint8(min(np.float32(UNIT) * np.sqrt(values[n] / total) + np.float32(0.5), np.float32(255.0)))
