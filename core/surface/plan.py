"""What is decided before the first tile: the grid, the levels from coarse to fine, and the range of heights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..block import Block, View
from ..errors import InputError, NotEnoughData
from ..frames import LocalFrame
from ..raster import Grid
from .exposure import Balance
from .views import STEEPEST, tile_views

Array = NDArray[np.float64]

# Heights are tried at steps that move the widest pair of views by this many cells against each other.
PARALLAX_STEP = 0.4
_MOST_HYPOTHESES = 160
_MOST_CELLS = 4e9
_COARSEST = 5


@dataclass(frozen=True)
class Level:
    """One pass over the area: cell and height step in metres, size in cells. Number 0 is the finest, n has 2**n its cell."""

    number: int
    cell: float
    step: float
    rows: int
    columns: int


@dataclass(frozen=True)
class Plan:
    """All that a tile needs to know; small enough to travel with every call.

    ``plane`` holds a, b, c of the ground's trend a + b (easting - west) + c (northing - north), ``relief`` the lowest and
    highest height (m) about it. ``levels`` run from coarse to fine.
    """

    views: tuple[View, ...]
    paths: tuple[str, ...]
    frame: LocalFrame
    grid: Grid
    plane: tuple[float, float, float]
    relief: tuple[float, float]
    levels: tuple[Level, ...]
    gsd: float
    window: int
    regularity: float
    scratch: str
    balance: Balance

    @property
    def datum(self) -> float:
        """The height (m) from which heights in tiles are counted, so that 32-bit numbers hold them to the micrometre."""
        return float(round(self.plane[0]))

    def trend(self, easting: NDArray[Any], northing: NDArray[Any]) -> Array:
        """Return the height of the ground's plane above the datum."""
        a, b, c = self.plane
        return np.asarray(a - self.datum + b * (easting - self.grid.west) + c * (northing - self.grid.north))


def ground_pixel(block: Block) -> float:
    """Return the mean size (m) of a pixel on the ground over all observations of tie points.

    Raises
    ------
    NotEnoughData
        When there are no observations.
    """
    if len(block.observed_point) == 0:
        raise NotEnoughData("The georeferenced block holds no tie points: run strandline:orient again.")
    sizes = np.empty(len(block.observed_point))
    for index, view in enumerate(block.views):
        mine = block.observed_view == index
        points = block.points[block.observed_point[mine]]
        depth = points @ view.rotation[2] + view.translation[2]
        sizes[mine] = depth / view.camera.brown()[:2].mean()
    return float(np.mean(sizes))


def base_over_height(block: Block) -> float:
    """Return the median over tie points of the widest base between their views, over the height.

    Raises
    ------
    NotEnoughData
        When no tie point is seen by two views that stand apart.
    """
    centres = np.array([view.centre for view in block.views])
    rays = centres[block.observed_view] - block.points[block.observed_point]
    slopes = rays[:, :2] / np.maximum(rays[:, 2:], 1e-3)
    count = len(block.points)
    spread = np.zeros(count)
    for direction in np.linspace(0.0, np.pi, 8, endpoint=False):
        along = slopes @ [np.cos(direction), np.sin(direction)]
        low, high = np.full(count, np.inf), np.full(count, -np.inf)
        np.minimum.at(low, block.observed_point, along)
        np.maximum.at(high, block.observed_point, along)
        spread = np.maximum(spread, np.where(high > low, high - low, 0.0))
    seen = spread[spread > 0]
    if not len(seen) or np.median(seen) < 0.01:
        raise NotEnoughData("The photographs stand too close together to measure heights: the survey needs a wider base.")
    return float(np.median(seen))


def fit_trend(points: Array, west: float, north: float) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """Return a plane through points (n, 3: easting, northing, height), robustly, and the range of heights about it.

    The range holds all but the outermost 0.5 % of the points on each side.
    """
    design = np.column_stack([np.ones(len(points)), points[:, 0] - west, points[:, 1] - north])
    weight = np.ones(len(points))
    for _ in range(10):
        root = np.sqrt(weight)[:, None]
        plane = np.linalg.lstsq(design * root, points[:, 2] * root[:, 0], rcond=1e-6)[0]
        residual = points[:, 2] - design @ plane
        scale = 1.4826 * np.median(np.abs(residual)) + 1e-6
        weight = 1.0 / np.maximum(1.0, np.abs(residual) / (1.5 * scale))
    low, high = np.percentile(residual, [0.5, 99.5])
    return (float(plane[0]), float(plane[1]), float(plane[2])), (float(low), float(high))


def search_range(found: tuple[float, float], flying_height: float) -> tuple[float, float]:
    """Return the range of heights (m) to search, given that of the tie points.

    Tie points favour open ground: trees, walls and pits have few. So a share of the flying height is added on both sides.
    """
    low, high = found
    margin = 0.1 * (high - low)
    return low - margin - 0.05 * flying_height, high + margin + 0.25 * flying_height


def covered_bounds(block: Block, frame: LocalFrame, points: Array) -> tuple[float, float, float, float]:
    """Return west, south, east, north of the ground that two photographs see, in the CRS.

    Raises
    ------
    NotEnoughData
        When no ground is seen twice.
    """
    low, high = np.percentile(points[:, :2], [1, 99], axis=0)
    reach = float(np.max(high - low)) + 1e-3
    middle = np.append((low + high) / 2, np.median(points[:, 2]))
    plane, _ = fit_trend(points, middle[0], middle[1])
    lattice = 256
    cell = 3.0 * reach / lattice
    west, north = -1.5 * reach, 1.5 * reach
    x = west + (np.arange(lattice) + 0.5) * cell
    y = north - (np.arange(lattice) + 0.5) * cell
    height = (plane[0] - middle[2] + plane[1] * x[None, :] + plane[2] * y[:, None]).astype(np.float32)
    ground = np.stack([*np.meshgrid(x, y), height], axis=-1).reshape(-1, 3)
    count = np.zeros((lattice, lattice), int)
    for view in tile_views(block.views, frame, middle, 1.5 * reach):
        lean = np.hypot(*view.slopes(ground).T).reshape(lattice, lattice)
        count += view.inside(west, north, cell, height) & (lean < STEEPEST)
    rows, columns = np.nonzero(count >= 2)
    if not len(rows):
        raise NotEnoughData("No ground is seen by two photographs: the survey needs more overlap.")
    return (
        float(middle[0] + west + columns.min() * cell),
        float(middle[1] + north - (rows.max() + 1) * cell),
        float(middle[0] + west + (columns.max() + 1) * cell),
        float(middle[1] + north - rows.min() * cell),
    )


def snapped_grid(bounds: tuple[float, float, float, float], resolution: float, crs: str) -> Grid:
    """Return the grid over ``bounds`` whose edges are multiples of ``resolution``.

    Raises
    ------
    InputError
        When it would have too many cells, or fewer than a window needs.
    """
    west, south, east, north = bounds
    left, right = math.floor(west / resolution + 1e-9), math.ceil(east / resolution - 1e-9)
    bottom, top = math.floor(south / resolution + 1e-9), math.ceil(north / resolution - 1e-9)
    width, height = right - left, top - bottom
    if width * height > _MOST_CELLS:
        raise InputError(
            f"RESOLUTION {resolution:g} m would make {width} x {height} cells: choose a coarser one, or a smaller AREA."
        )
    if min(width, height) < 8:
        raise InputError(
            f"RESOLUTION {resolution:g} m leaves only {width} x {height} cells: choose a finer one, or a larger AREA."
        )
    return Grid(left * resolution, top * resolution, resolution, width, height, crs)


def make_levels(grid: Grid, relief: tuple[float, float], base: float) -> tuple[Level, ...]:
    """Return the levels from coarse to fine; the coarsest can search all of ``relief``; ``base`` is the base over the height."""
    levels = []
    for number in range(_COARSEST + 1):
        cell = grid.cell * 2**number
        step = PARALLAX_STEP * cell / base
        levels.append(Level(number, cell, step, -(-grid.height // 2**number), -(-grid.width // 2**number)))
        if number >= 3 and (relief[1] - relief[0]) / step <= _MOST_HYPOTHESES:
            break
    return tuple(reversed(levels))
