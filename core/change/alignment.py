"""The common grid of two surface models, and their heights on it.

The grid is the coarser model's own. A model is read at the centres of the grid's cells by bilinear interpolation; where its
cells are finer, at k x k points spread evenly over the cell, whose mean it is (an area average, exact for whole ratios).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray
from pyproj import CRS, Transformer

from ..errors import InputError
from ..frames import transformer
from ..raster import Grid
from .heights import Heights

Array = NDArray[np.float64]
_STEP = 32  # cells between exactly transformed points; between them a map projection is straight to micrometres
_SAME = 1.2  # up to this ratio of cell sizes one point a cell tells all
_READ = 8_000_000  # cells of a model read at once: 64 MB
_SNAP = 1e-5  # cells
_AXIS = 1e-9  # rotation (per cell) below which a raster counts as north-up


@dataclass(frozen=True)
class Aligned:
    """A model seen through the common grid, and read ``offset`` (m to the east and north in the grid's CRS) beside it."""

    heights: Heights
    grid: Grid
    offset: tuple[float, float] = (0.0, 0.0)

    @cached_property
    def points(self) -> int:
        """Sample points per cell and axis."""
        ratio = max(self.grid.cell, self.grid.step_north) / self.heights.cell
        return 1 if ratio <= _SAME else math.ceil(ratio - 1e-6)

    @cached_property
    def _change(self) -> Transformer | None:
        return _change(self.grid.crs, self.heights.units.crs)

    def read(self, window: Grid) -> Array:
        """Return heights (rows, columns) on a window of the grid; NaN where the model has none or a hole is too near."""
        columns, rows = _lattice(window.width), _lattice(window.height)
        x = window.west + columns * window.cell
        y = window.north - rows * window.step_north
        xy = np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1).reshape(-1, 2) + self.offset
        source = self._cells(xy).reshape(len(rows), len(columns), 2)
        out = np.full((window.height, window.width), np.nan)
        if not np.isfinite(source).all():
            raise InputError(f"{self.heights.label} leaves the area where the other raster's CRS is defined: check both CRS.")
        file = self.heights.file
        low = np.maximum(np.floor(source.min(axis=(0, 1))).astype(int) - 2, 0)
        high = np.minimum(np.ceil(source.max(axis=(0, 1))).astype(int) + 2, (file.width, file.height))
        if (high <= low).any():
            return out
        values = self.heights.read(int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1]))
        if np.isnan(values).all():
            return out
        _sample(values, source - low, _STEP, self.points, out)
        return out

    def _cells(self, xy: Array) -> Array:
        """Return column, row (corners) in the model of points (n, 2) of the grid's CRS."""
        if self._change is not None:
            xy = np.column_stack(self._change.transform(xy[:, 0], xy[:, 1]))
        a, b, c, d, e, f = self.heights.transform
        x, y, det = xy[:, 0] - c, xy[:, 1] - f, a * e - b * d
        return np.column_stack([(e * x - b * y) / det, (a * y - d * x) / det])


def common_grid(before: Heights, after: Heights) -> tuple[Grid, Any]:
    """Return the coarser model's grid over what both cover, and the polygon of that overlap in its CRS.

    Raises
    ------
    InputError
        When they do not overlap or are in different vertical datums.
    """
    datums = {h.units.datum for h in (before, after)} - {None}
    if len(datums) > 1:
        raise InputError(
            f"BEFORE has heights above {before.units.datum}, AFTER above {after.units.datum}: convert one to the other's datum."
        )
    # Equal cells: the earlier one leads.
    coarser = after if after.cell > before.cell * (1 + 1e-6) else before
    shared = shapely.intersection(footprint(before, coarser.units.crs), footprint(after, coarser.units.crs))
    if shapely.area(shared) < coarser.cell**2:
        raise InputError("BEFORE and AFTER do not overlap: choose two rasters of the same place, and check their CRS.")
    return _over(coarser, shapely.bounds(shared)), shared


def link_accuracy(before: Heights, after: Heights) -> float:
    """Return how well (m) PROJ knows the transformation between the two models' CRS at the models; 0 for one datum."""
    change = _change(before.units.crs, after.units.crs)
    if change is None:
        return 0.0
    change.transform(*shapely.get_coordinates(shapely.centroid(footprint(before, before.units.crs)))[0])
    return max(0.0, float(change.get_last_used_operation().accuracy))


def footprint(heights: Heights, crs: str) -> Any:
    """Return the polygon in ``crs`` that the model's raster covers."""
    width, height = heights.file.width, heights.file.height
    steps = np.linspace(0.0, 1.0, 33)[:-1]
    around = np.concatenate(
        [
            np.column_stack([steps * width, 0 * steps]),
            np.column_stack([width + 0 * steps, steps * height]),
            np.column_stack([(1 - steps) * width, height + 0 * steps]),
            np.column_stack([0 * steps, (1 - steps) * height]),
        ]
    )
    a, b, c, d, e, f = heights.transform
    x, y = a * around[:, 0] + b * around[:, 1] + c, d * around[:, 0] + e * around[:, 1] + f
    change = _change(heights.units.crs, crs)
    if change is None:
        return shapely.Polygon(np.column_stack([x, y]))
    x, y = change.transform(x, y)
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise InputError(f"{heights.label} does not lie where the other raster's CRS is defined: check both CRS.")
    return shapely.Polygon(np.column_stack([x, y]))


def tiles(grid: Grid, reach: float, halo: int = 0) -> list[tuple[int, int, int, int]]:
    """Return column, row, width, height of tiles that cover the grid, row by row.

    ``reach`` is the largest ratio of the grid's cell to a model's: what is read for a tile stays below some 64 MB.
    """
    side = int(min(1024, max(16, math.sqrt(_READ) / max(reach, 1.0) - 2 * halo)))
    return [
        (column, row, min(side, grid.width - column), min(side, grid.height - row))
        for row in range(0, grid.height, side)
        for column in range(0, grid.width, side)
    ]


def _over(heights: Heights, bounds: tuple[float, float, float, float]) -> Grid:
    """Return the model's own cells over ``bounds`` (west, south, east, north); for a rotated one, north-up cells of its size."""
    a, b, c, d, e, f = heights.transform
    west, south, east, north = bounds
    crs = heights.units.crs
    if abs(b) > _AXIS * abs(a) or abs(d) > _AXIS * abs(e):
        a = e = heights.cell
        c, f = west, north
    a, e = abs(a), abs(e)
    # A raster that runs the other way has its cell edges on the same lattice.
    left, right = math.floor((west - c) / a + 1e-6), math.ceil((east - c) / a - 1e-6)
    top, bottom = math.ceil((north - f) / e - 1e-6), math.floor((south - f) / e + 1e-6)
    square = abs(a - e) <= 1e-9 * a
    return Grid(c + left * a, f + top * e, a, right - left, top - bottom, crs, None if square else e)


def _change(source: str, target: str) -> Transformer | None:
    """Return the transformation between two CRS, None when they are one."""
    first, second = CRS.from_wkt(source), CRS.from_wkt(target)
    if source == target or first.equals(second, ignore_axis_order=True) or _same_numbers(first, second):
        return None
    return transformer(first, second)


def _same_numbers(first: CRS, second: CRS) -> bool:
    """Tell whether two CRS differ only in their names, as WKT 1 and 2 of one CRS do."""
    return first.to_epsg() is not None and first.to_epsg() == second.to_epsg()


def _lattice(count: int) -> Array:
    """Return positions (cells) every _STEP from 0 to at least ``count``."""
    return np.arange(0, count + _STEP, _STEP, dtype=float)


@njit(cache=True)  # pragma: no cover
def _sample(values: Array, lattice: Array, step: int, points: int, out: Array) -> None:
    """Fill ``out`` with means of bilinear samples; ``lattice`` holds column, row (corners) in ``values`` every ``step`` cells."""
    rows, columns = out.shape
    nodes = lattice.shape[1]
    along = np.empty((points, nodes, 2))  # the lattice on the lines of samples of one row of cells
    for r in range(rows):
        for i in range(points):
            v = (r + (i + 0.5) / points) / step
            v0 = min(int(v), lattice.shape[0] - 2)
            for k in range(nodes):
                for a in range(2):
                    along[i, k, a] = (1 - v + v0) * lattice[v0, k, a] + (v - v0) * lattice[v0 + 1, k, a] - 0.5
        for c in range(columns):
            total, count = 0.0, 0
            u0 = c // step
            for j in range(points):
                u = (c - u0 * step + (j + 0.5) / points) / step
                for i in range(points):
                    x = along[i, u0, 0] + u * (along[i, u0 + 1, 0] - along[i, u0, 0])
                    y = along[i, u0, 1] + u * (along[i, u0 + 1, 1] - along[i, u0, 1])
                    sample = _bilinear(values, x, y)
                    if not np.isnan(sample):
                        total += sample
                        count += 1
            if 2 * count >= points * points:
                out[r, c] = total / count


@njit(cache=True, inline="always")  # pragma: no cover
def _bilinear(values: Array, x: float, y: float) -> float:
    """Return the value between four cells at ``x``, ``y`` (centres at whole numbers); NaN beyond the outer centres."""
    x0, y0 = int(np.floor(x + _SNAP)), int(np.floor(y + _SNAP))
    if x0 < 0 or y0 < 0 or x0 >= values.shape[1] or y0 >= values.shape[0]:
        return np.nan
    fx, fy = x - x0, y - y0
    # Centres that meet but for rounding need one neighbour, not four.
    x1, y1 = x0 + (1 if fx > _SNAP else 0), y0 + (1 if fy > _SNAP else 0)
    if x1 >= values.shape[1] or y1 >= values.shape[0]:
        return np.nan
    if x1 == x0:
        fx = 0.0
    if y1 == y0:
        fy = 0.0
    upper = (1 - fx) * values[y0, x0] + fx * values[y0, x1]
    lower = (1 - fx) * values[y1, x0] + fx * values[y1, x1]
    return (1 - fy) * upper + fy * lower
