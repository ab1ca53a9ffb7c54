"""Multi-image correlation: how well all photographs agree on a height, as compiled kernels.

The score of a cell is the weighted mean over all pairs of views of their zero-mean normalised cross-correlation in a square
window on the surface. A noise variance is added to each view's variance, so that texture that is weaker than the noise scores
low instead of at random. Each view weighs by its own mean correlation with the others, which mutes a view that shows
something else (a passing car, an edge that hides the cell).
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from .sampling import sample

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Integers = NDArray[np.int32]

BLOCK = 64  # cells per side that are resampled and correlated together: the views of a block stay in the processor's cache


@nb.njit(cache=True)
def _window_sums(a: Floats, b: Floats, row: int, small: int, large: int, line: Floats, near: Floats, far: Floats) -> None:
    """Sum a*b over the two windows around each column of ``row``; ``near`` and ``far`` have 2 ``large`` columns less."""
    width = a.shape[1]
    count = width - 2 * large
    line[:width] = 0.0
    for y in range(row - small, row + small + 1):
        p, q = a[y], b[y]
        for x in range(width):
            line[x] += p[x] * q[x]
    near[:count] = 0.0
    for k in range(large - small, large + small + 1):
        for x in range(count):
            near[x] += line[x + k]
    if large == small:
        far[:count] = near[:count]
        return
    for y in range(row - large, row - small):
        p, q = a[y], b[y]
        e, f = a[2 * row - y], b[2 * row - y]
        for x in range(width):
            line[x] += p[x] * q[x] + e[x] * f[x]
    far[:count] = 0.0
    for k in range(2 * large + 1):
        for x in range(count):
            far[x] += line[x + k]


@nb.njit(cache=True)
def correlate(views: Floats, seen: NDArray[np.bool_], small: int, large: int, noise: float, knee: float, score: Floats) -> None:
    """Score each cell of a plane of resampled ``views`` (m, rows, columns); NaN in them marks "not in this photograph".

    ``score`` (rows - 2 large, columns - 2 large) is that of the inner cells, NaN where fewer than two views remain; ``seen``
    (m, like score) is False where a view is known to be hidden. Windows have half sizes ``small`` and ``large``; the small one
    counts with v / (v + knee noise) of the mean variance v in it, the large one with the rest: fine where there is texture, wide
    where there is little.
    """
    m = views.shape[0]
    height, width = score.shape
    pairs = m * (m - 1) // 2
    f32 = np.float32
    n_near, n_far = f32(1.0 / (2 * small + 1) ** 2), f32(1.0 / (2 * large + 1) ** 2)
    floor, half_way = f32(noise), f32(knee * noise)
    ones = np.ones((views.shape[1], views.shape[2]), np.float32)
    line = np.empty(views.shape[2], np.float32)
    near, far = np.empty(width, np.float32), np.empty(width, np.float32)
    mean_near, mean_far = np.empty((m, width), np.float32), np.empty((m, width), np.float32)
    scale_near, scale_far = np.empty((m, width), np.float32), np.empty((m, width), np.float32)
    rho = np.empty((pairs, width), np.float32)
    share, known = np.empty(width, np.float32), np.empty(width, np.float32)
    agreement, partners = np.empty((m, width), np.float32), np.empty((m, width), np.float32)
    above, below = np.empty(width, np.float32), np.empty(width, np.float32)
    for y in range(height):
        row = y + large
        share[:], known[:] = 0.0, 0.0
        for i in range(m):
            _window_sums(views[i], ones, row, small, large, line, near, far)
            mean_near[i], mean_far[i] = near * n_near, far * n_far
            _window_sums(views[i], views[i], row, small, large, line, near, far)
            for x in range(width):
                variance = max(near[x] * n_near - mean_near[i, x] * mean_near[i, x], f32(0.0))
                wide = max(far[x] * n_far - mean_far[i, x] * mean_far[i, x], f32(0.0))
                valid = seen[i, y, x] and far[x] == far[x]
                share[x] += variance if valid else f32(0.0)
                known[x] += f32(1.0) if valid else f32(0.0)
                scale_near[i, x] = f32(1.0) / np.sqrt(variance + floor) if valid else f32(np.nan)
                scale_far[i, x] = f32(1.0) / np.sqrt(wide + floor)
        for x in range(width):
            texture = share[x] / max(known[x], f32(1.0))
            share[x] = texture / (texture + half_way) if half_way > 0 else f32(1.0)
        agreement[:], partners[:] = 0.0, 0.0
        k = 0
        for i in range(m):
            for j in range(i + 1, m):
                _window_sums(views[i], views[j], row, small, large, line, near, far)
                for x in range(width):
                    fine = (near[x] * n_near - mean_near[i, x] * mean_near[j, x]) * scale_near[i, x] * scale_near[j, x]
                    wide = (far[x] * n_far - mean_far[i, x] * mean_far[j, x]) * scale_far[i, x] * scale_far[j, x]
                    value = wide + share[x] * (fine - wide)
                    rho[k, x] = value
                    valid = value == value
                    agreement[i, x] += value if valid else f32(0.0)
                    agreement[j, x] += value if valid else f32(0.0)
                    partners[i, x] += f32(1.0) if valid else f32(0.0)
                    partners[j, x] += f32(1.0) if valid else f32(0.0)
                k += 1
        for i in range(m):
            for x in range(width):
                agreement[i, x] = max(agreement[i, x] / max(partners[i, x], f32(1.0)), f32(0.1))
        above[:], below[:] = 0.0, 0.0
        k = 0
        for i in range(m):
            for j in range(i + 1, m):
                for x in range(width):
                    valid = rho[k, x] == rho[k, x]
                    weight = agreement[i, x] * agreement[j, x] if valid else f32(0.0)
                    above[x] += weight * rho[k, x] if valid else f32(0.0)
                    below[x] += weight
                k += 1
        for x in range(width):
            score[y, x] = above[x] / below[x] if below[x] > 0 else f32(np.nan)


@nb.njit(cache=True)
def fill_costs(
    pixels: Floats,
    starts: NDArray[np.int64],
    shapes: NDArray[np.int64],
    corners: Array,
    matrices: Array,
    browns: Array,
    folds: Array,
    west: float,
    north: float,
    cell: float,
    base: Floats,
    step: float,
    first: Integers,
    count: Integers,
    offset: NDArray[np.int64],
    seen: NDArray[np.bool_],
    small: int,
    large: int,
    noise: float,
    knee: float,
    costs: Floats,
) -> None:
    """Write the cost 1 - score of every hypothesis of every cell into ``costs``.

    ``base`` is ``large`` cells wider on each side than the other arrays (rows, columns); ``west``, ``north`` are its corner.
    Hypothesis k of a cell is the height ``base + (first + k) * step`` for k < ``count``; its cost stands at ``offset + k``.
    Where fewer than two views see a hypothesis its cost is 1, that of no correlation. Photographs' windows lie one after the
    other in ``pixels``.
    """
    m = len(starts)
    rows, columns = first.shape
    plane = np.empty((m, BLOCK + 2 * large, BLOCK + 2 * large), np.float32)
    for top in range(0, rows, BLOCK):
        for left in range(0, columns, BLOCK):
            h, w = min(BLOCK, rows - top), min(BLOCK, columns - left)
            block_first, block_count = first[top : top + h, left : left + w], count[top : top + h, left : left + w]
            surface = base[top : top + h + 2 * large, left : left + w + 2 * large]
            block_seen = seen[:, top : top + h, left : left + w]
            score = np.empty((h, w), np.float32)
            low, high = block_first[0, 0], block_first[0, 0]
            for r in range(h):
                for c in range(w):
                    low = min(low, block_first[r, c])
                    high = max(high, block_first[r, c] + block_count[r, c])
            useful = np.zeros(m, np.bool_)
            for i in range(m):
                useful[i] = block_seen[i].any()
            for d in range(low, high):
                used = 0
                chosen = np.empty((m, h, w), np.bool_)
                for i in range(m):
                    if not useful[i]:
                        continue
                    image = pixels[starts[i] : starts[i] + shapes[i, 0] * shapes[i, 1]].reshape((shapes[i, 0], shapes[i, 1]))
                    out = plane[used, : h + 2 * large, : w + 2 * large]
                    mean = sample(
                        image,
                        corners[i],
                        matrices[i],
                        browns[i],
                        folds[i],
                        west + left * cell,
                        north - top * cell,
                        cell,
                        surface,
                        d * step,
                        out,
                    )
                    out -= np.float32(mean)  # sums of squares of large numbers would lose the small variances
                    chosen[used] = block_seen[i]
                    used += 1
                if used < 2:
                    score[:] = np.nan
                else:
                    views = plane[:used, : h + 2 * large, : w + 2 * large]
                    correlate(views, chosen[:used], small, large, noise, knee, score)
                for r in range(h):
                    for c in range(w):
                        k = d - block_first[r, c]
                        if 0 <= k < block_count[r, c]:
                            value = score[r, c]
                            costs[offset[top + r, left + c] + k] = 1.0 - value if value == value else 1.0
