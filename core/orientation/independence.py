"""How many independent statements tie points make.

What a lens model does not hold, a rolling shutter, or a match that is drawn aside in the same way, shows in residuals that are
alike among neighbours. Then a hundred observations say little more than one, and an adjustment that takes each for its own trusts
what it makes of the focal length far too much. The design effect (Kish 1965) measures it: how many times as much the means of
patches scatter as those of independent residuals would.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PATCHES = (5, 10)  # along the longer side: what varies over a photograph, and within it
_LEAST = 4  # residuals in a patch
_CHANCE = 1.25  # below, it may be chance


def design_effect(residuals: Array, weight: Array, view: NDArray[np.int64], xy: Array) -> float:
    """Return the design effect, 1 for independent residuals (m, 2) at pixels ``xy`` (m, 2) of the views ``view`` (m,).

    ``weight`` (m,) is 1 for a full observation; those below 0.99, and NaN, are left out.

    >>> random = np.random.default_rng(0)
    >>> xy, view = random.uniform(0, 1000, (4000, 2)), np.zeros(4000, np.int64)
    >>> design_effect(random.normal(size=(4000, 2)), np.ones(4000), view, xy)
    1.0
    """
    good = np.isfinite(residuals[:, 0]) & (weight >= 0.99)
    left, view, xy = residuals[good], view[good], xy[good]
    if len(left) < 10 * _LEAST:
        return 1.0
    variance = float(np.mean(np.sum(left**2, axis=1)))
    found = [1.0]
    for count in _PATCHES:
        patch = (xy // ((float(xy.max()) + 1.0) / count)).astype(np.int64)
        _, member = np.unique((view * count + patch[:, 1]) * count + patch[:, 0], return_inverse=True)
        size = np.bincount(member)
        sums = np.stack([np.bincount(member, left[:, axis]) for axis in (0, 1)], axis=1)
        full = size >= _LEAST
        if full.any() and variance > 0:
            found.append(float(np.mean(np.sum(sums[full] ** 2, axis=1) / size[full])) / variance)
    effect = max(found)
    return effect if effect > _CHANCE else 1.0
