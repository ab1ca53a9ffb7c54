"""Contours of a surface at one height, tile by tile, and the slope of the ground along them.

The surface between four cell centres is crossed by straight lines between the places where its sides pass through the height
(marching squares; Lorensen & Cline 1987 in the plane). A side gives the same place from both of its squares, so that pieces join
exactly. Where one of the four has no height there is no contour.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..raster import Grid
from .coregistration import robust_fit

Array = NDArray[np.float64]
_MOST = 400  # cells of a window that a plane is fitted to
_LEAST = 6


def segments(heights: Array, level: float, row: int, column: int) -> Array:
    """Return the contour's pieces (n, 2, 2) as column, row (centres at whole numbers) of heights (rows, columns).

    ``row`` and ``column`` are those of the first cell.
    """
    with np.errstate(invalid="ignore"):
        a, b, c, d = heights[:-1, :-1], heights[:-1, 1:], heights[1:, 1:], heights[1:, :-1]  # clockwise from north-west
        known = np.isfinite(a + b + c + d)
        high = [corner >= level for corner in (a, b, c, d)]
    cut = [known & (high[i] != high[(i + 1) % 4]) for i in range(4)]  # north, east, south, west
    number = np.sum(cut, axis=0)
    rows, columns = np.nonzero(number > 0)
    if not len(rows):
        return np.empty((0, 2, 2))
    corners = [v[rows, columns] for v in (a, b, c, d)]
    r, k = rows + row, columns + column
    # Each side from its western or northern end, so that both squares compute the same place.
    with np.errstate(invalid="ignore", divide="ignore"):
        share = [_share(corners[i], corners[j], level) for i, j in ((0, 1), (1, 2), (3, 2), (0, 3))]
    places = [
        np.column_stack([k + share[0], r]),
        np.column_stack([k + 1.0 + 0 * share[1], r + share[1]]),
        np.column_stack([k + share[2], r + 1.0 + 0 * share[2]]),
        np.column_stack([k + 0 * share[3], r + share[3]]),
    ]
    sides = np.stack(places, axis=1)
    crossed = np.stack([one[rows, columns] for one in cut], axis=1)
    two = crossed.sum(axis=1) == 2
    pairs = np.argsort(~crossed[two], axis=1, kind="stable")[:, :2]
    index = np.arange(int(two.sum()))
    found = [np.stack([sides[two][index, pairs[:, 0]], sides[two][index, pairs[:, 1]]], axis=1)]
    if not two.all():
        # A saddle: the middle tells which of the two ridges goes through.
        middle = sum(corner[~two] for corner in corners) / 4.0 >= level
        through = (corners[0][~two] >= level) == middle
        north, east, south, west = (sides[~two][:, i] for i in range(4))
        found.append(np.stack([north, np.where(through[:, None], east, west)], axis=1))
        found.append(np.stack([south, np.where(through[:, None], west, east)], axis=1))
    pieces = np.concatenate(found)
    return np.asarray(pieces[np.any(pieces[:, 0] != pieces[:, 1], axis=1)])


def joined(pieces: Array, grid: Grid) -> list[Any]:
    """Return the lines that the pieces (n, 2, 2; column, row) of a grid make, in its CRS."""
    if not len(pieces):
        return []
    places = pieces.reshape(-1, 2)
    xy = np.column_stack(grid.centres(places[:, 1], places[:, 0])).reshape(-1, 2, 2)
    merged = shapely.line_merge(shapely.multilinestrings(shapely.linestrings(xy)))
    return list(shapely.get_parts(merged))


def slope_at(heights: Array, window: Grid, x: float, y: float, scale: float) -> tuple[float, float] | None:
    """Return the slope to the east and to the north of a robust plane through the cells within half of ``scale`` (m) of a place.

    None when fewer than six have a height.
    """
    rows, columns = np.nonzero(np.isfinite(heights))
    east, north = window.centres(rows, columns)
    near = np.nonzero(np.hypot(east - x, north - y) <= scale / 2)[0]
    if len(near) < _LEAST:
        return None
    near = near[:: max(1, len(near) // _MOST)]
    design = np.column_stack([np.ones(len(near)), east[near] - x, north[near] - y])
    _, to_east, to_north = robust_fit(design, heights[rows[near], columns[near]]).tolist()
    return to_east, to_north


def _share(first: Array, second: Array, level: float) -> Array:
    return np.clip((level - first) / (second - first), 0.0, 1.0)
