"""Stable ground: what the difference is where nothing moved, and the shift, plane or adjusted surface taken off it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import NotEnoughData
from .terms import BENT_AT, COUNT, IN_METRES, about_another

Array = NDArray[np.float64]
_HUBER, _BIWEIGHT = 1.345, 4.685  # 95 % efficiency on normal errors
LEAST = 10  # cells of stable ground that a shift can be taken from
Method = Literal["none", "vertical", "plane", "combined"]


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
    """What is subtracted from the difference, a function of the place.

    ``coefficients`` (1,), (3,) or (7,) are those of the first of 1, x, y, z, x^2, xy, y^2 about ``centre`` (x0, y0, z0); z is
    BEFORE's height. The method "combined" is what stable ground and both georeferencings tell together.
    """

    method: Method
    coefficients: tuple[float, ...] = (0.0,)
    centre: tuple[float, ...] = (0.0, 0.0)

    def at(self, x: Array, y: Array, height: Array | None = None) -> Array:
        """Return the shift (m) at places of any matching shapes; ``height`` is needed by seven coefficients."""
        level, *others = self.coefficients
        places = (x, y) if height is None else (x, y, height)
        shift = np.full(np.broadcast_shapes(*(np.shape(v) for v in places)), level)
        if others:
            east, north = x - self.centre[0], y - self.centre[1]
            shift += others[0] * east + others[1] * north
        if len(others) > 2:
            if height is None:
                raise ValueError("a shift that depends on the height needs it")
            xx, xy, yy = others[3:]
            shift += others[2] * (height - self.centre[2]) + (xx * east + xy * north) * east + yy * north * north
        return shift

    def about(self, centre: tuple[float, ...]) -> Array:
        """Return the coefficients (7,) of the same shift about another centre."""
        own = np.zeros(COUNT)
        own[: len(self.coefficients)] = self.coefficients
        return np.asarray(own @ about_another(self.centre, centre))

    def describe(self) -> str:
        """Return it in words."""
        if self.method == "none":
            return "none"
        level, *slopes = self.coefficients
        text = f"{level:+.4f} m"
        if slopes:
            text += f", tilt {1e3 * slopes[0]:+.4f} mm/m to the east, {1e3 * slopes[1]:+.4f} mm/m to the north"
        if len(slopes) > 2:
            text += f", {1e3 * slopes[2]:+.4f} mm per metre of height"
            east, north, between = (1e3 * (IN_METRES @ self.coefficients)[4:]).tolist()
            text += f", bending at {BENT_AT:g} m {east:+.2f} mm to the east, {north:+.2f} mm to the north"
            text += f", {between:+.2f} mm to the north-east"
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
    if len(change) < LEAST:
        raise NotEnoughData(
            f"STABLE covers {len(change)} cells with a height in both rasters and {LEAST} are needed: "
            "draw larger stable areas, or set COREGISTER to none."
        )
    if method == "vertical":
        return Shift("vertical", (float(np.median(change)),))
    centre = (float(x.mean()), float(y.mean()))
    design = plane_design(x, y, centre)
    spread = np.linalg.svd(design[:, 1:], compute_uv=False) / np.sqrt(len(x))
    if spread[-1] < 0.02 * spread[0]:
        raise NotEnoughData("STABLE lies on one line, which leaves a plane free to tilt about it: add stable ground beside it.")
    level, east, north = robust_fit(design, change).tolist()
    return Shift("plane", (level, east, north), centre)


def robust_fit(design: Array, values: Array) -> Array:
    """Return coefficients (p,) of ``design`` (n, p): Huber's M-estimate, and from there Tukey's biweight, blind to what moved."""
    coefficients = np.asarray(np.linalg.lstsq(design, values, rcond=None)[0], np.float64)
    for rule in (_huber, _biweight):
        for _ in range(50):
            residual = np.abs(values - design @ coefficients)
            root = np.sqrt(rule(residual / max(1.4826 * float(np.median(residual)), 1e-12)))
            new = np.asarray(np.linalg.lstsq(design * root[:, None], values * root, rcond=None)[0], np.float64)
            settled = np.allclose(new, coefficients, rtol=1e-9, atol=1e-12)
            coefficients = new
            if settled:
                break
    return coefficients


def _huber(size: Array) -> Array:
    return np.asarray(np.minimum(1.0, _HUBER / np.maximum(size, 1e-300)), np.float64)


def _biweight(size: Array) -> Array:
    return np.asarray((1.0 - np.minimum(size / _BIWEIGHT, 1.0) ** 2) ** 2, np.float64)


def plane_design(x: Array, y: Array, centre: tuple[float, ...]) -> Array:
    """Return the columns 1, x - x0, y - y0 (n, 3)."""
    return np.column_stack([np.ones(len(x)), x - centre[0], y - centre[1]])
