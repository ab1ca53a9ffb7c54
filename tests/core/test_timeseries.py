"""Volumes through time: by hand, per-date errors, simulated surveys with known truth, and real ones."""

import numpy as np
import pyogrio
import pytest
import rasterio
import shapely
from beach import DATES, LINES, STABLE, ZONES, surveyed, true_surface
from strandline.core.change import profiles
from strandline.core.change.timeseries import Request, run
from strandline.core.contract import RasterSource, VectorSource
from strandline.core.errors import InputError, NotEnoughData
from strandline.core.vector import write_layer

CHANGE = np.array([[1.0, 0.5, 0.0, -1.0], [2.0, -0.5, 0.25, -2.0], [0.0, 0.0, 4.0, 1.0]])


@pytest.fixture
def step(tmp_path, progress, rows):
    def call(**options):
        paths = {"output": tmp_path / "table.gpkg", "zone_rates": tmp_path / "rates.gpkg"}
        result = run(Request(**{k: str(v) for k, v in paths.items()}, **options), progress)
        return result, rows(paths["output"]), rows(paths["zone_rates"])

    return call


class TestByHand:
    """A 4 x 3 grid of 2 m cells: date 1 is level, date 2 has CHANGE, date 3 twice of it less 0.5 m."""

    @pytest.fixture
    def dsms(self, make_raster):
        heights = [np.full((3, 4), 10.0), 10.0 + CHANGE, 9.5 + 2 * CHANGE]
        return tuple(make_raster(f"d_202{k}0101", h, cell=2.0) for k, h in enumerate(heights))

    def test_volumes(self, dsms, step):
        result, table, (rate,) = step(dsms=dsms)
        total = 4 * CHANGE.sum()
        assert [r["net"] for r in table] == pytest.approx([0.0, total, 2 * total - 24.0])
        assert [r["net_previous"] for r in table] == [None, pytest.approx(total), pytest.approx(total - 24.0)]
        assert table[1]["erosion"] == table[1]["erosion_previous"] == pytest.approx(4 * 3.5)
        assert table[1]["deposition"] == pytest.approx(4 * 8.75)
        fallen = 4 * np.maximum(0.5 - CHANGE, 0).sum()
        assert table[2]["erosion_previous"] == pytest.approx(fallen)
        assert table[2]["deposition_previous"] == pytest.approx(4 * np.maximum(CHANGE - 0.5, 0).sum())
        assert [table[2][k] for k in ("sigma", "low", "high", "significant", "date_sigma")] == [None] * 5
        assert result.net == pytest.approx(2 * total - 24.0)
        assert (result.area, result.covered_percent) == pytest.approx((48.0, 100.0))
        years = np.array([0, 366, 731]) / 365.25
        assert rate["rate"] == pytest.approx(np.polyfit(years, [r["net"] for r in table], 1)[0])

    def test_sigmas_are_per_date(self, dsms, step, make_raster):
        """Noise of 10, 20 and 30 cm a cell: each change has that of its own two dates."""
        cells = 4.0 * np.sqrt(12.0)
        precisions = tuple(make_raster(f"p_202{k}0101", np.full((3, 4), 0.1 * (k + 1)), cell=2.0) for k in range(3))
        _, table, _ = step(dsms=dsms, precisions=precisions, correlation_range=0.0, registration_sigma=0.05)
        level = 48 * 0.05
        one = [np.hypot(0.1 * (k + 1) * cells, level) for k in range(3)]
        assert [r["date_sigma"] for r in table] == pytest.approx(one, rel=1e-6)
        assert table[2]["sigma"] == pytest.approx(np.hypot(one[0], one[2]), rel=1e-6)
        assert table[2]["sigma_previous"] == pytest.approx(np.hypot(one[1], one[2]), rel=1e-6)
        # The consecutive changes add up; their sigmas do not, as both hold the error of the middle date.
        assert table[1]["net_previous"] + table[2]["net_previous"] == pytest.approx(table[2]["net"])
        assert np.hypot(table[1]["sigma_previous"], table[2]["sigma_previous"]) > 1.2 * table[2]["sigma"]
        assert table[2]["high"] - table[2]["net"] == pytest.approx(1.959964 * table[2]["sigma"], rel=1e-6)

    def test_only_ground_of_every_date_counts(self, dsms, step, make_raster, make_polygons, listener):
        holed = 10.0 + CHANGE
        holed[:, 2:] = np.nan
        dsms = dsms[0], make_raster("h_20210101", holed, cell=2.0), dsms[2]
        zones = make_polygons("z", [shapely.box(0, -6, 8, 0), shapely.box(5, -6, 8, 0)], {"name": ["all", "east"]})
        _, table, rates = step(dsms=dsms, zones=zones)
        assert table[1]["net"] == pytest.approx(4 * CHANGE[:, :2].sum())
        assert table[2]["net"] == pytest.approx(4 * (2 * CHANGE[:, :2] - 0.5).sum())
        assert [r["covered_percent"] for r in rates] == pytest.approx([50.0, 0.0])
        assert table[3]["net"] is None
        assert rates[1]["net"] is None
        assert any("No cell of east" in text for text in listener.warnings)
        assert any("without 2021-01-01 it would be 100 %" in text for text in listener.warnings)

    def test_rates_of_cells(self, make_raster, step, tmp_path, read_raster):
        """One cell rises by 1 m/year exactly, one not at all but for its noise, one has two dates only."""
        heights = np.array([[[0.0, 0.3, 0.0]], [[1.0, -0.2, np.nan]], [[2.0, 0.1, 2.0]], [[3.0, 0.2, np.nan]]]) + 5.0
        days = ("2021-01-01", "2022-01-01", "2023-01-01", "2024-01-01")
        dsms = tuple(make_raster(f"d{k}", h) for k, h in enumerate(heights))
        out = {k: str(tmp_path / f"{k}.tif") for k in ("rate", "significant")}
        told = {"sigma": 0.2, "correlation_range": 0.0, "registration_sigma": 0.0}
        step(dsms=dsms, dates=",".join(days), **told, **out)
        rate, significant = (read_raster(path)[0][0] for path in out.values())
        assert rate[0] == pytest.approx(365.25 / 365.0, rel=1e-6)
        assert rate[1] == pytest.approx(np.polyfit(365 / 365.25 * np.arange(4), heights[:, 0, 1], 1)[0], rel=1e-5)
        assert np.isnan(rate[2])
        assert np.isfinite(significant).tolist() == [True, False, False]

    def test_two_dates_have_volumes_and_no_rate(self, dsms, step, listener, tmp_path):
        result, table, (rate,) = step(dsms=dsms[:2])
        assert table[1]["net"] == pytest.approx(4 * CHANGE.sum())
        assert (rate["rate"], result.net_rate) == (None, None)
        assert any("Rates need 3 dates" in text for text in listener.warnings)
        with pytest.raises(InputError, match="RATE and SIGNIFICANT need 3 dates"):
            step(dsms=dsms[:2], rate=str(tmp_path / "r.tif"))

    def test_dates_by_table(self, dsms, step, tmp_path):
        names = [f"d_202{k}0101.tif" for k in range(3)]
        columns = {"file": names, "date": ["2010-01-01", "2000-01-01", "2005-01-01"], "sigma": [0.1, 0.2, 0.3]}
        write_layer(str(tmp_path / "dates.gpkg"), "dates", None, columns, None)
        table = VectorSource(str(tmp_path / "dates.gpkg"), "dates")
        _, rows, _ = step(dsms=dsms, date_table=table, correlation_range=0.0, registration_sigma=0.0)
        assert [r["date"] for r in rows] == ["2000-01-01", "2005-01-01", "2010-01-01"]
        assert [r["date_sigma"] for r in rows] == pytest.approx([s * 4 * np.sqrt(12) for s in (0.2, 0.3, 0.1)], rel=1e-6)

    def test_refused(self, dsms, step, make_raster, make_polygons, tmp_path):
        for told, kind, options in (
            ("DSMS holds 1 raster", InputError, {"dsms": dsms[:1]}),
            ("does not overlap", InputError, {"dsms": (*dsms[:2], make_raster("f_20220101", CHANGE, west=0.0))}),
            ("No zone of ZONES lies on the DSMs", InputError, {"zones": make_polygons("far", [shapely.box(900, 0, 950, 9)])}),
            ("RESOLUTION=-1", InputError, {"resolution": -1.0}),
            ("every date; without", NotEnoughData, {"dsms": (*dsms[:2], _empty_west(make_raster))}),
        ):
            with pytest.raises(kind, match=told):
                step(**{"dsms": dsms, **options, "zones": options.get("zones") or make_polygons("w", [shapely.box(0, -6, 4, 0)])})
            assert not (tmp_path / "table.gpkg").exists()


def _empty_west(make_raster):
    values = np.where(np.arange(4)[None, :] < 2, np.nan, CHANGE)
    return make_raster("w_20220101", values, cell=2.0)


def test_the_truth_lies_in_the_intervals(make_raster, make_polygons, make_lines, step, rows, tmp_path, progress):
    """Simulated surveys of four dates with noise, shared errors and levels of their own, put right on stable ground.

    z = error / sigma of the changes since the first date. In 8 surveys the dates' shared errors leave some 60 independent values
    to the root mean square of z, whose scatter is 1 / sqrt(120) = 0.09; three of these, and 0.1 for the sigmas, which are
    estimated from stable ground themselves.
    """
    stable, zones, lines = make_polygons("s", STABLE), make_polygons("z", ZONES), make_lines("t", LINES)
    shares = {}
    truth = [true_surface(k) for k in range(4)]
    flat = tuple(make_raster(f"t_{d}", s) for d, s in zip(DATES, truth, strict=True))

    def changes(dsms, **options):
        _, table, _ = step(dsms=dsms, zones=zones, **options)
        out = tmp_path / "p.gpkg"
        profiles.run(profiles.Request(dsms=dsms, transects=lines, datum=1.5, output=str(out), **options), progress)
        return {
            "volume": [(r["net"], r["sigma"]) for r in table if r["net_previous"] is not None],
            "profile": [(r["change_first"], r["change_first_sigma"]) for r in rows(out) if r["change_first"] is not None],
        }

    true = changes(flat)
    for seed in range(8):
        random = np.random.default_rng(100 + seed)
        dsms = tuple(make_raster(f"m_{d}", surveyed(random, k)) for k, d in enumerate(DATES))
        for key, told in changes(dsms, stable=stable).items():
            z = [(v - t) / s for (v, s), (t, _) in zip(told, true[key], strict=True)]
            shares.setdefault(key, []).extend(z)
    for key, z in shares.items():
        size = float(np.sqrt(np.mean(np.square(z))))
        assert 1 - 0.37 < size < 1 + 0.37, key
        assert abs(float(np.mean(z))) < 0.4, key


@pytest.fixture(scope="module")
def leo(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("leo")
    data = request.getfixturevalue("shared_data") / "leo"
    meta, _, lines, _ = pyogrio.raw.read(data / "leo_lod_transects.gpkg")
    around = [shapely.multipolygons([shapely.buffer(line, 2.0)]) for line in shapely.from_wkb(lines)]
    write_layer(str(folder / "s.gpkg"), "s", meta["crs"], {"id": list(range(len(around)))}, around, "MultiPolygon")
    _, _, lines, _ = pyogrio.raw.read(data / "leo_transects.gpkg")
    ends = [shapely.get_coordinates(shapely.line_interpolate_point(x, [0, 25])) for x in shapely.from_wkb(lines)]
    parts = [
        shapely.multipolygons([shapely.convex_hull(shapely.multipoints(np.vstack(ends[a:b])))]) for a, b in ((18, 27), (36, 46))
    ]
    write_layer(str(folder / "z.gpkg"), "z", meta["crs"], {"name": ["north", "south"]}, parts, "MultiPolygon")
    dsms = tuple(RasterSource(str(p)) for p in sorted((data / "dsm").glob("*.tif")))
    return {
        "dsms": dsms,
        "stable": VectorSource(str(folder / "s.gpkg"), "s"),
        "zones": VectorSource(str(folder / "z.gpkg"), "z"),
        "transects": VectorSource(str(data / "leo_transects.gpkg"), "leo_transects"),
    }


class TestLeo:
    """Six real surface models whose no data is not tagged, whose cells are not square, on grids of their own."""

    def test_volumes(self, leo, step, tmp_path, listener):
        rate = tmp_path / "rate.tif"
        result, table, rates = step(**{k: leo[k] for k in ("dsms", "stable", "zones")}, rate=str(rate))
        assert result.date_count == 6
        assert result.covered_percent == pytest.approx(100.0)
        assert sum("-10000" in text for text in listener.warnings) == 6
        assert [r["date"] for r in table[:6]] == [
            "2018-06-06",
            "2018-07-13",
            "2018-09-20",
            "2019-02-11",
            "2019-03-28",
            "2019-07-31",
        ]
        for zone in (table[:6], table[6:]):
            assert sum(r["net_previous"] or 0.0 for r in zone) == pytest.approx(zone[-1]["net"])
            # Decimetres of heights that the stable ground leaves: a few hundred m3 on half a hectare.
            assert all(50 < r["sigma"] < 3000 for r in zone[1:])
        assert all(abs(r["height_rate"]) < 0.5 for r in rates)
        with rasterio.open(rate) as file:
            assert file.crs.to_epsg() == 32755
            assert file.nodata == -9999.0

    def test_profiles(self, leo, tmp_path, progress, rows, listener):
        out = tmp_path / "p.gpkg"
        told = {k: leo[k] for k in ("dsms", "stable", "transects")}
        result = profiles.run(profiles.Request(**told, transect_field="tr_id", datum=0.5, output=str(out)), progress)
        assert (result.transect_count, result.date_count) == (59, 6)
        assert any("28 transect(s) lie outside" in text for text in listener.warnings)
        table = rows(out)
        covered = [r for r in table if r["volume"] is not None]
        assert {r["transect"] for r in covered} >= {str(i) for i in range(20, 45)}
        # A beach of some 20 m above half a metre: its width is known to a metre or two.
        widths = [(r["width"], r["width_sigma"]) for r in covered if r["width"] is not None]
        assert len(widths) > 120
        assert 15 < np.median([w for w, _ in widths]) < 30
        assert 0.1 < np.median([s for _, s in widths]) < 3
