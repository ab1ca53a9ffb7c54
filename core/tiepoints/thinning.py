"""Fewer matches for a first, quick mapping: the longest tracks, spread over every photograph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .features import spread
from .pairs import Pair

_KEPT = 200  # matches that every pair keeps, those of its longest tracks, or all it has


def thinned(
    pairs: Mapping[Pair, NDArray[np.int32]], xy: Sequence[NDArray[np.float32]], sizes: Sequence[tuple[int, int]], count: int
) -> dict[Pair, NDArray[np.int32]]:
    """Return matches of which every photograph keeps about ``count`` or more, those of its longest tracks in each place.

    ``pairs`` maps two photographs to their matches (m, 2), ``xy`` are the features' places, ``sizes`` width and height. A track
    is what matches join, through any number of photographs.
    """
    starts = np.concatenate([[0], np.cumsum([len(points) for points in xy])])
    joined = [m + [starts[i], starts[j]] for (i, j), m in pairs.items()]
    ties = np.concatenate(joined) if joined else np.zeros((0, 2), np.int64)
    graph = coo_array((np.ones(len(ties), np.int8), (ties[:, 0], ties[:, 1])), shape=(starts[-1], starts[-1]))
    _, track = connected_components(graph, directed=False)
    length = np.bincount(track)
    chosen = np.zeros(len(length), bool)
    for i, points in enumerate(xy):
        mine = track[starts[i] : starts[i + 1]]
        tied = np.flatnonzero(length[mine] > 1)
        best = spread(points[tied], length[mine[tied]].astype(np.float32), sizes[i], count)
        chosen[mine[tied[best]]] = True
    for (i, _), matches in pairs.items():
        # Where a few photographs alone join two parts of the block, their small common corner must not be thinned out.
        mine = track[matches[:, 0] + starts[i]]
        if chosen[mine].sum() < _KEPT:
            chosen[mine[np.argsort(-length[mine], kind="stable")[:_KEPT]]] = True
    result = {}
    for (i, j), matches in pairs.items():
        keep = chosen[track[matches[:, 0] + starts[i]]]
        if keep.any():
            result[i, j] = matches[keep]
    return result
