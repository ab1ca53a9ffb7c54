"""Camera models: from directions in the camera to pixels and back, with COLMAP's names and parameter order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

Array = NDArray[np.float64]

# Parameter names per model, in COLMAP's order (colmap/sensor/models.h).
PARAMETERS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
}
BROWN = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


@dataclass(frozen=True)
class Camera:
    """An interior orientation: COLMAP's model name, size and parameters (pixels; distortion without unit)."""

    model: str
    width: int
    height: int
    params: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the model's name and the number of parameters."""
        names = PARAMETERS.get(self.model)
        if names is None:
            raise InputError(f"The camera model {self.model} is not known; known are {', '.join(PARAMETERS)}.")
        if len(self.params) != len(names):
            raise InputError(f"The camera model {self.model} takes {len(names)} parameters, not {len(self.params)}.")

    def brown(self) -> Array:
        """Return fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6 (12), to which every model here reduces."""
        given = dict(zip(PARAMETERS[self.model], self.params, strict=True))
        if "f" in given:
            given["fx"] = given["fy"] = given.pop("f")
        return np.array([given.get(name, 0.0) for name in BROWN])

    def project(self, points: Array) -> Array:
        """Return pixels (n, 2) of points (n, 3) in the camera's frame; NaN behind the camera.

        The distortion is Brown's with a rational radial part, as in COLMAP's FULL_OPENCV. Points beyond the radius up to
        which the radial part grows (it folds back after) are NaN too.
        """
        fx, fy, cx, cy = self.brown()[:4]
        points = np.asarray(points, float)
        depth = np.where(points[:, 2] > 0, points[:, 2], np.nan)
        u, v = points[:, 0] / depth, points[:, 1] / depth
        with np.errstate(invalid="ignore"):
            outside = u * u + v * v > self.fold_radius() ** 2
            du, dv = self._distorted(u, v)
        du[outside] = np.nan
        return np.stack([fx * du + cx, fy * dv + cy], axis=1)

    def unproject(self, pixels: Array) -> Array:
        """Return directions (n, 3) with z = 1 of pixels (n, 2), by Newton's method on the distortion."""
        fx, fy, cx, cy = self.brown()[:4]
        pixels = np.asarray(pixels, float)
        target_u, target_v = (pixels[:, 0] - cx) / fx, (pixels[:, 1] - cy) / fy
        u, v, step = target_u.copy(), target_v.copy(), 1e-6
        for _ in range(20):
            du, dv = self._distorted(u, v)
            uu, vu = self._distorted(u + step, v)
            uv, vv = self._distorted(u, v + step)
            a, b, c, d = (uu - du) / step, (uv - du) / step, (vu - dv) / step, (vv - dv) / step
            ru, rv = target_u - du, target_v - dv
            determinant = a * d - b * c
            u += (d * ru - b * rv) / determinant
            v += (a * rv - c * ru) / determinant
            if max(np.abs(ru).max(initial=0), np.abs(rv).max(initial=0)) < 1e-12:
                break
        return np.stack([u, v, np.ones_like(u)], axis=1)

    def fold_radius(self) -> float:
        """Return the largest radius (tangent of the angle off axis) up to which the radial distortion still grows."""
        k1, k2, _, _, k3, k4, k5, k6 = self.brown()[4:]
        radius = np.linspace(0.0, 4.0, 4001)
        r2 = radius**2
        radial = radius * (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        falling = np.flatnonzero(np.diff(radial) <= 0)
        return float(radius[falling[0]]) if len(falling) else np.inf

    def _distorted(self, u: Array, v: Array) -> tuple[Array, Array]:
        k1, k2, p1, p2, k3, k4, k5, k6 = self.brown()[4:]
        r2 = u * u + v * v
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        return (
            u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u),
            v * radial + p1 * (r2 + 2 * v * v) + 2 * p2 * u * v,
        )
