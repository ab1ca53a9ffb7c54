"""Tiles of a level: how the area is cut, and how finished tiles are joined again without seams.

A tile's core belongs to it alone; its window reaches over the core by an overlap, in which it and its neighbours agree
up to noise, and heights pass gradually from one to the other.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files import whole
from .plan import Level

CORE = 512
OVERLAP = 40
_KEPT = 48  # layers of tiles kept at hand: those of a window and its neighbours
_NOTHING = {"height": np.nan, "score": np.nan, "sigma": np.nan}  # in tiles that were not computed; 0 in other layers


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


def needed(
    levels: tuple[Level, ...], finest: list[Tile], window: Callable[[Tile, Level], tuple[int, int, int, int]]
) -> list[list[Tile]]:
    """Return the tiles to compute of each level, from coarse to fine, so that ``finest`` can be.

    ``window`` returns first row, first column, rows and columns of what a tile needs of the next coarser level.
    """
    out = [finest]
    for level in reversed(levels[:-1]):
        asking = out[0]
        core, overlap = (asking[0].core, asking[0].overlap) if asking else (CORE, OVERLAP)
        places = {
            (tile.row, tile.column)
            for asked in asking
            for tile in touching(level, *window(asked, level), core=core, overlap=overlap)
        }
        out.insert(0, [tile for tile in tiles(level, core, overlap) if (tile.row, tile.column) in places])
    return out


def save(path: Path, **layers: Any) -> None:
    """Write a finished tile, whole or not at all."""
    with whole(path) as part, part.open("wb") as stream:
        np.savez(stream, **layers)


class Mosaic:
    """Reads windows of a finished level from its tiles' files; ``only`` are those that were computed, None when all were."""

    def __init__(
        self, scratch: str, level: Level, core: int = CORE, overlap: int = OVERLAP, *, only: list[Tile] | None = None
    ) -> None:
        self._scratch, self._level, self._core, self._overlap = scratch, level, core, overlap
        self._only = None if only is None else {(tile.row, tile.column) for tile in only}
        self._at_hand = OrderedDict[tuple[int, int, str], NDArray[Any]]()

    def read(self, layer: str, row: int, column: int, rows: int, columns: int) -> NDArray[Any]:
        """Return a layer of a window: each cell from the tile whose core holds it; NaN or 0 where none was computed."""
        out: NDArray[Any] | None = None
        for tile in self._standing(row, column, rows, columns):
            top, left, height, width = tile.core_window
            r0, r1 = max(row, top), min(row + rows, top + height)
            c0, c1 = max(column, left), min(column + columns, left + width)
            if r0 >= r1 or c0 >= c1:
                continue
            data = self._load(tile, layer)
            top, left = tile.window[:2]
            if out is None:
                out = np.full((rows, columns, *data.shape[2:]), _NOTHING.get(layer, 0), data.dtype)
            out[r0 - row : r1 - row, c0 - column : c1 - column] = data[r0 - top : r1 - top, c0 - left : c1 - left]
        assert out is not None
        return out

    def blend(self, layer: str, row: int, column: int, rows: int, columns: int, *, tolerance: float) -> NDArray[np.float32]:
        """Return a layer of a window, averaged in the overlaps where tiles agree to ``tolerance``; NaN as in the core."""
        own = self.read(layer, row, column, rows, columns)
        total, weights = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), np.float32)
        for tile in self._standing(row, column, rows, columns):
            top, left, height, width = tile.window
            r0, r1 = max(row, top), min(row + rows, top + height)
            c0, c1 = max(column, left), min(column + columns, left + width)
            if r0 >= r1 or c0 >= c1:
                continue
            here = slice(r0 - row, r1 - row), slice(c0 - column, c1 - column)
            there = slice(r0 - top, r1 - top), slice(c0 - left, c1 - left)
            data = self._load(tile, layer)[there]
            with np.errstate(invalid="ignore"):
                agrees = np.abs(data - own[here]) <= tolerance
            weight = np.where(agrees, tile.weight()[there], 0)
            total[here] += np.where(agrees, data - own[here], 0) * weight
            weights[here] += weight
        return np.asarray(own + total / np.maximum(weights, 1e-9), np.float32)

    def _standing(self, row: int, column: int, rows: int, columns: int) -> Iterator[Tile]:
        for tile in touching(self._level, row, column, rows, columns, self._core, self._overlap):
            if self._only is None or (tile.row, tile.column) in self._only:
                yield tile

    def _load(self, tile: Tile, layer: str) -> NDArray[Any]:
        key = tile.row, tile.column, layer
        if key in self._at_hand:
            self._at_hand.move_to_end(key)
            return self._at_hand[key]
        with np.load(tile.path(self._scratch), allow_pickle=False) as data:
            self._at_hand[key] = np.asarray(data[layer])
        if len(self._at_hand) > _KEPT:
            self._at_hand.popitem(last=False)
        return self._at_hand[key]


def touching(
    level: Level, row: int, column: int, rows: int, columns: int, core: int = CORE, overlap: int = OVERLAP
) -> Iterator[Tile]:
    """Yield the tiles whose windows reach into a window of a level."""
    for top in range(max(0, (row - overlap) // core * core), min(row + rows + overlap, level.rows), core):
        for left in range(max(0, (column - overlap) // core * core), min(column + columns + overlap, level.columns), core):
            yield Tile(level, top, left, core, overlap)
