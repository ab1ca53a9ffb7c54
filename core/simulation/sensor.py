"""The sensor: from light to an 8-bit photograph, with the noise that light and electronics bring."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FULL_WELL = 12000.0  # electrons at white: a small drone camera at base ISO
READ_NOISE = 5.0  # electrons
SAND_LEVEL = 0.34  # of full well, for dry flat sand under exposure 1
_VIGNETTING = 0.12  # light lost in the corners
# Colour of sand, paint and sea in red, green, blue.
_TINTS = np.array([[1.10, 1.0, 0.80], [1.0, 1.0, 1.0], [0.50, 0.62, 0.62]], np.float32)


def electrons(light: NDArray[np.float32], exposure: float) -> NDArray[np.float32]:
    """Return the mean electrons (3, rows, columns; red, green, blue) for the light of sand, paint and sea (same shape)."""
    rows, columns = light.shape[1:]
    y = (np.arange(rows, dtype=np.float32) + 0.5 - rows / 2)[:, None]
    x = (np.arange(columns, dtype=np.float32) + 0.5 - columns / 2)[None]
    fall = 1.0 - _VIGNETTING * (x * x + y * y) / np.float32((rows**2 + columns**2) / 4)
    colours = np.tensordot(_TINTS, light, axes=(0, 0))
    return np.asarray(colours * fall * np.float32(exposure * SAND_LEVEL * FULL_WELL), np.float32)


def expose(mean: NDArray[np.float32], noise: float, random: np.random.Generator) -> NDArray[np.float32]:
    """Return electrons read out (same shape): shot and read noise, ``noise`` times as large as physics has it.

    Photon transfer (Janesick 2007): variance = mean + read noise squared; Poisson's law is normal at these counts.
    """
    if noise == 0.0:
        return mean
    sigma = np.sqrt(mean + np.float32(READ_NOISE**2))
    return np.asarray(mean + np.float32(noise) * sigma * random.standard_normal(mean.shape, np.float32))


def develop(signal: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the 8-bit photograph (rows, columns, 3) of electrons (3, rows, columns): gamma 2.222 with a toe of slope 4.5."""
    linear = np.clip(signal / np.float32(FULL_WELL), 0.0, 1.0)
    toe = np.float32(0.018)
    curve = np.where(linear < toe, 4.5 * linear, 1.099 * np.maximum(linear, toe) ** np.float32(0.45) - 0.099)
    return np.asarray(np.moveaxis(curve * 255.0 + 0.5, 0, -1).astype(np.uint8))


def noise_level(mean: float, noise: float) -> float:
    """Return the noise (grey levels) to expect in the photograph at ``mean`` electrons, before JPEG."""
    linear = mean / FULL_WELL
    slope = 4.5 if linear < 0.018 else 1.099 * 0.45 * linear**-0.55
    return float(255.0 * slope * noise * np.sqrt(mean + READ_NOISE**2) / FULL_WELL)
