"""Tie points on ground that moves: sea, swash, vegetation."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from .solution import Solution


def outside(solution: Solution, ignore: shapely.Geometry) -> NDArray[np.bool_]:
    """Return which points of the solution's block (n,) lie outside the polygons, which are in its CRS."""
    places = solution.frame.to_crs(solution.block.points)
    shapely.prepare(ignore)
    return np.asarray(~shapely.contains_xy(ignore, places[:, 0], places[:, 1]))
