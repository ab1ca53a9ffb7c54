"""Rasters on disk. This module alone knows rasterio.

Arrays are float32 or uint8 with rows from north to south; NaN is "no value" and becomes a declared nodata value on disk.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import rasterio.shutil
from numpy.typing import NDArray
from rasterio._err import CPLE_BaseError  # what copying raises is of no public class
from rasterio.crs import CRS
from rasterio.enums import Resampling
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.transform import Affine
from rasterio.windows import Window

from .errors import InputError
from .files import remove_abandoned, require_writable, whole

# GDAL would keep 5 % of the machine's memory in blocks, in each process.
os.environ.setdefault("GDAL_CACHEMAX", "192")

NODATA = -9999.0
_BLOCK = 512


@dataclass(frozen=True)
class Grid:
    """A north-up grid: the west and north edges (m), the cell size (m), its size in cells, its CRS (WKT2).

    Cells are square unless ``cell_north``, their size from south to north, says otherwise.
    """

    west: float
    north: float
    cell: float
    width: int
    height: int
    crs: str
    cell_north: float | None = None

    @property
    def step_north(self) -> float:
        """The cell's size from south to north (m)."""
        return self.cell if self.cell_north is None else self.cell_north

    @property
    def cell_area(self) -> float:
        """The area of a cell (m2)."""
        return self.cell * self.step_north

    @property
    def transform(self) -> Affine:
        """The affine from column, row (corners) to easting, northing."""
        return Affine(self.cell, 0.0, self.west, 0.0, -self.step_north, self.north)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east, north."""
        return self.west, self.north - self.height * self.step_north, self.west + self.width * self.cell, self.north

    def centres(self, rows: NDArray[Any], columns: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the eastings and northings of the centres of cells, in the shapes of ``columns`` and ``rows``."""
        east = self.west + (np.asarray(columns, np.float64) + 0.5) * self.cell
        north = self.north - (np.asarray(rows, np.float64) + 0.5) * self.step_north
        return np.asarray(east), np.asarray(north)

    def window(self, column: int, row: int, width: int, height: int) -> Grid:
        """Return the part of the grid that starts at ``column``, ``row``."""
        west, north = self.west + column * self.cell, self.north - row * self.step_north
        return replace(self, west=west, north=north, width=width, height=height)


class RasterFile:
    """The first band of a raster file, read by windows. Use as a context manager.

    ``transform`` holds a, b, c, d, e, f of ``x = a column + b row + c``, ``y = d column + e row + f``; ``crs`` is WKT2 or None,
    ``nodata`` the declared value or None, ``unit`` the band's declared unit or "", ``colour`` True for a picture.
    A height is ``value * scale + offset``.
    """

    def __init__(self, path: str) -> None:
        try:
            with warnings.catch_warnings():
                # A raster without a place is refused by who needs one, in a sentence of its own.
                warnings.simplefilter("ignore", NotGeoreferencedWarning)
                self._file = rasterio.open(path)
        except RasterioError as error:
            raise InputError(f"The raster {path} cannot be read ({error}): give a raster file that is whole.") from error
        file = self._file
        self.path, self.width, self.height = path, int(file.width), int(file.height)
        self.transform: tuple[float, ...] = tuple(file.transform)[:6]
        self.placed = not file.transform.is_identity
        self.crs: str | None = file.crs.to_wkt(version="WKT2_2019") if file.crs else None
        self.nodata: float | None = file.nodata
        self.scale, self.offset = float(file.scales[0]), float(file.offsets[0])
        self.unit = str(file.units[0] or "")
        self.dtype = str(file.dtypes[0])
        interpretations = [c.name for c in file.colorinterp]
        self.colour = "red" in interpretations or "palette" in interpretations
        self.bands = sum(name != "alpha" for name in interpretations)
        self.tags: dict[str, str] = file.tags()
        self._masked = any(flag.name in ("per_dataset", "alpha") for flag in file.mask_flag_enums[0])

    def __enter__(self) -> RasterFile:
        """Return itself, open."""
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        """Close the file."""
        self._file.close()

    def read(self, column: int, row: int, width: int, height: int) -> NDArray[np.float64]:
        """Return the stored values of a window (rows, columns) inside the raster; NaN where a mask or alpha band hides them.

        Neither nodata nor scale and offset are applied: whoever reads knows more about them than the file.

        Raises
        ------
        InputError
            When the file is damaged there.
        """
        window = Window(column, row, width, height)
        try:
            values = self._file.read(1, window=window).astype(np.float64)
            if self._masked:
                values[self._file.dataset_mask(window=window) == 0] = np.nan
        except RasterioError as error:
            raise InputError(
                f"The raster {self.path} is damaged near row {row} ({error.__cause__ or error}): give a whole copy of it."
            ) from error
        return values


@dataclass(frozen=True)
class Patch:
    """A rectangle of values (bands, rows, columns) whose top-left cell is at ``column``, ``row`` of the grid."""

    column: int
    row: int
    values: NDArray[Any]


def check_destination(path: str) -> None:
    """Refuse, before any work, a raster that could not be written.

    Raises
    ------
    InputError
        When the name does not end in .tif or its folder cannot be written to.
    """
    target = Path(path)
    if target.suffix.lower() not in (".tif", ".tiff"):
        raise InputError(f"The raster {path} must be a GeoTIFF: give a name that ends in .tif.")
    require_writable(path, "raster")


class CogWriter:
    """Collects patches of one raster on disk and makes a cloud-optimised GeoTIFF of them; memory stays at a block.

    Use as a context manager: on success the finished raster replaces ``path``, otherwise nothing is left behind.
    """

    def __init__(
        self,
        path: str,
        grid: Grid,
        *,
        dtype: str = "float32",
        bands: int = 1,
        names: tuple[str, ...] = (),
        unit: str = "",
        nodata: float | None = None,
        overviews: str = "average",
        tags: dict[str, str] | None = None,
    ) -> None:
        """``nodata`` is NODATA for floats unless given, none for whole numbers; ``overviews`` is GDAL's resampling for them."""
        check_destination(path)
        self._path, self._grid, self._dtype, self._bands = path, grid, dtype, bands
        self._names, self._unit, self._overviews, self._tags = names, unit, overviews, tags or {}
        self._nodata = NODATA if nodata is None and dtype == "float32" else nodata

    def __enter__(self) -> CogWriter:
        """Open the collecting file."""
        remove_abandoned(self._path)
        self._whole = whole(self._path)
        self._part = self._whole.__enter__()
        self._raw = self._part.with_name(self._part.name + ".raw.tmp")
        # An RGB image is masked by a fourth band; values carry nodata.
        extra: dict[str, Any] = {} if self._nodata is None else {"nodata": self._nodata}
        if self._bands == 4:
            extra = {"photometric": "RGB", "alpha": "NON-PREMULTIPLIED"}
        self._file = rasterio.open(
            self._raw,
            "w",
            driver="GTiff",
            width=self._grid.width,
            height=self._grid.height,
            count=self._bands,
            dtype=self._dtype,
            crs=CRS.from_wkt(self._grid.crs),
            transform=self._grid.transform,
            tiled=True,
            blockxsize=_BLOCK,
            blockysize=_BLOCK,
            compress="zstd",
            zstd_level=1,
            bigtiff="if_safer",
            **extra,
        )
        if self._nodata:
            _fill(self._file, self._nodata)
        return self

    def write(self, patch: Patch) -> None:
        """Put a patch in its place; NaN becomes nodata."""
        values = patch.values
        if self._dtype == "float32":
            values = np.where(np.isnan(values), np.float32(NODATA), values).astype(np.float32)
        window = Window(patch.column, patch.row, values.shape[2], values.shape[1])
        try:
            self._file.write(values, window=window)
        except RasterioError as error:
            raise InputError(f"The raster {self._path} cannot be written ({error}): is there room on its disk?") from error

    def read(self, column: int, row: int, width: int, height: int) -> NDArray[Any]:
        """Return what has been collected in a window (bands, rows, columns), nodata as it is on disk."""
        return np.asarray(self._file.read(window=Window(column, row, width, height)))

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        """Finish the raster, or remove what was collected."""
        try:
            try:
                if kind is None:
                    for band, name in enumerate(self._names, start=1):
                        self._file.set_band_description(band, name)
                    if self._unit:
                        self._file.units = (self._unit,) * self._bands
                    self._file.update_tags(AREA_OR_POINT="Area", **self._tags)
                self._file.close()
                if kind is None:
                    self._finish()
            except BaseException as failure:
                self._whole.__exit__(type(failure), failure, failure.__traceback__)
                raise
            self._whole.__exit__(kind, error, trace)
        except (RasterioError, CPLE_BaseError) as failure:
            raise InputError(f"The raster {self._path} cannot be written ({failure}): is there room on its disk?") from failure
        finally:
            # Only now, so that what stands shows whether the disk was full.
            self._raw.unlink(missing_ok=True)

    def _finish(self) -> None:
        rasterio.shutil.copy(
            self._raw,
            self._part,
            driver="COG",
            compress="deflate",
            predictor="yes",
            blocksize=_BLOCK,
            overview_resampling=self._overviews,
            # What lies in a picture's colours tells nothing; of values QGIS wants to know the range at once.
            statistics="NO" if self._bands == 4 else "YES",
            bigtiff="if_safer",
            num_threads=1,
        )


def write_cog(path: str, grid: Grid, patches: Iterable[Patch], **options: Any) -> None:
    """Write ``patches`` as one raster; ``options`` are CogWriter's."""
    with CogWriter(path, grid, **options) as writer:
        for patch in patches:
            writer.write(patch)


def _fill(file: Any, value: float) -> None:
    for _, window in file.block_windows(1):
        shape = (file.count, int(window.height), int(window.width))
        file.write(np.full(shape, value, file.dtypes[0]), window=window)


__all__ = ["NODATA", "CogWriter", "Grid", "Patch", "RasterFile", "Resampling", "check_destination", "write_cog"]
