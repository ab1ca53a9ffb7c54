"""Heights of a model along a line, with the cells that each was taken from, so that noise which samples share is counted once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj import CRS

from ..errors import InputError
from ..frames import transformer
from .epocherror import EpochError
from .heights import Heights
from .terms import Moments, height_terms
from .transects import Transect
from .uncertainty import SAMPLE, correlated_variance
from .volumes import Parts

Array = NDArray[np.float64]
_READ = 4_000_000  # cells read at once: 32 MB
_SNAP = 1e-6  # cells
_LACKING, _CAREFUL = 0.05, 0.95  # as for zones: few nodes may lack a sigma, and get this quantile of the others
_SEED = 20150


@dataclass(frozen=True)
class Line:
    """Nodes (n,) of a transect at one date: distance (m), place, height (NaN: gap), sigma of a cell (NaN: not known).

    A height is the sum of ``weights`` (n, q) times the heights of ``cells`` (n, q), numbered in the model's own raster.
    """

    distance: Array
    place: Array
    height: Array
    sigma: Array
    cells: NDArray[np.int64]
    weights: Array


def sample_line(model: Heights, crs: str, transect: Transect, distance: Array, spacing: float) -> Line:
    """Return the heights of ``model`` at the nodes: bilinear, the mean over ``spacing`` along the line where cells are finer.

    A node has a height when at least half of its samples lie between four cells that have one.
    """
    length = transect.length
    k = max(1, int(np.ceil(spacing / model.cell - 1e-6)))
    reach = np.minimum(spacing / 2, np.minimum(distance, length - distance))  # even about the node, so that slopes do not bias
    offsets = ((np.arange(k) + 0.5) / k * 2.0 - 1.0)[None, :] * reach[:, None]
    xy = transect.at((distance[:, None] + offsets).ravel())
    cells, weights, height = _bilinear(model, crs, xy)
    good = np.isfinite(height).reshape(-1, k)
    enough = 2 * good.sum(axis=1) >= k
    share = np.where(good, 1.0, 0.0) / np.maximum(good.sum(axis=1, keepdims=True), 1)
    mean = (share * np.where(good, height.reshape(-1, k), 0.0)).sum(axis=1)
    weights = (weights.reshape(-1, k, 4) * share[:, :, None]).reshape(len(distance), 4 * k)
    nodes = transect.at(distance)
    nothing = np.full(len(distance), np.nan)
    return Line(distance, nodes, np.where(enough, mean, np.nan), nothing, cells.reshape(len(distance), 4 * k), weights)


def join(lines: list[Line]) -> Line:
    """Return the nodes of several lines of one date as one; no segment joins them."""
    width = max(line.cells.shape[1] for line in lines)
    padded = [((0, 0), (0, width - line.cells.shape[1])) for line in lines]
    return Line(
        np.concatenate([line.distance for line in lines]),
        np.concatenate([line.place for line in lines]),
        np.concatenate([line.height for line in lines]),
        np.concatenate([line.sigma for line in lines]),
        np.concatenate([np.pad(line.cells, pad) for line, pad in zip(lines, padded, strict=True)]),
        np.concatenate([np.pad(line.weights, pad) for line, pad in zip(lines, padded, strict=True)]),
    )


def weighted_sigma(line: Line, weight: Array, error: EpochError) -> Parts:
    """Return the sigmas of sum ``weight`` (n,) times height: random, correlated and systematic; None: not known."""
    used = weight != 0
    total = float(weight[used].sum())
    if not used.any():
        return Parts(0.0, 0.0, 0.0)
    sigma, place, height = line.sigma[used], line.place[used], line.height[used]
    lacking = ~np.isfinite(sigma)
    random = correlated = None
    if lacking.mean() < _LACKING and error.model.random is not None:
        sigma = np.where(lacking, np.quantile(sigma[~lacking], _CAREFUL), sigma)
        part = weight[used] * sigma
        cells, index = np.unique(line.cells[used], return_inverse=True)
        per_cell = np.bincount(index.ravel(), (part[:, None] * line.weights[used]).ravel(), len(cells))
        random = error.model.random * float(np.sqrt(per_cell @ per_cell))
        if error.model.structures is not None:
            nodes = np.column_stack([place, part])
            if len(nodes) > SAMPLE:
                nodes = nodes[np.random.default_rng(_SEED).choice(len(nodes), SAMPLE, replace=False)]
            squares = float(part @ part)
            correlated = float(
                np.sqrt(sum(f**2 * correlated_variance(nodes, len(part), squares, r) for f, r in error.model.structures))
            )
    origin = (float(place[0, 0]), float(place[0, 1]), 0.0)
    means = weight[used] @ height_terms(place[:, 0], place[:, 1], height, origin) / total
    shared = error.systematic.sigma(Moments(origin, tuple(means.tolist())))
    return Parts(random, correlated, None if shared is None else abs(total) * shared)


def _bilinear(model: Heights, crs: str, xy: Array) -> tuple[NDArray[np.int64], Array, Array]:
    """Return cells (n, 4), weights (n, 4) and heights (n,) at places in ``crs``."""
    if not CRS.from_wkt(crs).equals(CRS.from_wkt(model.units.crs), ignore_axis_order=True):
        xy = np.column_stack(transformer(crs, model.units.crs).transform(xy[:, 0], xy[:, 1]))
        if not np.isfinite(xy).all():
            raise InputError(f"TRANSECTS leave the area where the CRS of {model.label} is defined: check both CRS.")
    a, b, c, d, e, f = model.transform
    x, y, det = xy[:, 0] - c, xy[:, 1] - f, a * e - b * d
    column, row = (e * x - b * y) / det - 0.5, (a * y - d * x) / det - 0.5
    width, height = model.file.width, model.file.height
    left, top = np.floor(column + _SNAP), np.floor(row + _SNAP)
    fx, fy = np.clip(column - left, 0.0, 1.0), np.clip(row - top, 0.0, 1.0)
    fx[fx < _SNAP], fy[fy < _SNAP] = 0.0, 0.0
    inside = (left >= 0) & (top >= 0) & (left + (fx > 0) < width) & (top + (fy > 0) < height)
    values = np.full(len(xy), np.nan)
    cells = np.zeros((len(xy), 4), np.int64)
    weights = np.zeros((len(xy), 4))
    order = np.nonzero(inside)[0]
    if not len(order):
        return cells, weights, values
    left, top = left.astype(np.int64), top.astype(np.int64)
    right, bottom = left + (fx > 0), top + (fy > 0)
    cells[order] = np.stack([top * width + left, top * width + right, bottom * width + left, bottom * width + right], 1)[order]
    weights[order] = np.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy], 1)[order]
    pieces = [order]
    while pieces:
        piece = pieces.pop()
        c0, r0, c1, r1 = left[piece].min(), top[piece].min(), right[piece].max() + 1, bottom[piece].max() + 1
        if (c1 - c0) * (r1 - r0) > _READ and len(piece) > 1:
            pieces += [piece[: len(piece) // 2], piece[len(piece) // 2 :]]
            continue
        block = model.read(int(c0), int(r0), int(c1 - c0), int(r1 - r0))
        corners = [block[v[piece] - r0, h[piece] - c0] for v, h in ((top, left), (top, right), (bottom, left), (bottom, right))]
        values[piece] = (np.stack(corners, 1) * weights[piece]).sum(axis=1)
    return cells, weights, values


def hidden(line: Line, ignore: list[object]) -> NDArray[np.bool_]:
    """Return which nodes (n,) lie in polygons to ignore."""
    points = shapely.points(line.place)
    mask = np.zeros(len(points), np.bool_)
    for shape in ignore:
        shapely.prepare(shape)
        mask |= shapely.intersects(shape, points)
    return mask
