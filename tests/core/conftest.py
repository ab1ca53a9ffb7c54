"""Rasters, layers and a listener for tests of the engine."""

from pathlib import Path

import numpy as np
import pytest
import rasterio
import shapely
from rasterio.transform import Affine
from strandline.core.contract import RasterSource, VectorSource
from strandline.core.progress import Progress
from strandline.core.vector import write_layer

UTM = "EPSG:32755"
WEST, NORTH = 300_000.0, 5_774_000.0


class Listener:
    """Remembers what was said."""

    def __init__(self):
        self.infos, self.warnings, self.fractions = [], [], []

    def fraction(self, value):
        self.fractions.append(value)

    def message(self, text, *, warning):
        (self.warnings if warning else self.infos).append(text)

    def cancelled(self):
        return False


@pytest.fixture
def listener():
    return Listener()


@pytest.fixture
def progress(listener):
    return Progress(listener)


@pytest.fixture
def make_raster(tmp_path):
    """Write an array (rows, columns) as a raster and return its source."""

    def make(
        name,
        values,
        *,
        cell=1.0,
        cell_north=None,
        west=WEST,
        north=NORTH,
        crs=UTM,
        nodata=None,
        transform=None,
        layer_crs=None,
        scale=None,
        offset=None,
        unit=None,
        tags=None,
        **options,
    ):
        path = tmp_path / f"{name}.tif"
        values = np.asarray(values)
        bands = values[None] if values.ndim == 2 else values
        place = transform or Affine(cell, 0, west, 0, -(cell_north or cell), north)
        profile = {"height": bands.shape[1], "width": bands.shape[2], "count": len(bands), "dtype": bands.dtype}
        with rasterio.open(path, "w", driver="GTiff", crs=crs, transform=place, nodata=nodata, **profile, **options) as file:
            file.write(bands)
            if scale is not None:
                file.scales, file.offsets = (scale,) * len(bands), (offset or 0.0,) * len(bands)
            if unit:
                file.units = (unit,) * len(bands)
            if tags:
                file.update_tags(**tags)
        return RasterSource(str(path), layer_crs)

    return make


@pytest.fixture
def make_polygons(tmp_path):
    """Write polygons as a layer and return its source; coordinates count from (WEST, NORTH) unless ``absolute``."""

    def make(name, shapes, fields=None, *, crs=UTM, absolute=False):
        if not absolute:
            shapes = [shapely.transform(s, lambda xy: xy + (WEST, NORTH)) for s in shapes]
        shapes = [shapely.multipolygons(shapely.get_parts(s)) for s in shapes]
        path = tmp_path / f"{name}.gpkg"
        write_layer(str(path), name, crs, fields or {"number": list(range(len(shapes)))}, shapes, "MultiPolygon")
        return VectorSource(str(path), name)

    return make


@pytest.fixture
def read_raster():
    """Read a raster's first band with NaN for nodata, and its profile."""

    def read(path):
        with rasterio.open(Path(path)) as file:
            return file.read(1, masked=True).astype(float).filled(np.nan), file.profile, file.tags()

    return read


@pytest.fixture
def make_lines(tmp_path):
    """Write lines as a layer and return its source; coordinates count from (WEST, NORTH) unless ``absolute``."""

    def make(name, shapes, fields=None, *, crs=UTM, absolute=False, kind="LineString"):
        if not absolute:
            shapes = [shapely.transform(s, lambda xy: xy + (WEST, NORTH)) for s in shapes]
        path = tmp_path / f"{name}.gpkg"
        write_layer(str(path), name, crs, fields or {"number": list(range(len(shapes)))}, shapes, kind)
        return VectorSource(str(path), name)

    return make


@pytest.fixture
def rows():
    """Read a layer's rows; NULL is None."""

    def read(path):
        import pyogrio

        meta, _, _, columns = pyogrio.raw.read(path)
        table = [dict(zip(meta["fields"], values, strict=True)) for values in zip(*columns, strict=True)]
        return [{k: None if isinstance(v, float) and np.isnan(v) else v for k, v in row.items()} for row in table]

    return read


def correlated_field(random, shape, reach):
    """A field (rows, columns) of unit variance with the spherical correlation of range ``reach`` cells, on a torus."""
    rows, columns = shape
    y = np.minimum(np.arange(rows), rows - np.arange(rows))[:, None]
    x = np.minimum(np.arange(columns), columns - np.arange(columns))[None, :]
    h = np.minimum(np.hypot(x, y) / reach, 1.0)
    spectrum = np.maximum(np.fft.fft2(1.0 - 1.5 * h + 0.5 * h**3).real, 0.0)
    return np.fft.ifft2(np.sqrt(spectrum) * np.fft.fft2(random.standard_normal(shape))).real
