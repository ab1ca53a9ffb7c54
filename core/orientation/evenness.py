"""An even choice of tie points for the adjustment.

Neighbouring tie points share pixels, and with them the errors of matching and of the lens model: ten thousand in a photograph say
little more than one for each patch that is independent of the next. So that the adjustment's sigmas are true, and it is quick, it
takes the points of most rays, and of those as many as put one into every patch of every photograph, and tie every two photographs
as well as they can be tied.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .cameras import Rays

PATCHES = 48  # along the longer side of a photograph
_TIED = 50  # points that two photographs have in common before their link counts as held


def even_choice(rays: Rays, errors: NDArray[np.float64], sizes: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which points (n,) to take: most rays, then least ``errors`` (n,), where one fills an empty patch or a weak link.

    ``sizes`` (views, 2) are width and height in pixels. Points of two rays are taken only where no others do.
    """
    counts = np.diff(rays.start)
    order = np.lexsort((errors, -counts))
    patch = sizes.max(axis=1) / PATCHES
    cell = (rays.xy / patch[rays.view][:, None]).astype(np.int64)
    cell = np.clip(cell, 0, PATCHES)
    key = (rays.view * (PATCHES + 1) + cell[:, 1]) * (PATCHES + 1) + cell[:, 0]
    taken = np.zeros((len(sizes)) * (PATCHES + 1) ** 2, np.bool_)
    return np.asarray(_fill(rays.start, rays.view, key, order, taken, np.zeros((len(sizes), len(sizes)), np.int32)))


@njit(cache=True)
def _fill(start, view, key, order, taken, ties):  # type: ignore[no-untyped-def]
    chosen = np.zeros(len(start) - 1, np.bool_)
    for p in order:
        first, last = start[p], start[p + 1]
        wanted = False
        for i in range(first, last):
            if not taken[key[i]]:
                wanted = True
            for j in range(first, i):
                if ties[view[i], view[j]] < _TIED:
                    wanted = True
        if wanted:
            chosen[p] = True
            for i in range(first, last):
                taken[key[i]] = True
                for j in range(first, last):
                    ties[view[i], view[j]] += 1
    return chosen
