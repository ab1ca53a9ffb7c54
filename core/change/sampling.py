"""A random subset of cells that does not depend on the order in which they come."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class Sample:
    """Keeps the ``size`` cells with the smallest hash among all that are added, and counts them all.

    Equal cells give the same sample whatever the tiles, workers or platform.
    """

    def __init__(self, size: int, columns: int) -> None:
        self._size = size
        self._hashes: NDArray[np.uint64] = np.empty(0, np.uint64)
        self._values = np.empty((0, columns))
        self.count = 0

    def add(self, cells: NDArray[np.int64], *columns: NDArray[np.float64]) -> None:
        """Add cells by their number in the grid (n,), with one value (n,) per column."""
        self.count += len(cells)
        hashes = _mixed(cells)
        if len(self._hashes) == self._size:
            keep = hashes < self._hashes.max()
            hashes, columns = hashes[keep], tuple(c[keep] for c in columns)
        self._hashes = np.concatenate([self._hashes, hashes])
        self._values = np.concatenate([self._values, np.column_stack(columns)])
        if len(self._hashes) > self._size:
            smallest = np.argpartition(self._hashes, self._size - 1)[: self._size]
            self._hashes, self._values = self._hashes[smallest], self._values[smallest]

    @property
    def values(self) -> NDArray[np.float64]:
        """The sampled cells (m, columns), in a fixed order."""
        return self._values[np.argsort(self._hashes)]


def _mixed(cells: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Return a 64-bit hash of cell numbers (splitmix64; Steele, Lea & Flood 2014)."""
    z = cells.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))
