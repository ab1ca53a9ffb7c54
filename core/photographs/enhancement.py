"""Local contrast: what makes key points appear on sand, for tie points only.

The arctan method follows Rosu, Assenbaum, De la Torre and Pierrot-Deseilligny (2015): each pixel is standardised
by the mean and the standard deviation of the square window around it and compressed by an arctangent; the result is mapped
by one fixed affine function, so that the same ground looks the same in two photographs.
The ``micmac`` method is what MicMac's "SFS" does: a global tone curve that the local term may shift by at most 64.

The ``bandpass`` method first takes a band of scales, which follows the photograph's own signal and noise (``bandpass.py``), and
then goes on as arctan, with twice the standard deviation: local contrast normalisation (Jarrett, Kavukcuoglu, Ranzato and LeCun
2009) of that band. On very bare sand a single pixel is mostly noise. The arctangent folds that into the signal for good, and
the standard deviation it divides by is that of the noise; once it is taken off, what is left of the texture fills the range.

Where pixels are masked, sums over the window become sums over its unmasked pixels (normalised convolution), and where those are
less than a quarter of the window nothing is defined.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from .bandpass import CROSSOVER, band_of, band_passed
from .reading import ChannelSum, mean_level
from .signal import crossover

Method = Literal["arctan", "micmac", "equalize", "none", "bandpass"]
_BINS = 65536  # of MicMac's histograms
_MARGIN = 64.0  # grey levels by which MicMac's local term may shift the tone
_WIDE = 2.0  # standard deviations that "bandpass" maps to half of the range; less of it is bent than by the paper's one
_EVERY = 16  # the statistics are taken from every 16th row
_LEAST_SHARE = 0.25  # of a window's pixels that must be unmasked
_UNDEFINED = 128  # grey level of masked and undefined pixels: flat, so that nothing is found there
_NO_COUNTS, _NO_PIXELS = np.zeros((0, 0), np.int32), np.zeros((0, 0), np.bool_)

# atan(x) = x * (a0 + a1 x^2 + ... ) on [0, 1], fitted to the least largest error: 2.5e-7 rad, 2e-5 grey levels.
_A0, _A1, _A2, _A3, _A4, _A5, _A6 = np.array(
    [0.99999611, -0.33317368, 0.19807815, -0.13233342, 0.07962366, -0.03360421, 0.00681179], np.float32
)
_HALF_PI = np.float32(math.pi / 2)
_ONE_BY_HALF_PI = np.float32(2 / math.pi)


@dataclass(frozen=True)
class Contrast:
    """What a photograph's unmasked pixels told, in DN of the file for the sum of channels, from every 16th row.

    ``noise`` is the noise of one pixel, finest texture included; ``levels`` the DN per channel from black to white;
    ``mean_sigma`` the mean standard deviation in the window, ``floor`` the least that is believed, ``below_percent`` the share
    of pixels where it is less. These three are None for methods without a window. ``masked_percent`` is the share of all pixels
    that cannot hold key points, None without a mask. ``crossover`` is the frequency (cycles per pixel) at which noise overtakes
    texture, None where it is not told or not asked for; ``low_pass`` and ``weight`` are the sigma (px) and the weight of the
    two Gaussians of ``bandpass``, None for other methods.
    """

    noise: float
    levels: float
    mean_sigma: float | None = None
    floor: float | None = None
    below_percent: float | None = None
    masked_percent: float | None = None
    crossover: float | None = None
    low_pass: float | None = None
    weight: float | None = None


def noise_floor(channels: int, step: float = 1.0) -> float:
    """Return the least sigma of a sum of ``channels`` that is believed: independent channels with 1 DN, ``step``, each."""
    return math.sqrt(channels) * step


def has_window(method: Method) -> bool:
    """Tell whether a method looks at a window around each pixel."""
    return method in ("arctan", "micmac", "bandpass")


def enhance_photograph(
    photograph: ChannelSum, method: Method, window: int = 101, valid: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.uint8], Contrast]:
    """Return a photograph as 8-bit image (rows, columns) for the detection of key points, and its contrast.

    Parameters
    ----------
    photograph
        The sum of its channels.
    method
        ``arctan``: ``127.5 + 127.5 * local``, rounded, with ``local = atan((x - mean) / max(sigma, floor)) / (pi / 2)``
        over the window, reflected at the border with the edge pixel repeated.
        ``micmac``: ``tone + margin * local``, truncated, with the edge pixel replicated; see ``micmac_tables``.
        ``bandpass``: as ``arctan``, of ``band_passed`` values, with the floor that is left of the noise by that, and with
        twice the sigma.
        ``equalize``: 255 times the inclusive share of pixels that are not brighter, rounded. (A gamma curve before
        it would change nothing.)
        ``none``: the mean of the channels at 8 bits. JPG, TIFF and PNG are gamma-coded already: no curve is applied.
    window
        Side of the square window in pixels, odd.
    valid
        False (rows, columns) where pixels are masked: they enter no statistics. They, and those ``usable`` excludes, become 128.

    Notes
    -----
    Sums over the window are sums of whole numbers below 2**53 in float64: exact, and the same in any order. The variance
    of 16-bit photographs is good to 1e-5 DN**2.
    """
    values, step = photograph.values, photograph.step
    noise, levels = pixel_noise(values, valid) / step, photograph.white / photograph.channels / step
    kept = None if valid is None else usable(valid, method, window)
    masked = None if kept is None else 100.0 * float(1.0 - kept.mean())
    if not has_window(method):
        grey = mean_level(photograph) if method == "none" else equalized_table(values, valid)[values]
        return _flat(grey, kept), Contrast(noise, levels, masked_percent=masked)
    unit, wide = step, 1.0  # one DN in the values whose contrast is taken
    floor = noise_floor(photograph.channels, step)
    frequency, band = None, None
    if method == "bandpass":
        frequency = crossover(photograph.means, step, valid)
        band = band_of(frequency or CROSSOVER)
        values, scale, gain = band_passed(values, photograph.white, band, valid)
        unit, floor, wide = scale * step, floor * scale * gain, _WIDE
    half = window // 2
    counts = _NO_COUNTS if valid is None else _window_counts(valid, method, window)
    present = values if valid is None else np.where(valid, values, np.zeros((), values.dtype))  # adds nothing to the sums
    if method == "micmac":
        tone, margin = micmac_tables(values, valid)
        rows, columns = (np.clip(np.arange(-half, n + half), 0, n - 1) for n in values.shape)
    else:
        # 0.5 more than the middle, so that the truncation to whole grey levels rounds.
        tone, margin = np.full(1, 128.0, np.float32), np.full(1, 127.5, np.float32)
        rows, columns = (reflected(n, half) for n in values.shape)
    out = np.empty(values.shape, np.uint8)
    sigma, below, count = _local_contrast(
        present, counts, _NO_PIXELS if kept is None else kept, rows, columns, floor, wide, tone, margin, out
    )
    mean_sigma, below_percent = (sigma / count / unit, 100.0 * below / count) if count else (None, None)
    contrast = Contrast(noise, levels, mean_sigma, floor / unit, below_percent, masked, frequency)
    return _flat(out, kept), contrast if band is None else replace(contrast, low_pass=band.fine, weight=band.weight)


def usable(valid: NDArray[np.bool_], method: Method, window: int) -> NDArray[np.bool_]:
    """Return where key points may lie (rows, columns): unmasked, with a quarter of the window unmasked."""
    if not has_window(method):
        return valid
    return np.asarray(valid & (_window_counts(valid, method, window) >= _LEAST_SHARE * window * window))


def reflected(count: int, half: int) -> NDArray[np.int64]:
    """Return the indices (count + 2 half,) of a row of ``count`` pixels extended by reflection, the edge pixel repeated."""
    period = np.arange(-half, count + half) % (2 * count)
    return np.minimum(period, 2 * count - 1 - period)


def equalized_table(values: NDArray[Any], valid: NDArray[np.bool_] | None = None) -> NDArray[np.uint8]:
    """Return the grey level of each sum of channels from 0 to the largest, by the inclusive cumulative histogram."""
    counts = _histogram(values, int(values.max()) + 1, _NO_PIXELS if valid is None else valid)
    return np.floor(255.0 * np.cumsum(counts) / max(counts.sum(), 1) + 0.5).astype(np.uint8)


def micmac_tables(
    values: NDArray[Any], valid: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return tone and margin (grey levels) of each sum of channels, as MicMac's ``PrepSift`` has them.

    ``tone = (H + 2 L + 3 S) / 6``: the histogram's cumulative share, the linear scale to the largest value, and
    the cumulative share of the square roots of the histogram's counts, each times 255; ``margin`` is the distance to
    black or white, 64 at most. 65,536 bins over [0, largest] (MicMac, CPP_Devlop.cpp). Masked pixels are not counted.
    """
    largest = int(values.max() if valid is None else values.max(where=valid, initial=0))
    bins = np.arange(largest + 1, dtype=np.int64) * _BINS // (largest + 1)
    counts = np.bincount(bins, _histogram(values, largest + 1, _NO_PIXELS if valid is None else valid), _BINS)
    share = np.cumsum(counts) / max(counts.sum(), 1)
    roots = np.cumsum(np.sqrt(counts))
    linear = np.arange(largest + 1) / max(largest, 1)
    tone = 255.0 * (share[bins] + 2.0 * linear + 3.0 * (roots / max(roots[-1], 1.0))[bins]) / 6.0
    margin = np.minimum(_MARGIN, np.minimum(tone, 255.0 - tone))
    return tone.astype(np.float32), margin.astype(np.float32)


def pixel_noise(values: NDArray[Any], valid: NDArray[np.bool_] | None = None) -> float:
    """Return the noise of one pixel, from second differences along both axes (Immerkaer 1996), every 16th row.

    These are blind to planes and edges along the axes; what texture there is at the scale of a pixel counts as noise.
    """
    if min(values.shape) < 3:
        return 0.0
    above, middle, below = (values[i : values.shape[0] - 2 + i : _EVERY].astype(float) for i in range(3))
    along = above - 2.0 * middle + below
    mixed = np.abs(along[:, :-2] - 2.0 * along[:, 1:-1] + along[:, 2:])
    if valid is not None:
        whole = cv2.erode(valid.view(np.uint8), np.ones((3, 3), np.uint8))[1:-1:_EVERY, 1:-1].astype(bool)
        mixed = mixed[whole]
    return float(math.sqrt(math.pi / 2) / 6.0 * mixed.mean()) if mixed.size else 0.0


def _window_counts(valid: NDArray[np.bool_], method: Method, window: int) -> NDArray[np.int32]:
    """Return how many pixels of each window are unmasked (rows, columns), the border as the method has it."""
    border = cv2.BORDER_REPLICATE if method == "micmac" else cv2.BORDER_REFLECT
    pixels = valid.view(np.uint8)
    return np.asarray(cv2.boxFilter(pixels, cv2.CV_32S, (window, window), normalize=False, borderType=border), np.int32)


def _flat(grey: NDArray[np.uint8], kept: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    return grey if kept is None else np.where(kept, grey, np.uint8(_UNDEFINED))


@njit(cache=True)
def _histogram(values: NDArray[Any], bins: int, valid: NDArray[np.bool_]) -> NDArray[np.int64]:
    counts = np.zeros(bins, np.int64)
    for r in range(values.shape[0]):
        if valid.size == 0:
            for value in values[r]:
                counts[value] += 1
        else:
            for c in range(values.shape[1]):
                if valid[r, c]:
                    counts[values[r, c]] += 1
    return counts


@njit(cache=True)
def _local_contrast(
    values: NDArray[Any],
    counts: NDArray[np.int32],
    kept: NDArray[np.bool_],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    floor: float,
    wide: float,
    tone: NDArray[np.float32],
    margin: NDArray[np.float32],
    out: NDArray[np.uint8],
) -> tuple[float, float, float]:
    """Fill ``out`` with ``tone + margin * local``, sigma times ``wide``.

    Return the sums of sigma, of pixels below the floor, and of pixels.

    ``counts`` is the number of unmasked pixels in each window, or empty; masked ``values`` must be 0. ``kept`` says which pixels
    count in the sums that are returned; empty for all.

    ``rows`` and ``columns`` say which pixel stands where in the photograph extended by half a window on each side.
    Sums over the window slide down the columns and then along each row, so their cost does not depend on its size.
    """
    height, width = values.shape
    window = len(rows) - height + 1
    half = window // 2
    share = np.full(width, 1.0 / (window * window))
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
        if counts.size:
            for c in range(width):
                share[c] = 1.0 / max(counts[r, c], 1)
        present = values[r]
        for c in range(width):
            mean = sum_1[c] * share[c]
            variance = sum_2[c] * share[c] - mean * mean
            sigma = np.float32(wide * math.sqrt(max(variance, floor * floor)))
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
                if kept.size == 0 or kept[r, c]:
                    variance = sum_2[c] * share[c] - (sum_1[c] * share[c]) ** 2
                    sigmas += math.sqrt(max(variance, 0.0))
                    under_floor += 1.0 if variance < floor * floor else 0.0
                    count += 1.0
        leaving = values[rows[r]]
        for c in range(width):
            x = float(leaving[c])
            inner_1[c] -= x
            inner_2[c] -= x * x
    return sigmas, under_floor, count
