"""Which pairs of photographs are worth matching: a number that grows with the photographs, not with their square."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import combinations
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..survey import Photograph

Array = NDArray[np.float64]
Pair = tuple[int, int]

EXHAUSTIVE = 60  # photographs up to which 'auto' compares all with all when positions are missing
_NEAREST = 16  # neighbours in plan: two each way along the strip and across, and their diagonals, with some to spare
_FOLLOWING = 10  # neighbours in the order of flight, when that is all there is to go by
_BESIDE_ALIKE = 4  # of these where the most alike are found too: a photograph that is blurred or bare is like none
_ALIKE = 16  # most alike, as many as the nearest in plan
_ALWAYS = 4  # neighbours that are compared however far they are
_FOOTPRINTS = 1.5  # farther apart than this many ground widths, two nadir photographs share nothing
_METRES = 111_320.0  # per degree of latitude
_OVERLAP = 0.002  # share of a photograph that it must have in common with one found through a third


def choose_pairs(
    photographs: Sequence[Photograph],
    mode: Literal["auto", "exhaustive", "sequential"],
    alike: Callable[[set[Pair], int], set[Pair]],
) -> tuple[list[Pair], str]:
    """Return the pairs to match (indices, the smaller first, sorted) and the rule they were chosen by.

    ``auto`` takes the nearest neighbours in plan and the next in the order of flight when at least half of the photographs
    have positions (the others are found by their place in the flight); without positions all pairs of up to 60 photographs,
    and beyond the next in the order of flight and the most alike of the others. ``sequential`` takes the 10 that follow each
    one and those 16, 32, 64 ... behind it, which tie neighbouring strips at some places.

    ``alike(known, n)`` is called only where it is needed: it returns the pairs of each photograph with the ``n`` most like it,
    not counting those in ``known``.
    """
    count = len(photographs)
    everything = list(combinations(range(count), 2))
    if mode == "exhaustive" or len(everything) <= _NEAREST * 4:
        return everything, "all pairs"
    order = flight_order(photographs)
    placed = [p.position is not None for p in photographs]
    if mode == "auto" and 2 * sum(placed) >= count:
        index = [i for i, known in enumerate(placed) if known]
        near = {(index[i], index[j]) for i, j in neighbours([photographs[i] for i in index])}
        near |= followers(order, (1, 2))
        near |= {(i, j) for i, j in followers(order, range(1, _FOLLOWING + 1)) if not (placed[i] and placed[j])}
        return sorted(near), f"the {_NEAREST} nearest in plan and the next two in the order of flight"
    if mode == "auto" and count <= EXHAUSTIVE:
        return everything, "all pairs, as there are no positions to choose by"
    if mode == "auto":
        following = followers(order, range(1, _BESIDE_ALIKE + 1))
        rule = f"the next {_BESIDE_ALIKE} in the order of flight and the {_ALIKE} most alike"
        return sorted(following | alike(following, _ALIKE)), f"{rule}, as there are no positions to choose by"
    steps = [*range(1, _FOLLOWING + 1), *(2**n for n in range(4, 64) if 2**n < count)]
    return sorted(followers(order, steps)), f"the {_FOLLOWING} that follow in flight, and those 16, 32, 64 ... behind"


def flight_order(photographs: Sequence[Photograph]) -> list[int]:
    """Return the indices by time, or by name when not all have a time."""
    timed = all(p.time for p in photographs)
    return sorted(range(len(photographs)), key=lambda i: (photographs[i].time if timed else "", photographs[i].name))


def followers(order: Sequence[int], steps: Iterable[int]) -> set[Pair]:
    """Return the pairs that are ``steps`` apart in ``order``."""
    return {(min(a, b), max(a, b)) for step in steps for a, b in zip(order, order[step:], strict=False)}


def neighbours(photographs: Sequence[Photograph]) -> set[Pair]:
    """Return the pairs of photographs (all with a position) that are near in plan.

    Where the height above take-off and the focal length are known, and the camera looks down, pairs farther apart than one and
    a half ground widths are left out, but never the nearest four: take-off need not be at the height of the beach.
    """
    place = np.array([(p.position.longitude, p.position.latitude) for p in photographs if p.position], float)
    place = (place - place.mean(axis=0)) * _METRES * [np.cos(np.radians(place[:, 1].mean())), 1.0]
    reach = np.array([_ground_width(p) * _FOOTPRINTS for p in photographs])
    count = min(_NEAREST + 1, len(place))
    distance, index = cKDTree(place).query(place, count)
    pairs = set()
    for i in range(len(place)):
        # Several photographs of one place may hide the photograph itself from its own list.
        others = [(d, int(j)) for d, j in zip(distance[i], index[i], strict=True) if j != i]
        for rank, (d, j) in enumerate(others):
            if rank < _ALWAYS or d <= max(reach[i], reach[j]):
                pairs.add((min(i, j), max(i, j)))
    return pairs


def pairs_through_others(
    verified: Mapping[Pair, tuple[int, Array]], sizes: Sequence[tuple[int, int]], least: int
) -> list[tuple[int, int, Array]]:
    """Return pairs without a verified match that must overlap, as a third photograph shows, and their homography.

    ``verified`` maps a pair (i, j), i < j, to its number of matches and the homography (3, 3) to j from i; pairs of fewer than
    ``least`` matches are not trusted. ``sizes`` are width, height. A small common corner holds too few of the large features to
    be found at first; where it must lie, all features can be compared.
    """
    to: dict[int, dict[int, tuple[int, Array]]] = {i: {} for i in range(len(sizes))}
    for (i, j), (number, homography) in verified.items():
        if number >= least and abs(np.linalg.det(homography)) > 1e-9:
            to[i][j] = number, homography
            to[j][i] = number, np.asarray(np.linalg.inv(homography), np.float64)
    best: dict[Pair, tuple[int, Array]] = {}
    for middle, around in to.items():
        for i, j in combinations(sorted(around), 2):
            strength = min(around[i][0], around[j][0])
            if (i, j) not in verified and strength > (best[i, j][0] if (i, j) in best else 0):
                best[i, j] = strength, np.asarray(around[j][1] @ to[i][middle][1], np.float64)
    chosen = []
    for (i, j), (_, homography) in sorted(best.items()):
        if _common_share(homography, sizes[i], sizes[j]) >= _OVERLAP:
            chosen.append((i, j, homography / homography[2, 2]))
    return chosen


def blocks(count: int, pairs: Iterable[Pair]) -> list[list[int]]:
    """Return the groups of photographs that the pairs tie together, the largest first, each sorted."""
    ties = np.array(sorted(pairs), np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(ties)), (ties[:, 0], ties[:, 1])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    groups = [np.flatnonzero(label == k).tolist() for k in range(int(label.max(initial=-1)) + 1)]
    return sorted(groups, key=lambda g: (-len(g), g))


def _common_share(homography: Array, source: tuple[int, int], target: tuple[int, int]) -> float:
    """Return the share of the target's frame that the source's covers when mapped by ``homography``; 0 when that folds."""
    width, height = source
    corners = np.array([[0, 0, 1], [width, 0, 1], [width, height, 1], [0, height, 1]], float) @ homography.T
    if np.any(corners[:, 2] * corners[0, 2] <= 0):
        return 0.0
    mapped = (corners[:, :2] / corners[:, 2:]).astype(np.float32)
    frame = np.array([[0, 0], [target[0], 0], [target[0], target[1]], [0, target[1]]], np.float32)
    if not cv2.isContourConvex(mapped):
        return 0.0
    area, _ = cv2.intersectConvexConvex(mapped, frame)
    return float(area) / (target[0] * target[1])


def _ground_width(photograph: Photograph) -> float:
    """Return the longer side of what a photograph sees of level ground at take-off's height (m), infinite when not known."""
    p = photograph
    if not p.relative_height or p.relative_height <= 0 or not p.focal or (p.pitch is not None and p.pitch > -70):
        return np.inf
    return p.relative_height * max(p.width, p.height) / p.focal
