"""A random subset of cells that does not depend on the order in which they come."""

from __future__ import annotations

import numpy as np
from numba import njit, vectorize
from numpy.typing import NDArray

_ALL = 2**64 - 1
_LOW = np.uint64(2**32 - 1)


class Sample:
    """Keeps the ``size`` cells with the smallest hash among all that are added, and counts them all.

    Equal cells give the same sample whatever the tiles, workers or platform.
    """

    def __init__(self, size: int, columns: int) -> None:
        self._size = size
        self._hashes: NDArray[np.uint64] = np.empty(0, np.uint64)
        self._values = np.empty((0, columns))
        self.count = 0
        self.limit = _ALL  # a cell whose hash is not below this would not be kept

    def add(
        self,
        cells: NDArray[np.int64],
        *columns: NDArray[np.float64],
        count: int | None = None,
        patches: NDArray[np.int64] | None = None,
    ) -> None:
        """Add cells by their number in the grid (n,), with one value (n,) per column.

        Cells of one patch (n, numbers) are kept or left together, so that neighbours stay neighbours. ``count`` tells how many
        there were when cells at or above ``limit`` have been left out already.
        """
        self.count += len(cells) if count is None else count
        hashes = _hashes(cells.astype(np.int64))
        if patches is not None:
            hashes = (_hashes(patches.astype(np.int64)) & ~_LOW) | (hashes & _LOW)
        keep = hashes < np.uint64(self.limit)
        self._hashes = np.concatenate([self._hashes, hashes[keep]])
        self._values = np.concatenate([self._values, np.column_stack([c[keep] for c in columns])])
        if len(self._hashes) > self._size:
            smallest = np.argpartition(self._hashes, self._size - 1)[: self._size]
            self._hashes, self._values = self._hashes[smallest], self._values[smallest]
        if len(self._hashes) == self._size:
            self.limit = int(self._hashes.max())

    @property
    def values(self) -> NDArray[np.float64]:
        """The sampled cells (m, columns), in a fixed order."""
        return self._values[np.argsort(self._hashes)]


@njit(cache=True)  # pragma: no cover
def mixed(cell: int) -> np.uint64:
    """Return a 64-bit hash of a cell's number (splitmix64; Steele, Lea & Flood 2014)."""
    z = np.uint64(cell) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@vectorize(["uint64(int64)"], cache=True)  # pragma: no cover
def _hashes(cell: int) -> np.uint64:
    return mixed(cell)
