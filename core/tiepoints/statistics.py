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
    rays = np.zeros(int(track.max(initial=-1)) + 1, np.int64)
    seen = np.unique(np.stack([track, photograph]), axis=1)
    np.add.at(rays, seen[0], 1)
    multi = rays[track] >= 3
    rows = []
    for i in range(count):
        mine = photograph == i
        good = mine & kept
        rms = float(np.sqrt(np.mean(residual[good] ** 2))) if good.any() else None
        rows.append(
            PhotographStatistics(int(mine.sum()), int(good.sum()), int((mine & multi).sum()), int((good & multi).sum()), rms)
        )
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


def weakest_link(photograph: NDArray[np.integer], track: NDArray[np.integer], count: int) -> tuple[int, list[int]] | None:
    """Return how many points hold the block together where it is weakest, and the smaller of the two parts they join.

    ``photograph`` and ``track`` (n,) are observations of ``count`` photographs. A link are the points of three or more rays that
    two photographs share; the block is held by the strongest links that reach all of it (a maximum spanning tree), and the
    weakest of those is returned. None for fewer than three photographs, and 0 points when no link joins the parts.
    """
    if count < 3:
        return None
    seen = np.unique(np.stack([track, photograph]), axis=1)
    rays = np.bincount(seen[0], minlength=1)
    seen = seen[:, rays[seen[0]] >= 3]
    incidence = coo_array((np.ones(seen.shape[1]), (seen[1], seen[0])), shape=(count, int(track.max(initial=0)) + 1)).tocsr()
    shared = (incidence @ incidence.T).toarray()
    np.fill_diagonal(shared, 0)
    # scipy finds minimum trees of positive weights.
    tree = minimum_spanning_tree(coo_array(np.where(shared > 0, 1.0 / np.maximum(shared, 1), 0.0))).tocoo()
    points = 0
    if tree.nnz == count - 1:
        worst = int(tree.data.argmax())
        points = int(shared[tree.row[worst], tree.col[worst]])
        tree.data[worst] = 0.0
        tree.eliminate_zeros()
    _, part = connected_components(tree, directed=False)
    smallest = min(range(int(part.max()) + 1), key=lambda k: (int((part == k).sum()), k))
    return points, np.flatnonzero(part == smallest).tolist()


def coverage_percent(xy: NDArray[np.floating], width: int, height: int) -> float:
    """Return the percentage of a photograph's 10 x 10 cells that hold one or more of the points (n, 2)."""
    column = np.clip(np.asarray(xy)[:, 0] * CELLS / width, 0, CELLS - 1).astype(np.int64)
    row = np.clip(np.asarray(xy)[:, 1] * CELLS / height, 0, CELLS - 1).astype(np.int64)
    return 100.0 * len(np.unique(row * CELLS + column)) / CELLS**2
