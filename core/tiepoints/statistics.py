"""MicMac's statistics of an orientation, and how tie points cover a photograph.

Per photograph MicMac's Apero prints ``n``, the points of the photograph that enter, ``p``, the percentage of them that are
kept, ``m``, those with three or more rays, and ``k``, the percentage of these that are kept (Rosu et al. 2015 tabulate their
means). Here
``n`` are the observations of the photograph that enter the final bundle adjustment, and kept those that survive its final
filter; rays are those that enter. MicMac weighs its residual (ER2); this one is not weighed: the root of the mean squared 2D
residual of the kept, in pixels of the stored photograph.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

CELLS = 10  # cells along each side of a photograph, whose share with a tie point is the coverage
MOST_RAYS = 8  # points of that many rays and more are told together


@dataclass(frozen=True)
class PhotographStatistics:
    """One photograph: observations that enter and are kept, those of points with three or more rays, root mean square (px)."""

    observations: int
    kept: int
    multi: int
    multi_kept: int
    rms: float | None


@dataclass(frozen=True)
class Statistics:
    """The means over photographs (percentages 0..100, None where nothing entered), and ``mse`` (px) over all that is kept."""

    photographs: tuple[PhotographStatistics, ...]
    mtp: float
    mtp_percent: float | None
    mmtp: float
    mmtp_percent: float | None
    mse: float | None


def micmac_statistics(
    photograph: NDArray[np.integer],
    track: NDArray[np.integer],
    residual: NDArray[np.float64],
    kept: NDArray[np.bool_],
    count: int,
) -> Statistics:
    """Return the statistics of observations (n,) of ``count`` photographs.

    ``photograph`` is the index of the photograph and ``track`` the number of the tie point of each observation; ``residual`` (px)
    is the length of its 2D residual, which is read where ``kept``. A photograph's two observations of one point are one ray.
    """
    multi = rays_per_point(photograph, track)[track] >= 3

    def number(where: NDArray[np.bool_]) -> list[int]:
        return np.bincount(photograph[where], minlength=count).tolist()

    squares = np.bincount(photograph[kept], weights=residual[kept] ** 2, minlength=count).tolist()
    rows = [
        PhotographStatistics(entering, left, many, many_left, float(np.sqrt(total / left)) if left else None)
        for entering, left, many, many_left, total in zip(
            number(np.ones(len(kept), bool)), number(kept), number(multi), number(multi & kept), squares, strict=True
        )
    ]
    shares = [100.0 * r.kept / r.observations for r in rows if r.observations]
    multi_shares = [100.0 * r.multi_kept / r.multi for r in rows if r.multi]
    return Statistics(
        tuple(rows),
        float(np.mean([r.observations for r in rows])) if rows else 0.0,
        float(np.mean(shares)) if shares else None,
        float(np.mean([r.multi for r in rows])) if rows else 0.0,
        float(np.mean(multi_shares)) if multi_shares else None,
        float(np.sqrt(np.mean(residual[kept] ** 2))) if kept.any() else None,
    )


def rays_per_point(photograph: NDArray[np.integer], track: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the rays of each point 0 .. max(track) of observations (n,); two observations in one photograph are one ray."""
    return np.bincount(_rays(photograph, track)[0], minlength=int(track.max(initial=-1)) + 1)


def ray_histograms(photograph: NDArray[np.integer], track: NDArray[np.integer], count: int) -> NDArray[np.int64]:
    """Return how many points of each photograph have how many rays, (count, MOST_RAYS + 1); the last column is MOST_RAYS or more.

    ``photograph`` and ``track`` (n,) are observations of ``count`` photographs; a point that one observes twice counts once.
    """
    points, photographs = _rays(photograph, track)
    rays = np.minimum(rays_per_point(photograph, track)[points], MOST_RAYS)
    width = MOST_RAYS + 1
    return np.bincount(photographs * width + rays, minlength=count * width).reshape(count, width)


def _rays(photograph: NDArray[np.integer], track: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return point and photograph of each ray, a pair once, sorted."""
    width = int(photograph.max(initial=0)) + 1
    keys = np.unique(track.astype(np.int64) * width + photograph)  # one number a pair sorts many times faster than two rows
    return keys // width, keys % width


def weakest_link(photograph: NDArray[np.integer], track: NDArray[np.integer], count: int) -> tuple[int, list[int]] | None:
    """Return how many points hold the block together where it is weakest, and the smaller of the two parts they join.

    ``photograph`` and ``track`` (n,) are observations of ``count`` photographs. A link are the points of three or more rays that
    two photographs share; the block is held by the strongest links that reach all of it (a maximum spanning tree), and the
    weakest of those is returned. None for fewer than three photographs, and 0 points when no link joins the parts.
    """
    if count < 3:
        return None
    points, photographs = _rays(photograph, track)
    many = rays_per_point(photograph, track)[points] >= 3
    ones, shape = np.ones(int(many.sum())), (count, int(track.max(initial=0)) + 1)
    incidence = coo_array((ones, (photographs[many], points[many])), shape=shape).tocsr()
    shared = (incidence @ incidence.T).toarray()
    np.fill_diagonal(shared, 0)
    # scipy finds minimum trees of positive weights.
    tree = minimum_spanning_tree(coo_array(np.where(shared > 0, 1.0 / np.maximum(shared, 1), 0.0))).tocoo()
    least = 0
    if tree.nnz == count - 1:
        worst = int(tree.data.argmax())
        least = int(shared[tree.row[worst], tree.col[worst]])
        tree.data[worst] = 0.0
        tree.eliminate_zeros()
    _, part = connected_components(tree, directed=False)
    smallest = min(range(int(part.max()) + 1), key=lambda k: (int((part == k).sum()), k))
    return least, np.flatnonzero(part == smallest).tolist()


def cell_counts(xy: NDArray[np.floating], width: int, height: int) -> NDArray[np.int64]:
    """Return how many of the points (n, 2) lie in each of a photograph's 10 x 10 cells, (rows, columns)."""
    place = np.asarray(xy, np.float64).reshape(-1, 2) * CELLS / [width, height]
    column, row = np.clip(place, 0, CELLS - 1).astype(np.int64).T
    return np.bincount(row * CELLS + column, minlength=CELLS**2).reshape(CELLS, CELLS)


def coverage_percent(xy: NDArray[np.floating], width: int, height: int) -> float:
    """Return the percentage of a photograph's 10 x 10 cells that hold one or more of the points (n, 2)."""
    return 100.0 * np.count_nonzero(cell_counts(xy, width, height)) / CELLS**2
