"""The orthophoto: each cell's colour from the photographs that look down on it most steeply.

Three things keep it free of seams and ghosts. Photographs are brought to one brightness first (``exposure``). A photograph that
shows a place unlike most others, because something moved or stands in the way, steps back there (``_votes``). And colours are
parted in two bands (Burt and Adelson 1983): the broad one passes from photograph to photograph over metres, where it cannot show
a ghost, and the fine one over a few cells, where it cannot show a seam.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numba as nb
import numpy as np
from numpy.typing import NDArray

from .pictures import Pictures
from .sampling import project
from .views import TileView

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

WHITE = 65535
# Views that lean this much more (tangent) than the steepest weigh a third, in the fine band and in the broad one.
_FINE, _BROAD = 0.01, 0.08
_FURTHEST = 8.0 * _BROAD  # of leaning more than the steepest: beyond, a view takes no part
_HIDDEN = 100.0  # added to the lean of a view that something hides the cell from
_TAPER = 0.06  # share of the frame over which a photograph fades out towards its edge
_SQUARE = 9  # cells of the mean, taken twice, that parts the bands; less than tiles overlap
_ALIKE = 0.03  # of white: what broad colours of one place differ by in the photographs, by noise and by the light's direction
_OUTVOTED = 1.0  # added to the lean of a view that no other agrees with where others agree
_RATHER = 1e-3  # weight in broad colours of what is hidden: it counts where nothing else is there
_MOST = 16  # views of a tile


@dataclass(frozen=True)
class Layer:
    """A photograph over a tile: where nothing ``hides`` the surface from it (called when needed), its file, its reduction.

    ``gain`` and ``fall`` are the photograph's of ``Balance``: (3,) and (3, 2).
    """

    view: TileView
    unhidden: Callable[[], NDArray[np.bool_]]
    path: str
    reduction: int
    gain: Array
    fall: Array


@nb.njit(cache=True, error_model="numpy")
def _lean(
    size: Array, matrix: Array, brown: Array, fold2: float, centre: Array, west: float, north: float, cell: float,
    height: Floats, lean: Floats, fade: Floats,
) -> None:  # fmt: skip
    """Write how far the rays lean (tangent; NaN where not seen) and how far from the frame's edge (0..1) they fall."""
    rows, columns = height.shape
    for r in range(rows):
        y = north - (r + 0.5) * cell
        for c in range(columns):
            x, z = west + (c + 0.5) * cell, height[r, c]
            px, py = project(matrix, brown, fold2, x, y, z)
            lean[r, c] = np.nan
            if not (px >= 1.0 and py >= 1.0 and px <= size[0] - 1.0 and py <= size[1] - 1.0):
                continue
            up = centre[2] - z
            if up <= 0.0:
                continue
            lean[r, c] = np.sqrt((centre[0] - x) ** 2 + (centre[1] - y) ** 2) / up
            edge = min(min(px, size[0] - px) / size[0], min(py, size[1] - py) / size[1])
            fade[r, c] = min(edge / _TAPER, 1.0)


@nb.njit(cache=True, error_model="numpy")
def _take(
    picture: NDArray[Any], scale: float, white: float, size: Array, matrix: Array, brown: Array, fold2: float,
    gain: Array, fall: Array, west: float, north: float, cell: float, height: Floats, where: NDArray[np.bool_], out: Floats,
) -> None:  # fmt: skip
    """Write a photograph's balanced colours (bilinear; 0..1) to ``out`` (rows, columns, 3), 0 where not ``where``."""
    rows, columns = height.shape
    last_row, last_column = picture.shape[0] - 1, picture.shape[1] - 1
    corner2 = 0.25 * (size[0] ** 2 + size[1] ** 2)
    for r in range(rows):
        for c in range(columns):
            if not where[r, c]:
                out[r, c, 0] = out[r, c, 1] = out[r, c, 2] = 0.0
                continue
            px, py = project(matrix, brown, fold2, west + (c + 0.5) * cell, north - (r + 0.5) * cell, height[r, c])
            r2 = ((px - 0.5 * size[0]) ** 2 + (py - 0.5 * size[1]) ** 2) / corner2
            px = min(max(px * scale - 0.5, 0.0), last_column - 0.001)
            py = min(max(py * scale - 0.5, 0.0), last_row - 0.001)
            j, i = int(px), int(py)
            fx, fy = np.float32(px - j), np.float32(py - i)
            for b in range(3):
                upper = picture[i, j, b] * (1 - fx) + picture[i, j + 1, b] * fx
                lower = picture[i + 1, j, b] * (1 - fx) + picture[i + 1, j + 1, b] * fx
                even = np.exp(-(gain[b] + r2 * (fall[b, 0] + r2 * fall[b, 1])))
                out[r, c, b] = (upper * (1 - fy) + lower * fy) * even / white


@nb.njit(cache=True, error_model="numpy")
def _votes(broad: Floats, lean: Floats) -> None:
    """Add to ``lean`` (views, rows, columns) what views are set back by that disagree with most in ``broad`` (the same shape).

    Each view counts how many others have its grey at the place; who has fewer than the most is set back by a share of
    ``_OUTVOTED``. Of two views that disagree none is, so that the steeper one paints.
    """
    views, rows, columns = lean.shape
    count = np.empty(views)
    for r in range(rows):
        for c in range(columns):
            most, here = 0.0, 0
            for i in range(views):
                count[i] = 0.0
                if not lean[i, r, c] < _HIDDEN:
                    continue
                here += 1
                for j in range(views):
                    if lean[j, r, c] < _HIDDEN:
                        apart = (broad[i, r, c] - broad[j, r, c]) / _ALIKE
                        count[i] += 1.0 / (1.0 + apart * apart * apart * apart)
                most = max(most, count[i])
            if here < 3:
                continue
            for i in range(views):
                if lean[i, r, c] < _HIDDEN:
                    lean[i, r, c] += _OUTVOTED * (most - count[i]) / max(most - 1.0, 1.0)


def paint(
    layers: Sequence[Layer], pictures: Pictures, height: Floats, west: float, north: float, cell: float
) -> NDArray[np.uint16]:
    """Return red, green, blue, alpha (rows, columns, 4; 0..65535) of the surface ``height``; alpha 0 where none sees it.

    Where every view is hidden the steepest still paints: a wrong shadow is better to look at than a hole.
    """
    shape = height.shape
    out = np.zeros((*shape, 4), np.uint16)
    layers, leans, fades = _facing(layers, height, west, north, cell)
    if not layers:
        return out
    grey, colours, broads, shares = np.zeros_like(leans), [], [], []
    for n, layer in enumerate(layers):
        view, picture = layer.view, pictures.colour(layer.path, layer.reduction)
        seen = leans[n] < _HIDDEN
        where = np.isfinite(leans[n])
        colour = np.empty((*shape, 3), np.float32)
        _take(
            picture, 0.5**layer.reduction, float(np.iinfo(picture.dtype).max), view.size, view.matrix, view.brown, view.fold2,
            layer.gain, layer.fall, west, north, cell, height, where, colour,
        )  # fmt: skip
        usable = np.where(seen, np.float32(1.0), np.where(where, np.float32(_RATHER), np.float32(0.0)))
        share = _mean(usable)
        broad = _mean(usable[..., None] * colour) / np.maximum(share, 1e-6)[..., None]
        grey[n] = broad.mean(axis=2)
        colours.append(colour)
        broads.append(broad)
        shares.append(share)
    _votes(grey, leans)
    steepest = np.fmin.reduce(leans, axis=0)
    fine, coarse = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    fine_total, coarse_total = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    for lean, fade, colour, broad, share in zip(leans, fades, colours, broads, shares, strict=True):
        more = np.where(np.isnan(lean), np.float32(1e3), lean - steepest)
        narrow = np.where(more < _FURTHEST, np.exp(-np.minimum(more / _FINE, 60.0)) * (fade + 1e-4), 0).astype(np.float32)
        # A mean over half a square only, beside what is hidden, is no colour of the place.
        wide = np.where(more < _FURTHEST, np.exp(-more / _BROAD) * (fade + 1e-4) * share**2, 0).astype(np.float32)
        fine += narrow[..., None] * (colour - broad)
        coarse += wide[..., None] * broad
        fine_total += narrow
        coarse_total += wide
    painted = (fine_total > 0) & (coarse_total > 0)
    colour = fine / np.maximum(fine_total, 1e-20)[..., None] + coarse / np.maximum(coarse_total, 1e-20)[..., None]
    out[..., :3] = np.where(painted[..., None], np.clip(np.rint(WHITE * colour), 0, WHITE), 0)
    out[..., 3] = np.where(painted, WHITE, 0)
    return out


def _facing(
    layers: Sequence[Layer], height: Floats, west: float, north: float, cell: float
) -> tuple[list[Layer], Floats, Floats]:
    """Return the layers that may paint something, with their leans (hidden cells lean more) and fades (layers, rows, columns)."""
    kept, leans, fades = [], [], []
    for layer in layers:
        lean, fade = np.empty(height.shape, np.float32), np.zeros(height.shape, np.float32)
        view = layer.view
        _lean(view.size, view.matrix, view.brown, view.fold2, view.centre, west, north, cell, height, lean, fade)
        if np.isfinite(lean).any():
            kept.append(layer)
            leans.append(lean)
            fades.append(fade)
    # The steepest views of the tile first: a view that lies behind ``_MOST`` others everywhere paints nothing.
    rank = np.argsort([float(np.nanmean(lean)) for lean in leans], kind="stable")
    steepest = np.full(height.shape, np.inf, np.float32)
    chosen: list[int] = []
    for n in rank:
        if len(chosen) < _MOST or (np.isfinite(leans[n]) & np.isinf(steepest)).any():
            free = _free(kept[n], leans[n], steepest)
            if free is None:
                continue
            leans[n] = np.where(free, leans[n], leans[n] + np.float32(_HIDDEN))
            steepest = np.fmin(steepest, np.where(free, leans[n], np.inf)).astype(np.float32)
            chosen.append(int(n))
    chosen.sort()
    empty = np.zeros((0, *height.shape), np.float32)
    return (
        [kept[n] for n in chosen],
        np.array([leans[n] for n in chosen], np.float32) if chosen else empty,
        np.array([fades[n] for n in chosen], np.float32) if chosen else empty,
    )


def _free(layer: Layer, lean: Floats, steepest: Floats) -> NDArray[np.bool_] | None:
    """Return where a layer is not hidden, None when it leans too much against unhidden ones to paint anywhere."""
    with np.errstate(invalid="ignore"):
        near = lean < steepest + np.float32(_FURTHEST)
    return layer.unhidden() if near.any() else None


def _mean(values: Floats) -> Floats:
    """Return the mean over squares, twice: over some ten cells, falling off to their edge."""
    size = _SQUARE, _SQUARE
    once = cv2.blur(values, size, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(cv2.blur(once, size, borderType=cv2.BORDER_REFLECT_101), np.float32)
