"""Where a tile searches: a base surface, and for each cell the band of hypotheses about it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .mosaic import Mosaic, Tile
from .plan import Level, Plan
from .sampling import visible
from .views import TileView

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

BAND = 5  # steps searched on either side of what the coarser level found
_MOST = 72  # hypotheses of a cell at most, where the coarser level has steps
_NEIGHBOURS = 5  # coarser cells across whose lowest and highest height bound the search
_HORIZON = 160  # coarser cells around the tile that may hide it from a camera
_NEAR = 24  # cells within which the tile's own surface knows better than the coarser


@dataclass(frozen=True)
class Place:
    """A tile's place: its origin in the CRS, its window's corner relative to it (m), and how far it reaches (m)."""

    origin: Array
    west: float
    north: float
    reach: float

    @classmethod
    def of(cls, plan: Plan, tile: Tile) -> Place:
        """Return the place of ``tile``, with the origin in the middle of its window."""
        top, left, rows, columns = tile.window
        cell = tile.level.cell
        right, down = columns * cell / 2, rows * cell / 2
        origin = np.array([plan.grid.west + left * cell + right, plan.grid.north - top * cell - down, plan.datum])
        return cls(origin, -right, down, max(right, down, 20.0))


@dataclass(frozen=True)
class Band:
    """Hypothesis k of a cell is the height ``base + (first + k) * step``, k < ``count``; ``base`` has a border more."""

    border: int
    base: Floats
    first: NDArray[np.int32]
    count: NDArray[np.int32]

    @property
    def inner(self) -> Floats:
        """The base without the border."""
        b = self.border
        return np.ascontiguousarray(self.base[b:-b, b:-b])

    @property
    def offset(self) -> NDArray[np.int64]:
        """Where each cell's hypotheses start when those of all cells lie one after the other."""
        ends = np.cumsum(self.count, dtype=np.int64)
        return (ends - self.count.ravel()).reshape(self.count.shape)

    def limits(self, step: float) -> tuple[float, float]:
        """Return the lowest and the highest height of all hypotheses."""
        inner = self.inner
        return float((inner + self.first * step).min()), float((inner + (self.first + self.count) * step).max())


@dataclass(frozen=True)
class Coarser:
    """The coarser level's surface around a tile, its first row and column in the coarser level, and its cell."""

    surface: Floats
    row: int
    column: int
    cell: float
    step: float


def coarser_window(tile: Tile, coarser: Level) -> tuple[int, int, int, int]:
    """Return first row, first column, rows, columns of what a tile needs of the coarser level."""
    top, left, rows, columns = tile.window
    r0, c0 = max(0, top // 2 - _HORIZON), max(0, left // 2 - _HORIZON)
    r1 = min(coarser.rows, -(-(top + rows) // 2) + _HORIZON)
    c1 = min(coarser.columns, -(-(left + columns) // 2) + _HORIZON)
    return r0, c0, r1 - r0, c1 - c0


def coarser_surface(plan: Plan, tile: Tile) -> Coarser | None:
    """Return what the level before found around ``tile``, None on the coarsest level."""
    place = plan.levels.index(tile.level)
    if place == 0:
        return None
    level = plan.levels[place - 1]
    r0, c0, rows, columns = coarser_window(tile, level)
    mosaic = Mosaic(plan.scratch, level, tile.core, tile.overlap)
    surface = mosaic.blend("height", r0, c0, rows, columns, tolerance=2 * level.step)
    return Coarser(surface, r0, c0, level.cell, level.step)


def band_on_trend(plan: Plan, tile: Tile, border: int) -> Band:
    """Return the coarsest level's band: all of the relief about the ground's plane."""
    top, left, rows, columns = tile.window
    cell, step = tile.level.cell, tile.level.step
    easting = plan.grid.west + (np.arange(left - border, left + columns + border) + 0.5) * cell
    northing = plan.grid.north - (np.arange(top - border, top + rows + border) + 0.5) * cell
    base = plan.trend(easting[None, :], northing[:, None]).astype(np.float32)
    low, high = int(np.floor(plan.relief[0] / step)) - 2, int(np.ceil(plan.relief[1] / step)) + 2
    shape = rows, columns
    return Band(border, base, np.full(shape, low, np.int32), np.full(shape, high - low + 1, np.int32))


def band_about(coarser: Coarser, tile: Tile, border: int) -> Band:
    """Return a band about the coarser surface, wide where that has steps, so that edges find their place."""
    top, left, rows, columns = tile.window
    step = tile.level.step
    # Noise in the base would tilt and ripple the windows laid on it; steps must stay.
    smooth = cv2.bilateralFilter(cv2.medianBlur(coarser.surface, 3), 7, 1.5 * coarser.step, 2.0)
    kernel = np.ones((_NEIGHBOURS, _NEIGHBOURS), np.uint8)
    lowest, highest = cv2.erode(coarser.surface, kernel), cv2.dilate(coarser.surface, kernel)
    # The centre of fine cell i lies at (i + 0.5) / 2 - 0.5 among the coarse ones.
    x = ((np.arange(left - border, left + columns + border) + 0.5) / 2 - 0.5 - coarser.column).astype(np.float32)
    y = ((np.arange(top - border, top + rows + border) + 0.5) / 2 - 0.5 - coarser.row).astype(np.float32)
    base = cv2.remap(smooth, *np.meshgrid(x, y), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    r = np.rint(y[border:-border]).astype(int).clip(0, lowest.shape[0] - 1)[:, None]
    c = np.rint(x[border:-border]).astype(int).clip(0, lowest.shape[1] - 1)[None, :]
    middle = base[border:-border, border:-border]
    first = np.rint((lowest[r, c] - middle) / step).astype(np.int32) - BAND
    last = np.rint((highest[r, c] - middle) / step).astype(np.int32) + BAND
    first, last = np.maximum(first, -_MOST // 2), np.minimum(last, _MOST // 2)
    return Band(border, base, first, last - first + 1)


def unhidden(view: TileView, surface: Floats, cell: float, place: Place, step: float) -> NDArray[np.bool_]:
    """Tell from which cells of the tile's own surface nothing near hides a view's camera."""
    return visible(surface, cell, place.west, place.north, view.centre, _tolerance(cell, step), _NEAR)


def unhidden_by(coarser: Coarser, view: TileView, tile: Tile, place: Place) -> NDArray[np.bool_]:
    """Tell which cells of the tile's window the coarser surface, reaching far around it, does not hide from a view."""
    top, left, rows, columns = tile.window
    west = place.west + (coarser.column * 2 - left) * tile.level.cell
    north = place.north - (coarser.row * 2 - top) * tile.level.cell
    tolerance = _tolerance(coarser.cell, coarser.step)
    free = visible(coarser.surface, coarser.cell, west, north, view.centre, tolerance, _HORIZON)
    r = ((top + np.arange(rows)) // 2 - coarser.row).clip(0, free.shape[0] - 1)
    c = ((left + np.arange(columns)) // 2 - coarser.column).clip(0, free.shape[1] - 1)
    return np.ascontiguousarray(free[r[:, None], c[None, :]])


def _tolerance(cell: float, step: float) -> float:
    return 2 * step + cell  # two steps are noise, and one cell is the blur of an edge
