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


@nb.njit(cache=True, error_model="numpy")
def _add(parts: int, source: Floats, stride: int, out: Floats) -> None:
    """Write the sums of ``parts`` (3 or 5) values ``stride`` apart, from each place on; the end is left as it is."""
    n = len(source) - (parts - 1) * stride
    a, b, c = source, source[stride:], source[2 * stride :]
    if parts == 3:
        for i in range(n):
            out[i] = a[i] + b[i] + c[i]
    else:
        d, e = source[3 * stride :], source[4 * stride :]
        for i in range(n):
            out[i] = a[i] + b[i] + c[i] + d[i] + e[i]


@nb.njit(cache=True, error_model="numpy")
def _run_sums(size: int, source: Floats, stride: int, out: Floats, scratch: Floats) -> None:
    """Write the sums of ``size`` (odd) values ``stride`` apart, from each place on; the end is rubbish.

    Sums of sums for 9, the common size. Unlike a running sum this neither carries rounding errors on nor one missing value.
    """
    if size == 3 or size == 5:
        _add(size, source, stride, out)
    elif size == 9:
        _add(3, source, stride, scratch)
        _add(3, scratch, 3 * stride, out)
    else:
        _add(3, source, stride, out)
        for k in range(3, size, 2):
            n = len(source) - (k + 1) * stride
            a, b = source[k * stride :], source[(k + 1) * stride :]
            for i in range(n):
                out[i] += a[i] + b[i]


@nb.njit(cache=True, error_model="numpy")
def _window_sums(half: int, source: Floats, width: int, out: Floats, line: Floats, scratch: Floats) -> None:
    """Write the sums over the square window that starts at each place of an image, flat, of row length ``width``."""
    _run_sums(2 * half + 1, source, width, line, scratch)
    _run_sums(2 * half + 1, line, 1, out, scratch)


@nb.njit(cache=True, error_model="numpy")
def _meet(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> bool:
    """Tell whether two masks have a cell in common."""
    for r in range(first.shape[0]):
        for c in range(first.shape[1]):
            if first[r, c] and second[r, c]:
                return True
    return False


@nb.njit(cache=True, error_model="numpy")
def correlate(views: Floats, seen: NDArray[np.bool_], small: int, large: int, noise: float, knee: float, score: Floats) -> None:
    """Score each cell of a plane of resampled ``views`` (m, rows, columns); NaN in them marks "not in this photograph".

    ``score`` (rows - 2 large, columns - 2 large) is that of the inner cells, NaN where fewer than two views remain; ``seen``
    (m, like score) is False where a view is known to be hidden. Windows have half sizes ``small`` and ``large``; the small one
    counts with v / (v + knee noise) of the mean variance v in it, the large one with the rest: fine where there is texture, wide
    where there is little.
    """
    m, rows, width = views.shape
    length = rows * width
    height, inner = score.shape
    f32 = np.float32
    zero, one, nan = f32(0.0), f32(1.0), f32(np.nan)
    n_near, n_far = f32(1.0 / (2 * small + 1) ** 2), f32(1.0 / (2 * large + 1) ** 2)
    floor, half_way = f32(noise), f32(knee * noise)
    adaptive = large > small
    # The small window that is centred like the large one starts this many places later.
    late = (large - small) * (width + 1)
    meet, pairs = np.zeros((m, m), np.bool_), 0
    for i in range(m):
        for j in range(i + 1, m):
            meet[i, j] = _meet(seen[i], seen[j])
            pairs += meet[i, j]
    product, line, scratch = np.zeros(length, np.float32), np.zeros(length, np.float32), np.zeros(length, np.float32)
    near, far = np.zeros(length + late, np.float32), np.zeros(length, np.float32)
    centred = near[late:]
    mean_near, mean_far = np.empty((m, length), np.float32), np.empty((m, length), np.float32)
    scale_near, scale_far = np.empty((m, length), np.float32), np.empty((m, length), np.float32)
    share, known = np.zeros(length, np.float32), np.zeros(length, np.float32)
    for i in range(m):
        flat = views[i].copy().ravel()
        mf, sf, mn, sn = mean_far[i], scale_far[i], mean_near[i], scale_near[i]
        open_ = np.zeros(length, np.float32)
        for y in range(height):
            for x in range(inner):
                open_[y * width + x] = one if seen[i, y, x] else nan
        for p in range(length):
            product[p] = flat[p] * flat[p]
        _window_sums(large, flat, width, far, line, scratch)
        for p in range(length):
            mf[p] = far[p] * n_far
        _window_sums(large, product, width, far, line, scratch)
        for p in range(length):
            variance = far[p] * n_far - mf[p] * mf[p]
            variance = variance if variance > zero else (zero if variance <= zero else nan)
            # 1 or NaN: where the view is hidden or outside, all that it takes part in is NaN.
            sf[p] = open_[p] / np.sqrt(variance + floor)
        if adaptive:
            _window_sums(small, flat, width, near, line, scratch)
            for p in range(length):
                mn[p] = centred[p] * n_near
            _window_sums(small, product, width, near, line, scratch)
            for p in range(length):
                variance = centred[p] * n_near - mn[p] * mn[p]
                variance = variance if variance > zero else zero
                valid = sf[p] == sf[p]
                share[p] += variance if valid else zero
                known[p] += one if valid else zero
                sn[p] = one / np.sqrt(variance + floor)
    for p in range(length):
        share[p] = share[p] / (share[p] + half_way * known[p]) if share[p] > zero else zero
    rho = np.empty((pairs, length), np.float32)
    agreement, partners = np.zeros((m, length), np.float32), np.zeros((m, length), np.float32)
    k = 0
    for i in range(m):
        first = views[i].copy().ravel()
        mf, sf, mn, sn = mean_far[i], scale_far[i], mean_near[i], scale_near[i]
        for j in range(i + 1, m):
            if not meet[i, j]:
                continue
            second = views[j].copy().ravel()
            mg, sg, mo, so = mean_far[j], scale_far[j], mean_near[j], scale_near[j]
            value = rho[k]
            for p in range(length):
                product[p] = first[p] * second[p]
            _window_sums(large, product, width, far, line, scratch)
            for p in range(length):
                value[p] = (far[p] * n_far - mf[p] * mg[p]) * sf[p] * sg[p]
            if adaptive:
                _window_sums(small, product, width, near, line, scratch)
                for p in range(length):
                    fine = (centred[p] * n_near - mn[p] * mo[p]) * sn[p] * so[p]
                    value[p] += share[p] * (fine - value[p])
            ai, aj, pi, pj = agreement[i], agreement[j], partners[i], partners[j]
            for p in range(length):
                valid = value[p] == value[p]
                v, n = (value[p] if valid else zero), (one if valid else zero)
                ai[p] += v
                aj[p] += v
                pi[p] += n
                pj[p] += n
            k += 1
    least = f32(0.1)
    for i in range(m):
        ai, pi = agreement[i], partners[i]
        for p in range(length):
            mean = ai[p] / (pi[p] if pi[p] > zero else one)
            ai[p] = mean if mean > least else least
    above, below = share, known
    above[:] = zero
    below[:] = zero
    k = 0
    for i in range(m):
        for j in range(i + 1, m):
            if not meet[i, j]:
                continue
            ai, aj, value = agreement[i], agreement[j], rho[k]
            for p in range(length):
                valid = value[p] == value[p]
                weight = ai[p] * aj[p] if valid else zero
                above[p] += weight * (value[p] if valid else zero)
                below[p] += weight
            k += 1
    for y in range(height):
        for x in range(inner):
            p = y * width + x
            score[y, x] = above[p] / below[p] if below[p] > zero else nan


@nb.njit(cache=True, error_model="numpy")
def _level(values: Floats) -> np.float32:
    """Return about the mean of what is not NaN."""
    total, number = np.float32(0.0), np.float32(0.0)
    for r in range(0, values.shape[0], 4):
        for c in range(0, values.shape[1], 4):
            if values[r, c] == values[r, c]:
                total += values[r, c]
                number += np.float32(1.0)
    return total / number if number > 0 else np.float32(0.0)


@nb.njit(cache=True, error_model="numpy")
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
                    sample(
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
                    out -= _level(out)  # sums of squares of large numbers would lose the small variances
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
