"""Signal and noise of a photograph's colours: at which frequency the noise overtakes the ground's texture.

Sand is nearly grey: its texture is the same in all colours, while light and electronics bring each colour a noise of its own. Of
three colours with one signal the variance of each one's noise follows from their covariances, ``C_rr - C_rg C_rb / C_gb``,
whatever their gains (the three-cornered hat: Gray and Allan 1974; triple collocation: Stoffelen 1998). That needs no flat patch,
no second exposure and no data of the sensor.

Noise is measured on means of 8 and of 16 pixels: finer, a JPG's colours have been made of one another by demosaicing and halved
by the compression, and their noise looks like signal. It is taken as white. What it and the texture make up together is measured
on means of 4 pixels, as near to the crossover as the noise can still be told: ripples and wet patches lift the coarse, and say
nothing of the fine. The rest of the way goes a model: texture whose power falls with the frequency to the power of 2.4, as it
does on simulated sand; 2 is usual for natural scenes (Field 1987).
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

BLOCK = 4  # pixels, side of the means
STRIP = 64  # rows of which means are taken together
PERIOD = 192  # rows from one such strip to the next: a third tells enough, and every colour filter array repeats in it
SLOPE = 2.4  # of the texture's power over frequency
# Cycles per mean at which a second difference along both axes tells the power of such texture: the mean of f**-2.4, weighted by
# the square of the response of the difference and of the means, to the power of -1 / 2.4.
_CENTRE = 0.632
# Shares of white noise's and of texture's power that demosaicing by (1, 2, 1) leaves in means of 4 pixels: the RAW's here, a
# JPG's about.
_NOISE_LEFT, _TEXTURE_LEFT = 0.49, 0.67
_GAIN = 6.0  # of the second difference on white noise
_CALM = 0.9  # share of the differences that is used: edges of paint and plants are not texture
_CALM_VARIANCE = 0.6231  # of a normal variable's smallest 0.9: 1 - 2 t phi(t) / 0.9 at t = 1.6449
_LEAST = 200  # differences
_LEAST_SNR = 0.5  # in means of 4 pixels
_NO_NOISE = 0.1  # of the variance of rounding: less noise than that means that the colours are copies of one


def strip_starts(rows: int) -> range:
    """Return the first row of each strip of a photograph."""
    return range(0, rows - STRIP + 1, PERIOD)


def block_means(pixels: NDArray[Any]) -> NDArray[np.float32]:
    """Return the means (STRIP / BLOCK, n, channels) of a strip of pixels (STRIP, columns, channels); four divides n."""
    columns = pixels.shape[1] // (4 * BLOCK) * 4 * BLOCK
    if not columns:
        return np.zeros((STRIP // BLOCK, 0, pixels.shape[2]), np.float32)
    part = np.ascontiguousarray(pixels[:, :columns])
    small = cv2.resize(part.astype(np.float32), (columns // BLOCK, STRIP // BLOCK), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32).reshape(STRIP // BLOCK, columns // BLOCK, pixels.shape[2])


def crossover(means: NDArray[np.float32], step: float, valid: NDArray[np.bool_] | None = None) -> float | None:
    """Return the frequency (cycles per pixel) at which noise and texture of a photograph have the same power.

    ``means`` (strips, 16, n, 3) are ``block_means`` of its strips, ``step`` is what its colours are rounded to, in their unit,
    ``valid`` (rows, columns) is False where the photograph is masked. None when that cannot be told: without three colours, with
    three that are copies of one or have little in common, or with too little ground. The noise is the geometric mean of what its
    two bands tell.
    """
    if means.ndim != 4 or means.shape[3] != 3 or not means.size:
        return None
    there = np.ones(means.shape[:3], bool) if valid is None else _whole_blocks(valid, means.shape[2])
    bands = []
    for block in (BLOCK, 2 * BLOCK, 4 * BLOCK):
        powers = _powers(means, there, block)
        if powers is None:
            return None
        bands.append(powers)
        means, there = _halved(means), _halved(there[..., None].astype(np.float32))[..., 0] == 1
    rounding = 3 * step**2 / 12
    noise = math.sqrt(max(bands[1][1], 0.0) * max(bands[2][1], 0.0))
    if noise < _NO_NOISE * rounding:
        return None
    ratio = (bands[0][0] / max(noise, rounding) - _NOISE_LEFT) / _TEXTURE_LEFT
    # Where plants and shade differ in colour, that is taken for noise, and more of it than means of 4 pixels can hold.
    return float(_CENTRE / BLOCK * ratio ** (1 / SLOPE)) if ratio >= _LEAST_SNR else None


def _powers(means: NDArray[np.float32], there: NDArray[np.bool_], block: int) -> tuple[float, float] | None:
    """Return the variance that all, and that the noise of, a sum of the colours has in a band, as white noise of pixels."""
    whole = there[:, :-2] & there[:, 1:-1] & there[:, 2:]
    whole = whole[:, :, :-2] & whole[:, :, 1:-1] & whole[:, :, 2:]
    second = means[:, :-2] - 2 * means[:, 1:-1] + means[:, 2:]
    second = (second[:, :, :-2] - 2 * second[:, :, 1:-1] + second[:, :, 2:])[whole].astype(float)
    if len(second) < _LEAST:
        return None
    size = np.abs(second.sum(axis=1))
    second = second[size <= np.quantile(size, _CALM)] * (block / _GAIN)
    c = second.T @ second / len(second)
    # Of normal variables with covariance C, those with a small sum s have C - (1 - k) cov(s) cov(s)' / var(s): put back.
    own = c.sum(axis=1)
    if own.sum() > 0:
        c = c + (1 / _CALM_VARIANCE - 1) * np.outer(own, own) / own.sum()
    if min(c[0, 1], c[0, 2], c[1, 2]) <= 0:  # nothing in common: all of it is noise
        return float(c.sum()), float(max(c.sum(), np.trace(c)))
    noise = sum(c[i, i] - c[i, j] * c[i, k] / c[j, k] for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)))
    return float(c.sum()), float(noise)


def _halved(means: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the means over two by two of (strips, rows, columns, channels)."""
    strips, rows, columns, channels = means.shape
    even = means[:, :, : columns // 2 * 2]
    return np.asarray(even.reshape(strips, rows // 2, 2, columns // 2, 2, channels).mean(axis=(2, 4)), np.float32)


def _whole_blocks(valid: NDArray[np.bool_], columns: int) -> NDArray[np.bool_]:
    """Return which blocks (strips, 16, columns) are not masked anywhere."""
    strips = [valid[top : top + STRIP, : columns * BLOCK] for top in strip_starts(len(valid))]
    blocks = np.stack(strips).reshape(len(strips), STRIP // BLOCK, BLOCK, columns, BLOCK)
    return np.asarray(blocks.all(axis=(2, 4)))
