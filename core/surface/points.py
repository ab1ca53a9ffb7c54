"""The surface as a point cloud: LAS or LAZ, written tile by tile."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import laspy
import numpy as np
from numpy.typing import NDArray
from pyproj import CRS

from ..errors import InputError
from ..files import remove_abandoned, require_writable, whole
from ..raster import Grid

_SCALE = 0.001  # metres


def check_points_destination(path: str) -> None:
    """Refuse, before any work, a point cloud that could not be written.

    Raises
    ------
    InputError
        When the name does not end in .laz or .las or its folder cannot be written to.
    """
    target = Path(path)
    if target.suffix.lower() not in (".laz", ".las"):
        raise InputError(f"The point cloud {path} must be LAS or LAZ: give a name that ends in .laz.")
    require_writable(path, "point cloud")


class PointWriter:
    """Writes cells as coloured points. Use as a context manager: the file is whole or absent."""

    def __init__(self, path: str, grid: Grid) -> None:
        self._path, self._grid = path, grid

    def __enter__(self) -> PointWriter:
        """Open the file."""
        header = laspy.LasHeader(point_format=7, version="1.4")
        header.scales = np.full(3, _SCALE)
        header.offsets = np.array([np.floor(self._grid.west), np.floor(self._grid.north), 0.0])
        header.add_crs(CRS.from_user_input(self._grid.crs))
        remove_abandoned(self._path)
        self._whole = whole(self._path)
        part = self._whole.__enter__()
        self._file = laspy.open(part, mode="w", header=header, do_compress=Path(self._path).suffix.lower() == ".laz")
        self._header = header
        return self

    def write(self, column: int, row: int, height: NDArray[np.float32], colour: NDArray[np.uint8]) -> None:
        """Add the cells of a patch that have a height; ``colour`` is (rows, columns, 3 or 4)."""
        r, c = np.nonzero(np.isfinite(height))
        if not len(r):
            return
        record = laspy.ScaleAwarePointRecord.zeros(len(r), header=self._header)
        record.x = self._grid.west + (column + c + 0.5) * self._grid.cell
        record.y = self._grid.north - (row + r + 0.5) * self._grid.cell
        record.z = height[r, c].astype(float)
        shade = colour[r, c].astype(np.uint16) * 257
        record.red, record.green, record.blue = shade[:, 0], shade[:, 1], shade[:, 2]
        record.return_number[:], record.number_of_returns[:] = 1, 1
        self._file.write_points(record)

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        """Finish the file, or remove it."""
        try:
            self._file.close()
        except BaseException as failure:
            self._whole.__exit__(type(failure), failure, failure.__traceback__)
            raise
        self._whole.__exit__(kind, error, trace)
