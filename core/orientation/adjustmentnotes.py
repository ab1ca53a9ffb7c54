"""What the analyst must know of an adjustment, in sentences: weights that were changed, and photographs that hang loose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from .gnss import Gnss
from .marks import listed
from .observations import Seen
from .weighting import Weighted

Array = NDArray[np.float64]

_ALIKE = 3.0  # tie points that count as one: what is told of
_LOOSE, _LOOSE_MATTERS = 5.0, 0.5  # times the others' sigma, and metres
_ENLARGED = 9.0  # variance factor of ground points that is told of


def weight_notes(settled: Weighted, gnss: Gnss, with_control: bool) -> list[str]:
    """Say which observations scatter more than their sigmas say, and what the positions share."""
    notes, factors = [], settled.factors
    effect = settled.adjusted.effect
    if effect > _ALIKE:
        notes.append(
            f"Residuals of neighbouring tie points are alike, as a rolling shutter or a lens beyond its model makes them: "
            f"{effect:.0f} of them count as one, and what is known beforehand of the camera weighs more."
        )
    worst = max(factors["plan"], factors["height"])
    if worst > _ENLARGED:
        notes.append(
            f"The control points fit {np.sqrt(factors['plan']):.0f} times worse in plan and {np.sqrt(factors['height']):.0f} "
            "times worse in height than their sigmas say, and all of them do: their sigmas are taken as that much larger; give "
            "their true SIGMA_H and SIGMA_V."
        )
    if factors["mark"] > 1.0:
        notes.append(
            f"The marks scatter {np.sqrt(factors['mark']):.1f} times as much as SIGMA_MARK says, and are weighted accordingly."
        )
    grown = np.sqrt(max(factors["GNSS plan"], factors["GNSS height"]))
    if gnss.declared and grown > 1.0:
        notes.append(f"The GNSS positions scatter up to {grown:.1f} times as much as they say, and are weighted accordingly.")
    if with_control and len(gnss):
        bias, sigma = settled.adjusted.bias, np.sqrt(np.diag(settled.adjusted.cofactor)[-3:])
        large = np.abs(bias) > np.maximum(4 * sigma, 3 * np.median(settled.adjusted.positions.sigma, axis=0))
        if large.any() and gnss.declared:
            notes.append(
                "Against the control points the GNSS positions are all off by "
                f"{-bias[0]:+.2f} m east, {-bias[1]:+.2f} m north and {-bias[2]:+.2f} m in height, which is taken off: the two "
                "may stand on different reference stations, datums or kinds of height."
            )
    return notes


def loose_notes(centre_sigma: Array, block: Block) -> list[str]:
    """Say which photographs are known far worse than the others, by the sigmas (n, 3) of their projection centres."""
    sigma = np.linalg.norm(centre_sigma, axis=1)
    loose = sigma > max(_LOOSE * float(np.median(sigma)), _LOOSE_MATTERS)
    if not loose.any() or loose.mean() > 0.5:
        return []
    names = [view.name for view, one in zip(block.views, loose, strict=True) if one]
    are = "is" if len(names) == 1 else "are"
    return [
        f"{listed(names)} {are} known to {sigma[loose].max():.1f} m only against the rest of the block, which is known to "
        f"{np.median(sigma):.2f} m: too few tie points join them to more than one photograph of it; do not use their ground, or "
        "give control points on it."
    ]


def unseen(seen: Seen) -> str:
    """Say that the photograph of a point's only mark cannot see it."""
    return (
        f"{seen.point.name} is marked in {seen.single} alone, which cannot see it from where it was taken: the point takes no "
        "part; check the mark."
    )
