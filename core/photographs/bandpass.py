"""The band of scales in which a photograph's texture is told best: a filter that follows its signal and noise.

A photograph is replaced by ``G1 x - w G2 x``, two Gaussian means. The first takes off what is mostly noise. The filter that
brings an image nearest to its signal has the response ``S / (S + N)`` (Wiener 1949): it falls around the frequency f1 where noise
overtakes the texture. The first Gaussian has fallen to 1 / e there. Its sigma goes to zero as the signal grows.

The second lifts the fine against the coarse. The power of sand's texture falls with the frequency, so that coarse texture drowns
fine texture, and a scale space holds fewer extrema than it has room for: whitening, as correlation has long used it (Knapp
and Carter 1976), makes more of them. It also lifts what noise is left, on which two photographs of the same ground do not
agree. So ``w`` rises with f1, from nothing to 0.8, where strong texture had most tie points (tried: 0, 0.5, 0.67, 0.8, 0.9, 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

CROSSOVER = 0.2251  # cycles per pixel where nothing tells the photograph's own: sigma 1 px
_COARSE = 2.0  # sigma in pixels of the second Gaussian
_MOST = 0.8  # weight of the second Gaussian
_RISE = (0.15, 0.24)  # cycles per pixel: crossovers between which the weight rises to that
_SIGMAS = (0.3, 1.5)  # px; a narrower Gaussian is none, a wider one leaves no band below the second
_REACH = 3.0  # sigmas after which a Gaussian is cut
_FINEST = 1 << 22  # what is filtered is held in whole numbers up to about this


@dataclass(frozen=True)
class Band:
    """Sigmas (px) of the Gaussians, the first 0 for none, and the weight of the second."""

    fine: float
    coarse: float
    weight: float

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the filter's response to frequencies (cycles per pixel)."""
        first, second = (np.exp(-2 * (math.pi * s * frequency) ** 2) for s in (self.fine, self.coarse))
        return np.asarray(first - self.weight * second)


def band_of(crossover: float) -> Band:
    """Return the band for a photograph whose noise overtakes its texture at a frequency (cycles per pixel)."""
    # exp(-2 pi^2 sigma^2 f1^2) = 1 / e
    sigma = 1 / (math.sqrt(2) * math.pi * crossover)
    sigma = 0.0 if sigma < _SIGMAS[0] else min(sigma, _SIGMAS[1])
    return Band(sigma, _COARSE, float(np.interp(crossover, _RISE, (0.0, _MOST))))


def band_passed(
    values: NDArray[Any], white: int, band: Band, valid: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.int32], float, float]:
    """Return values (rows, columns) through a band in whole numbers, the number of those in one, and the gain on white noise.

    Masked pixels do not enter the means; where there are only those the result is 0. The border is reflected.
    """
    scale = 2.0 ** math.floor(math.log2(_FINEST / white))
    kernels = [_kernel(sigma) for sigma in (band.fine, band.coarse)]
    present = values.astype(np.float32) if valid is None else np.where(valid, values, 0).astype(np.float32)
    there = None if valid is None else valid.astype(np.float32)
    first = _mean(present, there, kernels[0], scale)
    second = _mean(present, there, kernels[1], -band.weight * scale)
    # Rounded to whole numbers, of which sums are exact.
    out = np.asarray(cv2.add(first, second, dtype=cv2.CV_32S), np.int32)
    side = len(kernels[1])
    fine = np.zeros(side)
    fine[(side - len(kernels[0])) // 2 :][: len(kernels[0])] = kernels[0]
    (a, b), c = ((k @ k) ** 2 for k in (fine, kernels[1])), (fine @ kernels[1]) ** 2
    return out, scale, math.sqrt(a - 2 * band.weight * c + band.weight**2 * b)


def _kernel(sigma: float) -> NDArray[np.float64]:
    reach = math.ceil(_REACH * sigma)
    return np.asarray(cv2.getGaussianKernel(2 * reach + 1, sigma, cv2.CV_64F)[:, 0] if reach else np.ones(1))


def _mean(
    image: NDArray[np.float32], there: NDArray[np.float32] | None, kernel: NDArray[np.float64], factor: float
) -> NDArray[np.float32]:
    """Return the mean of what is there, times a factor."""

    def filtered(part: NDArray[np.float32], times: float) -> NDArray[np.float32]:
        across = kernel * times
        return np.asarray(cv2.sepFilter2D(part, cv2.CV_32F, across, kernel, borderType=cv2.BORDER_REFLECT), np.float32)

    if len(kernel) == 1:
        return image * np.float32(factor)
    smooth = filtered(image, factor)
    if there is not None:
        smooth /= np.maximum(filtered(there, 1.0), np.float32(1e-6))
    return smooth
