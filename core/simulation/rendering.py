"""Photographs of the beach: its fields on a grid, and the first point of them that each ray meets."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..block import View
from .noise import noise
from .terrain import grain_count, height_at, reflectance_at

Array = NDArray[np.float64]

FINE = 2  # cells of reflectance per cell of height, each way
RADIANCE_UNIT = 1.0 / 20000  # of the stored radiance; that of dry flat sand is 1
_SKY = 0.6  # share of the light that comes from the whole sky; haze keeps beaches low in contrast
_LATTICE = 4  # pixels between exact rays; linear in between they err by less than 0.001 px
_BLACK, _WHITE = 0.25, 1.9  # paint, relative to dry sand
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


def new_arrays(folder: Path, field: Field) -> None:
    """Make the two files that ``fill_heights`` and ``fill_radiance`` fill."""
    np.lib.format.open_memmap(folder / "heights.npy", "w+", np.float32, (field.rows, field.columns))
    shape = (field.rows * FINE, field.columns * FINE)
    np.lib.format.open_memmap(folder / "radiance.npy", "w+", np.uint16, shape)


def fill_heights(folder: str, field: Field, start: int, end: int, shape: tuple[float, float, float, int], after: bool) -> None:
    """Compute the rows from ``start`` to ``end`` of the heights; ``shape`` is the beach's."""
    heights = np.load(Path(folder) / "heights.npy", mmap_mode="r+")
    _heights(heights[start:end], field.a, field.c + start * field.cell, field.cell, *shape, after)
    heights.flush()


def fill_radiance(
    folder: str, field: Field, start: int, end: int, shape: tuple[float, float, float, int], after: bool, contrast: float, light: Light
) -> None:
    """Compute the radiance that belongs to the rows of heights from ``start`` to ``end``."""
    heights = np.load(Path(folder) / "heights.npy", mmap_mode="r")
    radiance = np.load(Path(folder) / "radiance.npy", mmap_mode="r+")
    sun = np.array(
        [
            math.cos(light.elevation) * math.cos(light.azimuth),
            math.cos(light.elevation) * math.sin(light.azimuth),
            math.sin(light.elevation),
        ]
    )
    finest = 1.5 * field.cell
    _radiance(
        heights, radiance, start, end, field.a, field.c, field.cell, shape[1], shape[3], after, contrast, finest, grain_count(finest), sun
    )
    radiance.flush()


@dataclass(frozen=True)
class Scene:
    """The fields of one date in memory, and the painted targets: a, c, cosine, sine of each one's turn (n, 4), half a side."""

    field: Field
    heights: NDArray[np.float32]
    radiance: NDArray[np.uint16]
    targets: Array
    half: float

    @classmethod
    def load(cls, folder: str, field: Field, targets: Array, half: float) -> Scene:
        """Map the files of ``folder``; pages are shared between processes."""
        heights = np.load(Path(folder) / "heights.npy", mmap_mode="r")
        radiance = np.load(Path(folder) / "radiance.npy", mmap_mode="r")
        return cls(field, heights, radiance, targets, half)

    def render(self, view: View, sea: int, steepest: float, top: float) -> NDArray[np.float32]:
        """Return the light on each pixel (3, rows, columns): of sand, paint and sea, relative to dry flat sand.

        ``view`` is in beach coordinates; ``sea`` seeds the water of this moment; ``steepest`` and ``top`` bound the
        slope and height of the heights field, so that marching along a ray can not step over its first hit.
        """
        camera = view.camera
        columns, rows = -(-camera.width // _LATTICE) + 1, -(-camera.height // _LATTICE) + 1
        mesh = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2) * float(_LATTICE)
        rays = camera.unproject(mesh)[:, :2].reshape(rows, columns, 2)
        out = np.zeros((_PLANES, camera.height, camera.width), np.float32)
        f = self.field
        _render(
            self.heights, self.radiance, f.a, f.c, f.cell, top, steepest,
            view.centre, np.ascontiguousarray(view.rotation.T), rays, self.targets, self.half, sea, out,
        )  # fmt: skip
        return out

    def hit(self, view: View, pixels: Array, steepest: float, top: float) -> Array:
        """Return the points (n, 3) of the surface that ``pixels`` (n, 2) of ``view`` show."""
        rays = view.camera.unproject(pixels) @ view.rotation
        f, points = self.field, np.empty((len(rays), 3))
        for i, ray in enumerate(rays):
            mx, my = ray[0] / -ray[2], ray[1] / -ray[2]
            t = _trace(self.heights, f.a, f.c, 1 / f.cell, *view.centre, mx, my, top, steepest)
            points[i] = view.centre + t * np.array([mx, my, -1.0])
        return points


def bounds(heights: NDArray[np.float32], start: int, end: int) -> tuple[float, float]:
    """Return the largest height and a bound of the slope of the bilinear surface, in units per cell, over some rows."""
    part = np.asarray(heights[start : end + 1])
    along = np.abs(np.diff(part, axis=1)).max(initial=0.0)
    across = np.abs(np.diff(part, axis=0)).max(initial=0.0)
    return float(part.max()), float(math.hypot(along, across))


@njit(cache=True, nogil=True)
def _heights(
    out: Any, a: float, c: float, cell: float, length: float, across: float, relief: float, seed: int, after: bool
) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = height_at(a + j * cell, c + i * cell, length, across, relief, seed, after)


@njit(cache=True, nogil=True)
def _radiance(
    heights: Any, out: Any, start: int, end: int, a: float, c: float, cell: float, across: float, seed: int, after: bool,
    contrast: float, finest: float, count: int, sun: Any,
) -> None:  # fmt: skip
    rows, columns = heights.shape
    inv = 1.0 / cell
    for i in range(start * FINE, end * FINE):
        y = c + i * cell / FINE
        for j in range(columns * FINE):
            x = a + j * cell / FINE
            zx = (_height(heights, a, c, inv, x + cell, y) - _height(heights, a, c, inv, x - cell, y)) * 0.5 * inv
            zy = (_height(heights, a, c, inv, x, y + cell) - _height(heights, a, c, inv, x, y - cell)) * 0.5 * inv
            facing = (sun[2] - zx * sun[0] - zy * sun[1]) / math.sqrt(1.0 + zx * zx + zy * zy)
            light = _SKY + (1.0 - _SKY) * max(facing, 0.0) / sun[2]
            value = light * reflectance_at(x, y, across, seed, after, contrast, finest, count)
            out[i, j] = min(value / RADIANCE_UNIT, 65535.0)


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
    heights: Any, a: float, c: float, inv: float, x0: float, y0: float, z0: float, mx: float, my: float, top: float, steepest: float
) -> float:
    """Return how far below (m) the ray (mx, my, -1) from (x0, y0, z0) meets the surface first.

    Sphere tracing: where the ray is ``gap`` above a surface no steeper than ``steepest``, it can not meet it within
    ``gap / (1 + |m| steepest)``. Newton's step ends it.
    """
    t = z0 - top
    pace = 1.0 / (1.0 + math.sqrt(mx * mx + my * my) * steepest)
    for _ in range(500):
        gap = z0 - t - _height(heights, a, c, inv, x0 + mx * t, y0 + my * t)
        if gap < 5e-4:
            break
        t += gap * pace
    probe = 2e-3
    gap = z0 - t - _height(heights, a, c, inv, x0 + mx * t, y0 + my * t)
    later = z0 - t - probe - _height(heights, a, c, inv, x0 + mx * (t + probe), y0 + my * (t + probe))
    if gap - later > 0.1 * probe:
        t += probe * gap / (gap - later)
    return t


@njit(cache=True, nogil=True)
def _render(
    heights: Any, radiance: Any, a: float, c: float, cell: float, top: float, steepest: float,
    centre: Any, world_from_camera: Any, rays: Any, targets: Any, half: float, sea: int, out: Any,
) -> None:  # fmt: skip
    inv, fine = 1.0 / cell, FINE / cell
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
                t = _trace(heights, a, c, inv, centre[0], centre[1], centre[2], mx, my, top, steepest)
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
