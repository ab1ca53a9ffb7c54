"""Tie points that take no part in the surface, to check it by."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..raster import Grid

Array = NDArray[np.float64]

_EVERY = 10
_RAYS = 3  # a point of two rays is as wrong as its one match


@dataclass(frozen=True)
class Comparison:
    """The surface less the tie points left out (m), with the surface's sigma there, and how many points there were at all."""

    differences: Array  # (n,)
    sigmas: Array  # (n,)
    left_out: int

    @property
    def median(self) -> float | None:
        """The median difference (m), None without points."""
        return float(np.median(self.differences)) if len(self.differences) else None

    @property
    def nmad(self) -> float | None:
        """1.4826 times the median absolute deviation from the median (m), None without points (Hoehle and Hoehle 2009)."""
        if not len(self.differences):
            return None
        return float(1.4826 * np.median(np.abs(self.differences - np.median(self.differences))))


def split(block: Block) -> tuple[Block, Array]:
    """Return the block that matching may start from, and the points (n, 3; local frame) that are left out of it.

    Every tenth point of three rays or more, in the order of the model, so that the same block is always parted alike.
    """
    candidates = np.flatnonzero((block.rays >= _RAYS) & (block.errors <= np.percentile(block.errors, 95)))
    held = candidates[_EVERY // 2 :: _EVERY]
    kept = np.ones(len(block.points), bool)
    kept[held] = False
    return block.only(kept), block.points[held]


@dataclass
class Check:
    """Collects, patch by patch, what the surface has at points (n, 3: easting, northing, height)."""

    points: Array
    _differences: list[Array] = field(default_factory=list)
    _sigmas: list[Array] = field(default_factory=list)

    def put(self, patch: Grid, height: NDArray[np.floating], sigma: NDArray[np.floating], wide: Grid) -> None:
        """Compare the points that lie in ``patch`` with heights and sigmas (m) over ``wide``, a grid that reaches a cell further.

        Heights are bilinear between four cells; a point beside a cell without a height is left.
        """
        if not len(self.points):
            return
        west, south, east, north = patch.bounds
        x, y, z = self.points.T
        mine = (x >= west) & (x < east) & (y > south) & (y <= north)
        column = (x[mine] - wide.west) / wide.cell - 0.5
        row = (wide.north - y[mine]) / wide.step_north - 0.5
        c, r = np.floor(column).astype(int), np.floor(row).astype(int)
        whole = (c >= 0) & (r >= 0) & (c < wide.width - 1) & (r < wide.height - 1)
        c, r, column, row, z = c[whole], r[whole], column[whole], row[whole], z[mine][whole]
        u, v = column - c, row - r
        here = (1 - v) * ((1 - u) * height[r, c] + u * height[r, c + 1]) + v * (
            (1 - u) * height[r + 1, c] + u * height[r + 1, c + 1]
        )
        known = np.isfinite(here)
        self._differences.append((here - z)[known])
        self._sigmas.append(np.asarray(sigma[r, c], float)[known])

    def result(self) -> Comparison:
        """Return what was found."""
        if not self._differences:
            return Comparison(np.zeros(0), np.zeros(0), len(self.points))
        return Comparison(np.concatenate(self._differences), np.concatenate(self._sigmas), len(self.points))
