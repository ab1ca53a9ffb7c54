"""Pairs of photographs that look alike, for flights without positions: the largest features of all are searched at once.

Each of them votes for the photographs where its nearest neighbours lie. On sand, which looks alike all over, most neighbours
are strangers, all about equally near; so a neighbour's vote is how much nearer it is than the last one found (after Jegou,
Douze & Schmid 2011, Exploiting descriptor distances for precise image search). What one photograph costs grows with the
logarithm of their number.
"""

from __future__ import annotations

from collections.abc import Iterable, Set

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from ..progress import SILENT, Progress
from .features import Features, spread
from .pairs import Pair

_LARGEST = 400  # features of each photograph: 1,000 photographs take 0.6 GB with the trees; twice as many find hardly more
_NEAREST = 12  # neighbours of each, some of them in its own photograph
_KD_TREE = 1  # OpenCV's number of the algorithm
_TREES = 4  # randomised k-d trees (Silpa-Anan & Hartley 2008)
_CHECKS = 64  # features compared with each: finds as many pairs as all would


def largest(features: Features, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the descriptors (n, 128) of the largest features, spread over a photograph of ``size`` (width, height)."""
    return features.descriptors[spread(features.xy, features.scale, size, _LARGEST)]


def alike_pairs(descriptors: Iterable[NDArray[np.uint8]], known: Set[Pair], count: int, progress: Progress = SILENT) -> set[Pair]:
    """Return for each photograph the pairs (the smaller index first) with the ``count`` others most like it.

    ``descriptors`` (n, 128) are those of one photograph each, of which some may have none. Pairs in ``known`` are passed over,
    and do not count.
    """
    votes = _votes(list(descriptors), progress)
    pairs = set()
    for i in range(votes.shape[0]):
        own = slice(votes.indptr[i], votes.indptr[i + 1])
        others, weights = votes.indices[own], votes.data[own]
        ranked = ((min(i, j), max(i, j)) for j in others[np.lexsort((others, -weights))].tolist())
        pairs.update([pair for pair in ranked if pair not in known][:count])
    return pairs


def _votes(descriptors: list[NDArray[np.uint8]], progress: Progress) -> csr_array:
    """Return the votes (photographs, photographs) that each pair has from both of its photographs."""
    sizes = [len(d) for d in descriptors]
    owner = np.repeat(np.arange(len(sizes)), sizes)
    rows, columns, weights = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
    if len(owner):
        points = np.concatenate(descriptors, dtype=np.float32)  # products of whole numbers: exact in any order
        # The trees draw at random from OpenCV's own generator.
        cv2.setRNGSeed(1)
        index = cv2.flann.Index(points, {"algorithm": _KD_TREE, "trees": _TREES})
        ends = np.cumsum(sizes)
        for i in np.flatnonzero(sizes):
            progress.at(i / len(sizes))
            queries = points[ends[i] - sizes[i] : ends[i]]
            nearest, distance = index.knnSearch(queries, min(_NEAREST, len(points)), params={"checks": _CHECKS})
            photograph, weight = _ballot(int(i), owner[nearest], distance.astype(np.float64))
            rows.append(np.full(len(photograph), i))
            columns.append(photograph)
            weights.append(weight)
    places = np.concatenate(rows), np.concatenate(columns)
    one_way = coo_array((np.concatenate(weights), places), shape=(len(sizes), len(sizes))).tocsr()
    both = csr_array(one_way + one_way.T)
    both.eliminate_zeros()
    both.sort_indices()
    return both


def _ballot(
    own: int, photograph: NDArray[np.int64], distance: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the photographs voted for and the weights, from neighbours (queries, nearest first) and squared distances.

    A feature has one vote for a photograph, that of its nearest neighbour there, and none for its own.
    """
    last = distance[:, -1:]
    weight = (last - distance) / np.where(last > 0, last, 1.0)
    query = np.arange(len(distance))[:, None]
    _, first = np.unique(query * (int(photograph.max()) + 1) + photograph, return_index=True)
    first = first[photograph.ravel()[first] != own]
    voted, which = np.unique(photograph.ravel()[first], return_inverse=True)
    return voted, np.asarray(np.bincount(which, weight.ravel()[first]), np.float64)
