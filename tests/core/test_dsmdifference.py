"""The step as a whole: volumes by hand, every kind of input, and sentences for bad ones."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from strandline.core.change.dsmdifference import Request, run
from strandline.core.contract import RasterSource, VectorSource
from strandline.core.errors import Cancelled, InputError, NotEnoughData
from strandline.core.progress import Progress
from strandline.core.vector import write_layer

WEST, NORTH = 300_000.0, 5_774_000.0
FOOT = 1200 / 3937


@pytest.fixture
def step(tmp_path, progress):
    """Run the step; its output lies in ``tmp_path / "out"``."""

    def call(before, after, **options):
        return run(Request(before, after, str(tmp_path / "out" / "change.tif"), **options), progress)

    return call


def rows(path):
    meta, _, _, columns = pyogrio.raw.read(path)
    return [dict(zip(meta["fields"], values, strict=True)) for values in zip(*columns, strict=True)]


class TestVolumesByHand:
    """A 4 x 3 grid of 2 m cells whose change is known cell by cell."""

    CHANGE = np.array([[1.0, 0.5, 0.0, -1.0], [2.0, -0.5, 0.25, -2.0], [0.0, 0.0, 4.0, np.nan]])

    @pytest.fixture
    def pair(self, make_raster):
        before = np.full((3, 4), 10.0)
        return make_raster("before", before, cell=2.0), make_raster("after", before + self.CHANGE, cell=2.0, nodata=np.nan)

    def test_whole(self, step, pair, read_raster):
        result = step(*pair, before_sigma=0.3, after_sigma=0.4)
        # Sum of rises 7.75 m, of falls 3.5 m, on cells of 4 m2; 11 of 12 cells.
        assert result.deposition == pytest.approx(31.0, abs=1e-9)
        assert result.erosion == pytest.approx(14.0, abs=1e-9)
        assert result.net == pytest.approx(17.0, abs=1e-9)
        assert result.area == pytest.approx(48.0)
        assert result.covered_percent == pytest.approx(100 * 11 / 12)
        # sqrt(11) cells x 4 m2 x 0.5 m
        assert result.net_random == pytest.approx(4 * 0.5 * np.sqrt(11))
        # Beyond 1.96 x 0.5 m: rises 1, 2 and 4, falls 1 and 2.
        assert result.deposition_significant == pytest.approx(28.0)
        assert result.erosion_significant == pytest.approx(12.0)
        assert result.net_significant == pytest.approx(16.0)
        values, profile, tags = read_raster(result.output)
        np.testing.assert_array_equal(values, self.CHANGE)
        assert profile["nodata"] == -9999.0
        assert "after minus before" in tags["STRANDLINE_DIFFERENCE"]

    def test_not_known_is_none(self, step, pair):
        result = step(*pair, before_sigma=0.3, after_sigma=0.4)
        assert (result.net_correlated, result.net_systematic, result.net_sigma, result.erosion_sigma) == (None,) * 4
        result = step(*pair)
        assert result.net_random is None
        assert result.net_significant is None
        assert result.net == pytest.approx(17.0)

    def test_cut_cells(self, step, pair, make_polygons, tmp_path):
        # From 1 to 5 m east, 0 to 3 m south: the first column half, the third half; the second row half.
        zones = make_polygons("zones", [shapely.box(1, -3, 5, 0)], {"name": ["beach"]})
        result = step(*pair, zones=zones, volumes=str(tmp_path / "v.gpkg"), before_sigma=0.0, after_sigma=1.0)
        shares = np.outer([1.0, 0.5, 0.0], [0.5, 1.0, 0.5, 0.0])
        change = np.nan_to_num(self.CHANGE)
        assert result.net == pytest.approx(4 * (shares * change).sum(), abs=1e-9)
        assert result.net == pytest.approx(4 * (0.5 + 0.5 + 0.5 - 0.25 + 0.0625), abs=1e-9)
        assert result.erosion == pytest.approx(4 * 0.25)
        assert result.area == pytest.approx(12.0)
        assert result.covered_percent == pytest.approx(100.0)
        assert result.net_random == pytest.approx(4 * np.sqrt((shares**2).sum()))
        (row,) = rows(tmp_path / "v.gpkg")
        assert row["zone"] == "beach"
        assert row["net"] == pytest.approx(result.net)
        assert np.isnan(row["sigma"])

    def test_triangle_with_hole(self, step, pair, make_polygons):
        ring = shapely.Polygon([(0, -4), (4, -4), (0, 0)], [[(0.5, -3.5), (1.5, -3.5), (1.5, -3.0), (0.5, -3.0)]])
        result = step(*pair, zones=make_polygons("zones", [ring]))
        # By cells: (0,0) half, (1,0) whole minus the hole's 0.5 m2, (1,1) half.
        assert result.net == pytest.approx(2 * 1.0 + 3.5 * 2.0 + 2 * -0.5, abs=1e-9)
        assert result.area == pytest.approx(7.5)

    def test_overlapping_zones_count_once_in_the_total(self, step, pair, make_polygons, tmp_path):
        zones = make_polygons("zones", [shapely.box(0, -4, 4, 0), shapely.box(2, -4, 6, 0)], {"name": ["a", "b"]})
        result = step(*pair, zones=zones, volumes=str(tmp_path / "v.gpkg"))
        a, b = rows(tmp_path / "v.gpkg")
        assert a["net"] == pytest.approx(4 * 3.0)
        assert b["net"] == pytest.approx(4 * 0.25)
        assert result.net == pytest.approx(4 * 3.25)
        assert result.area == pytest.approx(24.0)

    def test_zones_of_another_crs(self, step, pair, make_polygons):
        from pyproj import Transformer

        change = Transformer.from_crs("EPSG:32755", "EPSG:32754", always_xy=True)
        box = shapely.transform(shapely.box(1, -3, 5, 0), lambda xy: np.column_stack(change.transform(*(xy + (WEST, NORTH)).T)))
        result = step(*pair, zones=make_polygons("zones", [box], crs="EPSG:32754", absolute=True))
        assert result.net == pytest.approx(4 * (0.5 + 0.5 + 0.5 - 0.25 + 0.0625), abs=1e-6)
        assert result.area == pytest.approx(12.0, abs=1e-6)

    def test_uncovered_ground_is_not_filled(self, step, pair, make_polygons, tmp_path):
        zones = make_polygons("zones", [shapely.box(4, -6, 12, -4), shapely.box(50, -6, 60, -4)], {"name": ["edge", "off"]})
        step(*pair, zones=zones, volumes=str(tmp_path / "v.gpkg"))
        edge, off = rows(tmp_path / "v.gpkg")
        assert edge["net"] == pytest.approx(16.0)
        assert edge["covered_percent"] == pytest.approx(25.0)
        assert np.isnan(off["net"])
        assert off["covered_percent"] == 0.0

    def test_zone_names(self, step, pair, make_polygons, tmp_path):
        shapes = [shapely.box(0, -4, 4, 0), shapely.box(4, -4, 8, 0)]
        zones = make_polygons("zones", shapes, {"name": ["a", None], "code": [7, 8]})
        out = str(tmp_path / "v.gpkg")
        step(*pair, zones=zones, volumes=out)
        assert [r["zone"] for r in rows(out)] == ["a", "2"]
        step(*pair, zones=zones, zone_field="code", volumes=out)
        assert [r["zone"] for r in rows(out)] == ["7", "8"]
        step(*pair, zones=make_polygons("plain", shapes, {"code": [7, 8]}), volumes=out)
        assert [r["zone"] for r in rows(out)] == ["1", "2"]

    def test_columns(self, step, pair, tmp_path):
        out = str(tmp_path / "v.gpkg")
        result = step(*pair, volumes=out, before_sigma=0.3, after_sigma=0.4, correlation_range=0.0, registration_sigma=0.1)
        (row,) = rows(out)
        names = "zone net sigma sigma_random sigma_correlated sigma_systematic low high erosion erosion_sigma deposition "
        names += "deposition_sigma erosion_significant deposition_significant net_significant area covered_percent"
        assert list(row) == names.split()
        assert result.net_correlated == 0.0
        assert result.net_systematic == pytest.approx(44 * 0.1)
        assert result.net_sigma == pytest.approx(np.hypot(4 * 0.5 * np.sqrt(11), 4.4))
        assert row["high"] - row["net"] == pytest.approx(1.959964 * result.net_sigma, rel=1e-6)
        assert row["net"] - row["low"] == pytest.approx(1.959964 * result.net_sigma, rel=1e-6)

    def test_ignore(self, step, pair, make_polygons, read_raster):
        result = step(*pair, ignore=make_polygons("ignore", [shapely.box(0, -2, 4, 0), shapely.box(6.5, -3, 7, -2.5)]))
        values, _, _ = read_raster(result.output)
        assert np.isnan(values[0, :2]).all()
        assert np.isnan(values[1, 3])
        assert np.isfinite(values).sum() == 8
        assert result.net == pytest.approx(4 * (4.25 - 0.5 - 1.0 + 2.0 - 0.0))

    def test_significant_raster(self, step, pair, read_raster, tmp_path):
        result = step(*pair, before_sigma=0.3, after_sigma=0.4, significant=str(tmp_path / "s.tif"))
        values, _, _ = read_raster(result.significant)
        expected = np.where(np.abs(self.CHANGE) > 0.98, self.CHANGE, np.nan)
        np.testing.assert_array_equal(values, expected)


class TestPrecision:
    """Sigma by cell: 0.1 m in the west, 0.4 m in the east of AFTER."""

    @pytest.fixture
    def scene(self, make_raster):
        values = np.add.outer(np.zeros(8), np.arange(10.0))
        precision = np.where(np.arange(10) < 5, 0.1, 0.4) * np.ones((8, 1))
        precision[0, 0] = -9999.0
        pair = make_raster("b", values), make_raster("a", values + 0.5)
        return pair, {"before_sigma": 0.0, "after_precision": make_raster("p", precision, nodata=-9999.0)}

    def test_cell(self, step, scene, listener):
        pair, options = scene
        result = step(*pair, **options)
        # 1.96 x 0.1 < 0.5 < 1.96 x 0.4; one cell has no precision.
        assert result.deposition_significant == pytest.approx(39 * 0.5)
        assert any("1 cells have a change but no precision" in w for w in listener.warnings)
        # The 95 % quantile of the other cells' precision stands in for one cell of 80.
        assert result.net_random == pytest.approx(np.sqrt(39 * 0.01 + 40 * 0.16 + 0.16))

    def test_too_many_cells_without_precision(self, step, scene, make_raster, listener):
        pair, options = scene
        precision = np.full((8, 10), 0.1)
        precision[0, :3] = np.nan
        options |= {"correlation_range": 0.0, "registration_sigma": 0.0}
        some = step(*pair, **{**options, "after_precision": make_raster("some", precision, nodata=np.nan)})
        # 3 of 80 cells are below 5 %, 4 of 80 are not; all have one precision, so the quantile is it.
        assert some.net_random == pytest.approx(np.sqrt(80) * 0.1)
        assert some.net_sigma == pytest.approx(np.sqrt(80) * 0.1)
        assert "95 % quantile" in listener.warnings[-1]
        precision[0, 3] = np.nan
        many = step(*pair, **{**options, "after_precision": make_raster("many", precision, nodata=np.nan)})
        assert (many.net_random, many.net_correlated, many.net_sigma) == (None, None, None)
        assert "overlap they are more than 5 %" in listener.warnings[-1]

    def test_cells_without_precision_err_with_the_others(self, step, scene, make_raster):
        """All cells alike over a kilometre: 3 of 80 without a precision weigh as much as any other."""
        pair, options = scene
        precision = np.full((8, 10), 0.1)
        precision[0, :3] = np.nan
        after_precision = make_raster("some", precision, nodata=np.nan)
        result = step(*pair, **{**options, "after_precision": after_precision, "correlation_range": 1e6})
        assert result.net_correlated == pytest.approx(80 * 0.1, rel=1e-3)

    def test_uniform(self, step, scene):
        pair, options = scene
        result = step(*pair, **options, lod="uniform")
        sigma = np.sqrt((39 * 0.01 + 40 * 0.16) / 79)
        assert result.net_random == pytest.approx(np.sqrt(80) * sigma)
        assert result.deposition_significant == pytest.approx(0.0)  # 1.96 x 0.293 m

    def test_where_it_is_known(self, step, scene, make_polygons):
        pair, options = scene
        zone = make_polygons("zone", [shapely.box(1, -8, 7, 0)])
        result = step(*pair, **options, zones=zone, correlation_range=0.0, registration_sigma=0.0)
        assert result.net_random == pytest.approx(np.sqrt(32 * 0.01 + 16 * 0.16))
        assert result.net_sigma == result.net_random

    def test_registration_widens_the_level_of_detection(self, step, scene):
        pair, _ = scene
        sigma = {"before_sigma": 0.1, "after_sigma": 0.1}
        assert step(*pair, **sigma, registration_sigma=0.0).deposition_significant == pytest.approx(40.0)
        assert step(*pair, **sigma, registration_sigma=0.3).deposition_significant == 0.0


class TestInputs:
    """The same two surfaces in every dress give the same volume."""

    BEFORE = np.add.outer(np.arange(12.0), np.arange(10.0) / 4) + 5
    RISE = 0.5

    def check(self, result, cells=120, tolerance=1e-6):
        assert result.net == pytest.approx(self.RISE * cells, rel=tolerance)
        assert result.erosion == pytest.approx(0.0, abs=1e-3)

    @pytest.mark.parametrize("value", [-9999.0, -10000.0, -32768.0, -3.4028234663852886e38, -99999.0, 1e20, np.inf, -54321.0])
    @pytest.mark.parametrize("dtype", ["float32", "float64"])
    def test_nodata_without_tag(self, step, make_raster, listener, value, dtype):
        with np.errstate(over="ignore"):
            hidden = self.BEFORE.astype(dtype)
            hidden[:3, :4] = value
        result = step(make_raster("b", hidden), make_raster("a", (self.BEFORE + self.RISE).astype(dtype)))
        self.check(result, 108)
        assert result.covered_percent == pytest.approx(90.0)
        assert np.isinf(value) or any("no data" in w and "BEFORE" in w for w in listener.warnings)

    def test_nodata_at_both_ends(self, step, make_raster):
        hidden = self.BEFORE.copy()
        hidden[0, :4], hidden[1, :4] = -9999.0, 32767.0
        self.check(step(make_raster("b", hidden), make_raster("a", self.BEFORE + self.RISE)), 112)

    def test_a_cliff_is_not_nodata(self, step, make_raster, listener):
        hidden = self.BEFORE.copy()
        hidden[0, :4] = -40.0
        step(make_raster("b", hidden), make_raster("a", hidden + self.RISE))
        assert not [w for w in listener.warnings if "no data" in w]

    def test_tag_and_override(self, step, make_raster, listener):
        hidden = self.BEFORE.copy()
        hidden[:3, :4] = 0.0
        after = make_raster("a", self.BEFORE + self.RISE)
        self.check(step(make_raster("b", hidden, nodata=0.0), after), 108)
        self.check(step(make_raster("b", hidden), after, nodata=0.0), 108)
        step(make_raster("b", hidden), after)
        assert any("exactly 0" in w for w in listener.warnings)
        self.check(step(make_raster("b", hidden, nodata=6.0), after, nodata=0.0), 108)
        assert any("replaces" in w for w in listener.warnings)

    def test_float32_tag_with_few_digits(self, step, make_raster):
        hidden = self.BEFORE.astype(np.float32)
        hidden[:3, :4] = np.float32(-3.4e38)
        self.check(step(make_raster("b", hidden), make_raster("a", self.BEFORE + self.RISE), nodata=-3.4e38), 108)

    def test_integers_with_scale_and_offset(self, step, make_raster):
        centimetres = np.round((self.BEFORE - 5) * 100).astype(np.int16)
        centimetres[0, 0] = -32768
        before = make_raster("b", centimetres, scale=0.01, offset=5.0)
        self.check(step(before, make_raster("a", self.BEFORE + self.RISE)), 119)

    def test_mask_band(self, step, make_raster):
        import rasterio

        before = make_raster("b", self.BEFORE)
        with rasterio.open(before.path, "r+") as file:
            file.write_mask(np.arange(120).reshape(12, 10) >= 12)
        self.check(step(before, make_raster("a", self.BEFORE + self.RISE)), 108)

    def test_feet_declared(self, step, make_raster, listener):
        """California zone 5 in US survey feet with heights in feet: 3 ft cells, a rise of 1 ft."""
        options = {"cell": 3.0, "west": 6_000_000.0, "north": 2_000_000.0, "crs": "EPSG:2229+6360"}
        before, after = make_raster("b", self.BEFORE, **options), make_raster("a", self.BEFORE + 1.0, **options)
        result = step(before, after)
        assert result.net == pytest.approx(120 * 9 * FOOT**3, rel=1e-9)
        assert any("metres" in i for i in listener.infos)
        # QGIS hands over the horizontal CRS alone.
        assert step(replace(before, crs="EPSG:2229"), after).net == pytest.approx(120 * 9 * FOOT**3, rel=1e-9)

    def test_feet_of_height_only(self, step, make_raster):
        feet = make_raster("b", self.BEFORE / 0.3048, unit="ft")
        self.check(step(feet, make_raster("a", self.BEFORE + self.RISE)))

    def test_feet_undeclared(self, step, make_raster):
        options = {"west": 6_000_000.0, "north": 2_000_000.0, "crs": "EPSG:2229"}
        before = make_raster("b", self.BEFORE, **options)
        with pytest.raises(InputError, match="unit of its heights"):
            step(before, before)

    def test_feet_against_metres(self, step, make_raster):
        """The same ground in feet and, reprojected by its factor, in metres of the same zone (EPSG:26945)."""
        feet = make_raster("b", self.BEFORE, cell=3.0, west=6_561_666.667 + 300, north=1_640_416.667, crs="EPSG:2229+6360")
        after = make_raster(
            "a", (self.BEFORE + 1) * FOOT, cell=3 * FOOT, west=2_000_000 + 300 * FOOT, north=500_000.0, crs="EPSG:26945"
        )
        result = step(feet, after)
        # The false origins agree to 0.1 mm; rows at the edge need a neighbour that is not there.
        assert result.net / (result.area * result.covered_percent / 100) == pytest.approx(FOOT, abs=2e-3)

    def test_layer_crs_overrides(self, step, make_raster):
        wrong = make_raster("b", self.BEFORE, crs="EPSG:32754", layer_crs="EPSG:32755")
        self.check(step(wrong, make_raster("a", self.BEFORE + self.RISE)))

    def test_another_crs(self, step, make_raster):
        """A smooth surface given in two UTM zones; the common grid is the coarser's and the change survives."""
        from pyproj import Transformer

        change = Transformer.from_crs("EPSG:32754", "EPSG:32755", always_xy=True)

        def surface(x, y):
            return 10 + 2 * np.sin((x - WEST) / 30) + 0.02 * (y - NORTH)

        rows_, columns = np.mgrid[0:200, 0:200]
        before = surface(WEST + columns + 0.5, NORTH - rows_ - 0.5)
        x0, y0 = Transformer.from_crs("EPSG:32755", "EPSG:32754", always_xy=True).transform(WEST + 100, NORTH - 100)
        rows_, columns = np.mgrid[0:600, 0:600]
        x, y = change.transform(x0 - 120 + (columns + 0.5) * 0.4, y0 + 120 - (rows_ + 0.5) * 0.4)
        after = make_raster("a", surface(x, y) + 0.25, cell=0.4, west=x0 - 120, north=y0 + 120, crs="EPSG:32754")
        result = step(make_raster("b", before), after)
        covered = result.area * result.covered_percent / 100
        assert result.covered_percent > 99.0
        # Both grids sample a sine of 190 m wavelength: interpolation errs by under 0.1 mm.
        assert result.net / covered == pytest.approx(0.25, abs=1e-4)
        assert result.erosion == 0.0

    def test_datums_that_are_loosely_linked(self, step, make_raster, listener):
        """NAD 83 and WGS 84 are known to each other to metres only."""
        options = {"west": 500_000.0, "north": 4_000_000.0}
        before = make_raster("b", self.BEFORE, crs="EPSG:26911", **options)
        step(before, make_raster("a", self.BEFORE + 1, crs="EPSG:32611", **options))
        assert any("linked to 4 m only" in w for w in listener.warnings)
        listener.warnings.clear()
        step(before, make_raster("a", self.BEFORE + 1, crs="EPSG:26911", **options))
        assert not any("linked" in w for w in listener.warnings)

    def test_finer_raster_is_averaged(self, step, make_raster, read_raster):
        random = np.random.default_rng(1)
        fine = random.normal(10, 1, (48, 40))
        result = step(make_raster("b", self.BEFORE), make_raster("a", fine, cell=0.25))
        values, _, _ = read_raster(result.output)
        mean = fine.reshape(12, 4, 10, 4).mean((1, 3))
        np.testing.assert_allclose(values, mean - self.BEFORE, atol=1e-6)

    def test_bands_alpha_and_pictures(self, step, make_raster, listener):
        two = make_raster("two", np.stack([self.BEFORE, self.BEFORE * 0 + 99]))
        self.check(step(two, make_raster("a", self.BEFORE + self.RISE)))
        assert any("2 bands" in w for w in listener.warnings)
        picture = make_raster("rgb", np.full((3, 12, 10), 80, np.uint8), photometric="RGB")
        with pytest.raises(InputError, match="picture"):
            step(two, picture)


class TestBadInput:
    """One sentence each, and nothing written."""

    @pytest.fixture
    def good(self, make_raster):
        return make_raster("good", np.add.outer(np.arange(20.0), np.arange(20.0)))

    @pytest.fixture
    def refused(self, step, tmp_path):
        def check(kind, match, *pair, **options):
            with pytest.raises(kind, match=match) as caught:
                step(*pair, **options)
            assert "\n" not in str(caught.value)
            assert not list((tmp_path / "out").glob("*")) if (tmp_path / "out").exists() else True

        return check

    def test_rasters(self, refused, good, make_raster, tmp_path):
        flat = np.zeros((20, 20)) + 3
        refused(InputError, "cannot be read", RasterSource(str(tmp_path / "none.tif")), good)
        refused(InputError, "no CRS", make_raster("b", flat, crs=None), good)
        refused(InputError, "degrees", make_raster("b", flat, crs="EPSG:4326", west=147, north=-38, cell=1e-5), good)
        refused(InputError, "do not overlap", make_raster("b", flat, west=WEST + 1000), good)
        refused(NotEnoughData, "no heights at all", make_raster("b", flat * np.nan), good)
        refused(NotEnoughData, "no heights at all", make_raster("b", flat * 0 - 9999), good)
        holes = np.add.outer(np.arange(20.0), np.arange(20.0))
        left, right = holes.copy(), holes.copy()
        left[:, :10], right[:, 10:] = np.nan, np.nan
        refused(NotEnoughData, "no cell where both", make_raster("b", left), make_raster("a", right))

    def test_truncated(self, refused, good, make_raster):
        broken = make_raster("broken", np.random.default_rng(0).normal(size=(400, 400)))
        path = Path(broken.path)
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        refused(InputError, "BEFORE|damaged", broken, good)

    def test_web_mercator_would_falsify_areas(self, refused, make_raster):
        raster = make_raster(
            "b", np.add.outer(np.arange(20.0), np.arange(20.0)), crs="EPSG:3857", west=16_000_000, north=-4_580_000
        )
        refused(InputError, "Areas in", raster, raster)

    def test_vertical_datums(self, refused, make_raster):
        values = np.add.outer(np.arange(20.0), np.arange(20.0))
        a = make_raster("a", values, crs="EPSG:32610+5703", west=500_000, north=4_000_000)
        b = make_raster("b", values, crs="EPSG:32610+3855", west=500_000, north=4_000_000)
        refused(InputError, "convert one", a, b)

    def test_layers(self, refused, good, make_polygons, tmp_path):
        far = make_polygons("far", [shapely.box(900, -990, 950, -950)])
        near = make_polygons("near", [shapely.box(1, -9, 9, -1)])
        refused(InputError, "No zone of ZONES", good, good, zones=far)
        refused(InputError, "STABLE does not lie", good, good, stable=far)
        refused(InputError, "has no field", good, good, zones=near, zone_field="kind")
        refused(InputError, "has no polygons", good, good, zones=make_polygons("empty", []))
        line = str(tmp_path / "line.gpkg")
        write_layer(
            line, "line", "EPSG:32755", {"id": [1]}, [shapely.LineString([(WEST, NORTH), (WEST + 9, NORTH - 9)])], "LineString"
        )
        refused(InputError, "not a polygon", good, good, zones=VectorSource(line, "line"))
        refused(InputError, "cannot be read", good, good, zones=VectorSource(str(tmp_path / "no.gpkg"), "no"))

    def test_parameters(self, refused, good, make_polygons, tmp_path):
        near = make_polygons("near", [shapely.box(1, -9, 9, -1)])
        refused(InputError, "CONFIDENCE", good, good, confidence=95.0)
        refused(InputError, "needs STABLE", good, good, coregister="vertical")
        refused(InputError, "needs STABLE", good, good, coregister="horizontal")
        refused(NotEnoughData, "too little relief", good, good, coregister="horizontal", stable=near)
        refused(InputError, "BEFORE_SIGMA", good, good, before_sigma=-1.0)
        refused(InputError, "both given", good, good, before_sigma=1.0, before_precision=good)
        refused(InputError, "level of detection", good, good, significant=str(tmp_path / "out" / "s.tif"))
        refused(InputError, "also an input", good, good, volumes=None, significant=good.path, before_sigma=1.0, after_sigma=1.0)
        refused(InputError, "GeoPackage", good, good, volumes=str(tmp_path / "v.shp"))
        tiny = make_polygons("tiny", [shapely.box(1, -3, 3, -1)])
        refused(NotEnoughData, "larger stable areas", good, good, stable=tiny)

    def test_identical(self, step, good, listener):
        result = step(good, good, before_sigma=0.1, after_sigma=0.1)
        assert (result.net, result.erosion, result.deposition) == (0.0, 0.0, 0.0)
        assert any("same file" in w for w in listener.warnings)
        assert any("identical" in w for w in listener.warnings)


class TestStableGround:
    """A shift or tilt put on AFTER is found on stable ground and taken off."""

    @pytest.fixture
    def scene(self, make_raster, make_polygons):
        random = np.random.default_rng(3)
        rows_, columns = np.mgrid[0:200, 0:200]
        before = 5 + 0.02 * columns + random.normal(0, 0.03, (200, 200))
        after = 5 + 0.02 * columns + random.normal(0, 0.03, (200, 200))
        after[60:100, 60:140] += 0.5
        tilt = 0.07 + 0.0004 * (columns - 100) - 0.0003 * (rows_ - 100)
        stable = make_polygons("stable", [shapely.box(0, -200, 200, -140), shapely.box(0, -40, 200, 0)])
        zone = make_polygons("zone", [shapely.box(50, -110, 150, -50)])
        return before, after, tilt, {"stable": stable, "zones": zone}

    def test_vertical(self, step, scene, make_raster):
        before, after, _, layers = scene
        result = step(make_raster("b", before), make_raster("a", after + 0.12), **layers)
        truth = 40 * 80 * 0.5
        # 6,000 cells of 0.0424 m: 3.3 m3 random, and 6,000 m2 times the median's 0.4 mm: 2.4 m3.
        assert result.net == pytest.approx(truth, abs=3 * result.net_sigma)
        assert 2.0 < result.net_sigma < 30.0
        assert result.net_random == pytest.approx(np.sqrt(6000) * 0.0424, rel=0.1)

    def test_plane(self, step, scene, make_raster, tmp_path):
        before, after, tilt, layers = scene
        pair = make_raster("b", before), make_raster("a", after + tilt)
        truth = 40 * 80 * 0.5
        result = step(*pair, coregister="plane", output_html_file=str(tmp_path / "r.html"), **layers)
        assert result.net == pytest.approx(truth, abs=3 * result.net_sigma)
        assert "tilt" in (tmp_path / "r.html").read_text(encoding="utf-8")
        left = step(*pair, coregister="none", **layers)
        assert abs(left.net - truth) > 300
        assert left.net_systematic is None

    def test_moving_ground_in_stable_is_outvoted(self, step, scene, make_raster):
        before, after, _, layers = scene
        spoiled = after.copy()
        spoiled[:10, :] += 1.0  # 10 % of the stable cells
        result = step(make_raster("b", before), make_raster("a", spoiled), **layers)
        # The median of 10 % contaminated normal noise moves by 0.14 sigma: 6 mm.
        assert result.net == pytest.approx(1600, abs=60)


def test_georeferencing_of_both_models_gives_the_systematic_term(step, make_raster):
    """Sigma 2 cm up and 1 mrad about the north axis in each model, 50 m from the pivot."""
    from strandline.core.frames import LocalFrame

    frame = LocalFrame.at("EPSG:32755", WEST, NORTH, 0.0)
    pivot = frame.from_crs(np.array([[WEST - 30.0, NORTH - 20.0, 10.0]]))[0]
    covariance = np.zeros((7, 7))
    covariance[2, 2], covariance[4, 4] = 0.02**2, 0.001**2
    georef = {
        "frame": {"crs": frame.crs, "longitude": frame.longitude, "latitude": frame.latitude, "height": frame.height},
        "pivot": pivot.tolist(),
        "covariance": covariance.ravel().tolist(),
        "method": "adjustment",
    }
    values = np.full((40, 40), 10.0)
    tags = {"STRANDLINE_GEOREFERENCING": json.dumps(georef)}
    before, after = make_raster("b", values, tags=tags), make_raster("a", values + 1, tags=tags)
    result = step(before, after, before_sigma=0.01, after_sigma=0.01, correlation_range=0.0)
    # The mean of the cells is 50 m east of the pivot: 2 cm and 5 cm, twice; the grid's axes are turned by 1.8 degrees.
    expected = 1600 * np.sqrt(2 * (0.02**2 + 0.05**2))
    assert result.net_systematic == pytest.approx(expected, rel=2e-3)
    assert step(before, make_raster("c", values)).net_systematic is None
    for kind in ("ellipsoidal", "orthometric"):
        make_raster(kind, values, tags={"STRANDLINE_GEOREFERENCING": json.dumps({**georef, "heights": kind})})
    folder = Path(before.path).parent
    with pytest.raises(InputError, match="ellipsoidal heights and AFTER orthometric"):
        step(RasterSource(str(folder / "ellipsoidal.tif")), RasterSource(str(folder / "orthometric.tif")))
    broken = make_raster("broken", values, tags={"STRANDLINE_GEOREFERENCING": "{"})
    with pytest.raises(InputError, match="damaged"):
        step(broken, after)


def test_one_hectare_by_the_book(step, make_raster, tmp_path):
    """5 cm cells, 3 cm in each model, 20 m range, 2 cm registration: 0.2, 67 and 200 m3 (Rolstad 2009, Anderson 2019 agree)."""
    flat = np.zeros((2000, 2000), np.float32)
    flat[0, 0] = 1e-3
    before, after = make_raster("b", flat, cell=0.05), make_raster("a", flat + np.float32(0.01), cell=0.05)
    options = {"before_sigma": 0.03, "after_sigma": 0.03, "correlation_range": 20.0, "registration_sigma": 0.02}
    result = step(before, after, output_html_file=str(tmp_path / "r.html"), **options)
    sigma = 0.03 * np.sqrt(2)
    assert result.net_random == pytest.approx(2000 * 0.05**2 * sigma, rel=1e-6)
    # Disk of one hectare: c a^2 / (5 L^2) with the square's edges costing a few per cent.
    disk = 1e4 * sigma * np.sqrt(0.2) * 20.0 / np.sqrt(1e4 / np.pi)
    assert disk == pytest.approx(67.3, abs=0.1)
    assert result.net_correlated == pytest.approx(disk, rel=0.08)
    assert result.net_systematic == pytest.approx(200.0)
    assert result.net_sigma == pytest.approx(np.sqrt(result.net_random**2 + result.net_correlated**2 + 200**2))
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "not distinguishable from no change" in page


def test_random_sigma_covers_the_truth(step, make_raster, make_polygons, tmp_path):
    """Uncorrelated noise: the net's error over its random sigma has a standard deviation of one."""
    random = np.random.default_rng(11)
    zones = [shapely.box(x, -y - 10, x + 10, -y) for x in range(0, 200, 10) for y in range(0, 200, 10)]
    noise = random.normal(0, 0.05, (2, 200, 200))
    out = str(tmp_path / "v.gpkg")
    pair = make_raster("b", noise[0]), make_raster("a", noise[1] + 0.3)
    step(*pair, zones=make_polygons("zones", zones), volumes=out, before_sigma=0.05, after_sigma=0.05)
    table = rows(out)
    score = np.array([(r["net"] - 30.0) / r["sigma_random"] for r in table])
    # 400 zones: the standard deviation is known to 3.5 %, the mean to 5 %.
    assert score.std() == pytest.approx(1.0, abs=0.12)
    assert abs(score.mean()) < 0.15
    assert np.mean(np.abs(score) < 1.96) == pytest.approx(0.95, abs=0.035)


def test_the_same_again(step, make_raster, read_raster):
    random = np.random.default_rng(5)
    pair = make_raster("b", random.normal(size=(60, 50))), make_raster("a", random.normal(size=(60, 50)), west=WEST + 0.3)
    options = {"before_sigma": 0.1, "after_sigma": 0.1, "correlation_range": 8.0, "lod": "coherent"}
    first = step(*pair, **options)
    content = Path(first.output).read_bytes()
    assert step(*pair, **options) == first
    assert Path(first.output).read_bytes() == content


def test_tiles_do_not_show(step, make_raster, make_polygons, read_raster, monkeypatch, tmp_path):
    """Tiles of 1,024 and of 17 cells: the same rasters to the bit, the same numbers to rounding."""
    from strandline.core.change import difference

    random = np.random.default_rng(12)
    before, after = random.normal(5, 0.1, (70, 90)), random.normal(5.05, 0.1, (70, 90))
    after[20:30, 20:40] = np.nan
    pair = make_raster("b", before), make_raster("a", after, west=WEST + 0.4, north=NORTH + 0.7)
    zones = make_polygons("zones", [shapely.Point(30, -30).buffer(25), shapely.Point(60, -40).buffer(20)])
    options = {"zones": zones, "before_sigma": 0.1, "after_sigma": 0.1, "correlation_range": 9.0, "lod": "coherent"}
    options |= {"significant": str(tmp_path / "s.tif"), "stable": make_polygons("stable", [shapely.box(0, -70, 90, -50)])}
    large = step(*pair, **options)
    rasters = [read_raster(path)[0] for path in (large.output, large.significant)]

    def small(grid, reach, halo=0):
        corners = [(c, r) for r in range(0, grid.height, 17) for c in range(0, grid.width, 17)]
        return [(c, r, min(17, grid.width - c), min(17, grid.height - r)) for c, r in corners]

    monkeypatch.setattr(difference, "tiles", small)
    tiled = step(*pair, **options)
    for path, expected in zip((tiled.output, tiled.significant), rasters, strict=True):
        np.testing.assert_array_equal(read_raster(path)[0], expected)
    for name in (
        "net",
        "net_sigma",
        "net_correlated",
        "erosion",
        "deposition_sigma",
        "deposition_significant",
        "covered_percent",
    ):
        assert getattr(tiled, name) == pytest.approx(getattr(large, name), rel=1e-9)


def test_cancelled_half_way(make_raster, tmp_path):
    """The output of an earlier run stays, and nothing else."""

    class Impatient:
        def __init__(self, patience):
            self.patience, self.last = patience, 0.0

        def fraction(self, value):
            assert value >= self.last
            self.last = value

        def message(self, text, *, warning):
            pass

        def cancelled(self):
            return self.last > self.patience

    values = np.add.outer(np.arange(1100.0), np.arange(1100.0))
    pair = make_raster("b", values), make_raster("a", values + 1)
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "change.tif").write_bytes(b"earlier")
    for patience in (0.05, 0.4, 0.6):
        listener = Impatient(patience)
        with pytest.raises(Cancelled):
            run(Request(*pair, str(folder / "change.tif"), volumes=str(folder / "v.gpkg")), Progress(listener))
        assert [p.name for p in folder.iterdir()] == ["change.tif"]
        assert (folder / "change.tif").read_bytes() == b"earlier"


def test_full_sigma_covers_the_truth(step, make_raster, make_polygons):
    """Correlated and random noise and a shift: with STABLE alone the interval of the net holds the truth as often as it says."""
    from strandline.core.change.variogram import correlation

    side, reach, sill, nugget = 128, 10.0, 0.03, 0.02
    i = np.minimum(np.arange(2 * side), 2 * side - np.arange(2 * side))
    spectrum = np.sqrt(np.maximum(np.fft.fft2(correlation(np.hypot(i[:, None], i[None]), reach)).real, 0))
    stable = make_polygons("stable", [shapely.box(0, -128, 128, -64)])
    zone = make_polygons("zone", [shapely.box(30, -50, 90, -10)])
    random = np.random.default_rng(8)
    scores = []
    for _ in range(40):
        field = np.fft.ifft2(np.fft.fft2(random.standard_normal((2 * side, 2 * side))) * spectrum).real[:side, :side]
        after = 0.2 + sill * field + nugget * random.standard_normal((side, side))
        after[10:50, 30:90] += 0.1
        pair = make_raster("b", np.zeros((side, side)) + 1e-9), make_raster("a", after)
        result = step(*pair, stable=stable, zones=zone)
        scores.append((result.net - 240.0) / result.net_sigma)
    # 40 runs: a standard deviation of one is met to 11 %, the sill of each run is estimated from 80 patches.
    assert np.std(scores) == pytest.approx(1.0, abs=0.3)
    assert abs(np.mean(scores)) < 0.5
    assert np.mean(np.abs(scores) < 1.96) >= 0.85


def test_memory_stays_bounded(make_raster, tmp_path):
    """8,000 x 8,000 cells, mostly empty: two such arrays of 64-bit numbers alone would be 1 GB."""
    import rasterio
    from rasterio.windows import Window

    side, sources = 8_000, []
    for name, rise in (("b", 0.0), ("a", 0.5)):
        path = tmp_path / f"{name}.tif"
        profile = {"driver": "GTiff", "width": side, "height": side, "count": 1, "dtype": "float32", "nodata": -9999.0}
        profile |= {
            "tiled": True,
            "blockxsize": 512,
            "blockysize": 512,
            "sparse_ok": True,
            "crs": "EPSG:32755",
            "compress": "deflate",
        }
        place = rasterio.transform.Affine(0.1, 0, WEST, 0, -0.1, NORTH)
        with rasterio.open(path, "w", transform=place, **profile) as file:
            patch = np.add.outer(np.arange(1000.0), np.arange(1000.0)).astype(np.float32)[None] / 1000
            for corner in (0, 3500, 7000):
                file.write(patch + np.float32(rise), window=Window(corner, corner, 1000, 1000))
        sources.append({"path": str(path)})
    request = tmp_path / "request.json"
    request.write_text(json.dumps({"before": sources[0], "after": sources[1], "output": str(tmp_path / "o.tif")}))
    code = (
        "import sys\nimport strandline.core.change.dsmdifference\nfrom strandline.core.entry import main\n"
        "def peak():\n    return next(int(l.split()[1]) for l in open('/proc/self/status') if l.startswith('VmHWM'))\n"
        "before = peak()\nstatus = main(['dsmdifference', sys.argv[1]])\n"
        "print(status, (peak() - before) / 1024, file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(request)], capture_output=True, text=True, check=True)
    status, grown = done.stderr.split()[-2:]
    assert status == "0"
    result = json.loads(done.stdout.splitlines()[-1])["result"]
    assert result["net"] == pytest.approx(3e6 * 0.01 * 0.5, rel=1e-5)
    assert float(grown) < 450.0, grown
