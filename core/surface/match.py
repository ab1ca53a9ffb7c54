"""The surface of one tile at one level: base, band of hypotheses, correlation, regularisation, and what can be believed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from .correlation import fill_costs
from .mosaic import Mosaic, Tile, save
from .ortho import paint
from .pictures import COARSEST, Pictures, grey
from .plan import Plan
from .regularisation import regularise
from .reliability import believable, matching_sigma
from .sampling import visible
from .views import TileView, choose, tile_views

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

MOST_VIEWS = 8
SMALL, LARGE = 2, 4  # half sizes of the two windows that an adaptive one is mixed of
NOISE = 1.0  # variance in 8-bit grey levels under which texture counts as noise: a JPEG's rounding and its sensor's rest
KNEE = 12.0  # times the noise: where the small and the large window count alike
BAND = 5  # steps searched on either side of what the coarser level found
_MOST_BAND = 72  # hypotheses of a cell at most, where the coarser level has steps
_NEIGHBOURS = 5  # coarser cells whose lowest and highest bound the search
P_SMALL, P_LARGE = 0.06, 0.35  # penalties at REGULARITY 1 for a change of one step, and for a jump
_HORIZON = 160  # cells around the tile that may hide it from a camera

_pictures = Pictures()


@dataclass(frozen=True)
class _Window:
    """A tile's window with a border: its place in tile coordinates, the base surface and what stands around."""

    west: float  # of the inner cells
    north: float
    cell: float
    border: int
    base: Floats  # with the border
    first: NDArray[np.int32]  # inner cells
    count: NDArray[np.int32]

    @property
    def inner(self) -> Floats:
        b = self.border
        return self.base[b:-b, b:-b]


def match_tile(plan: Plan, tile: Tile) -> None:
    """Compute a tile and save it in the plan's scratch folder, unless it is there already.

    Layers: ``height`` (m above the plan's datum; the regularised surface everywhere), and on the finest level ``score``,
    ``sigma`` (m), ``views`` (photographs that see the cell), ``covered`` (it lies in two frames, hidden or not), ``good`` (what
    can be believed) and ``colour``.
    """
    path = tile.path(plan.scratch)
    if path.is_file():
        return
    level = tile.level
    top, left, rows, columns = tile.window
    origin, west, north, reach = _place(plan, tile)
    small, large = (plan.window // 2, plan.window // 2) if plan.window else (SMALL, LARGE)
    everyone = tile_views(plan.views, plan.frame, origin, reach)
    coarser = _coarser(plan, tile)
    window = _from_trend(plan, tile, large) if coarser is None else _from_coarser(plan, tile, coarser, large)
    window = replace(window, west=west, north=north)
    lattice = max(1, -(-max(rows, columns) // 24))
    thin = np.ascontiguousarray(window.inner[lattice // 2 :: lattice, lattice // 2 :: lattice])
    views = choose(everyone, west, north, level.cell * lattice, thin, MOST_VIEWS)
    open_sky = [_open(plan, tile, view, coarser, west, north) for view in views]
    seen = np.array(open_sky, bool).reshape(len(views), rows, columns)
    offset = (np.cumsum(window.count, dtype=np.int64) - window.count.ravel()).reshape(rows, columns)
    costs = np.ones(int(window.count.sum(dtype=np.int64)), np.float32)
    crops = _crops(plan, window, views, level.cell, level.step)
    if len(views) >= 2:
        fill_costs(
            np.concatenate([c.pixels.ravel() for c in crops]),
            np.cumsum([0] + [c.pixels.size for c in crops])[:-1],
            np.array([c.pixels.shape for c in crops]),
            np.array([c.corner for c in crops]),
            np.array([v.matrix for v in views]),
            np.array([v.brown for v in views]),
            np.array([v.fold2 for v in views]),
            west - large * level.cell,
            north + large * level.cell,
            level.cell,
            window.base,
            level.step,
            window.first,
            window.count,
            offset,
            seen,
            small,
            large,
            NOISE,
            KNEE if large > small else 0.0,
            costs,
        )
    height, score, curvature, doubt = regularise(
        costs,
        offset,
        window.first,
        window.count,
        np.ascontiguousarray(window.inner),
        step=level.step,
        small=P_SMALL * plan.regularity,
        large=P_LARGE * plan.regularity,
    )
    # Noise below a step is smoothed over less than the window, steps stay.
    height = cv2.bilateralFilter(height, 5, level.step, 1.5)
    if level.number > 0:
        save(path, height=height)
        return
    framed = np.zeros((rows, columns), np.uint8)
    for n, view in enumerate(views):
        inside = view.inside(west, north, level.cell, height)
        framed += inside
        seen[n] &= inside
        seen[n] &= _unhidden(view, height, level.cell, west, north, level.step)
    number = seen.sum(axis=0).astype(np.uint8)
    layers = {
        "height": height,
        "score": score,
        "sigma": matching_sigma(score, curvature, number, (2 * large + 1) ** 2, level.step),
        "views": number,
        "covered": framed >= 2,
        "good": believable(height, score, number, doubt, (2 * large + 1) ** 2, level.step),
    }
    layers["colour"] = _colour(plan, tile, everyone, coarser, height, west, north)
    save(path, **layers)


def _place(plan: Plan, tile: Tile) -> tuple[Array, float, float, float]:
    """Return the tile's origin in the CRS, its window's corner relative to it, and how far it reaches (m)."""
    top, left, rows, columns = tile.window
    cell = tile.level.cell
    half_width, half_height = columns * cell / 2, rows * cell / 2
    easting, northing = plan.grid.west + left * cell + half_width, plan.grid.north - top * cell - half_height
    return np.array([easting, northing, plan.datum]), -half_width, half_height, max(half_width, half_height, 20.0)


def _from_trend(plan: Plan, tile: Tile, border: int) -> _Window:
    """Return the coarsest level's window: the ground's trend, and all of the relief to search."""
    top, left, rows, columns = tile.window
    cell, step = tile.level.cell, tile.level.step
    easting = plan.grid.west + (np.arange(left - border, left + columns + border) + 0.5) * cell
    northing = plan.grid.north - (np.arange(top - border, top + rows + border) + 0.5) * cell
    base = plan.trend(easting[None, :], northing[:, None]).astype(np.float32)
    low, high = int(np.floor(plan.relief[0] / step)) - 2, int(np.ceil(plan.relief[1] / step)) + 2
    shape = rows, columns
    return _Window(0, 0, cell, border, base, np.full(shape, low, np.int32), np.full(shape, high - low + 1, np.int32))


@dataclass(frozen=True)
class _Coarser:
    """The coarser level's surface around a tile, its first row and column in the coarser level, and its cell."""

    surface: Floats
    row: int
    column: int
    cell: float


def _coarser(plan: Plan, tile: Tile) -> _Coarser | None:
    place = plan.levels.index(tile.level)
    if place == 0:
        return None
    level = plan.levels[place - 1]
    top, left, rows, columns = tile.window
    r0, c0 = max(0, top // 2 - _HORIZON), max(0, left // 2 - _HORIZON)
    r1 = min(level.rows, -(-(top + rows) // 2) + _HORIZON)
    c1 = min(level.columns, -(-(left + columns) // 2) + _HORIZON)
    mosaic = Mosaic(plan.scratch, level, tile.core, tile.overlap)
    surface = mosaic.blend("height", r0, c0, r1 - r0, c1 - c0, tolerance=2 * level.step)
    return _Coarser(surface, r0, c0, level.cell)


def _from_coarser(plan: Plan, tile: Tile, coarser: _Coarser, border: int) -> _Window:
    """Return a window whose base is the coarser surface, and whose band is wide where that has steps."""
    top, left, rows, columns = tile.window
    step = tile.level.step
    smooth = cv2.medianBlur(coarser.surface, 3)
    kernel = np.ones((_NEIGHBOURS, _NEIGHBOURS), np.uint8)
    lowest, highest = cv2.erode(coarser.surface, kernel), cv2.dilate(coarser.surface, kernel)
    # Cell centres: fine cell i lies at (i + 0.5) / 2 - 0.5 among the coarse ones.
    x = ((np.arange(left - border, left + columns + border) + 0.5) / 2 - 0.5 - coarser.column).astype(np.float32)
    y = ((np.arange(top - border, top + rows + border) + 0.5) / 2 - 0.5 - coarser.row).astype(np.float32)
    grid_x, grid_y = np.meshgrid(x, y)
    base = cv2.remap(smooth, grid_x, grid_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    inner = slice(border, -border), slice(border, -border)
    nearest = np.rint(grid_y[inner]).astype(int), np.rint(grid_x[inner]).astype(int)
    nearest = (nearest[0].clip(0, lowest.shape[0] - 1), nearest[1].clip(0, lowest.shape[1] - 1))
    middle = base[inner]
    first = np.floor((lowest[nearest] - middle) / step).astype(np.int32) - BAND
    last = np.ceil((highest[nearest] - middle) / step).astype(np.int32) + BAND
    first = np.maximum(first, -_MOST_BAND // 2)
    last = np.minimum(last, _MOST_BAND // 2)
    return _Window(0, 0, tile.level.cell, border, base, first, last - first + 1)


def _open(plan: Plan, tile: Tile, view: TileView, coarser: _Coarser | None, west: float, north: float) -> NDArray[np.bool_]:
    """Tell which of the window's cells the coarser surface does not hide from a view; all of them on the coarsest level."""
    top, left, rows, columns = tile.window
    if coarser is None:
        return np.ones((rows, columns), np.bool_)
    west = west + (coarser.column * 2 - left) * tile.level.cell
    north = north - (coarser.row * 2 - top) * tile.level.cell
    step = 2 * tile.level.step
    free = _unhidden(view, coarser.surface, coarser.cell, west, north, step)
    r = (top + np.arange(rows)) // 2 - coarser.row
    c = (left + np.arange(columns)) // 2 - coarser.column
    return free[np.minimum(r, free.shape[0] - 1)[:, None], np.minimum(c, free.shape[1] - 1)[None, :]]


def _unhidden(view: TileView, surface: Floats, cell: float, west: float, north: float, step: float) -> NDArray[np.bool_]:
    # Two steps are noise, and one cell sideways is the blur of an edge.
    return visible(surface, cell, west, north, view.centre, 2 * step + cell, float(surface.max()))


@dataclass(frozen=True)
class _Crop:
    pixels: Floats
    corner: tuple[float, float, float]


def _reduction(view: TileView, west: float, north: float, cell: float) -> int:
    """Return the level of a photograph whose pixel comes closest to the cell, rather finer than coarser."""
    pixel = float(view.ground_pixel(np.zeros((1, 3)))[0])
    return int(np.clip(np.floor(np.log2(max(cell / pixel, 1e-3)) + 0.4), 0, COARSEST))


def _crops(plan: Plan, window: _Window, views: list[TileView], cell: float, step: float) -> list[_Crop]:
    """Return the part of each photograph that any hypothesis of the window falls on, grey."""
    low = window.inner + window.first * step
    high = low + window.count * step
    out = []
    for view in views:
        level = _reduction(view, window.west, window.north, cell)
        picture = _pictures.get(plan.paths[view.index], level)
        box = _pixel_box(view, window.west, window.north, cell, float(low.min()), float(high.max()), low.shape)
        out.append(_crop(picture, 0.5**level, box))
    return out


def _pixel_box(
    view: TileView, west: float, north: float, cell: float, low: float, high: float, shape: tuple[int, ...]
) -> tuple[float, float, float, float]:
    """Return the full-size pixels (left, top, right, bottom) that the volume between two heights falls on."""
    x = west + np.linspace(-8, shape[1] + 8, 17) * cell
    y = north - np.linspace(-8, shape[0] + 8, 17) * cell
    xyz = np.stack(np.meshgrid(x, y, [low, high]), axis=-1).reshape(-1, 3)
    ray = xyz @ view.matrix[:, :3].T + view.matrix[:, 3]
    ray = ray[ray[:, 2] > 0]
    uv = ray[:, :2] / ray[:, 2:]
    # Without distortion, then widened: a box need only be large enough.
    pixels = uv * view.brown[:2] + view.brown[2:4]
    r2 = (uv**2).sum(axis=1)
    bend = np.abs(view.brown[[4, 5, 8]] @ np.stack([r2, r2**2, r2**3])) + np.abs(view.brown[9:12]).sum()
    slack = 8 + float(np.minimum(np.max(bend * np.sqrt(r2)) * view.brown[0], 0.5 * view.size.max()))
    pixels = np.clip(pixels, -slack, view.size + slack)
    left, top = pixels.min(axis=0) - slack
    right, bottom = pixels.max(axis=0) + slack
    return float(left), float(top), float(right), float(bottom)


def _crop(picture: NDArray[np.uint8], scale: float, box: tuple[float, float, float, float]) -> _Crop:
    rows, columns = picture.shape[:2]
    left, top = (int(np.clip(np.floor(v * scale), 0, n - 2)) for v, n in zip(box[:2], (columns, rows), strict=True))
    right, bottom = (int(np.ceil(v * scale)) for v in box[2:])
    right, bottom = int(np.clip(right, left + 2, columns)), int(np.clip(bottom, top + 2, rows))
    return _Crop(grey(picture[top:bottom, left:right]), (scale, float(left), float(top)))


def _colour(
    plan: Plan, tile: Tile, views: list[TileView], coarser: _Coarser | None, height: Floats, west: float, north: float
) -> NDArray[np.uint8]:
    """Return the tile's orthophoto (rows, columns, 4), painted from all photographs that see it."""
    cell, step = tile.level.cell, tile.level.step
    layers = []
    for view in views:
        if not view.inside(west, north, cell, height).any():
            continue
        free = _open(plan, tile, view, coarser, west, north) & _unhidden(view, height, cell, west, north, step)
        level = _reduction(view, west, north, cell)
        layers.append((view, free, plan.paths[view.index], level))
    return paint(layers, _pictures, height, west, north, cell)
