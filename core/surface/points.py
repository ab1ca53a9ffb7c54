"""The surface as a point cloud: LAS or LAZ, written tile by tile."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from numpy.typing import NDArray
from pyproj import CRS

from .. import __version__
from ..errors import InputError
from ..files import remove_abandoned, require_writable, whole
from ..raster import Grid

_FINEST = 1e-4  # metres; what heights are stored to


@dataclass(frozen=True)
class Cells:
    """A patch of cells (rows, columns): height (m; NaN: no point), sigma (m), views, filled, colour (.., 3 or 4; 16 bits)."""

    height: NDArray[np.float32]
    sigma: NDArray[np.float32]
    views: NDArray[np.uint8]
    filled: NDArray[np.bool_]
    colour: NDArray[np.uint16]


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
    """Writes cells as coloured points with sigma and views. Use as a context manager: the file is whole or absent.

    Sigma (``sigma``, metres) and the number of photographs (``views``) are extra dimensions, which PDAL, laspy and QGIS show by
    these names. Filled cells are synthetic, by LAS's own flag.
    """

    def __init__(self, path: str, grid: Grid, datum: float = 0.0) -> None:
        """``datum`` is a height (m) in the middle of the surface's, from which heights are counted in the file."""
        self._path, self._grid, self._datum = path, grid, datum

    def __enter__(self) -> PointWriter:
        """Open the file."""
        grid = self._grid
        header = laspy.LasHeader(point_format=7, version="1.4")
        # Whole numbers of 32 bits reach over 2e9 steps: the finest that the extent allows, so that cells stay on their lattice.
        extent = max(grid.width * grid.cell, grid.height * grid.step_north)
        fine = next(s for s in (_FINEST, 1e-3, 1e-2) if extent / s < 2**31 or s == 1e-2)
        header.scales = np.array([fine, fine, _FINEST])
        header.offsets = np.array([np.floor(grid.west), np.floor(grid.north), np.floor(self._datum)])
        header.add_extra_dims(
            [
                laspy.ExtraBytesParams("sigma", "float32", "sigma of matching, m"),
                laspy.ExtraBytesParams("views", "uint8", "photographs"),
            ]
        )
        header.add_crs(CRS.from_user_input(grid.crs))
        header.system_identifier = "image matching"
        header.generating_software = f"Strandline {__version__}"
        remove_abandoned(self._path)
        self._whole = whole(self._path)
        part = self._whole.__enter__()
        self._file = laspy.open(part, mode="w", header=header, do_compress=Path(self._path).suffix.lower() == ".laz")
        self._header = header
        return self

    def write(self, column: int, row: int, cells: Cells) -> None:
        """Add the cells of a patch that have a height."""
        r, c = np.nonzero(np.isfinite(cells.height))
        if not len(r):
            return
        record = laspy.ScaleAwarePointRecord.zeros(len(r), header=self._header)
        record.x, record.y = self._grid.centres(row + r, column + c)
        record.z = cells.height[r, c].astype(float)
        record.red, record.green, record.blue = (cells.colour[r, c, k] for k in range(3))
        record.return_number[:], record.number_of_returns[:] = 1, 1
        record["sigma"], record["views"] = cells.sigma[r, c], cells.views[r, c]
        record.synthetic[:] = cells.filled[r, c]
        self._file.write_points(record)

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        """Finish the file, or remove it."""
        try:
            self._file.close()
        except BaseException as failure:
            self._whole.__exit__(type(failure), failure, failure.__traceback__)
            raise
        self._whole.__exit__(kind, error, trace)
