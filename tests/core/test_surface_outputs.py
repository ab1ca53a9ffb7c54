"""What becomes of finished tiles: holes, orthophoto, points left out, tiles of an area, files."""

import shutil
from collections import namedtuple
from dataclasses import replace

import laspy
import numpy as np
import pytest
import rasterio
from pyproj import CRS
from strandline.core.block import Block
from strandline.core.errors import InputError
from strandline.core.raster import CogWriter, Grid, Patch
from strandline.core.surface import checks, exposure
from strandline.core.surface.filling import MOST, fill
from strandline.core.surface.finish import vertical_datum
from strandline.core.surface.holdout import Check, split
from strandline.core.surface.mosaic import Mosaic, needed, save, tiles
from strandline.core.surface.ortho import WHITE, Layer, paint
from strandline.core.surface.plan import Level
from strandline.core.surface.points import Cells, PointWriter
from strandline.core.surface.thumbnails import Thumbnails
from strandline.core.surface.views import TileView

UTM = CRS.from_epsg(32630).to_wkt()


# Holes


def plane(rows=40, columns=50):
    r, c = np.mgrid[0:rows, 0:columns]
    return (0.1 * r - 0.05 * c).astype(np.float32), np.full((rows, columns), 0.01, np.float32), np.ones((rows, columns), bool)


def without(height, sigma, good, *places):
    for place in places:
        good[place] = False
        height[place] = 99.0
        sigma[place] = np.nan
    return height, sigma, good


def test_a_hole_in_a_plane_is_filled_by_the_plane():
    truth, _, _ = plane()
    height, sigma, good = without(*plane(), np.s_[10:14, 20:25])
    height, sigma, filled = fill(height, sigma, good, 20)
    assert filled.sum() == 20
    assert np.allclose(height, truth, atol=1e-5)
    assert (sigma[filled] >= 0.01).all()


def test_a_hole_of_more_cells_than_asked_stays():
    height, sigma, good = without(*plane(), np.s_[10:14, 20:25])
    assert not fill(height, sigma, good, 19)[2].any()


@pytest.mark.parametrize(
    "place", [np.s_[0:3, 20:23], np.s_[37:40, 20:23], np.s_[20:23, 0:3], np.s_[20:23, 47:50], np.s_[20:21, 49:50]]
)
def test_nothing_is_filled_outwards(place):
    assert not fill(*without(*plane(), place), 100)[2].any()


def test_a_bay_of_the_edge_is_no_hole():
    """A pocket of six cells behind a strait one cell wide belongs to what is outside."""
    height, sigma, good = without(*plane(), np.s_[:, 40:], np.s_[20, 36:40], np.s_[19:22, 34:36])
    assert not fill(height, sigma, good, 100)[2].any()
    # With the strait closed it is a hole.
    good[20, 38] = True
    height[20, 38], sigma[20, 38] = 0.1 * 20 - 0.05 * 38, 0.01
    assert fill(height, sigma, good, 100)[2].sum() == 8


def test_nothing_is_filled_that_touches_what_is_ignored():
    """Two holes alike, one beside cells that are left out though they have heights, as waves have."""
    holes = np.s_[10:13, 10:13], np.s_[30:33, 10:13]
    height, sigma, good = without(*plane(), *holes)
    barred = np.zeros_like(good)
    barred[8:13, 13:20] = True
    filled = fill(height, sigma, good, 100, barred)[2]
    assert not filled[holes[0]].any()
    assert filled[holes[1]].all()
    # One cell of sand between, and it is a hole of its own, but nothing of what is left out takes part in it.
    barred[:, 13] = False
    height[barred] = 50.0
    height, _, filled = fill(height, sigma, good, 100, barred)
    assert filled[holes[0]].all()
    assert np.allclose(height[holes[0]], plane()[0][holes[0]], atol=1e-5)


def test_windows_of_two_tiles_fill_alike():
    height, sigma, good = without(*plane(120, 160), np.s_[50:58, 76:84])
    whole = fill(height, sigma, good, 64)
    for columns in (slice(0, 120), slice(40, 160)):
        part = fill(height[:, columns], sigma[:, columns], good[:, columns], 64)
        for a, b in zip(whole, part, strict=True):
            assert np.array_equal(a[:, columns], b, equal_nan=True)


def test_the_sigma_of_filled_cells_holds():
    """On ground as rough as a beach, and on noise, the truth lies within the sigma of filled cells as often as it says."""
    rng = np.random.default_rng(3)
    for roughness in (1.0, 2.0, 3.0):
        size = 256
        frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
        frequency[0, 0] = 1.0
        ground = np.fft.ifft2(np.fft.fft2(rng.normal(size=(size, size))) * frequency ** (-roughness / 2 - 0.5)).real
        ground = (0.3 * ground / ground.std()).astype(np.float32)
        good = np.ones((size, size), bool)
        for r in range(16, 240, 24):
            for c in range(16, 240, 24):
                side = rng.integers(2, 9)
                good[r : r + side, c : c + side] = False
        sigma = np.where(good, 0.005 + 0.005 * rng.random(good.shape), np.nan).astype(np.float32)
        height, after, filled = fill(np.where(good, ground, 0).astype(np.float32), sigma, good, 64)
        assert np.array_equal(filled, ~good)
        assert after[filled].min() > np.nanmax(sigma[good]) * 0.8
        error = np.abs(height - ground)[filled] / after[filled]
        assert np.mean(error < 1) > 0.683
        # No more than four times what it needs to be, or the number would say nothing.
        assert np.sqrt(np.mean(error**2)) > 0.25


# Points left out


def block(points, rays):
    views = ()
    observed = np.repeat(np.arange(len(points)), rays).astype(np.int32)
    return Block(views, points, np.full(len(points), 0.3), np.asarray(rays, np.int32), observed, np.zeros_like(observed))


def test_every_tenth_point_of_three_rays_is_left_out():
    points = np.arange(300.0).reshape(100, 3)
    rays = np.where(np.arange(100) % 2, 3, 2)
    kept, left_out = split(block(points, rays))
    # Of the 50 points of three rays the 6th, the 16th ...; the points of two rays all stay.
    assert left_out[:, 0].tolist() == [3.0 * (2 * n + 1) for n in (5, 15, 25, 35, 45)]
    assert len(kept.points) == 95
    assert (kept.rays == 2).sum() == 50
    assert np.isin(left_out[:, 0], kept.points[:, 0]).sum() == 0
    # A point of three rays that matches badly is not what to check by.
    bad = replace(block(points, rays), errors=np.where(np.arange(100) == 11, 3.0, 0.3))
    assert 33.0 not in split(bad)[1][:, 0]


def test_the_comparison_is_bilinear_and_skips_what_is_empty():
    wide = Grid(0.0, 4.0, 1.0, 4, 4, UTM)
    r, c = np.mgrid[0:4, 0:4]
    east, north = c + 0.5, 3.5 - r
    height = 2.0 * east + 3.0 * north
    height[3, 3] = np.nan
    points = np.array([[1.25, 2.75, 2 * 1.25 + 3 * 2.75 - 0.5], [3.2, 0.9, 0.0], [9.0, 9.0, 0.0]])
    check = Check(points)
    check.put(wide.window(1, 1, 2, 2), height, np.full((4, 4), 0.1), wide)  # the second point lies outside of this patch
    check.put(wide.window(3, 3, 1, 1), height, np.full((4, 4), 0.1), wide)  # and beside an empty cell
    found = check.result()
    assert found.differences == pytest.approx([0.5])
    assert found.left_out == 3
    assert (found.median, found.nmad) == (pytest.approx(0.5), 0.0)
    assert Check(np.zeros((0, 3))).result().nmad is None


# Brightness and colours


def test_gains_and_the_fall_to_the_corners_are_found():
    rng = np.random.default_rng(0)
    views, points = 6, 400
    gain = rng.normal(0, 0.15, (views, 3))
    gain -= gain.mean(axis=0)
    fall = np.array([[-0.30, -0.05], [-0.25, -0.04], [-0.20, -0.10]])
    shade = np.exp(rng.uniform(np.log(0.2), np.log(0.5), (points, 3)))
    point, view = np.nonzero(rng.random((points, views)) < 0.5)
    radius = np.sqrt(rng.uniform(0, 1, len(point)))
    terms = np.column_stack([radius**2, radius**4])
    colours = shade[point] * np.exp(gain[view] + terms @ fall.T) + rng.normal(0, 0.004, (len(point), 3))
    moved = rng.random(len(point)) < 0.05  # people, cars, waves
    colours[moved] = rng.uniform(0.1, 0.9, (moved.sum(), 3))
    found = exposure.solve(colours, point, view, radius, views)
    # 200 observations of 1.5 % each, sqrt(2) for what the others' mean has: 0.15 %; five times that.
    assert np.abs(found.gain - gain).max() < 0.008
    corners = np.array([0.25, 0.5, 0.9])[:, None] ** [2, 4]
    assert np.abs(corners @ (found.fall - fall).T).max() < 0.015


def test_what_is_tied_to_nothing_keeps_its_brightness():
    found = exposure.solve(np.full((4, 3), 0.5), np.arange(4), np.array([0, 1, 2, 2]), np.zeros(4), 4)
    assert not found.gain.any()
    assert not found.fall.any()


class Photographs:
    """In place of files: constant colours, with what was painted over them."""

    def __init__(self, pictures):
        self._pictures = pictures

    def colour(self, path, level):
        assert level == 0
        return self._pictures[path]


def looking_down(index, east):
    """A camera 20 m above a place, one pixel to 5 cm, 400 x 400 pixels: 20 x 20 m."""
    matrix = np.array([[1.0, 0, 0, -east], [0, -1.0, 0, 0], [0, 0, -1.0, 20.0]])
    brown = np.array([400.0, 400.0, 200.0, 200.0, 0, 0, 0, 0, 0, 0, 0, 0])
    return TileView(index, matrix, np.array([east, 0.0, 20.0]), brown, np.inf, np.array([400.0, 400.0]))


def layer(index, east, *, hidden=None, gain=0.0):
    view = looking_down(index, east)
    free = np.ones((80, 80), bool) if hidden is None else ~hidden
    return Layer(view, lambda: free, str(index), 0, np.full(3, gain), np.zeros((3, 2)))


def painted(layers, pictures, height=None):
    """Return the colours (80, 80; 8 bits) of 8 x 8 m in the middle, cells of 10 cm."""
    height = np.zeros((80, 80), np.float32) if height is None else height
    out = paint(layers, Photographs(pictures), height, -4.0, 4.0, 0.1)
    assert out.dtype == np.uint16
    assert (out[..., 3] == WHITE).all()
    return out[..., 0] / (WHITE / 255)


def test_photographs_of_one_brightness_leave_no_seam():
    """Two photographs, the second brighter by a fifth: balanced they are one, and unbalanced they pass over slowly."""
    pictures = {"0": np.full((400, 400, 3), 100, np.uint8), "1": np.full((400, 400, 3), 122, np.uint8)}
    even = painted([layer(0, -2.0), layer(1, 2.0, gain=np.log(1.22))], pictures)
    assert even == pytest.approx(np.full(even.shape, 100.0), abs=0.1)
    uneven = painted([layer(0, -2.0), layer(1, 2.0)], pictures)
    assert uneven[40, 0] < 103
    assert uneven[40, -1] > 119
    # A hard seam would jump by 22 grey levels; spread over metres it is no more than what noise hides.
    assert np.abs(np.diff(uneven, axis=1)).max() < 3.0


def test_what_moved_leaves_no_ghost():
    """A white car that one of four photographs shows, though that one looks down most steeply, is painted from the others."""
    rng = np.random.default_rng(1)
    pictures = {str(n): (100 + rng.integers(-2, 3, (400, 400, 1)) + np.zeros(3, int)).astype(np.uint8) for n in range(4)}
    pictures["0"][180:220, 170:230] = 240  # 3 x 2 m in the middle
    out = painted([layer(0, 0.0), layer(1, -3.0), layer(2, 3.0), layer(3, 5.0)], pictures)
    assert out[22:58, 27:53].max() < 110  # less than a tenth of the car's brightness over the sand
    # Alone it is shown: there is nothing else to paint with.
    assert painted([layer(0, 0.0)], pictures)[40, 40] > 230


def test_a_hidden_cell_is_painted_by_who_sees_it():
    pictures = {"0": np.full((400, 400, 3), 200, np.uint8), "1": np.full((400, 400, 3), 60, np.uint8)}
    hidden = np.zeros((80, 80), bool)
    hidden[:, 40:] = True
    out = painted([layer(0, 0.0, hidden=hidden), layer(1, 6.0)], pictures)
    assert out[:, 42:].max() < 65
    assert out[:, :20].min() > 190  # the broad band passes over slowly
    # Hidden from all, the steepest still paints.
    both = painted([layer(0, 0.0, hidden=hidden), layer(1, 6.0, hidden=hidden)], pictures)
    assert both[:, 42:48].min() > 170


def test_sixteen_bits_stay_sixteen():
    ramp = np.linspace(20_000, 21_000, 400).astype(np.uint16)
    picture = np.repeat(np.tile(ramp, (400, 1))[..., None], 3, axis=2)
    out = paint([layer(0, 0.0)], Photographs({"0": picture}), np.zeros((80, 80), np.float32), -4.0, 4.0, 0.1)
    assert len(np.unique(out[40, :, 0])) == 80  # four of these shades are one of 256
    assert out[40, 0, 0] == pytest.approx(20_000 + 1000 * (200 - 4.0 / 0.05 + 0.5) / 399, abs=3)


# Tiles of an area


LEVELS = (Level(1, 0.2, 0.1, 1500, 3000), Level(0, 0.1, 0.05, 3000, 6000))


def reach(tile, coarser):
    """What a tile needs of the coarser level: its window and 60 cells around."""
    top, left, rows, columns = tile.window
    r0, c0 = max(0, top // 2 - 60), max(0, left // 2 - 60)
    r1, c1 = min(coarser.rows, -(-(top + rows) // 2) + 60), min(coarser.columns, -(-(left + columns) // 2) + 60)
    return r0, c0, r1 - r0, c1 - c0


def test_only_what_is_needed_is_computed():
    every = tiles(LEVELS[1])
    assert [len(level) for level in needed(LEVELS, every, reach)] == [len(tiles(LEVELS[0])), len(every)]
    corner = [t for t in every if t.row == 0 and t.column == 0]
    coarse, fine = needed(LEVELS, corner, reach)
    assert fine == corner
    # 552 cells with the overlap are 276 coarse ones, and 60 more; the next tile's overlap begins at 512 - 40.
    assert [(t.row, t.column) for t in coarse] == [(0, 0)]
    middle = [t for t in every if t.row == 1024 and t.column == 2048]
    rows = sorted({t.row for t in needed(LEVELS, middle, reach)[0]})
    # Rows 984 to 1576 are 492 to 788 of the coarser level, with 60 more 432 to 848: the first tile reaches to 552.
    assert rows == [0, 512]


def test_what_was_not_computed_is_empty(tmp_path):
    level = LEVELS[0]
    every = tiles(level)
    some = [every[0], every[1]]
    for tile in some:
        top, left, rows, columns = tile.window
        save(tile.path(str(tmp_path)), height=np.full((rows, columns), 7.0, np.float32), good=np.ones((rows, columns), bool))
    mosaic = Mosaic(str(tmp_path), level, only=some)
    window = 500, 1000, 30, 40  # over two tiles of the first row, one of them computed, and two of the second
    height, good = mosaic.blend("height", *window, tolerance=0.1), mosaic.read("good", *window)
    assert (height[:12, :24] == 7.0).all()
    assert np.isnan(height[12:]).all()
    assert np.isnan(height[:, 24:]).all()
    assert np.array_equal(good, np.isfinite(height))


# What is refused


def test_holes_count_cells():
    assert checks.holes(1.0, 0.1) == 100
    assert checks.holes(0.0, 0.1) == 0
    with pytest.raises(InputError, match=r"FILL=2000 m2 is more than 100000 cells of 0.1 m.*give 1000 m2 or less"):
        checks.holes(2000.0, 0.1)
    assert checks.holes(MOST * 0.01, 0.1) == MOST


def test_a_disk_without_room_is_told_before_work(tmp_path, monkeypatch):
    space = namedtuple("space", "total used free")
    plan = namedtuple("plan", "scratch")(str(tmp_path / "survey" / "dense"))
    cut = [tiles(level) for level in LEVELS]
    outputs = {"output": str(tmp_path / "out" / "dsm.tif")}
    monkeypatch.setattr(shutil, "disk_usage", lambda _: space(0, 0, 10_000_000))
    with pytest.raises(InputError, match=rf"{tmp_path} has 0.01 GB free, and this surface takes up to 0.6\d GB"):
        checks.check_room(plan, cut, outputs)
    # What stands already takes no room again.
    for tile in cut[1]:
        tile.path(plan.scratch).parent.mkdir(parents=True, exist_ok=True)
        tile.path(plan.scratch).touch()
    with pytest.raises(InputError, match=r"takes up to 0.1\d GB"):
        checks.check_room(plan, cut, outputs)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: space(0, 0, 1_000_000_000))
    checks.check_room(plan, cut, outputs)


def test_files_named_twice_and_photographs_are_not_written(tmp_path):
    one = str(tmp_path / "a.tif")
    for other in (one, str(tmp_path / "b" / ".." / "a.tif")):
        (tmp_path / "b").mkdir(exist_ok=True)
        with pytest.raises(InputError, match="named for two outputs"):
            checks.check_files({"output": one, "ortho": other}, None)
    with pytest.raises(InputError, match=r"a\.tif is a photograph"):
        checks.check_photographs({"ortho": one}, (one,))


# Files


GRID = Grid(500_000.0, 4_650_000.0, 0.5, 700, 600, UTM)


def test_rasters_declare_all_that_gis_asks_for(tmp_path):
    values = np.full((1, 600, 700), np.nan, np.float32)
    values[0, 100:400, 200:500] = 3.0 + np.linspace(0, 1, 300)
    number = np.where(np.isnan(values), 0, 4).astype(np.uint8)
    with CogWriter(str(tmp_path / "h.tif"), GRID, names=("height (m)",), unit="m") as writer:
        writer.write(Patch(0, 0, values))
    with CogWriter(str(tmp_path / "n.tif"), GRID, dtype="uint8", names=("n",), nodata=255, overviews="mode") as writer:
        writer.write(Patch(0, 0, number[:, :300]))
    with rasterio.open(tmp_path / "h.tif") as file:
        assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert file.units == ("m",)
        assert file.descriptions == ("height (m)",)
        assert file.overviews(1) == [2]
        assert float(file.tags(1)["STATISTICS_MEAN"]) == pytest.approx(3.5, abs=1e-3)
        assert float(file.tags(1)["STATISTICS_MAXIMUM"]) == pytest.approx(4.0)
    with rasterio.open(tmp_path / "n.tif") as file:
        assert file.nodata == 255
        assert (file.read(1)[300:] == 255).all()  # what was never written is no value, not none at all
        assert (file.read(1)[:300] == number[0, :300]).all()
        # No overview invents a number that no cell has.
        assert set(np.unique(file.read(1, out_shape=(300, 350)))) <= {0, 4, 255}


def test_colours_of_sixteen_bits_have_an_alpha_band(tmp_path):
    values = np.full((4, 600, 700), 40_000, np.uint16)
    with CogWriter(str(tmp_path / "o.tif"), GRID, dtype="uint16", bands=4, names=("red", "green", "blue", "alpha")) as writer:
        writer.write(Patch(0, 0, values))
    with rasterio.open(tmp_path / "o.tif") as file:
        assert file.dtypes == ("uint16",) * 4
        assert [c.name for c in file.colorinterp] == ["red", "green", "blue", "alpha"]
        assert file.read(2, window=((0, 1), (0, 1)))[0, 0] == 40_000


def test_points_carry_what_is_known_of_them(tmp_path):
    height = np.array([[10.12345, np.nan], [11.0, 12.0]], np.float32)
    cells = Cells(
        height,
        np.array([[0.011, np.nan], [0.02, 0.03]], np.float32),
        np.array([[5, 0], [3, 2]], np.uint8),
        np.array([[False, False], [False, True]]),
        np.arange(16, dtype=np.uint16).reshape(2, 2, 4) * 4000,
    )
    with PointWriter(str(tmp_path / "p.laz"), GRID, 10.0) as writer:
        writer.write(10, 20, cells)
    cloud = laspy.read(tmp_path / "p.laz")
    assert np.asarray(cloud.x) == pytest.approx([500_005.25, 500_005.25, 500_005.75])
    assert np.asarray(cloud.y) == pytest.approx([4_649_989.75, 4_649_989.25, 4_649_989.25])
    assert np.asarray(cloud.z) == pytest.approx([10.1234, 11.0, 12.0], abs=1e-4)
    assert np.asarray(cloud["sigma"]) == pytest.approx([0.011, 0.02, 0.03])
    assert np.asarray(cloud["views"]).tolist() == [5, 3, 2]
    assert np.asarray(cloud.synthetic).tolist() == [0, 0, 1]
    assert np.asarray(cloud.green).tolist() == [4000, 36_000, 52_000]
    assert cloud.header.parse_crs().to_epsg() == 32630
    assert cloud.header.offsets[2] == 10.0
    assert cloud.header.maxs[0] == pytest.approx(500_005.75)


def test_thumbnails_join_patches_at_any_thinning():
    grid = replace(GRID, width=3000, height=2000)
    thumbs = Thumbnails(grid)
    assert thumbs.thinning == 3
    r, c = np.mgrid[0:2000, 0:3000]
    layer = (r * 10_000.0 + c).astype(np.float32)
    for row in range(0, 2000, 512):
        for column in range(0, 3000, 512):
            part = layer[row : row + 512, column : column + 512]
            none = np.zeros(part.shape, np.uint8)
            thumbs.put(row, column, part, part, part, none, np.zeros((*part.shape, 4), np.uint8))
    assert np.array_equal(thumbs.layers()["height"], layer[::3, ::3])


def test_the_vertical_datum_is_told():
    assert vertical_datum("ellipsoidal", "EPSG:2154") == "ellipsoidal heights above GRS 1980"
    assert vertical_datum("orthometric", UTM).startswith("orthometric")
    assert vertical_datum("unknown", UTM) == "unknown"
