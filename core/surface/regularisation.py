"""Semi-global regularisation (Hirschmueller 2008) of costs whose hypotheses differ from cell to cell.

Costs of all cells lie one after the other: hypothesis k of a cell is the height ``base + (first + k) * step`` and stands at
``offset + k``, for k < ``count``. Penalties act on the change of height against the base surface, so that a slope
the base already has costs nothing; where the base itself jumps, they act on the height.
"""

from __future__ import annotations

import cv2
import numba as nb
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Integers = NDArray[np.int32]
Places = NDArray[np.int64]

# A base that changes by more steps than this from cell to cell has a jump there, not a slope.
_SLOPE = 1.5
_SUMMED = 5  # cells per side over which the refinement sums costs
DIRECTIONS = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))


@nb.njit(
    cache=True, error_model="numpy", fastmath={"nnan", "nsz"}
)  # costs are never NaN, and only so is a minimum found in vector registers
def aggregate(
    costs: Floats,
    offset: Places,
    first: Integers,
    count: Integers,
    base: Floats,
    step: float,
    down: int,
    right: int,
    small: float,
    large: float,
    total: Floats,
) -> None:
    """Add to ``total`` the least cost of every hypothesis along the paths that run ``down``, ``right`` (-1, 0 or 1).

    ``small`` is the penalty of a change by one step from cell to cell, ``large`` of any greater one.
    """
    rows, columns = base.shape
    depth = 0
    for r in range(rows):
        for c in range(columns):
            depth = max(depth, count[r, c])
    f32 = np.float32
    p1, p2 = f32(small), f32(large)
    before, now = np.zeros((columns, depth), np.float32), np.zeros((columns, depth), np.float32)
    least_before, least_now = np.zeros(columns, np.float32), np.zeros(columns, np.float32)
    line = np.empty(depth + 2, np.float32)
    for y in range(rows):
        r = y if down >= 0 else rows - 1 - y
        for x in range(columns):
            c = x if right >= 0 else columns - 1 - x
            n, o = count[r, c], offset[r, c]
            here = now[c]
            r0, c0 = r - down, c - right
            if r0 < 0 or c0 < 0 or r0 >= rows or c0 >= columns:
                for k in range(n):
                    here[k] = costs[o + k]
            else:
                there = now[c0] if down == 0 else before[c0]
                least = least_now[c0] if down == 0 else least_before[c0]
                jump = least + p2
                rise = (base[r, c] - base[r0, c0]) / step
                shift = 0 if abs(rise) <= _SLOPE else int(np.rint(rise))
                # line[k + 1] is the neighbour's value at this cell's hypothesis k.
                begin = first[r, c] + shift - first[r0, c0] - 1
                known = count[r0, c0]
                enter, leave = max(0, -begin), min(n + 2, known - begin)
                if leave <= enter:
                    enter = leave = 0
                for k in range(0, enter):
                    line[k] = jump
                for k in range(enter, leave):
                    line[k] = there[begin + k]
                for k in range(max(leave, enter), n + 2):
                    line[k] = jump
                for k in range(n):
                    value = (line[k] if line[k] < line[k + 2] else line[k + 2]) + p1
                    value = value if value < line[k + 1] else line[k + 1]
                    value = value if value < jump else jump
                    here[k] = costs[o + k] + (value - least)
            low = here[0]
            for k in range(n):
                low = here[k] if here[k] < low else low
                total[o + k] += here[k]
            least_now[c] = low
        before, now = now, before
        least_before, least_now = least_now, least_before


@nb.njit(cache=True, error_model="numpy")
def decide(
    costs: Floats, total: Floats, offset: Places, first: Integers, count: Integers, base: Floats, step: float
) -> tuple[Floats, Floats]:
    """Return height and doubt of the best hypothesis of each cell, both (rows, columns).

    The height is refined by a parabola through the total costs; doubt is how many steps the best hypothesis without
    regularisation is away.
    """
    rows, columns = base.shape
    height, doubt = np.empty((rows, columns), np.float32), np.empty((rows, columns), np.float32)
    for r in range(rows):
        for c in range(columns):
            o, n = offset[r, c], count[r, c]
            # Among equals the base wins: where nothing speaks, the surface stays.
            best = min(max(-first[r, c], 0), n - 1)
            plain = best
            for k in range(n):
                if total[o + k] < total[o + best]:
                    best = k
                if costs[o + k] < costs[o + plain]:
                    plain = k
            part = 0.0
            if 0 < best < n - 1:
                a, b, d = total[o + best - 1], total[o + best], total[o + best + 1]
                if a + d - 2.0 * b > 0.0:
                    part = min(max(0.5 * (a - d) / (a + d - 2.0 * b), -0.5), 0.5)
            height[r, c] = base[r, c] + (first[r, c] + best + part) * step
            doubt[r, c] = abs(plain - best)
    return height, doubt


def regularise(
    costs: Floats, offset: Places, first: Integers, count: Integers, base: Floats, *, step: float, small: float, large: float
) -> tuple[Floats, Floats]:
    """Return height and doubt, as ``decide`` tells them, after summing the paths of all eight directions."""
    total = np.zeros_like(costs)
    for down, right in DIRECTIONS:
        aggregate(costs, offset, first, count, base, step, down, right, small, large, total)
    return decide(costs, total, offset, first, count, base, step)


def refine(costs: Floats, step: float) -> tuple[Floats, Floats, Floats]:
    """Return correction (m), score and curvature (1/m2) of each cell from ``costs`` (rows, columns, hypotheses) about a surface.

    Regularisation draws weak cells towards the base, by up to a step. This takes that back: the minimum of the plain costs,
    summed over a few cells (which weighs each by its own sharpness), near the regularised surface. Hypotheses are ``step``
    apart with the middle one on the surface; a cell whose minimum lies at the end of them, or has no curvature, is not corrected.
    """
    rows, columns, count = costs.shape
    summed = np.stack([cv2.blur(np.ascontiguousarray(costs[:, :, k]), (_SUMMED, _SUMMED)) for k in range(count)])
    best = summed.argmin(axis=0)
    inner = best.clip(1, count - 2)[None]
    a, b, d = (np.take_along_axis(summed, inner + k, axis=0)[0] for k in (-1, 0, 1))
    bend = a + d - 2 * b
    usable = (best > 0) & (best < count - 1) & (bend > 0)
    part = np.where(usable, 0.5 * (a - d) / np.where(usable, bend, 1.0), 0.0)
    height = np.where(usable, (best - count // 2 + part) * step, 0.0)
    plain = np.take_along_axis(np.moveaxis(costs, 2, 0), np.where(usable, best, count // 2)[None], axis=0)[0]
    return height.astype(np.float32), (1.0 - plain).astype(np.float32), (bend / step**2).astype(np.float32)
