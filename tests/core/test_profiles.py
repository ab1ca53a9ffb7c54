"""Profiles: a plane beach by hand, gaps, units, and sentences for what cannot be meant."""

import numpy as np
import pytest
import shapely
from strandline.core.change.crosssection import sand_above, seaward_crossing
from strandline.core.change.profiles import Request, run
from strandline.core.errors import InputError, NotEnoughData

WEST, NORTH = 300_000.0, 5_774_000.0
SLOPE = 0.05


def plane(lift=0.0, columns=120, rows=40):
    """A beach that falls by 5 % to the east; 4.5 m high at the centre of the eleventh column."""
    x = np.arange(columns) + 0.5
    return np.repeat((4.5 - SLOPE * (x - 10.5) + lift)[None, :], rows, axis=0)


@pytest.fixture
def beach(make_raster, make_lines):
    dsms = make_raster("b_20200101", plane()), make_raster("b_20210101", plane(0.1))
    return {"dsms": dsms, "transects": make_lines("t", [shapely.LineString([(10.5, -20.5), (110.5, -20.5)])])}


@pytest.fixture
def step(tmp_path, progress, rows):
    def call(**options):
        out = tmp_path / "profiles.gpkg"
        result = run(Request(output=str(out), points=str(tmp_path / "points.gpkg"), datum=1.0, **options), progress)
        return result, rows(out), rows(tmp_path / "points.gpkg")

    return call


class TestCrossSection:
    """From hand-drawn profiles."""

    D = np.arange(5.0)

    def test_sand(self):
        # Trapezoids 2.5, 1.5, then a triangle of 1 m height over half a segment; nothing below.
        sand = sand_above(self.D, np.array([3.0, 2.0, 1.0, -1.0, -2.0]), 0.0, 0.0, 4.0)
        assert sand.volume == pytest.approx(2.5 + 1.5 + 0.25, abs=1e-12)
        assert sand.covered == 4.0
        np.testing.assert_allclose(sand.weight, [0.5, 1.0, 0.5 + 0.375, 0.125, 0.0], atol=1e-12)

    def test_from_and_to(self):
        sand = sand_above(self.D, np.array([3.0, 2.0, 1.0, -1.0, -2.0]), 0.0, 0.5, 1.5)
        assert sand.volume == pytest.approx((2.5 + 2.0) / 4 + (2.0 + 1.5) / 4, abs=1e-12)
        assert sand.covered == pytest.approx(1.0)

    def test_a_gap_holds_no_sand(self):
        sand = sand_above(self.D, np.array([3.0, 2.0, np.nan, 2.0, 1.0]), 0.0, 0.0, 4.0)
        assert sand.volume == pytest.approx(2.5 + 1.5)
        assert sand.covered == 2.0
        assert sand.weight[2] == 0.0

    def test_weights_are_derivatives(self):
        height = np.array([1.2, 0.4, -0.3, 0.2, -0.5])
        sand = sand_above(self.D, height, 0.1, 0.3, 3.7)
        for i in range(5):
            moved = height.copy()
            moved[i] += 1e-6
            slope = (sand_above(self.D, moved, 0.1, 0.3, 3.7).volume - sand.volume) / 1e-6
            assert slope == pytest.approx(sand.weight[i], abs=1e-5)

    def test_the_most_seaward_fall(self):
        crossing = seaward_crossing(self.D, np.array([1.0, -1.0, 1.0, -3.0, -4.0]), 0.0, 0.0, 4.0, 2.0)
        assert crossing.distance == pytest.approx(2.25)
        assert crossing.count == 2
        np.testing.assert_allclose(crossing.weight, [0, 0, 0.75, 0.25, 0])
        assert seaward_crossing(self.D, np.array([1.0, np.nan, -1.0, -1.0, -1.0]), 0.0, 0.0, 4.0, 2.0) is None
        assert seaward_crossing(self.D, np.arange(5.0) - 2.5, 0.0, 0.0, 4.0, 2.0) is None


class TestPlaneBeach:
    """Falls through the datum, 1 m, after 70 m, and lifted by 10 cm after 72 m."""

    def test_by_hand(self, beach, step):
        result, (first, last), points = step(**beach)
        assert first["volume"] == pytest.approx(3.5 * 70 / 2, abs=1e-6)
        assert last["volume"] == pytest.approx(3.6 * 72 / 2, abs=1e-6)
        assert last["change_first"] == last["change_previous"] == pytest.approx(7.1, abs=1e-6)
        assert (first["width"], last["width"]) == pytest.approx((70.0, 72.0), abs=1e-6)
        assert last["width_change_first"] == pytest.approx(0.1 / SLOPE, abs=1e-6)
        assert last["slope"] == pytest.approx(-SLOPE, abs=1e-9)
        assert first["covered_percent"] == last["covered_percent"] == pytest.approx(100.0)
        assert result.mean_change == pytest.approx(7.1, abs=1e-6)
        assert len(points) == 2 * 101
        assert points[0]["height"] == pytest.approx(4.5)
        # Nothing tells the sigma: it is not known, not 0.
        keys = ("volume_sigma", "change_first_sigma", "change_first_low", "change_first_significant", "width_sigma")
        assert [last[k] for k in keys] == [None] * 5
        assert (result.mean_change_sigma, points[0]["sigma"]) == (None, None)
        assert [first[k] for k in ("change_first", "change_previous", "width_change_first")] == [None] * 3

    def test_sigma_by_hand(self, beach, step):
        """Noise of 3 cm a cell adds in quadrature, 2 cm of a whole surface adds plainly; dates are independent."""
        result, (first, last), points = step(**beach, sigma=0.03, correlation_range=0.0, registration_sigma=0.02)
        assert first["volume_sigma"] == pytest.approx(np.hypot(0.03 * np.sqrt(69.5), 0.02 * 70), rel=1e-6)
        square = 0.03**2 * (69.5 + 71.5) + 0.02**2 * (70**2 + 72**2)
        assert last["change_first_sigma"] == pytest.approx(np.sqrt(square), rel=1e-6)
        assert result.mean_change_sigma == pytest.approx(np.sqrt(square), rel=1e-6)
        assert last["change_first_high"] - last["change_first"] == pytest.approx(1.959964 * np.sqrt(square), rel=1e-6)
        assert last["change_first_significant"] == 1
        assert first["width_sigma"] == pytest.approx(np.hypot(0.03, 0.02) / SLOPE, rel=1e-6)
        assert points[0]["sigma"] == pytest.approx(np.hypot(0.03, 0.02))

    def test_errors_that_all_nodes_share_add_plainly(self, beach, step):
        _, (first, _), _ = step(**beach, sigma=0.03, correlation_range=1e9, registration_sigma=0.0)
        assert first["volume_sigma"] == pytest.approx(np.hypot(0.03 * np.sqrt(69.5), 0.03 * 70), rel=1e-6)

    def test_noise_is_counted_by_cell_whatever_the_spacing(self, beach, step):
        """Half a cell's spacing makes twice the nodes of the same noise."""
        told = {"sigma": 0.03, "correlation_range": 0.0, "registration_sigma": 0.0}
        _, (coarse, _), _ = step(**beach, **told)
        _, (fine, _), _ = step(**beach, **told, spacing=0.5)
        _, (wide, _), _ = step(**beach, **told, spacing=5.0)
        assert fine["volume"] == pytest.approx(coarse["volume"], abs=1e-6)
        assert wide["volume"] == pytest.approx(coarse["volume"], abs=1e-6)
        assert fine["volume_sigma"] == pytest.approx(coarse["volume_sigma"], rel=0.01)
        assert wide["volume_sigma"] == pytest.approx(coarse["volume_sigma"], rel=0.05)

    def test_the_mean_of_neighbours_keeps_what_they_share(self, beach, step, make_lines):
        lines = [shapely.LineString([(10.5, y), (110.5, y)]) for y in (-10.5, -20.5, -30.5)]
        beach["transects"] = make_lines("t", lines)
        result, rows, _ = step(**beach, sigma=0.03, correlation_range=0.0, registration_sigma=0.02)
        assert [r["transect"] for r in rows] == ["1", "1", "2", "2", "3", "3"]
        square = 0.03**2 * (69.5 + 71.5) / 3 + 0.02**2 * (70**2 + 72**2)
        assert result.mean_change_sigma == pytest.approx(np.sqrt(square), rel=1e-6)

    def test_section(self, beach, step):
        _, (first, last), _ = step(**beach, start=10.0, end=20.0)
        assert first["volume"] == pytest.approx(10 * (3.5 - SLOPE * 15), abs=1e-6)
        assert last["change_first"] == pytest.approx(1.0, abs=1e-6)
        assert first["width"] is None

    def test_a_gap_is_told_and_left_out_of_the_change(self, beach, step, make_raster):
        holed = plane(0.1)
        holed[:, 30:40] = np.nan
        beach["dsms"] = beach["dsms"][0], make_raster("h_20210101", holed)
        _, (first, last), points = step(**beach)
        # Nodes 20 to 29 lie in the hole: 11 of 100 segments have no height.
        assert last["covered_percent"] == pytest.approx(89.0)
        assert last["change_first_covered_percent"] == pytest.approx(89.0)
        assert last["change_first"] == pytest.approx(7.1 - 11 * 0.1, abs=1e-6)
        assert last["volume"] < first["volume"]
        assert sum(p["height"] is None for p in points) == 10

    def test_flip(self, beach, step, make_lines, listener):
        beach["transects"] = make_lines("t", [shapely.LineString([(110.5, -20.5), (10.5, -20.5)])])
        _, (first, _), _ = step(**beach, flip=True)
        assert first["width"] == pytest.approx(70.0)
        _, (first, _), _ = step(**beach)
        assert first["width"] is None
        assert any("FLIP" in text for text in listener.warnings)

    def test_another_crs_and_cells(self, beach, step, make_lines, make_raster):
        """The same beach at 2 m and 0.5 m cells, and the transect in the neighbouring UTM zone."""
        from pyproj import Transformer

        x = np.arange(240) * 0.5 + 0.25
        fine = np.repeat((4.6 - SLOPE * (x - 10.5))[None, :], 80, axis=0)
        beach["dsms"] = beach["dsms"][0], make_raster("f_20210101", fine, cell=0.5)
        change = Transformer.from_crs("EPSG:32755", "EPSG:32754", always_xy=True)
        line = shapely.transform(
            shapely.LineString([(10.5, -20.5), (110.5, -20.5)]),
            lambda xy: np.column_stack(change.transform(*(xy + (WEST, NORTH)).T)),
        )
        beach["transects"] = make_lines("t", [line], crs="EPSG:32754", absolute=True)
        _, (first, last), _ = step(**beach)
        assert first["volume"] == pytest.approx(3.5 * 70 / 2, abs=1e-3)
        assert last["volume"] == pytest.approx(3.6 * 72 / 2, abs=1e-3)

    def test_feet_are_converted(self, beach, step, make_raster):
        beach["dsms"] = tuple(make_raster(f"f_202{k}0101", plane(0.1 * k) / 0.3048, unit="ft") for k in (0, 1))
        _, (first, last), _ = step(**beach)
        assert first["volume"] == pytest.approx(3.5 * 70 / 2, abs=1e-6)
        assert last["change_first"] == pytest.approx(7.1, abs=1e-6)

    def test_stable_ground_takes_a_level_off(self, beach, step, make_raster, make_polygons):
        """The second survey lies 30 cm too high, everywhere; beyond the stable strip the beach rose by 10 cm."""
        random = np.random.default_rng(5)
        noise = [0.005 * random.standard_normal((40, 120)) for _ in range(2)]
        change = np.where(np.arange(120) < 40, 0.0, 0.1)[None, :] + 0.3
        beach["dsms"] = make_raster("a_20200101", plane() + noise[0]), make_raster("a_20210101", plane() + change + noise[1])
        beach["stable"] = make_polygons("stable", [shapely.box(0, -40, 38, 0)])
        _, (_, last), _ = step(**beach, start=40.0, end=60.0)
        assert last["change_first"] == pytest.approx(2.0, abs=3 * last["change_first_sigma"])
        assert 0.001 < last["change_first_sigma"] < 0.1
        assert last["change_first_significant"] == 1


class TestRefused:
    """One sentence each, and no file."""

    @pytest.fixture
    def refused(self, beach, step, tmp_path):
        def call(told, kind=InputError, **options):
            with pytest.raises(kind, match=told):
                step(**{**beach, **options})
            assert not (tmp_path / "profiles.gpkg").exists()

        return call

    def test_sentences(self, refused, beach, make_raster, make_lines, make_polygons):
        a, b = beach["dsms"]
        refused("DSMS holds 0", dsms=())
        refused("in DSMS twice", dsms=(a, a))
        refused("same date", dates="2020-01-01, 2020-01-01")
        refused("does not overlap", dsms=(a, make_raster("c_20220101", plane(), west=WEST + 1e4)))
        refused("No line of TRANSECTS lies on the DSMs", transects=make_lines("far", [shapely.LineString([(900, 0), (950, 0)])]))
        refused("has no length", transects=make_lines("zero", [shapely.LineString([(20, -5), (20, -5)])]))
        refused("is not a line", transects=make_polygons("poly", [shapely.box(0, -5, 5, 0)]))
        two = shapely.MultiLineString([[(0, -5), (5, -5)], [(9, -5), (12, -5)]])
        refused("several parts", transects=make_lines("two", [two], kind="MultiLineString"))
        line = shapely.LineString([(0, -5), (5, -5)])
        named = make_lines("same", [line, line], {"name": ["a", "a"]})
        refused("two lines are called a", transects=named)
        refused("beyond the end", start=200.0)
        refused("END", start=50.0, end=40.0)
        refused("SPACING", spacing=-1.0)
        refused("more than 5,000,000 points", spacing=1e-5)
        refused("SIGMA is -1", sigma=-1.0)
        refused("PRECISIONS and SIGMA", sigma=0.1, precisions=(a, b))
        refused("PRECISIONS holds 1", precisions=(a,))
        refused("needs STABLE", coregister="plane")
        refused("STABLE covers 0 cells", NotEnoughData, stable=make_polygons("off", [shapely.box(500, 0, 510, 10)]))
        refused("CONFIDENCE", confidence=1.0)

    def test_precisions_in_another_order(self, refused, beach, make_raster):
        flat = np.full((40, 120), 0.02)
        refused("same order", precisions=(make_raster("p_20210101", flat), make_raster("p_20200101", flat)))

    def test_heights_of_two_kinds(self, refused, make_raster):
        tags = [{"STRANDLINE_GEOREFERENCING": f'{{"heights": "{kind}"}}'} for kind in ("ellipsoidal", "orthometric")]
        dsms = tuple(make_raster(f"k_202{k}0101", plane(), tags=tag) for k, tag in enumerate(tags))
        refused("ellipsoidal heights and", dsms=dsms)


def test_one_date_has_profiles_without_change(beach, step, listener):
    beach["dsms"] = beach["dsms"][:1]
    result, (row,), _ = step(**beach)
    assert row["volume"] == pytest.approx(122.5)
    assert result.mean_change is None
    assert any("one date only" in text for text in listener.warnings)


def test_a_datum_beyond_the_heights_is_told(beach, tmp_path, progress, listener, rows):
    run(Request(output=str(tmp_path / "o.gpkg"), datum=50.0, **beach), progress)
    assert rows(tmp_path / "o.gpkg")[0]["volume"] == 0.0
    assert any("lies outside the profiles' heights" in text for text in listener.warnings)


def test_the_report_stands_alone(beach, tmp_path, progress):
    page = tmp_path / "p.html"
    told = {"sigma": 0.03, "correlation_range": 5.0, "registration_sigma": 0.02}
    run(Request(output=str(tmp_path / "o.gpkg"), datum=1.0, output_html_file=str(page), **told, **beach), progress)
    text = page.read_text()
    assert "From 2020-01-01 to 2021-01-01 the beach changed by +7.10 +- " in text
    assert text.count("data:image/png;base64") == 2
    assert "://" not in text
