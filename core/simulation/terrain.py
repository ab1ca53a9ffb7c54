"""The beach: its surface, its sand, and what happened between two dates.

Coordinates: ``a`` along the shore and ``c`` across it towards the sea, metres from the area's landward corner; ``z`` up from
the sea. Across the shore lie flat ground behind the dune with a hard path, the dune, the berm and the foreshore. The
shape is drawn for a width of 40 m and scaled to others, heights with it up to twice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .noise import averaged, noise, octaves

Array = NDArray[np.float64]

DRAWN_WIDTH = 40.0
STABLE_UNTIL = 7.5  # of the drawn width: the ground landward of it does not change
ZONES = {"dune": (8.0, 21.0), "berm": (21.0, 31.0), "foreshore": (31.0, 40.0)}
# Grains of the sand's reflectance (m): eight, from 2 cm to 3 m in equal ratios, little more than an octave apart.
GRAINS = 0.02 * 150.0 ** (np.arange(8) / 7.0)

# What changed: centre along (share of length), half-length (share), centre across, half-widths landward and seaward (drawn
# metres), height (m at the drawn width).
_EROSION = (0.38, 0.26, 18.5, 2.0, 5.0, -0.70)
_DEPOSITION = (0.66, 0.22, 29.5, 5.0, 5.0, 0.35)


@dataclass(frozen=True)
class Beach:
    """A beach ``length`` along and ``width`` across the shore (m), whose sand has the contrast ``contrast``.

    That is the RMS of its reflectance, relative to the mean, over features from 2 cm to 3 m, with equal power in each octave.
    """

    length: float
    width: float
    contrast: float
    seed: int

    @property
    def across(self) -> float:
        """Metres across the shore per drawn metre."""
        return self.width / DRAWN_WIDTH

    @property
    def relief(self) -> float:
        """Metres of height per drawn metre."""
        return min(self.across, 2.0)

    @property
    def shape(self) -> tuple[float, float, float, int]:
        """What the kernels need: length, across, relief, seed."""
        return self.length, self.across, self.relief, 10007 * self.seed  # so that neighbouring seeds share no noise

    def heights(self, a: Array, c: Array, after: bool) -> Array:
        """Return the surface's heights (m, same shape as ``a`` and ``c``) before or after the change."""
        a, c = np.broadcast_arrays(np.asarray(a, float), np.asarray(c, float))
        out = np.empty(a.size)
        _fill_heights(a.ravel(), c.ravel(), *self.shape, after, out)
        return out.reshape(a.shape)

    def changes(self) -> dict[str, float]:
        """Return the volumes (m3) of the scarp cut and the lobe laid down, without what ripples add.

        Each is a product of raised cosines of height h: ``h * half_length * (landward + seaward) / 2``.
        """
        volumes = {}
        for name, (_, half, _, landward, seaward, height) in (("erosion", _EROSION), ("deposition", _DEPOSITION)):
            depth = abs(height) * self.relief
            volumes[name] = depth * half * self.length * (landward + seaward) / 2 * self.across
        return volumes


@njit(cache=True, nogil=True)
def _step(x: float, start: float, end: float) -> float:
    t = min(max((x - start) / (end - start), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@njit(cache=True, nogil=True)
def _bump(x: float, before: float, behind: float) -> float:
    """Return cos^2 from 1 at 0 down to 0 at -``before`` and ``behind``."""
    t = x / behind if x > 0 else -x / before
    if t >= 1.0:
        return 0.0
    w = math.cos(0.5 * math.pi * t)
    return w * w


@njit(cache=True, nogil=True)
def _lobe(a: float, x: float, length: float, lobe: tuple[float, float, float, float, float, float]) -> float:
    along = lobe[1] * length
    return lobe[5] * _bump(a - lobe[0] * length, along, along) * _bump(x - lobe[2], lobe[3], lobe[4])


@njit(cache=True, nogil=True)
def height_at(a: float, c: float, length: float, across: float, relief: float, seed: int, after: bool) -> float:
    """Return the height (m above the sea) at one place; the sea itself is flat at 0."""
    x = c / across
    crest = 13.5 + 0.7 * noise(a / 25.0, 0.5, seed + 1)
    shore = x - 29.0
    z = 3.2 - 0.01 * x - 1.1 * _step(x, 14.0, 21.0)
    z += (2.2 + 0.25 * noise(a / 18.0, 0.5, seed + 2)) * _bump(x - crest, 5.5, 7.5)
    z -= 0.09 * (shore if shore > 30.0 else math.log1p(math.exp(shore)))
    if after:
        z += _lobe(a, x, length, _EROSION) + _lobe(a, x, length, _DEPOSITION)
    z *= relief
    z += 0.035 * noise(a / 7.0, c / 7.0, seed + 3) + 0.012 * noise(a / 1.8, c / 1.8, seed + 4)
    moved = _step(x, 8.0, 9.0)
    if moved < 1.0:  # trodden ground
        z += (1.0 - moved) * 0.005 * octaves(a, c, 0.18, 3, seed + 5)
    if moved > 0.0:  # wind ripples in patches, laid anew between the dates
        now = seed + (500 if after else 400)
        patch = min(max(0.55 + 0.45 * noise(a / 5.0, c / 5.0, now), 0.05), 1.2)
        phase = 2.0 * math.pi * (c / 0.5 + 0.35 * a + 1.1 * noise(a / 2.5, c / 2.5, now + 1))
        z += moved * (0.007 * patch * math.cos(phase) + 0.002 * noise(a / 0.25, c / 0.25, now + 2))
    return max(z, 0.0)


@njit(cache=True, nogil=True)
def reflectance_at(
    a: float, c: float, across: float, seed: int, after: bool, contrast: float, grains: Array, weights: Array
) -> float:
    """Return the reflectance relative to that of dry sand, whose ``grains`` (m) have ``weights`` (see ``grain_weights``)."""
    x = c / across
    now = seed + 700
    if after and x > 8.5 + 0.5 * noise(a / 0.9, c / 0.9, seed + 100):
        now = seed + 800  # sand moves between the dates
    texture = 0.0
    for k in range(grains.size):
        texture += weights[k] * noise(a / grains[k], c / grains[k], now + 7919 * k)
    waterline = 33.5 + 0.8 * noise(a / 6.0, 0.5, now + 101)
    wet = _step(x, waterline - 1.2, waterline + 0.8)
    band = -2.5 * wet + 0.8 * noise(a / 22.0, c / 7.0, now + 102) * (1.0 - wet)
    wrack = abs(x - 28.6 - 0.6 * noise(a / 4.0, 0.5, now + 103))
    if wrack < 0.5 and noise(a / 0.22, c / 0.22, now + 104) > 0.9 + 2.0 * wrack:
        band -= 5.0
    if 2.5 < x - 0.15 * noise(a / 6.0, 0.5, seed + 105) < 5.0:  # a path of gravel
        texture = 1.3 * texture - 2.5
    return max(1.0 + contrast * (texture + band), 0.02)


def grain_weights(width: float) -> Array:
    """Return the standard deviation (8,) that each of ``GRAINS`` has in squares of ``width`` (m), for a contrast of 1."""
    return np.array([averaged(width / grain) for grain in GRAINS]) / math.sqrt(len(GRAINS))


@njit(cache=True, nogil=True)
def _fill_heights(a: Array, c: Array, length: float, across: float, relief: float, seed: int, after: bool, out: Array) -> None:
    for i in range(a.size):
        out[i] = height_at(a[i], c[i], length, across, relief, seed, after)
