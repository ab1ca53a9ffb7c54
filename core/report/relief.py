"""The light on a surface: one hillshade for all reports."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

AZIMUTH, ALTITUDE = 315.0, 45.0  # degrees, of the light: cartography's custom


def hillshade(height: NDArray[np.floating], cell: float | tuple[float, float], exaggeration: float = 1.0) -> NDArray[np.float32]:
    """Return the light (0..1) on a surface (rows to the south, columns to the east) from the north-west, 45 degrees high.

    It is the cosine of the angle between the light and the surface's normal (Horn 1981), 0.71 on level ground, 0 in the
    shade, and NaN beside holes. ``cell`` is the size of a cell in units of the height, or the sizes to the south and to the
    east; heights are multiplied by ``exaggeration``.
    """
    if min(height.shape) < 2:
        return np.full(height.shape, np.nan, np.float32)
    south, east = cell if isinstance(cell, tuple) else (cell, cell)
    down, right = np.gradient(height, south, east)
    down, right = exaggeration * down, exaggeration * right
    azimuth, altitude = np.radians(AZIMUTH), np.radians(ALTITUDE)
    light = np.sin(altitude) + np.cos(altitude) * (down * np.cos(azimuth) - right * np.sin(azimuth))
    return np.clip(light / np.sqrt(1.0 + down**2 + right**2), 0.0, 1.0).astype(np.float32)


def exaggeration(height: NDArray[np.floating], cell: float | tuple[float, float], wanted: float = 0.5) -> float:
    """Return the round factor (1, 2, 5, 10 ... 100) that brings the steepest tenth of a surface near the slope ``wanted``.

    A beach is too flat to see without; whoever draws it says the factor. Slopes count from their median, the beach's own.
    """
    if min(height.shape) < 2:
        return 1.0
    south, east = cell if isinstance(cell, tuple) else (cell, cell)
    down, right = np.gradient(height, south, east)
    known = np.isfinite(down) & np.isfinite(right)
    if not known.any():
        return 1.0
    down, right = down[known], right[known]
    steep = float(np.quantile(np.hypot(down - np.median(down), right - np.median(right)), 0.9))
    return round_factor(wanted / steep) if steep > 0 else 1.0


def heights_drawn(factor: float) -> str:
    """Return in words what is done to heights."""
    return "heights as they are" if factor == 1 else f"heights {factor:g} times exaggerated"


def round_factor(value: float, most: float = 100.0) -> float:
    """Return the largest of 1, 2, 5, 10, 20 ... ``most`` that does not exceed ``value``, and 1 at least."""
    steps = [m * 10.0**e for e in range(4) for m in (1, 2, 5)]
    return max((s for s in steps if s <= min(value, most)), default=1.0)
