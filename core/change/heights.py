"""A surface model as heights in metres, with NaN where there is none, whatever its file says or forgets to say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..contract import RasterSource
from ..errors import InputError, NotEnoughData
from ..progress import Progress
from ..raster import RasterFile
from .units import Units, units_of

Array = NDArray[np.float64]
_CELLS = 2_000_000  # cells read at once: 16 MB
_CUSTOMARY = frozenset({-99.0, -999.0, -9999.0, -10000.0, -32767.0, -32768.0, -99999.0, 9999.0, 32767.0, 65535.0, 99999.0})
_NO_HEIGHT = 1e5  # metres; nothing on Earth is that high or deep


@dataclass(frozen=True)
class Heights:
    """An open surface model.

    ``transform`` holds a, b, c, d, e, f of ``x = a column + b row + c``, ``y = d column + e row + f`` in metres of ``units.crs``.
    ``nodata`` are the stored values that mean "no height"; ``mean_square`` is that of the values in metres.
    """

    label: str
    file: RasterFile
    units: Units
    transform: tuple[float, ...]
    nodata: tuple[float, ...] = ()
    mean_square: float = 0.0

    def __enter__(self) -> Heights:
        """Return itself, open."""
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        """Close the file."""
        self.file.__exit__(kind, error, trace)

    @property
    def cell(self) -> float:
        """The size (m) of the square that has the cell's area."""
        a, b, _, d, e, _ = self.transform
        return float(abs(a * e - b * d)) ** 0.5

    def read(self, column: int, row: int, width: int, height: int) -> Array:
        """Return heights (rows, columns) of a window inside the raster."""
        values = self.file.read(column, row, width, height)
        for value in self.nodata:
            values[values == value] = np.nan
        values[np.isinf(values)] = np.nan
        return self.metres(values)

    def metres(self, stored: Array) -> Array:
        """Return heights of stored values."""
        return (stored * self.file.scale + self.file.offset) * self.units.vertical


class _Extremes(NamedTuple):
    """The two lowest and two highest distinct stored values, how often the outer ones and zero came, cells and sum of squares."""

    low: float = np.inf
    second_low: float = np.inf
    low_count: float = 0.0
    high: float = -np.inf
    second_high: float = -np.inf
    high_count: float = 0.0
    zeros: float = 0.0
    cells: float = 0.0
    squares: float = 0.0  # of metres


def open_heights(source: RasterSource, label: str, nodata: float | None, progress: Progress) -> Heights:
    """Open a surface model and read it once, to know that it is whole and which values are no heights.

    ``nodata`` replaces the value that the file declares.

    Raises
    ------
    InputError
        When it cannot be read, placed or measured.
    NotEnoughData
        When it has no heights.
    """
    file = RasterFile(source.path)
    if file.colour or file.dtype.startswith("complex"):
        raise InputError(f"{label} ({source.path}) is a picture, not a surface model: give a raster of heights.")
    if not file.placed:
        raise InputError(f"{label} ({source.path}) has no place on the ground (no geotransform): georeference it.")
    if file.bands > 1:
        progress.warn(f"{label} has {file.bands} bands: the first is taken as heights.")
    units = units_of(label, file.crs, source.crs, file.unit)
    if (units.horizontal, units.vertical) != (1.0, 1.0):
        progress.info(
            f"{label} is converted to metres: {units.horizontal:.9g} m per unit of its CRS, {units.vertical:.9g} m of height."
        )
    transform = tuple(v * units.horizontal for v in file.transform)
    heights = Heights(label, file, units, transform, _declared(label, file, nodata, progress))
    while True:
        seen = _scan(heights, progress)
        found = _undeclared(seen, abs(file.scale * units.vertical))
        if found is None:
            break
        progress.warn(
            f"{label}: the value {found:.9g} is far outside the other heights and is treated as no data; declare it with NODATA."
        )
        heights = replace(heights, nodata=(*heights.nodata, found))
    if not seen.cells:
        raise NotEnoughData(f"{label} ({source.path}) has no heights at all: every cell is without data.")
    if seen.zeros > 0.05 * seen.cells and seen.low < seen.high:
        share = 100.0 * seen.zeros / seen.cells
        progress.warn(f"{label}: {share:.0f} % of the heights are exactly 0; if that means no data, give NODATA=0.")
    return replace(heights, mean_square=seen.squares / seen.cells)


def _declared(label: str, file: RasterFile, nodata: float | None, progress: Progress) -> tuple[float, ...]:
    if nodata is None:
        return () if file.nodata is None or np.isnan(file.nodata) else (file.nodata, *_as_stored(file, file.nodata))
    if file.nodata is not None and not np.isnan(file.nodata) and file.nodata != nodata:
        progress.warn(f"{label}: NODATA {nodata:.9g} replaces the file's own no-data value {file.nodata:.9g}.")
    return (nodata, *_as_stored(file, nodata))


def _as_stored(file: RasterFile, value: float) -> tuple[float, ...]:
    """Return ``value`` as a 32-bit file has it: -3.4e38 written with a few digits is another number there."""
    if file.dtype != "float32":
        return ()
    return (float(np.float32(np.clip(value, -3.4028234663852886e38, 3.4028234663852886e38))),)


def _scan(heights: Heights, progress: Progress) -> _Extremes:
    seen = np.array(_Extremes())
    nodata = np.array(heights.nodata, float)
    to_metres = heights.metres(np.array([0.0, 1.0]))
    for block in progress.over(list(_blocks(heights.file))):
        _look(heights.file.read(*block), nodata, to_metres[0], to_metres[1] - to_metres[0], seen)
    return _Extremes(*seen.tolist())


def _blocks(file: RasterFile) -> Iterator[tuple[int, int, int, int]]:
    rows = max(1, _CELLS // file.width)
    for row in range(0, file.height, rows):
        yield 0, row, file.width, min(rows, file.height - row)


def _undeclared(seen: _Extremes, metres: float) -> float | None:
    """Return the stored value (``metres`` per unit) that can only mean "no data": an end of the values far from all others.

    A value in customary use needs one cell and a gap of twice the range of the rest; any other needs ten cells, a gap of
    twenty times that range, and 1,000 m. A number that no height on Earth reaches needs nothing.
    """
    # Without both ends, so that a no-data value at one end does not hide another at the other.
    rest = max(0.0, seen.second_high - seen.second_low) if np.isfinite(seen.second_high - seen.second_low) else 0.0
    for value, count, gap in (
        (seen.low, seen.low_count, seen.second_low - seen.low),
        (seen.high, seen.high_count, seen.high - seen.second_high),
    ):
        if not np.isfinite(value):
            continue
        alone = not np.isfinite(gap)
        if abs(value) * metres >= _NO_HEIGHT or (alone and value in _CUSTOMARY and value < -500.0):
            return value
        if not alone and value in _CUSTOMARY and gap > 2.0 * rest and gap > 50.0:
            return value
        if not alone and count >= 10 and gap > 20.0 * rest and gap * metres > 1000.0:
            return value
    return None


@njit(cache=True)  # pragma: no cover
def _look(values: Array, nodata: Array, offset: float, scale: float, seen: Array) -> None:
    """Update ``seen``, the numbers of _Extremes, by the stored values (rows, columns) that are finite and not ``nodata``."""
    for value in values.flat:
        if not np.isfinite(value):
            continue
        hidden = False
        for other in nodata:
            hidden |= value == other
        if hidden:
            continue
        if value < seen[0]:
            seen[1], seen[0], seen[2] = seen[0], value, 0.0
        elif seen[0] < value < seen[1]:
            seen[1] = value
        if value > seen[3]:
            seen[4], seen[3], seen[5] = seen[3], value, 0.0
        elif seen[4] < value < seen[3]:
            seen[4] = value
        seen[2] += value == seen[0]
        seen[5] += value == seen[3]
        seen[6] += value == 0.0
        seen[7] += 1.0
        metres = offset + scale * value
        seen[8] += metres * metres
