"""Guided matching: a feature is compared only with those near where the pair's geometry puts it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from .features import Features

Array = NDArray[np.float64]
_SAME = 2.0  # px: candidates closer than this to the best are the same feature (another orientation), not a rival


@dataclass(frozen=True)
class Prediction:
    """Where features are expected in the other photograph (n, 2; infinite: nowhere), and how far around to look (n,), pixels."""

    places: Array
    reach: Array


def by_homography(features: Features, homography: Array, reach: float) -> Prediction:
    """Return where a homography (3, 3) puts features, with one reach (pixels) for all."""
    with np.errstate(divide="ignore", invalid="ignore"):
        mapped = features.xy.astype(np.float64) @ homography[:, :2].T + homography[:, 2]
        places = np.where(mapped[:, 2:] > 0, mapped[:, :2] / mapped[:, 2:], np.inf)
    return Prediction(places, np.full(len(features), reach))


def guided_matches(
    first: Features,
    second: Features,
    forward: Prediction,
    backward: Prediction,
    fundamental: Array | None,
    *,
    band: float,
    turn: float,
    zoom: float,
    ratio: float,
    least: float,
) -> NDArray[np.int32]:
    """Return the mutual best matches (m, 2) of two photographs whose relative geometry is known roughly.

    A candidate lies where ``forward`` expects the feature of the first in the second, ``backward`` that of the second in the
    first, and within ``band`` pixels of the line of ``fundamental`` (3, 3; ``x2' F x1 = 0``; None for no such test); it is turned
    by ``turn`` (radians) and zoomed by ``zoom`` against the first, to 30 degrees and a factor of 1.6. ``ratio`` limits the
    distance of the descriptors against that of the second best candidate, ``least`` their product (1 for equal ones).
    """
    there = _best(first, second, forward, fundamental, band, turn, zoom, ratio, least)
    transposed = None if fundamental is None else fundamental.T
    back = _best(second, first, backward, transposed, band, -turn, 1 / zoom, ratio, least)
    index = np.flatnonzero(there >= 0)
    index = index[back[there[index]] == index]
    return np.column_stack([index, there[index]]).astype(np.int32)


def _best(
    source: Features,
    target: Features,
    expected: Prediction,
    fundamental: Array | None,
    band: float,
    turn: float,
    zoom: float,
    ratio: float,
    least: float,
) -> NDArray[np.int32]:
    """Return for each source feature the index of its best target feature, -1 for none."""
    lines = np.zeros((len(source), 3))
    if fundamental is not None:
        lines = source.xy.astype(np.float64) @ fundamental[:, :2].T + fundamental[:, 2]
        lines /= np.maximum(np.hypot(lines[:, 0], lines[:, 1]), 1e-300)[:, None]
    cell = max(float(np.median(expected.reach)), 8.0) if len(source) else 8.0
    columns = int(target.xy[:, 0].max() // cell) + 1
    rows = int(target.xy[:, 1].max() // cell) + 1
    cells = (target.xy // np.float32(cell)).astype(np.int64)
    index = cells[:, 1] * columns + cells[:, 0]
    order = np.argsort(index, kind="stable")
    starts = np.searchsorted(index[order], np.arange(columns * rows + 1))
    return np.asarray(
        _search(
            expected.places, expected.reach, lines, source.scale * zoom, source.angle + turn, source.descriptors,
            target.xy, target.scale, target.angle, target.descriptors,
            order, starts, columns, rows, cell, band, ratio**2, least,
        )
    )  # fmt: skip


@numba.njit(cache=True, nogil=True)
def _product(first: Any, second: Any) -> Any:
    # Whole numbers: the sum is the same in any order, so the compiler may use vector instructions.
    total: Any = 0
    for k in range(128):
        total += np.int32(first[k]) * np.int32(second[k])
    return total


@numba.njit(cache=True, nogil=True)
def _search(
    predicted: Any,
    reaches: Any,
    lines: Any,
    scale1: Any,
    angle1: Any,
    desc1: Any,
    xy2: Any,
    scale2: Any,
    angle2: Any,
    desc2: Any,
    order: Any,
    starts: Any,
    columns: int,
    rows: int,
    cell: float,
    band: float,
    ratio2: float,
    least: float,
) -> Any:
    unit = 512.0 * 512.0
    out = np.full(len(predicted), -1, np.int32)
    near = np.empty(len(xy2), np.int64)
    score = np.empty(len(xy2), np.int64)
    for i in range(len(predicted)):
        x, y = predicted[i]
        reach = reaches[i]
        if not (-reach < x < columns * cell + reach and -reach < y < rows * cell + reach):
            continue
        found, best, top = 0, -1, -1
        for row in range(max(0, int((y - reach) // cell)), min(rows - 1, int((y + reach) // cell)) + 1):
            for column in range(max(0, int((x - reach) // cell)), min(columns - 1, int((x + reach) // cell)) + 1):
                for at in range(starts[row * columns + column], starts[row * columns + column + 1]):
                    j = order[at]
                    dx, dy = xy2[j, 0] - x, xy2[j, 1] - y
                    if dx * dx + dy * dy > reach * reach:
                        continue
                    if abs(lines[i, 0] * xy2[j, 0] + lines[i, 1] * xy2[j, 1] + lines[i, 2]) > band:
                        continue
                    zoom = scale2[j] / scale1[i]
                    if zoom > 1.6 or zoom < 0.625:
                        continue
                    turned = (angle2[j] - angle1[i]) / (2 * np.pi)
                    if abs(turned - np.rint(turned)) > 1 / 12:
                        continue
                    product = _product(desc1[i], desc2[j])
                    near[found], score[found] = j, product
                    found += 1
                    # Equal products are decided by the index, so that the order of the search does not show.
                    if product > top or (product == top and j < best):
                        top, best = product, j
        if best < 0 or top < least * unit:
            continue
        second: Any = 0
        for n in range(found):
            dx, dy = xy2[near[n], 0] - xy2[best, 0], xy2[near[n], 1] - xy2[best, 1]
            if score[n] > second and dx * dx + dy * dy > _SAME * _SAME:
                second = score[n]
        # Squared distance of unit descriptors is 2 - 2 s.
        if max(unit - top, 0.0) <= ratio2 * (unit - second):
            out[i] = best
    return out
