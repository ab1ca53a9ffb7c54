"""The difference of two aligned models, tile by tile: change, sigma, significance, raster files and tallies."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from ..errors import NotEnoughData
from ..progress import Progress
from ..raster import CogWriter, Grid, Patch
from .alignment import Aligned, tiles
from .coregistration import Shift
from .sampling import Sample
from .significance import HALO, beyond_detection, coherent
from .volumes import Cells, Tally
from .zones import cell_shares, touched

Array = NDArray[np.float64]
_PREVIEW = 900  # cells of the report's map along its longer side
_STABLE_CELLS = 300_000  # of stable ground that are kept; more would tell nothing new
_PATCH = 32  # cells


@dataclass(frozen=True)
class Sigma:
    """Where the sigma of a cell's change comes from: two precision rasters or numbers, or one number for both.

    ``common`` (m) stands for both models; else ``before`` and ``after`` do.
    """

    before: Aligned | float | None = None
    after: Aligned | float | None = None
    common: float | None = None

    def at(self, window: Grid) -> Array:
        """Return the sigma (rows, columns) on a window; NaN where a precision raster has none."""
        if self.common is not None:
            return np.full((window.height, window.width), self.common)
        return np.asarray(np.hypot(_one(self.before, window), _one(self.after, window)))

    def moved(self, offset: tuple[float, float]) -> Sigma:
        """Return the same for AFTER read beside its place."""
        return replace(self, after=replace(self.after, offset=offset)) if isinstance(self.after, Aligned) else self


@dataclass(frozen=True)
class Pair:
    """Two models on one grid; ``ignore`` are polygons in the grid's CRS whose cells have no change."""

    before: Aligned
    after: Aligned
    ignore: list[Any]

    @property
    def grid(self) -> Grid:
        """The common grid."""
        return self.before.grid

    def moved(self, offset: tuple[float, float]) -> Pair:
        """Return the same with AFTER read ``offset`` (m to the east and north) beside its place."""
        return replace(self, after=replace(self.after, offset=offset))

    def tiles(self, halo: int = 0) -> list[tuple[int, int, int, int]]:
        """Return the grid's tiles, sized by what must be read for one."""
        return tiles(self.grid, max(self.before.points, self.after.points), halo)

    def change(self, window: Grid) -> tuple[Array, Array]:
        """Return after minus before and before (rows, columns) on a window."""
        before = self.before.read(window)
        if np.isnan(before).all():
            return before.copy(), before
        change = self.after.read(window) - before
        if self.ignore:
            change[touched(self.ignore, window)] = np.nan
        return change, before


@dataclass(frozen=True)
class Stable:
    """A random sample of the ``count`` cells of stable ground: row, column, place (m), height before, change and sigma (n,).

    ``patches`` are whole patches of neighbours, for what goes with distance; None when the sample is all there is.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    x: Array
    y: Array
    height: Array
    change: Array
    sigma: Array | None
    count: int
    patches: Stable | None = None

    def with_sigma(self, value: float) -> Stable:
        """Return the same with one sigma for all cells."""
        patches = None if self.patches is None else self.patches.with_sigma(value)
        return replace(self, sigma=np.full(len(self.change), value), patches=patches)


@dataclass
class Outcome:
    """What a pass over the grid leaves: tallies, a thinned map of change and BEFORE's height, and counts."""

    tallies: list[Tally]
    change: Array
    height: Array
    thinning: int
    valid: int = 0
    moved: int = 0
    without_sigma: int = 0


def stable_ground(pair: Pair, stable: list[Any], sigma: Sigma | None, progress: Progress) -> Stable:
    """Return the change of the cells of which at least half lies on stable ground."""
    grid = pair.grid
    sample, patches = Sample(_STABLE_CELLS, 7), Sample(_STABLE_CELLS, 7)
    tree = shapely.STRtree(stable)
    for column, row, width, height in progress.over(pair.tiles()):
        window = grid.window(column, row, width, height)
        near = tree.query(shapely.box(*window.bounds))
        if not len(near):
            continue
        inside = touched([stable[i] for i in near], window, 0.5)
        if not inside.any():
            continue
        change, before = pair.change(window)
        spread = np.zeros_like(change) if sigma is None else sigma.at(window)
        rows, columns = np.nonzero(inside & np.isfinite(change) & np.isfinite(spread))
        r, c = rows + row, columns + column
        x, y = grid.centres(r, c)
        values = (r.astype(float), c.astype(float), x, y, before[rows, columns], change[rows, columns], spread[rows, columns])
        sample.add(r * grid.width + c, *values)
        patches.add(r * grid.width + c, *values, patches=(r // _PATCH) * grid.width + c // _PATCH)
    found = _stable(sample, sigma is not None)
    return found if sample.count <= _STABLE_CELLS else replace(found, patches=_stable(patches, sigma is not None))


def difference(
    pair: Pair,
    shift: Shift,
    sigma: Sigma | None,
    shapes: list[Any],
    *,
    registration: float,
    method: Literal["cell", "uniform", "coherent"],
    confidence: float,
    output: str,
    significant: str | None,
    tags: dict[str, str],
    progress: Progress,
) -> Outcome:
    """Write the change, and where asked the significant change, and tally it over ``shapes``.

    ``registration`` (m) widens the level of detection only. Nothing is left on disk when this fails.
    """
    grid = pair.grid
    thinning = max(1, -(-max(grid.width, grid.height) // _PREVIEW))
    small = (-(-grid.height // thinning), -(-grid.width // thinning))
    outcome = Outcome([Tally(float(shapely.area(s))) for s in shapes], np.full(small, np.nan), np.full(small, np.nan), thinning)
    tree = shapely.STRtree(shapes)
    halo = HALO if method == "coherent" and sigma is not None else 1  # slopes look one cell further
    with ExitStack() as files:
        whole = files.enter_context(CogWriter(output, grid, names=("change",), tags=tags))
        kept_file = (
            files.enter_context(CogWriter(significant, grid, names=("significant change",), tags=tags)) if significant else None
        )
        for column, row, width, height in progress.over(pair.tiles(halo)):
            around, inner = with_halo(grid, column, row, width, height, halo)
            change, before = pair.change(around)
            _thin(outcome.height, thinning, column, row, before[inner])
            if np.isnan(change[inner]).all():
                continue  # the files begin without data
            change = change - _shift_on(shift, around, before)
            spread = kept = None
            if sigma is not None:
                spread = sigma.at(around)
                detection = np.hypot(spread, registration)
                rule = coherent if method == "coherent" else beyond_detection
                kept = rule(change, detection, confidence)[inner] & np.isfinite(change[inner])
                spread = spread[inner]
                outcome.without_sigma += int(np.count_nonzero(np.isfinite(change[inner]) & ~np.isfinite(spread)))
            after = _ringed(before + change, inner)
            change, before = change[inner], before[inner]
            whole.write(Patch(column, row, change[None]))
            if kept_file is not None and kept is not None:
                kept_file.write(Patch(column, row, np.where(kept, change, np.nan)[None]))
            window = grid.window(column, row, width, height)
            tile = Cells(window, row * grid.width + column, grid.width, change, spread, kept, before, after)
            for i in tree.query(shapely.box(*window.bounds)):
                found = cell_shares(shapes[i], window)
                if found is not None:
                    outcome.tallies[i].add(tile, *found)
            _thin(outcome.change, thinning, column, row, change)
            known = np.isfinite(change)
            outcome.valid += int(np.count_nonzero(known))
            outcome.moved += int(np.count_nonzero(known & (change != 0)))
        if outcome.valid == 0:
            raise NotEnoughData("BEFORE and AFTER have no cell where both have a height: choose rasters whose data overlap.")
    return outcome


def _stable(sample: Sample, sigma_known: bool) -> Stable:
    r, c, x, y, height, change, spread = sample.values.T
    return Stable(r.astype(np.int64), c.astype(np.int64), x, y, height, change, spread if sigma_known else None, sample.count)


def _one(source: Aligned | float | None, window: Grid) -> Array:
    if isinstance(source, Aligned):
        values = source.read(window)
        values[values <= 0] = np.nan
        return values
    return np.full((window.height, window.width), np.nan if source is None else source)


def with_halo(grid: Grid, column: int, row: int, width: int, height: int, halo: int) -> tuple[Grid, tuple[slice, slice]]:
    """Return the window with its halo, cut at the grid's edges, and where the window lies in it."""
    left, top = min(halo, column), min(halo, row)
    right, bottom = min(halo, grid.width - column - width), min(halo, grid.height - row - height)
    around = grid.window(column - left, row - top, width + left + right, height + top + bottom)
    return around, (slice(top, top + height), slice(left, left + width))


def _ringed(values: Array, inner: tuple[slice, slice]) -> Array:
    """Return the ``inner`` part of values with one cell around it, NaN where the grid ends."""
    rows, columns = inner
    missing = [(int(part.start == 0), int(part.stop == size)) for part, size in zip(inner, values.shape, strict=True)]
    part = values[max(rows.start - 1, 0) : rows.stop + 1, max(columns.start - 1, 0) : columns.stop + 1]
    return np.pad(part, missing, constant_values=np.nan) if any(map(any, missing)) else part


def _shift_on(shift: Shift, window: Grid, height: Array) -> Array:
    x, y = window.centres(np.arange(window.height), np.arange(window.width))
    return shift.at(x[None, :], y[:, None], height)


def _thin(map_: Array, step: int, column: int, row: int, values: Array) -> None:
    """Put every ``step``-th cell of a tile that begins at ``column``, ``row`` into the thinned map."""
    r, c = (-row) % step, (-column) % step
    part = values[r::step, c::step]
    map_[(row + r) // step :, (column + c) // step :][: part.shape[0], : part.shape[1]] = part
