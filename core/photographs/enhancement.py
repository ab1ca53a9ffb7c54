"""Local contrast: what makes key points appear on sand, for tie points only.

The arctan method follows Rosu, Assenbaum, De la Torre and Pierrot-Deseilligny (2015): each pixel is standardised
by the mean and the standard deviation of the square window around it and compressed by an arctangent; the result is mapped
by one fixed affine function, so that the same ground looks the same in two photographs.
The ``micmac`` method is what MicMac's "SFS" does: a global tone curve that the local term may shift by at most 64.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .reading import ChannelSum, mean_level

Method = Literal["arctan", "micmac", "equalize", "none"]
_BINS = 65536  # of MicMac's histograms
_MARGIN = 64.0  # grey levels by which MicMac's local term may shift the tone
_EVERY = 16  # the statistics are taken from every 16th row

# atan(x) = x * (a0 + a1 x^2 + ... ) on [0, 1], fitted to the least largest error: 2.5e-7 rad, 2e-5 grey levels.
_A0, _A1, _A2, _A3, _A4, _A5, _A6 = np.array(
    [0.99999611, -0.33317368, 0.19807815, -0.13233342, 0.07962366, -0.03360421, 0.00681179], np.float32
)
_HALF_PI = np.float32(math.pi / 2)
_ONE_BY_HALF_PI = np.float32(2 / math.pi)


@dataclass(frozen=True)
class Contrast:
    """What a photograph's pixels told, in DN of the sum of channels, from every 16th row.

    ``noise`` is the noise of one pixel, finest texture included; ``mean_sigma`` the mean standard deviation in
    the window; ``below_percent`` the share of pixels where that is under the floor. The last two are None for methods
    without a window.
    """

    noise: float
    mean_sigma: float | None = None
    below_percent: float | None = None


def noise_floor(channels: int) -> float:
    """Return the least sigma of a sum of ``channels`` that is believed: independent channels with 1 DN each."""
    return math.sqrt(channels)


def enhance_photograph(photograph: ChannelSum, method: Method, window: int = 101) -> tuple[NDArray[np.uint8], Contrast]:
    """Return a photograph as 8-bit image (rows, columns) for the detection of key points, and its contrast.

    Parameters
    ----------
    photograph
        The sum of its channels.
    method
        ``arctan``: ``127.5 + 127.5 * local``, rounded, with ``local = atan((x - mean) / max(sigma, floor)) / (pi / 2)``
        over the window, reflected at the border with the edge pixel repeated.
        ``micmac``: ``tone + margin * local``, truncated, with the edge pixel replicated; see ``micmac_tables``.
        ``equalize``: 255 times the inclusive share of pixels that are not brighter, rounded. (A gamma curve before
        it would change nothing.)
        ``none``: the mean of the channels at 8 bits. JPG, TIFF and PNG are gamma-coded already: no curve is applied.
    window
        Side of the square window in pixels, odd.

    Notes
    -----
    Sums over the window are sums of whole numbers below 2**53 in float64: exact, and the same in any order. The variance
    of 16-bit photographs is good to 1e-5 DN**2.
    """
    values = photograph.values
    noise = pixel_noise(values)
    if method in ("none", "equalize"):
        grey = mean_level(photograph) if method == "none" else equalized_table(values)[values]
        return grey, Contrast(noise)
    half = window // 2
    if method == "micmac":
        tone, margin = micmac_tables(values)
        rows, columns = (np.clip(np.arange(-half, n + half), 0, n - 1) for n in values.shape)
    else:
        # 0.5 more than the middle, so that the truncation to whole grey levels rounds.
        tone, margin = np.full(1, 128.0, np.float32), np.full(1, 127.5, np.float32)
        rows, columns = (reflected(n, half) for n in values.shape)
    out = np.empty(values.shape, np.uint8)
    sigma, below, count = _local_contrast(values, rows, columns, noise_floor(photograph.channels), tone, margin, out)
    return out, Contrast(noise, sigma / count, 100.0 * below / count)


def reflected(count: int, half: int) -> NDArray[np.int64]:
    """Return the indices (count + 2 half,) of a row of ``count`` pixels extended by reflection, the edge pixel repeated."""
    period = np.arange(-half, count + half) % (2 * count)
    return np.minimum(period, 2 * count - 1 - period)


def equalized_table(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the grey level of each sum of channels from 0 to the largest, by the inclusive cumulative histogram."""
    counts = _histogram(values, int(values.max()) + 1)
    return np.floor(255.0 * np.cumsum(counts) / values.size + 0.5).astype(np.uint8)


def micmac_tables(values: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return tone and margin (grey levels) of each sum of channels from 0 to the largest, as MicMac's ``PrepSift`` has them.

    ``tone = (H + 2 L + 3 S) / 6``: the histogram's cumulative share, the linear scale to the largest value, and
    the cumulative share of the square roots of the histogram's counts, each times 255; ``margin`` is the distance to
    black or white, 64 at most. 65,536 bins over [0, largest] (MicMac, CPP_Devlop.cpp).
    """
    largest = int(values.max())
    bins = np.arange(largest + 1, dtype=np.int64) * _BINS // (largest + 1)
    counts = np.bincount(bins, _histogram(values, largest + 1), _BINS)
    share = np.cumsum(counts) / values.size
    roots = np.cumsum(np.sqrt(counts))
    linear = np.arange(largest + 1) / max(largest, 1)
    tone = 255.0 * (share[bins] + 2.0 * linear + 3.0 * (roots / roots[-1])[bins]) / 6.0
    margin = np.minimum(_MARGIN, np.minimum(tone, 255.0 - tone))
    return tone.astype(np.float32), margin.astype(np.float32)


def pixel_noise(values: NDArray[Any]) -> float:
    """Return the noise of one pixel (DN), from second differences along both axes (Immerkaer 1996), every 16th row.

    These are blind to planes and edges along the axes; what texture there is at the scale of a pixel counts as noise.
    """
    if min(values.shape) < 3:
        return 0.0
    above, middle, below = (values[i : values.shape[0] - 2 + i : _EVERY].astype(float) for i in range(3))
    along = above - 2.0 * middle + below
    mixed = along[:, :-2] - 2.0 * along[:, 1:-1] + along[:, 2:]
    return float(math.sqrt(math.pi / 2) / 6.0 * np.abs(mixed).mean())


@njit(cache=True)
def _histogram(values: NDArray[Any], bins: int) -> NDArray[np.int64]:
    counts = np.zeros(bins, np.int64)
    for r in range(values.shape[0]):
        for value in values[r]:
            counts[value] += 1
    return counts


@njit(cache=True)
def _local_contrast(
    values: NDArray[Any],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    floor: float,
    tone: NDArray[np.float32],
    margin: NDArray[np.float32],
    out: NDArray[np.uint8],
) -> tuple[float, float, float]:
    """Fill ``out`` with ``tone + margin * local``; return the sums of sigma, of pixels below the floor, and of pixels.

    ``rows`` and ``columns`` say which pixel stands where in the photograph extended by half a window on each side.
    Sums over the window slide down the columns and then along each row, so their cost does not depend on its size.
    """
    height, width = values.shape
    window = len(rows) - height + 1
    half = window // 2
    share = 1.0 / (window * window)
    # Column sums of x and x^2, extended to both sides; then those of the whole window, then local contrast, of one row.
    column_1, column_2 = np.zeros(width + 2 * half), np.zeros(width + 2 * half)
    sum_1, sum_2 = np.empty(width), np.empty(width)
    local = np.empty(width, np.float32)
    inner_1, inner_2 = column_1[half : half + width], column_2[half : half + width]
    for k in range(window - 1):
        for c in range(width):
            x = float(values[rows[k], c])
            inner_1[c] += x
            inner_2[c] += x * x
    sigmas, under_floor, count = 0.0, 0.0, 0.0
    for r in range(height):
        entering = values[rows[r + window - 1]]
        for c in range(width):
            x = float(entering[c])
            inner_1[c] += x
            inner_2[c] += x * x
        for k in range(half):
            for c in (k, half + width + k):
                column_1[c] = inner_1[columns[c]]
                column_2[c] = inner_2[columns[c]]
        total_1, total_2 = 0.0, 0.0
        for c in range(window - 1):
            total_1 += column_1[c]
            total_2 += column_2[c]
        for c in range(width):
            total_1 += column_1[c + window - 1]
            total_2 += column_2[c + window - 1]
            sum_1[c], sum_2[c] = total_1, total_2
            total_1 -= column_1[c]
            total_2 -= column_2[c]
        present = values[r]
        for c in range(width):
            mean = sum_1[c] * share
            variance = sum_2[c] * share - mean * mean
            sigma = np.float32(math.sqrt(max(variance, floor * floor)))
            distance = np.float32(float(present[c]) - mean)
            size = abs(distance)
            # atan(size / sigma) from the ratio that lies in [0, 1].
            ratio = min(size, sigma) / max(size, sigma)
            square = ratio * ratio
            angle = _A6 * square + _A5
            angle = angle * square + _A4
            angle = angle * square + _A3
            angle = angle * square + _A2
            angle = angle * square + _A1
            angle = (angle * square + _A0) * ratio
            angle = angle if size <= sigma else _HALF_PI - angle
            local[c] = (angle if distance >= np.float32(0.0) else -angle) * _ONE_BY_HALF_PI
        if len(tone) == 1:
            for c in range(width):
                out[r, c] = np.uint8(tone[0] + margin[0] * local[c])
        else:
            for c in range(width):
                out[r, c] = np.uint8(tone[present[c]] + margin[present[c]] * local[c])
        if r % _EVERY == 0:
            for c in range(width):
                variance = sum_2[c] * share - (sum_1[c] * share) ** 2
                sigmas += math.sqrt(max(variance, 0.0))
                under_floor += 1.0 if variance < floor * floor else 0.0
            count += width
        leaving = values[rows[r]]
        for c in range(width):
            x = float(leaving[c])
            inner_1[c] -= x
            inner_2[c] -= x * x
    return sigmas, under_floor, count
