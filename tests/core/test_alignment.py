"""The common grid, and models seen through it."""

import numpy as np
import pytest
import shapely
from strandline.core.change.alignment import Aligned, common_grid, tiles
from strandline.core.change.heights import open_heights
from strandline.core.progress import SILENT

WEST, NORTH = 300_000.0, 5_774_000.0


def ramp(rows, columns, cell=1.0, east=0.0, south=0.0):
    """A plane of 0.3 m/m to the east and -0.2 m/m to the south, at the centres of cells."""
    r, c = np.mgrid[0:rows, 0:columns]
    return 5.0 + 0.3 * (east + (c + 0.5) * cell) - 0.2 * (south + (r + 0.5) * cell)


@pytest.fixture
def opened(make_raster):
    def make(name, values, **options):
        return open_heights(make_raster(name, values, **options), name, None, SILENT)

    return make


def test_the_coarser_grid_is_kept(opened):
    fine = opened("fine", ramp(100, 100, 0.5), cell=0.5)
    coarse = opened("coarse", ramp(30, 30), cell=1.0013, cell_north=1.0008, west=WEST + 7.3, north=NORTH - 4.1)
    grid, shared = common_grid(fine, coarse)
    assert (grid.cell, grid.step_north) == (1.0013, 1.0008)
    assert ((grid.west - WEST - 7.3) / 1.0013) == pytest.approx(0.0, abs=1e-6)
    assert (grid.width, grid.height) == (30, 30)
    assert shapely.area(shared) == pytest.approx(30 * 1.0013 * 30 * 1.0008, rel=1e-9)
    assert common_grid(coarse, fine)[0] == grid


def test_equal_cells_take_the_earlier_grid(opened):
    first, second = opened("b", ramp(9, 9), west=WEST + 0.25), opened("a", ramp(9, 9))
    grid, _ = common_grid(first, second)
    assert (grid.west, grid.width, grid.height) == (WEST + 0.25, 9, 9)


def test_own_grid_returns_own_values(opened):
    values = np.random.default_rng(0).normal(size=(70, 50))
    heights = opened("a", values)
    grid, _ = common_grid(heights, heights)
    np.testing.assert_array_equal(Aligned(heights, grid).read(grid), values)
    np.testing.assert_array_equal(Aligned(heights, grid).read(grid.window(7, 33, 40, 30)), values[33:63, 7:47])


@pytest.mark.parametrize(("cell", "shift"), [(1.0, 0.37), (0.9, 0.1), (0.5, 0.2), (0.4, 0.33), (0.07, 0.01)])
def test_planes_pass_unbent(opened, cell, shift):
    count = int(40 / cell)
    coarse = opened("b", ramp(30, 30, east=5, south=5), west=WEST + 5, north=NORTH - 5)
    values = ramp(count, count, cell, shift, shift)
    fine = opened("a", values, cell=cell, west=WEST + shift, north=NORTH - shift)
    grid, _ = common_grid(coarse, fine)
    difference = Aligned(fine, grid).read(grid) - Aligned(coarse, grid).read(grid)
    assert np.isfinite(difference).all()
    np.testing.assert_allclose(difference, 0.0, atol=1e-9)


def test_rotated_and_mirrored_rasters(opened):
    from rasterio.transform import Affine

    angle = np.radians(20)
    turn = Affine(np.cos(angle), np.sin(angle), WEST + 10, np.sin(angle), -np.cos(angle), NORTH - 10)
    r, c = np.mgrid[0:60, 0:60] + 0.5
    x, y = turn.c + turn.a * c + turn.b * r, turn.f + turn.d * c + turn.e * r
    rotated = opened("r", 5.0 + 0.3 * (x - WEST) - 0.2 * (NORTH - y), transform=turn)
    plain = opened("p", ramp(100, 100, 0.999), cell=0.999)
    grid, shared = common_grid(rotated, plain)
    change = Aligned(plain, grid).read(grid) - Aligned(rotated, grid).read(grid)
    np.testing.assert_allclose(change[np.isfinite(change)], 0.0, atol=1e-9)
    assert np.isfinite(change).sum() == pytest.approx(shapely.area(shared), rel=0.06)
    flipped = opened("f", ramp(40, 40)[::-1], transform=Affine(1, 0, WEST, 0, 1, NORTH - 40))
    grid, _ = common_grid(flipped, flipped)
    assert (grid.north, grid.height) == (NORTH, 40)
    np.testing.assert_allclose(Aligned(flipped, grid).read(grid), ramp(40, 40), atol=1e-9)


def test_holes_do_not_bleed(opened):
    values = ramp(20, 20)
    values[8, 9] = -9999.0
    holed = opened("h", values, west=WEST + 0.5, nodata=-9999.0)
    whole = opened("w", ramp(20, 20))
    grid, _ = common_grid(whole, holed)
    read = Aligned(holed, grid).read(grid)
    # Half a cell east: the two cells beside the hole need it, and the column at the edge has no western neighbour.
    assert np.isnan(read[8]).nonzero()[0].tolist() == [0, 9, 10]
    assert np.isfinite(read[:, 1:]).sum() == 20 * 19 - 2
    assert np.nanmin(read) > -10


def test_a_finer_model_needs_half_the_cell(opened):
    fine = ramp(40, 40, 0.25)
    fine[0:4, 0:2] = np.nan  # half of cell 0, 0
    fine[0:4, 4:7] = np.nan  # three quarters of cell 0, 1
    coarse = opened("c", ramp(10, 10))
    grid, _ = common_grid(coarse, opened("f", fine, cell=0.25))
    read = Aligned(opened("f", fine, cell=0.25), grid).read(grid)
    assert read[0, 0] == pytest.approx(np.nanmean(fine[0:4, 0:4]))
    assert np.isnan(read[0, 1])
    assert np.isfinite(read).sum() == 99


def test_another_zone_is_exact(opened):
    """Against a transformation of every cell centre: what lies between the exactly transformed points errs by micrometres."""
    from pyproj import Transformer

    heights = opened("a", np.zeros((300, 300)) + np.arange(300.0), crs="EPSG:32754", west=826_000.0, north=5_765_000.0, cell=2.0)
    to_55 = Transformer.from_crs("EPSG:32754", "EPSG:32755", always_xy=True)
    x, y = to_55.transform(826_300.0, 5_764_700.0)
    other = opened("b", np.zeros((100, 100)) + np.arange(100.0), cell=2.5, west=x - 125, north=y + 125)
    grid, _ = common_grid(other, heights)
    r, c = np.mgrid[0 : grid.height, 0 : grid.width]
    east, north = grid.centres(r, c)
    back, _ = to_55.transform(east, north, direction="INVERSE")
    expected = (back - 826_000.0) / 2.0 - 0.5
    np.testing.assert_allclose(Aligned(heights, grid).read(grid), expected, atol=1e-5)


def test_tiles_cover_once(opened):
    heights = opened("a", ramp(9, 9))
    grid, _ = common_grid(heights, heights)
    from dataclasses import replace

    big = replace(grid, width=2500, height=1300)
    seen = np.zeros((1300, 2500), int)
    for column, row, width, height in tiles(big, 1.0):
        seen[row : row + height, column : column + width] += 1
    assert (seen == 1).all()
    assert max(w for _, _, w, _ in tiles(big, 20.0)) * 20 < 3000
