"""Grids, windows and reading raster files."""

from pathlib import Path

import numpy as np
import pytest
from strandline.core.errors import InputError
from strandline.core.raster import NODATA, CogWriter, Grid, Patch, RasterFile

UTM = "EPSG:32755"


@pytest.fixture
def grid():
    from pyproj import CRS

    return Grid(300_000.0, 5_774_000.0, 2.0, 5, 4, CRS.from_user_input(UTM).to_wkt(), 3.0)


def test_cells_need_not_be_square(grid):
    assert grid.bounds == (300_000.0, 5_774_000.0 - 12.0, 300_010.0, 5_774_000.0)
    assert grid.cell_area == 6.0
    part = grid.window(1, 2, 2, 2)
    assert (part.west, part.north, part.step_north) == (300_002.0, 5_774_000.0 - 6.0, 3.0)
    east, north = grid.centres(np.array([0, 3]), np.array([0, 4]))
    assert east.tolist() == [300_001.0, 300_009.0]
    assert north.tolist() == [5_774_000.0 - 1.5, 5_774_000.0 - 10.5]


def test_square_by_default(grid):
    square = Grid(0.0, 0.0, 2.0, 5, 4, grid.crs)
    assert square.step_north == 2.0
    assert square.window(0, 1, 1, 1).bounds == (0.0, -4.0, 2.0, -2.0)


def test_written_grid_is_read_back(grid, tmp_path):
    values = np.arange(20.0, dtype=np.float32).reshape(4, 5)
    values[1, 1] = np.nan
    with CogWriter(str(tmp_path / "a.tif"), grid, tags={"KEY": "value"}) as writer:
        writer.write(Patch(0, 0, values[None]))
    with RasterFile(str(tmp_path / "a.tif")) as file:
        assert file.transform == pytest.approx((2.0, 0.0, 300_000.0, 0.0, -3.0, 5_774_000.0))
        assert (file.width, file.height, file.nodata, file.bands, file.colour) == (5, 4, NODATA, 1, False)
        assert file.tags["KEY"] == "value"
        np.testing.assert_array_equal(file.read(1, 1, 2, 2), [[NODATA, 7.0], [11.0, 12.0]])


def test_failure_leaves_the_earlier_raster(grid, tmp_path):
    path = tmp_path / "a.tif"
    path.write_bytes(b"earlier")
    writer = CogWriter(str(path), grid)
    writer.__enter__()
    writer.write(Patch(0, 0, np.zeros((1, 4, 5), np.float32)))
    writer.__exit__(RuntimeError, RuntimeError(), None)
    assert path.read_bytes() == b"earlier"
    assert list(tmp_path.iterdir()) == [path]


def test_alpha_hides(make_raster):
    values = np.stack([np.full((3, 4), 7, np.uint8), np.full((3, 4), 255, np.uint8)])
    values[1, 0, 0] = 0
    source = make_raster("a", values, photometric="MINISBLACK", alpha="YES")
    with RasterFile(source.path) as file:
        read = file.read(0, 0, 4, 3)
    assert np.isnan(read[0, 0])
    assert np.isfinite(read).sum() == 11


def test_damage_is_one_sentence(make_raster, tmp_path):
    source = make_raster("a", np.random.default_rng(0).normal(size=(300, 300)))
    path = Path(source.path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 3])
    with RasterFile(source.path) as file, pytest.raises(InputError, match=r"damaged near row 250.*a whole copy"):
        file.read(0, 250, 300, 50)
    (tmp_path / "empty.tif").write_bytes(b"")
    with pytest.raises(InputError, match="cannot be read"):
        RasterFile(str(tmp_path / "empty.tif"))
