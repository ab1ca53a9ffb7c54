"""Photographs of the beach: its fields on a grid, and the first point of them that each ray meets."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..block import View
from .noise import noise
from .terrain import GRAINS, Beach, grain_weights, height_at, reflectance_at

Array = NDArray[np.float64]

FINE = 2  # cells of reflectance per cell of height, each way
RADIANCE_UNIT = 1.0 / 20000  # of the stored radiance; that of dry flat sand is 1
_SKY = 0.8  # share of the light that comes from the whole sky: thin cloud, under which ripples shade less than sand varies
_LATTICE = 4  # pixels between exact rays; linear in between they err by less than 0.001 px
_BLACK, _WHITE = 0.25, 1.9  # paint, relative to dry sand
_ONE_HIT = 0.95  # of |m| times the steepest slope; below it a ray meets the surface once
_CLOSE = 2e-5  # m, how near to the surface a ray is followed: 0.001 px
_PLANES = 3  # sand, paint, sea


@dataclass(frozen=True)
class Field:
    """A grid in beach coordinates: rows across (c), columns along (a), ``cell`` (m) apart from ``a``, ``c``."""

    a: float
    c: float
    cell: float
    columns: int
    rows: int


@dataclass(frozen=True)
class Light:
    """The sun: azimuth from the beach's a axis towards c and elevation (rad)."""

    azimuth: float
    elevation: float

    @property
    def direction(self) -> Array:
        """The unit vector (3,) towards the sun."""
        flat = math.cos(self.elevation)
        return np.array([flat * math.cos(self.azimuth), flat * math.sin(self.azimuth), math.sin(self.elevation)])


@dataclass(frozen=True)
class Fields:
    """Where the fields of one date are kept while photographs are rendered, and what they show."""

    folder: str
    field: Field
    beach: Beach
    after: bool
    light: Light

    def create(self) -> None:
        """Make the two files that ``fill`` fills, empty."""
        f = self.field
        for name, kind, fine in (("heights.npy", np.float32, 1), ("radiance.npy", np.uint16, FINE)):
            np.lib.format.open_memmap(Path(self.folder) / name, "w+", kind, (f.rows * fine, f.columns * fine))

    def open(self, mode: Literal["r", "r+"]) -> tuple[Any, Any]:
        """Map heights and radiance; pages are shared between processes."""
        heights, radiance = (np.load(Path(self.folder) / name, mmap_mode=mode) for name in ("heights.npy", "radiance.npy"))
        return heights, radiance


def fill(fields: Fields, start: int, end: int) -> None:
    """Compute the rows of heights from ``start`` to ``end`` and the radiance that belongs to them."""
    f, beach = fields.field, fields.beach
    heights, radiance = fields.open("r+")
    length, across, relief, seed = beach.shape
    band = np.empty((end - start + 3, f.columns))  # with a row before and two behind, for the slope
    c = f.c + (start - 1) * f.cell
    _heights(band, f.a, c, f.cell, length, across, relief, seed, fields.after)
    heights[start:end] = band[1:-2]
    sun = fields.light.direction
    out = np.empty(((end - start) * FINE, f.columns * FINE), np.uint16)
    texture = (across, seed, fields.after, beach.contrast, GRAINS, grain_weights(f.cell / FINE))
    _radiance(band, out, f.a, c, f.cell, sun, *texture)
    radiance[start * FINE : end * FINE] = out
    heights.flush()
    radiance.flush()


@dataclass(frozen=True)
class Scene:
    """The fields of one date in memory, and the painted targets: a, c, cosine, sine of each one's turn (n, 4), half a side.

    ``top`` and ``steepest`` bound the height and slope of the bilinear surface, so that marching along a ray can not
    step over its first hit.
    """

    field: Field
    heights: NDArray[np.float32]
    radiance: NDArray[np.uint16]
    targets: Array
    half: float
    top: float
    steepest: float

    @classmethod
    def of(cls, field: Field, heights: NDArray[np.float32], radiance: NDArray[np.uint16], targets: Array, half: float) -> Scene:
        """Return the scene with its bounds."""
        along = np.abs(np.diff(heights, axis=1)).max()
        across = np.abs(np.diff(heights, axis=0)).max()
        return cls(field, heights, radiance, targets, half, float(heights.max()), math.hypot(along, across) / field.cell)

    def render(self, view: View, sea: int) -> NDArray[np.float32]:
        """Return the light on each pixel (3, rows, columns): of sand, paint and sea, relative to dry flat sand.

        ``view`` is in beach coordinates; ``sea`` seeds the water of this moment.
        """
        camera = view.camera
        x = np.arange(-(-camera.width // _LATTICE) + 1, dtype=float) * _LATTICE
        y = np.arange(-(-camera.height // _LATTICE) + 1, dtype=float) * _LATTICE
        mesh = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        rays = camera.unproject(mesh)[:, :2].reshape(len(y), len(x), 2)
        out = np.zeros((_PLANES, camera.height, camera.width), np.float32)
        f, axes = self.field, np.ascontiguousarray(view.rotation.T)
        ground = (self.heights, self.radiance, f.a, f.c, f.cell, self.top, self.steepest)
        _render(*ground, view.centre, axes, rays, self.targets, self.half, sea, out)
        return out

    def hit(self, view: View, pixels: Array) -> Array:
        """Return the points (n, 3) of the surface that ``pixels`` (n, 2) of ``view`` show."""
        rays = view.camera.unproject(pixels) @ view.rotation
        f, points = self.field, np.empty((len(rays), 3))
        for i, ray in enumerate(rays):
            mx, my = ray[0] / -ray[2], ray[1] / -ray[2]
            t = _trace(self.heights, f.a, f.c, 1 / f.cell, *view.centre, mx, my, self.top, self.steepest, 0.0)
            points[i] = view.centre + t * np.array([mx, my, -1.0])
        return points


@njit(cache=True, nogil=True)
def _heights(
    out: Any, a: float, c: float, cell: float, length: float, across: float, relief: float, seed: int, after: bool
) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = height_at(a + j * cell, c + i * cell, length, across, relief, seed, after)


@njit(cache=True, nogil=True)
def _radiance(
    heights: Any, out: Any, a: float, c: float, cell: float, sun: Any,
    across: float, seed: int, after: bool, contrast: float, grains: Any, weights: Any,
) -> None:  # fmt: skip
    """Fill ``out`` below the second row of ``heights``, whose first is at ``c``."""
    inv = 1.0 / cell
    for i in range(out.shape[0]):
        y = c + cell + i * cell / FINE
        for j in range(out.shape[1]):
            x = a + j * cell / FINE
            zx = (_height(heights, a, c, inv, x + cell, y) - _height(heights, a, c, inv, x - cell, y)) * 0.5 * inv
            zy = (_height(heights, a, c, inv, x, y + cell) - _height(heights, a, c, inv, x, y - cell)) * 0.5 * inv
            facing = (sun[2] - zx * sun[0] - zy * sun[1]) / math.sqrt(1.0 + zx * zx + zy * zy)
            light = _SKY + (1.0 - _SKY) * max(facing, 0.0) / sun[2]
            value = light * reflectance_at(x, y, across, seed, after, contrast, grains, weights)
            out[i, j] = int(min(value / RADIANCE_UNIT, 65535.0))


@njit(cache=True, nogil=True)
def _height(heights: Any, a: float, c: float, inv: float, x: float, y: float) -> float:
    """Return the bilinear height at a place; beyond the field's edge, that of the edge."""
    u = min(max((x - a) * inv, 0.0), heights.shape[1] - 1.000001)
    v = min(max((y - c) * inv, 0.0), heights.shape[0] - 1.000001)
    j, i = int(u), int(v)
    u -= j
    v -= i
    upper = (1 - u) * float(heights[i, j]) + u * float(heights[i, j + 1])
    lower = (1 - u) * float(heights[i + 1, j]) + u * float(heights[i + 1, j + 1])
    return (1 - v) * upper + v * lower


@njit(cache=True, nogil=True)
def _trace(
    heights: Any, a: float, c: float, inv: float, x0: float, y0: float, z0: float, mx: float, my: float,
    top: float, steepest: float, guess: float,
) -> float:  # fmt: skip
    """Return how far below (m) the ray (mx, my, -1) from (x0, y0, z0) meets the surface first.

    Where the ray is steeper than the surface anywhere, it meets it once, and t = z0 - z(t) is a contraction by at most
    |m| ``steepest``, from any ``guess``. Else sphere tracing from the ``top``: where the ray is ``gap`` above a surface no
    steeper than ``steepest``, it can not meet it within ``gap / (1 + |m| steepest)``.
    """
    lean = math.sqrt(mx * mx + my * my) * steepest
    if lean < _ONE_HIT:
        t = guess
        for _ in range(500):
            gap = z0 - t - _height(heights, a, c, inv, x0 + mx * t, y0 + my * t)
            t += gap
            if abs(gap) < _CLOSE:
                break
        return t
    t = z0 - top
    for _ in range(5000):
        gap = z0 - t - _height(heights, a, c, inv, x0 + mx * t, y0 + my * t)
        t += gap / (1.0 + lean)
        if gap < _CLOSE:
            break
    return t


@njit(cache=True, nogil=True)
def _render(
    heights: Any, radiance: Any, a: float, c: float, cell: float, top: float, steepest: float,
    centre: Any, world_from_camera: Any, rays: Any, targets: Any, half: float, sea: int, out: Any,
) -> None:  # fmt: skip
    inv, fine = 1.0 / cell, FINE / cell
    t = centre[2] - top
    reach = 2.5 * half * half
    m = world_from_camera
    for row in range(out.shape[1]):
        for column in range(out.shape[2]):
            side, target = 2, -1
            k = 0
            while k < side * side:
                px = column + (k % side + 0.5) / side
                py = row + (k // side + 0.5) / side
                u, v = px / _LATTICE, py / _LATTICE
                j, i = int(u), int(v)
                u -= j
                v -= i
                dx = (1 - v) * ((1 - u) * rays[i, j, 0] + u * rays[i, j + 1, 0])
                dx += v * ((1 - u) * rays[i + 1, j, 0] + u * rays[i + 1, j + 1, 0])
                dy = (1 - v) * ((1 - u) * rays[i, j, 1] + u * rays[i, j + 1, 1])
                dy += v * ((1 - u) * rays[i + 1, j, 1] + u * rays[i + 1, j + 1, 1])
                down = -(m[2, 0] * dx + m[2, 1] * dy + m[2, 2])
                mx = (m[0, 0] * dx + m[0, 1] * dy + m[0, 2]) / down
                my = (m[1, 0] * dx + m[1, 1] * dy + m[1, 2]) / down
                t = _trace(heights, a, c, inv, centre[0], centre[1], centre[2], mx, my, top, steepest, t)
                x, y, z = centre[0] + mx * t, centre[1] + my * t, centre[2] - t
                if k == 0 and side == 2:
                    for n in range(targets.shape[0]):
                        if (x - targets[n, 0]) ** 2 + (y - targets[n, 1]) ** 2 < reach:
                            target, side = n, 6  # sharp paint wants finer samples
                    if target >= 0:
                        continue  # again, from the first of the finer samples
                weight = 1.0 / (side * side)
                k += 1
                if target >= 0:
                    ex, ey = x - targets[target, 0], y - targets[target, 1]
                    p = targets[target, 2] * ex + targets[target, 3] * ey
                    q = targets[target, 2] * ey - targets[target, 3] * ex
                    if abs(p) < half and abs(q) < half:
                        out[1, row, column] += weight * (_WHITE if p * q > 0 else _BLACK)
                        continue
                if z < 1e-3:  # the sea: glints of the moment, which no other photograph shows
                    glint = 0.05 * noise(x / 1.5, y / 0.6, sea) + 0.03 * noise(x / 0.3, y / 0.2, sea + 1)
                    out[2, row, column] += weight * max(1.0 + glint, 0.0)
                    continue
                out[0, row, column] += weight * _height(radiance, a, c, fine, x, y) * RADIANCE_UNIT
