"""The terms of a height error: 1, x, y, z, and x^2, xy, y^2, in which cameras bend a block; about a centre, and about another.

With d = c1 - c0 the terms about c0 are ``about_another(d)`` times those about c1, exactly. So a zone's mean terms, which are all
that a volume feels of such an error, can be summed about any place near it, and an error's coefficients move by the transpose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
COUNT = 7
BENT_AT = 50.0  # metres from the centre at which a bending is told in words
# Bending at BENT_AT to the east, to the north, and half-way between: three directions tell the three terms.
_BENT = BENT_AT**2 * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.5, 0.5]])
# The same in metres for all: level, the tilts' and the scale's lift over BENT_AT, the bending there.
IN_METRES = np.block([[np.diag([1.0, BENT_AT, BENT_AT, BENT_AT]), np.zeros((4, 3))], [np.zeros((3, 4)), _BENT]])


@dataclass(frozen=True)
class Moments:
    """The mean terms (7,) of a zone's covered cells, weighted by their shares, about ``origin`` (x, y, z); a place by default.

    ``slopes`` are the cells' mean slopes to the east and north, by which a shift in plan tells.
    """

    origin: tuple[float, ...]
    means: tuple[float, ...] = (1.0,) + (0.0,) * (COUNT - 1)
    slopes: tuple[float, float] = (0.0, 0.0)

    def about(self, centre: tuple[float, ...]) -> Array:
        """Return the mean terms (7,) about ``centre`` (2,) or (3,)."""
        return np.asarray(about_another(centre, self.origin) @ np.array(self.means))


def height_terms(x: Array, y: Array, height: Array, centre: tuple[float, ...]) -> Array:
    """Return the terms (n, 7) at places (n,) about ``centre`` (x0, y0, z0)."""
    east, north = x - centre[0], y - centre[1]
    return np.column_stack([np.ones(len(x)), east, north, height - centre[2], east * east, east * north, north * north])


def about_another(centre: tuple[float, ...], other: tuple[float, ...]) -> Array:
    """Return the matrix (7, 7) by which terms about ``other`` become those about ``centre``; a third number left out is 0.

    >>> float(about_another((1.0, 2.0), (4.0, 6.0))[5] @ [1, 0, 0, 0, 0, 0, 0])  # x y of the place (4, 6) about (1, 2)
    12.0
    """
    east, north, up = np.array([*other, 0.0][:3]) - np.array([*centre, 0.0][:3])
    matrix = np.eye(COUNT)
    matrix[1:, 0] = east, north, up, east * east, east * north, north * north
    matrix[4, 1] = 2.0 * east
    matrix[5, 1:3] = north, east
    matrix[6, 2] = 2.0 * north
    return matrix
