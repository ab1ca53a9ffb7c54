"""The surface of one tile at one level: band, correlation, regularisation, and what can be believed."""

from __future__ import annotations

from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from .bands import Band, Coarser, Place, band_about, band_on_trend, coarser_surface, unhidden, unhidden_by
from .correlation import fill_costs
from .crops import cut, reduction
from .mosaic import Tile, save
from .ortho import Layer, paint
from .pictures import Pictures
from .plan import Plan
from .regularisation import refine, regularise
from .reliability import believable, matching_sigma
from .views import TileView, choose, tile_views

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

MOST_VIEWS = 8
SMALL, LARGE = 2, 4  # half sizes of the two windows that an adaptive one is mixed of
NOISE = 0.5  # variance in 8-bit grey levels under which texture counts as noise: a JPEG's rounding and its sensor's rest
KNEE = 24.0  # times the noise: where the small and the large window count alike
REFINE = 3  # half steps on either side of the regularised surface in which its last refinement searches
P_SMALL, P_LARGE = 0.02, 1.0  # penalties at REGULARITY 1 for a change of one step, and for a jump

_pictures = Pictures()  # one cache per process: tiles that follow each other share photographs


def match_tile(plan: Plan, tile: Tile) -> None:
    """Compute a tile and save it in the plan's scratch folder, unless it is there already.

    Layers: ``height`` (m above the plan's datum; the regularised surface everywhere), and on the finest level ``score``,
    ``sigma`` (m), ``views`` (photographs that see the cell), ``covered`` (it lies in two frames, hidden or not), ``good`` (what
    can be believed) and ``colour``.
    """
    path = tile.path(plan.scratch)
    if path.is_file():
        return
    level, cell = tile.level, tile.level.cell
    place = Place.of(plan, tile)
    small, large = (plan.window // 2, plan.window // 2) if plan.window else (SMALL, LARGE)
    everyone = tile_views(plan.views, plan.frame, place.origin, place.reach)
    coarser = coarser_surface(plan, tile)
    band = band_about(coarser, tile, large) if coarser else band_on_trend(plan, tile, large)
    base = band.inner
    every = max(1, -(-max(base.shape) // 24))
    lattice = np.ascontiguousarray(base[every // 2 :: every, every // 2 :: every])
    views = choose(everyone, place.west, place.north, cell * every, lattice, MOST_VIEWS)
    seen = np.ones((len(views), *base.shape), bool)
    for n, view in enumerate(views):
        if coarser:
            seen[n] = unhidden_by(coarser, view, tile, place) & _framed(view, place, cell, band, level.step)
        else:
            seen[n] = _somewhere_framed(view, place, cell, band, level.step)
    costs = _costs(plan, views, seen, band, place, cell, level.step, small, large)
    height, doubt = regularise(
        costs,
        band.offset,
        band.first,
        band.count,
        base,
        step=level.step,
        small=P_SMALL * plan.regularity,
        large=P_LARGE * plan.regularity,
    )
    # Noise below a step is smoothed over less than the window; steps stay.
    height = cv2.bilateralFilter(height, 5, level.step, 1.5)
    if level.number > 0:
        save(path, height=height)
        return
    around = np.pad(height, large, mode="edge")
    near = Band(large, around, np.full(base.shape, -REFINE, np.int32), np.full(base.shape, 2 * REFINE + 1, np.int32))
    held = np.array([_framed(view, place, cell, near, 0.5 * level.step) for view in views], bool).reshape(seen.shape)
    costs = _costs(plan, views, seen & held, near, place, cell, 0.5 * level.step, small, large)
    correction, score, curvature = refine(costs.reshape(*base.shape, -1), 0.5 * level.step)
    height = cv2.bilateralFilter(height + correction, 5, level.step, 1.5)
    calm = cv2.medianBlur(height, 5)  # what hides is not the noise of single cells
    framed = np.array([view.inside(place.west, place.north, cell, height) for view in views], bool).reshape(seen.shape)
    for n, view in enumerate(views):
        seen[n] &= framed[n] & unhidden(view, calm, cell, place, level.step)
    number = seen.sum(axis=0).astype(np.uint8)
    cells = (2 * large + 1) ** 2
    # A camera's noise is alike over about two pixels (its colours are interpolated): finer cells are not independent.
    independent = cells * min(1.0, cell / (2.0 * plan.gsd)) ** 2
    sigma = matching_sigma(score, curvature, number, independent, level.step)
    save(
        path,
        height=height,
        score=score,
        sigma=sigma,
        views=number,
        covered=framed.sum(axis=0) >= 2,
        good=believable(height, score, sigma, number, doubt, cells, level.step),
        colour=_colour(plan, tile, place, everyone, coarser, calm),
    )


def _framed(view: TileView, place: Place, cell: float, band: Band, step: float) -> Mask:
    """Tell at which cells a view shows the whole window at every hypothesis.

    A view that left the frame between two hypotheses would change their scores by its absence alone, and pull the height there.
    """
    base = band.inner
    low = (base + band.first * step).astype(np.float32)
    high = (base + (band.first + band.count) * step).astype(np.float32)
    whole = view.inside(place.west, place.north, cell, low) & view.inside(place.west, place.north, cell, high)
    side = 2 * band.border + 1
    return np.asarray(cv2.erode(whole.astype(np.uint8), np.ones((side, side), np.uint8)) > 0)


def _somewhere_framed(view: TileView, place: Place, cell: float, band: Band, step: float) -> Mask:
    """Tell at which cells a view may show something at some hypothesis; the others need not be looked at."""
    base, seen = band.inner, np.zeros(band.first.shape, bool)
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        height = (base + (band.first + share * band.count) * step).astype(np.float32)
        seen |= view.inside(place.west, place.north, cell, height)
    return np.asarray(cv2.dilate(seen.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)


def _costs(
    plan: Plan, views: list[TileView], seen: Mask, band: Band, place: Place, cell: float, step: float, small: int, large: int
) -> Floats:
    """Return the costs of all hypotheses; 1, that of no correlation, where two views are missing."""
    costs = np.ones(int(band.count.sum(dtype=np.int64)), np.float32)
    if len(views) < 2:
        return costs
    crops = cut(plan, _pictures, views, band, place, cell, step)
    fill_costs(
        crops.pixels,
        crops.starts,
        crops.shapes,
        crops.corners,
        np.array([v.matrix for v in views]),
        np.array([v.brown for v in views]),
        np.array([v.fold2 for v in views]),
        place.west - large * cell,
        place.north + large * cell,
        cell,
        band.base,
        step,
        band.first,
        band.count,
        band.offset,
        seen,
        small,
        large,
        NOISE,
        KNEE if large > small else 0.0,
        costs,
    )
    return costs


def _colour(
    plan: Plan, tile: Tile, place: Place, views: list[TileView], coarser: Coarser | None, surface: Floats
) -> NDArray[np.uint16]:
    """Return the tile's orthophoto (rows, columns, 4; 16 bits), painted from the photographs that look at it."""
    cell, step = tile.level.cell, tile.level.step

    def unhidden_from(view: TileView) -> Mask:
        free = unhidden(view, surface, cell, place, step)
        return free & unhidden_by(coarser, view, tile, place) if coarser else free

    layers = [
        Layer(
            view,
            partial(unhidden_from, view),
            plan.paths[view.index],
            reduction(view, cell),
            plan.balance.gain[view.index],
            plan.balance.fall,
        )
        for view in views
    ]
    return paint(layers, _pictures, surface, place.west, place.north, cell)
