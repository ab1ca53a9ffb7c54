"""Seeded gradient noise: a smooth random function of the plane, the same on every machine and in any order of calls."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

# Gradient noise with components uniform in [-1, 1] and the quintic fade has variance 8/3 Iab = 0.031021, where
# Ia and Ib integrate f^2 t^2 and f^2 over 0..1, f = 1 - (6 t^5 - 15 t^4 + 10 t^3). This brings it to 1.
_UNIT = 5.677717


@njit(cache=True, nogil=True, inline="always")
def _slope_product(column: int, row: int, seed: int, u: float, v: float) -> float:
    h = (column * 374761393 + row * 668265263 + seed * 2147483647 + 97) & 0xFFFFFFFF
    h = ((h ^ (h >> 15)) * 2246822519) & 0xFFFFFFFF
    h = ((h ^ (h >> 13)) * 3266489917) & 0xFFFFFFFF
    h ^= h >> 16
    return ((h & 0xFFFF) / 32767.5 - 1.0) * u + ((h >> 16) / 32767.5 - 1.0) * v


@njit(cache=True, nogil=True)
def noise(x: float, y: float, seed: int) -> float:
    """Return gradient noise (Perlin 2002) of mean 0, variance 1 and a grain of 1 in ``x`` and ``y``."""
    column, row = math.floor(x), math.floor(y)
    u, v = x - column, y - row
    i, j = int(column), int(row)
    a = _slope_product(i, j, seed, u, v)
    b = _slope_product(i + 1, j, seed, u - 1.0, v)
    c = _slope_product(i, j + 1, seed, u, v - 1.0)
    d = _slope_product(i + 1, j + 1, seed, u - 1.0, v - 1.0)
    fu = u * u * u * (u * (u * 6.0 - 15.0) + 10.0)
    fv = v * v * v * (v * (v * 6.0 - 15.0) + 10.0)
    upper = a + fu * (b - a)
    lower = c + fu * (d - c)
    return _UNIT * (upper + fv * (lower - upper))


@njit(cache=True, nogil=True)
def octaves(x: float, y: float, finest: float, count: int, seed: int) -> float:
    """Return noise of variance 1 with equal power at ``finest``, 2 ``finest``, ... (``count`` grains, metres)."""
    total, grain = 0.0, finest
    for k in range(count):
        total += noise(x / grain, y / grain, seed + 7919 * k)
        grain *= 2.0
    return total / math.sqrt(count)


def averaged(width: float) -> float:
    """Return the standard deviation that ``noise`` keeps when it is averaged over squares of ``width`` grains.

    A node's share of the noise is ``g_x k1(x) k0(y) + g_y k0(x) k1(y)`` with k0 the fade, k1(x) = x k0(x) and gradients of
    variance 1/3; averaging does to k0 and k1 what it does to the noise. ``averaged(0)`` is 1.
    """
    x = np.linspace(-1.0 - width, 1.0 + width, 4001)
    t = np.minimum(np.abs(x), 1.0)
    fade = 1.0 - t**3 * (t * (t * 6.0 - 15.0) + 10.0)
    power = [float(np.trapezoid(_box(x, kernel, width) ** 2, x)) for kernel in (fade, x * fade)]
    return _UNIT * math.sqrt(2.0 / 3.0 * power[0] * power[1])


def _box(x: NDArray[np.float64], values: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """Return the mean of ``values`` (n,) at ``x`` (n,) over ``width`` about each place; they are 0 beyond."""
    if width == 0.0:
        return values
    total = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(x))])
    return np.asarray((np.interp(x + 0.5 * width, x, total) - np.interp(x - 0.5 * width, x, total)) / width, float)
