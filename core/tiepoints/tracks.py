"""Tracks: the keypoints that matches join, at most one in each photograph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from .pairs import Pair

_LEVELS = 16  # classes of likeness; within one, matches are taken in the order of their pairs


def build_tracks(
    matches: Mapping[Pair, NDArray[np.int32]], likeness: Mapping[Pair, NDArray[np.float32]], counts: Sequence[int]
) -> list[NDArray[np.int32]]:
    """Return for each photograph the track of each of its keypoints (n,), -1 for none.

    ``matches`` maps two photographs to indices of their keypoints (m, 2), ``likeness`` to how alike each two are (m,), ``counts``
    are numbers of keypoints. Matches are joined from the most alike down; one that would put two keypoints of a photograph into a
    track is passed over, so that a wrong match costs itself and not the two tracks it touches.
    """
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    total = int(starts[-1])
    parent, following, last = (np.arange(total, dtype=np.int32) for _ in range(3))
    following[:] = -1
    photograph = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
    seen = np.full(len(counts), -1, np.int32)
    values = [likeness[pair] for pair in matches]
    bounds = np.quantile(np.concatenate(values), np.linspace(1, 0, _LEVELS + 1)) if values else np.zeros(2)
    bounds[0], bounds[-1] = np.inf, -np.inf
    for high, low in zip(bounds[:-1], bounds[1:], strict=True):
        for (i, j), found in matches.items():
            chosen = found[(likeness[i, j] < high) & (likeness[i, j] >= low)]
            _join(chosen, starts[i], starts[j], parent, following, last, photograph, seen)
    label = _labels(parent, following)
    return [label[a:b] for a, b in zip(starts[:-1], starts[1:], strict=True)]


def within_tracks(matches: NDArray[np.int32], first: NDArray[np.int32], second: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Tell which matches (m, 2) join two keypoints of one track; ``first`` and ``second`` are their photographs' tracks (n,)."""
    track = first[matches[:, 0]]
    return (track >= 0) & (track == second[matches[:, 1]])


@numba.njit(cache=True, nogil=True)
def _root(parent: Any, i: Any) -> Any:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@numba.njit(cache=True, nogil=True)
def _join(matches: Any, start1: int, start2: int, parent: Any, following: Any, last: Any, photograph: Any, seen: Any) -> None:
    # The members of a track are a chain from its root, so that two tracks are joined by one link.
    for m in range(len(matches)):
        a = _root(parent, matches[m, 0] + start1)
        b = _root(parent, matches[m, 1] + start2)
        if a == b:
            continue
        if b < a:
            a, b = b, a
        member = a
        while member >= 0:
            seen[photograph[member]] = a
            member = following[member]
        member, clash = b, False
        while member >= 0 and not clash:
            clash = seen[photograph[member]] == a
            member = following[member]
        member = a
        while member >= 0:
            seen[photograph[member]] = -1
            member = following[member]
        if not clash:
            parent[b] = a
            following[last[a]] = b
            last[a] = last[b]


@numba.njit(cache=True, nogil=True)
def _labels(parent: Any, following: Any) -> Any:
    label = np.full(len(parent), -1, np.int32)
    count = 0
    for i in range(len(parent)):
        # Roots come before their members: a track is joined to the one of the smaller root.
        if parent[i] == i:
            if following[i] >= 0:
                label[i] = count
                count += 1
        else:
            label[i] = label[_root(parent, i)]
    return label
