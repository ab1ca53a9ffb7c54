"""The camera's sensor and what the camera makes of it: from light to a Bayer mosaic, and from that to an 8-bit photograph."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

BITS = 12
FULL_WELL = 9000.0  # electrons at white: a small drone camera at base ISO
READ_NOISE = 4.0  # electrons
BLACK, WHITE = 256, 2**BITS - 1  # DN without light, and of a full well
ELECTRONS = FULL_WELL / (WHITE - BLACK)  # per DN
SAND_LEVEL = 0.5  # of full well, for green on dry flat sand under exposure 1: white paint is just not clipped
# What red, green and blue of the sensor answer to white light: silicon behind its filters sees green best.
NEUTRAL = (0.9, 1.0, 0.8)
PATTERN = np.array([[0, 1], [1, 2]])  # RGGB: the colours of the first two pixels of the first two rows

_VIGNETTING = 0.12  # light lost in the corners
# Colour of sand, paint and sea in red, green, blue, once white is white.
_TINTS = np.array([[1.10, 1.0, 0.80], [1.0, 1.0, 1.0], [0.50, 0.62, 0.62]], np.float32)
_DEEP = 65535.0  # white while the camera computes


def expose(light: NDArray[np.float32], exposure: float, noise: float, random: np.random.Generator) -> NDArray[np.uint16]:
    """Return the mosaic (rows, columns; DN) of the light of sand, paint and sea (3, rows, columns; dry flat sand is 1).

    Photon transfer (Janesick 2007): variance = mean + read noise squared, in electrons; Poisson's law is normal at these
    counts. ``noise`` scales the noise of light and electronics; rounding to whole DN is always there.
    """
    rows, columns = light.shape[1:]
    drawn = random.standard_normal((rows, columns), np.float32) if noise else np.zeros((rows, columns), np.float32)
    mosaic = np.empty((rows, columns), np.uint16)
    answers = _TINTS * np.array(NEUTRAL, np.float32) * np.float32(exposure * SAND_LEVEL * FULL_WELL)
    _read_out(light, vignette(rows, columns), drawn, answers, PATTERN, noise, mosaic)
    return mosaic


def develop(mosaic: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return the photograph (rows, columns, 3; red, green, blue) as the camera makes it of its mosaic.

    White balance, edge-aware demosaicing, gamma 2.222 with a toe of slope 4.5, 8 bits.
    """
    gains = np.where(PATTERN == 0, 1 / NEUTRAL[0], np.where(PATTERN == 1, 1 / NEUTRAL[1], 1 / NEUTRAL[2]))
    return np.asarray(_curve()[demosaic(mosaic, gains)])


def demosaic(mosaic: NDArray[np.uint16], gains: NDArray[np.float64]) -> NDArray[np.uint16]:
    """Return red, green, blue (rows, columns, 3) of a mosaic times ``gains`` (2, 2; of its first pixels), 65535 at white."""
    balanced = np.empty_like(mosaic)
    _balance(mosaic, gains * (_DEEP / (WHITE - BLACK)), balanced)
    # The filter does not reach the border: it is shown what a mirror would show, which keeps the colours' places.
    framed = cv2.copyMakeBorder(balanced, 2, 2, 2, 2, cv2.BORDER_REFLECT_101)
    return np.asarray(cv2.cvtColor(framed, cv2.COLOR_BayerRGGB2RGB_EA)[2:-2, 2:-2], np.uint16)


def linear(photograph: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the light (0..1, same shape) that ``develop`` makes the grey levels of."""
    grey = np.arange(256) / 255.0
    return np.asarray(np.where(grey < 0.081, grey / 4.5, ((grey + 0.099) / 1.099) ** (1 / 0.45))[photograph])


def vignette(rows: int, columns: int) -> NDArray[np.float32]:
    """Return the share of the light (rows, columns) that the lens lets through."""
    y, x = np.arange(rows)[:, None] + 0.5 - rows / 2, np.arange(columns)[None] + 0.5 - columns / 2
    return np.asarray(1.0 - _VIGNETTING * (x * x + y * y) / ((rows**2 + columns**2) / 4), np.float32)


def noise_level(electrons: float, noise: float) -> float:
    """Return the standard deviation (DN) of pixels of a mosaic with that mean."""
    return math.sqrt((noise / ELECTRONS) ** 2 * (electrons + READ_NOISE**2) + 1 / 12)


def sand_electrons() -> tuple[float, float, float]:
    """Return the mean electrons of dry flat sand in red, green, blue, in the photograph's middle under exposure 1."""
    red, green, blue = (float(t) * n * SAND_LEVEL * FULL_WELL for t, n in zip(_TINTS[0], NEUTRAL, strict=True))
    return red, green, blue


def _curve() -> NDArray[np.uint8]:
    """Return the 8-bit value of each 16-bit one."""
    linear = np.arange(_DEEP + 1) / _DEEP
    curve = np.where(linear < 0.018, 4.5 * linear, 1.099 * linear**0.45 - 0.099)
    return np.asarray(np.floor(curve * 255.0 + 0.5), np.uint8)


@njit(cache=True, nogil=True)
def _read_out(light: Any, fall: Any, drawn: Any, answers: Any, pattern: Any, noise: float, out: Any) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            colour = pattern[i % 2, j % 2]
            mean = 0.0
            for plane in range(light.shape[0]):
                mean += light[plane, i, j] * answers[plane, colour]
            mean *= fall[i, j]
            signal = mean + noise * math.sqrt(mean + READ_NOISE**2) * drawn[i, j]
            out[i, j] = int(min(max(BLACK + signal / ELECTRONS, 0.0), float(WHITE)) + 0.5)


@njit(cache=True, nogil=True)
def _balance(mosaic: Any, gains: Any, out: Any) -> None:
    for i in range(mosaic.shape[0]):
        for j in range(mosaic.shape[1]):
            level = max(float(mosaic[i, j]) - BLACK, 0.0) * gains[i % 2, j % 2]
            out[i, j] = int(min(level, _DEEP) + 0.5)
