"""Tiles of a level: how the area is cut, and how finished tiles are joined again without seams.

A tile's core belongs to it alone; its window reaches over the core by an overlap, in which it and its neighbours agree
up to noise, and heights pass gradually from one to the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files import whole
from .plan import Level

CORE = 512
OVERLAP = 40


@dataclass(frozen=True)
class Tile:
    """A tile by its core's first row and column and size; the window adds the overlap, inside the level."""

    level: Level
    row: int
    column: int
    core: int = CORE
    overlap: int = OVERLAP

    @property
    def core_window(self) -> tuple[int, int, int, int]:
        """First row, first column, rows, columns of the core."""
        return (
            self.row,
            self.column,
            min(self.core, self.level.rows - self.row),
            min(self.core, self.level.columns - self.column),
        )

    @property
    def window(self) -> tuple[int, int, int, int]:
        """First row, first column, rows, columns with the overlap."""
        row, column, rows, columns = self.core_window
        top, left = max(0, row - self.overlap), max(0, column - self.overlap)
        bottom = min(self.level.rows, row + rows + self.overlap)
        right = min(self.level.columns, column + columns + self.overlap)
        return top, left, bottom - top, right - left

    def path(self, scratch: str) -> Path:
        """Return where the finished tile lies."""
        return Path(scratch) / f"level{self.level.number}" / f"{self.row}_{self.column}.npz"

    def weight(self) -> NDArray[np.float32]:
        """Return the weight of the tile over its window: from nearly 0 at its outer edge to 1 in the core's inside."""
        top, left, rows, columns = self.window
        profiles = []
        for start, size, end in ((top, rows, self.level.rows), (left, columns, self.level.columns)):
            index = np.arange(size, dtype=np.float32)
            before = index + 1 if start > 0 else np.full(size, np.inf)
            after = size - index if start + size < end else np.full(size, np.inf)
            profiles.append(np.clip(np.minimum(before, after) / (2 * self.overlap + 1), 0, 1))
        return np.minimum.outer(profiles[0], profiles[1]).astype(np.float32)


def tiles(level: Level, core: int = CORE, overlap: int = OVERLAP) -> list[Tile]:
    """Return the tiles of a level, row by row in alternating direction, so that neighbours share photographs."""
    out = []
    for n, row in enumerate(range(0, level.rows, core)):
        columns = list(range(0, level.columns, core))
        out += [Tile(level, row, column, core, overlap) for column in (columns if n % 2 == 0 else reversed(columns))]
    return out


def save(path: Path, **layers: Any) -> None:
    """Write a finished tile, whole or not at all."""
    with whole(path) as part, part.open("wb") as stream:
        np.savez(stream, **layers)


class Mosaic:
    """Reads windows of a finished level from its tiles' files."""

    def __init__(self, scratch: str, level: Level, core: int = CORE, overlap: int = OVERLAP) -> None:
        self._scratch, self._level, self._core, self._overlap = scratch, level, core, overlap

    def read(self, layer: str, row: int, column: int, rows: int, columns: int) -> NDArray[Any]:
        """Return a layer of a window: each cell from the tile whose core holds it."""
        out: NDArray[Any] | None = None
        for tile in self._touching(row, column, rows, columns):
            top, left, height, width = tile.core_window
            r0, r1 = max(row, top), min(row + rows, top + height)
            c0, c1 = max(column, left), min(column + columns, left + width)
            if r0 >= r1 or c0 >= c1:
                continue
            data = _load(tile, self._scratch, layer)
            top, left = tile.window[:2]
            if out is None:
                out = np.empty((rows, columns, *data.shape[2:]), data.dtype)
            out[r0 - row : r1 - row, c0 - column : c1 - column] = data[r0 - top : r1 - top, c0 - left : c1 - left]
        assert out is not None
        return out

    def blend(self, layer: str, row: int, column: int, rows: int, columns: int, *, tolerance: float) -> NDArray[np.float32]:
        """Return a layer of a window, averaged in the overlaps where tiles agree to ``tolerance``; NaN as in the core."""
        own = self.read(layer, row, column, rows, columns)
        total, weights = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), np.float32)
        for tile in self._touching(row, column, rows, columns):
            top, left, height, width = tile.window
            r0, r1 = max(row, top), min(row + rows, top + height)
            c0, c1 = max(column, left), min(column + columns, left + width)
            if r0 >= r1 or c0 >= c1:
                continue
            here = slice(r0 - row, r1 - row), slice(c0 - column, c1 - column)
            there = slice(r0 - top, r1 - top), slice(c0 - left, c1 - left)
            data = _load(tile, self._scratch, layer)[there]
            with np.errstate(invalid="ignore"):
                agrees = np.abs(data - own[here]) <= tolerance
            weight = np.where(agrees, tile.weight()[there], 0)
            total[here] += np.where(agrees, data - own[here], 0) * weight
            weights[here] += weight
        return np.asarray(own + total / np.maximum(weights, 1e-9), np.float32)

    def _touching(self, row: int, column: int, rows: int, columns: int) -> Iterator[Tile]:
        core, overlap = self._core, self._overlap
        for top in range(max(0, (row - overlap) // core * core), min(row + rows + overlap, self._level.rows), core):
            for left in range(
                max(0, (column - overlap) // core * core), min(column + columns + overlap, self._level.columns), core
            ):
                yield Tile(self._level, top, left, core, overlap)


def _load(tile: Tile, scratch: str, layer: str) -> NDArray[Any]:
    with np.load(tile.path(scratch), allow_pickle=False) as data:
        return np.asarray(data[layer])
