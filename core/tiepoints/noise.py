"""Noise of a photograph where it stands, and what of it is left in a scale space."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .scalespace import LAYERS

_HALF = 16  # half a window of the local mean, in pairs of pixels
LEAST_NOISE = 1.0 / math.sqrt(12.0)  # grey levels: the noise of rounding to whole ones, below which nothing is believed


@dataclass(frozen=True)
class NoiseMap:
    """Sigma of the noise of a pixel (grey levels), for each two by two pixels (rows, columns)."""

    sigma: NDArray[np.float32]

    def at(self, xy: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the sigma at places (n, 2; pixels, from the corner of the first)."""
        column, row = (np.clip(v.astype(np.int64) // 2, 0, n - 1) for v, n in zip(xy.T, self.sigma.shape[::-1], strict=True))
        return self.sigma[row, column]


def noise_map(image: NDArray[np.uint8]) -> NoiseMap:
    """Measure the noise of a grey image (rows, columns), both at least 6, in windows of 66 pixels.

    The mean size of second differences along both axes (Immerkaer 1996), which are blind to planes and to edges along the
    axes, of means of two by two pixels: what JPEG and demosaicing take from neighbouring pixels is not
    missed there. Texture as fine as that counts as noise.
    """
    small = cv2.resize(image.astype(np.float32), (image.shape[1] // 2, image.shape[0] // 2), interpolation=cv2.INTER_AREA)
    second = np.array([1.0, -2.0, 1.0], np.float32)
    size = np.abs(cv2.sepFilter2D(small, cv2.CV_32F, second, second, borderType=cv2.BORDER_REFLECT_101))
    side = 2 * _HALF + 1
    mean = cv2.blur(size, (side, side), borderType=cv2.BORDER_REFLECT_101)
    # The filter's gain on white noise is 6, the mean size of a normal variable sqrt(2 / pi) sigma, the mean of four halves sigma.
    return NoiseMap(np.maximum(np.float32(2 * math.sqrt(math.pi / 2) / 6) * mean, np.float32(LEAST_NOISE)))


def noise_gain(sigma: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the standard deviation of the difference of Gaussians of unit white noise, the finer of ``sigma`` pixels.

    For variances a, b of two Gaussians the integral of their product is 1 / (2 pi (a + b)).
    """
    a = np.asarray(sigma, np.float64) ** 2
    b = a * 2.0 ** (2.0 / LAYERS)
    return np.asarray(np.sqrt((1 / a + 1 / b - 4 / (a + b)) / (4 * math.pi)), np.float32)
