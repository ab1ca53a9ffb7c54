"""Stable ground: what the difference is where nothing moved, and the shift or plane taken off it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import NotEnoughData

Array = NDArray[np.float64]
_HUBER = 1.345  # 95 % efficiency on normal errors
_LEAST = 10  # cells of stable ground that a shift can be taken from
Method = Literal["none", "vertical", "plane"]


@dataclass(frozen=True)
class Statistics:
    """Of ``count`` differences (m); ``q68`` and ``q95`` are quantiles of their absolute values."""

    count: int
    mean: float
    median: float
    std: float
    nmad: float
    q68: float
    q95: float


@dataclass(frozen=True)
class Shift:
    """What is subtracted from the difference: ``coefficients`` (1,) or (3,) of 1, x - x0, y - y0 about ``centre``."""

    method: Method
    coefficients: tuple[float, ...] = (0.0,)
    centre: tuple[float, float] = (0.0, 0.0)

    def at(self, x: Array, y: Array) -> Array:
        """Return the shift (m) at places of any matching shapes."""
        c = self.coefficients
        if len(c) == 1:
            return np.full(np.broadcast_shapes(np.shape(x), np.shape(y)), c[0])
        return np.asarray(c[0] + c[1] * (x - self.centre[0]) + c[2] * (y - self.centre[1]))

    def describe(self) -> str:
        """Return it in words."""
        if self.method == "none":
            return "none"
        text = f"{self.coefficients[0]:+.4f} m"
        if len(self.coefficients) == 3:
            text += (
                f", tilt {1e3 * self.coefficients[1]:+.4f} mm/m to the east, {1e3 * self.coefficients[2]:+.4f} mm/m to the north"
            )
        return text


def nmad(values: Array) -> float:
    """Return the normalised median absolute deviation (Hoehle & Hoehle 2009).

    >>> nmad(np.array([1.0, 2.0, 3.0, 4.0, 100.0]))
    1.4826
    """
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def statistics(change: Array) -> Statistics:
    """Return the statistics of differences (n,), all finite."""
    size = np.abs(change)
    return Statistics(
        len(change),
        float(change.mean()),
        float(np.median(change)),
        float(change.std()),
        nmad(change),
        float(np.quantile(size, 0.683)),
        float(np.quantile(size, 0.95)),
    )


def fit_shift(method: Method, x: Array, y: Array, change: Array) -> Shift:
    """Return the robust shift of ``change`` (n,) at ``x``, ``y`` (n,) on stable ground: the median, or a plane by Huber weights.

    Raises
    ------
    NotEnoughData
        When stable ground does not determine it.
    """
    if method == "none":
        return Shift("none")
    if len(change) < _LEAST:
        raise NotEnoughData(
            f"STABLE covers {len(change)} cells with a height in both rasters and {_LEAST} are needed: "
            "draw larger stable areas, or set COREGISTER to none."
        )
    if method == "vertical":
        return Shift("vertical", (float(np.median(change)),))
    centre = (float(x.mean()), float(y.mean()))
    design = plane_design(x, y, centre)
    spread = np.linalg.svd(design[:, 1:], compute_uv=False) / np.sqrt(len(x))
    if spread[-1] < 0.02 * spread[0]:
        raise NotEnoughData("STABLE lies on one line, which leaves a plane free to tilt about it: add stable ground beside it.")
    weights: Array = np.ones(len(change))
    coefficients: Array = np.zeros(3)
    for _ in range(50):
        root = np.sqrt(weights)
        new = np.asarray(np.linalg.lstsq(design * root[:, None], change * root, rcond=None)[0], np.float64)
        residual = change - design @ new
        scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-12)
        weights = np.asarray(np.minimum(1.0, _HUBER * scale / np.maximum(np.abs(residual), 1e-300)), np.float64)
        settled = np.allclose(new, coefficients, rtol=1e-9, atol=1e-12)
        coefficients = new
        if settled:
            break
    return Shift("plane", (float(coefficients[0]), float(coefficients[1]), float(coefficients[2])), centre)


def plane_design(x: Array, y: Array, centre: tuple[float, float]) -> Array:
    """Return the columns 1, x - x0, y - y0 (n, 3)."""
    return np.column_stack([np.ones(len(x)), x - centre[0], y - centre[1]])
