"""Shorelines: contours by hand, a plane beach, rates, and sentences for what cannot be meant."""

import numpy as np
import pyogrio
import pytest
import shapely
from strandline.core.change.contours import joined, segments
from strandline.core.change.shoreline import Request, run
from strandline.core.change.trend import fit_trend
from strandline.core.errors import InputError, NotEnoughData
from strandline.core.raster import Grid

WEST, NORTH = 300_000.0, 5_774_000.0
SLOPE = 0.05
GRID = Grid(0.0, 0.0, 1.0, 9, 9, "")


def plane(lift=0.0):
    """Falls by 5 % to the east; 4.5 m at the centre of the eleventh column, 1 m at that of the 81st."""
    return np.repeat((4.5 - SLOPE * np.arange(-10, 110) + lift)[None, :], 40, axis=0)


@pytest.fixture
def beach(make_raster, make_lines):
    dsms = tuple(make_raster(f"b_202{k}0101", plane(0.1 * k)) for k in range(3))
    lines = [shapely.LineString([(10.5, y), (110.5, y)]) for y in (-10.5, -20.5)]
    return {"dsms": dsms, "transects": make_lines("t", lines)}


@pytest.fixture
def step(tmp_path, progress, rows):
    def call(**options):
        names = ("output", "positions", "rates")
        paths = {n: str(tmp_path / f"{n}.gpkg") for n in names if n == "output" or options.get("transects")}
        result = run(Request(**{"datum": 1.0, **options}, **paths), progress)
        return result, *(rows(paths[n]) if n in paths else None for n in names)

    return call


class TestContours:
    """Marching squares by hand."""

    def test_one_square(self):
        pieces = segments(np.array([[1.0, 0.0], [1.0, 0.0]]), 0.25, 3, 5)
        np.testing.assert_allclose(np.sort(pieces.reshape(-1, 2), axis=0), [[5.75, 3], [5.75, 4]])

    def test_an_island_is_a_ring(self):
        heights = np.zeros((5, 5))
        heights[2, 2] = 1.0
        (ring,) = joined(segments(heights, 0.5, 0, 0), GRID)
        assert ring.is_ring
        assert shapely.length(ring) == pytest.approx(4 * np.sqrt(0.5))

    def test_a_saddle_joins_the_side_of_its_middle(self):
        high = segments(np.array([[1.0, 0.0], [0.0, 1.0]]), 0.4, 0, 0)  # the middle, 0.5, is above: the ridge goes through
        low = segments(np.array([[1.0, 0.0], [0.0, 1.0]]), 0.6, 0, 0)
        assert len(high) == len(low) == 2
        # Through: each line cuts off one of the low corners, north-east (column 1, row 0) or south-west.
        middles = np.sort(high.mean(axis=1)[:, 0])
        assert middles == pytest.approx([0.2, 0.8])
        assert {tuple(np.round(m, 6)) for m in low.mean(axis=1)} == {(0.2, 0.2), (0.8, 0.8)}
        assert {tuple(np.round(m, 6)) for m in high.mean(axis=1)} == {(0.8, 0.2), (0.2, 0.8)}

    def test_no_line_through_a_gap(self):
        heights = np.repeat(np.array([[1.0, 1.0, 0.0, 0.0]]), 6, axis=0)
        heights[3, 1] = np.nan
        lines = joined(segments(heights, 0.5, 0, 0), GRID)
        assert sorted(shapely.length(lines).tolist()) == pytest.approx([1.0, 2.0])

    def test_tiles_join_exactly(self):
        random = np.random.default_rng(3)
        heights = random.standard_normal((9, 9)).cumsum(0).cumsum(1)
        whole = joined(segments(heights, 0.3, 0, 0), GRID)
        parts = [segments(heights[r : r + 5, c : c + 5], 0.3, r, c) for r in (0, 4) for c in (0, 4)]
        tiled = joined(np.concatenate(parts), GRID)
        assert len(tiled) == len(whole)
        assert shapely.equals(shapely.union_all(tiled), shapely.union_all(whole))


class TestPlaneBeach:
    """10 cm more sand a year move the shoreline by 0.1 / 0.05 = 2 m a year."""

    def test_by_hand(self, beach, step):
        told = {"sigma": 0.03, "correlation_range": 0.0, "registration_sigma": 0.02}
        result, lines, positions, rates = step(**beach, **told)
        assert [r["date"] for r in lines] == ["2020-01-01", "2021-01-01", "2022-01-01"]
        assert [r["length"] for r in lines] == pytest.approx([39.0] * 3)
        assert [r["slope"] for r in lines] == pytest.approx([SLOPE] * 3, abs=1e-9)
        assert [p["distance"] for p in positions] == pytest.approx([70, 72, 74] * 2, abs=1e-6)
        sigma = np.hypot(0.03, 0.02) / SLOPE  # the crossings lie on cell centres
        assert [p["sigma"] for p in positions] == pytest.approx([sigma] * 6, rel=1e-6)
        assert positions[2]["change_first"] == pytest.approx(4.0, abs=1e-6)
        assert positions[2]["change_previous"] == pytest.approx(2.0, abs=1e-6)
        assert positions[2]["change_previous_sigma"] == pytest.approx(np.sqrt(2) * sigma, rel=1e-6)
        years = 731 / 365.25
        for row in rates:
            assert row["nsm"] == row["sce"] == pytest.approx(4.0, abs=1e-6)
            assert row["nsm_sigma"] == pytest.approx(np.sqrt(2) * sigma, rel=1e-6)
            assert row["epr"] == pytest.approx(4.0 / years, abs=1e-6)
            assert row["lrr"] == pytest.approx(4.0 / years, rel=1e-3)
            assert row["wlr"] == pytest.approx(4.0 / years, rel=1e-3)
            t = np.array([0, 366, 731]) / 365.25
            assert row["wlr_sigma"] == pytest.approx(sigma / np.sqrt(((t - t.mean()) ** 2).sum()), rel=1e-6)
            assert row["nsm_significant"] == 1
        assert result.mean_nsm == pytest.approx(4.0, abs=1e-6)

    def test_seaward_is_positive_also_where_it_retreats(self, beach, step, make_raster):
        beach["dsms"] = beach["dsms"][0], make_raster("r_20210101", plane(-0.2))
        result, _, _, rates = step(**beach)
        assert result.mean_nsm == pytest.approx(-4.0, abs=1e-6)
        assert rates[0]["nsm_sigma"] is None
        assert rates[0]["wlr"] is None  # three dates are needed

    def test_flat_ground_is_told(self, beach, step, make_raster, listener):
        beach["dsms"] = tuple(make_raster(f"f_202{k}0101", 0.01 * (plane(0.1 * k) - 1.0) + 1.0) for k in range(2))
        _, _, positions, _ = step(**beach, sigma=0.03, correlation_range=0.0, registration_sigma=0.02)
        assert all(p["flat"] == 1 for p in positions)
        assert positions[0]["sigma"] == pytest.approx(np.hypot(0.03, 0.02) / 0.0005, rel=1e-3)
        assert any("their sigmas are large" in text for text in listener.warnings)

    def test_islands_are_removed(self, beach, step, make_raster):
        heights = plane()
        heights[10:13, 100:103] = 3.0
        beach["dsms"] = (make_raster("i_20200101", heights),)
        _, (line,), _, _ = step(**beach)
        assert (line["parts"], line["removed"]) == (1, 1)
        # A ring of ten metres around it counts where it is asked for, and lies more seaward.
        _, (line,), positions, _ = step(**beach, min_length=5.0)
        assert line["parts"] == 2
        assert [p["crossings"] for p in positions] == [3, 1]
        assert positions[0]["distance"] > 85
        _, (line,), positions, _ = step(**beach, min_length=5.0, keep="longest")
        assert line["parts"] == 1
        assert positions[0]["distance"] == pytest.approx(70.0, abs=1e-6)
        _, (line,), _, _ = step(**beach, min_length=5.0, keep="seaward")
        assert line["parts"] == 2

    def test_a_coarser_grid_keeps_a_plane(self, beach, step):
        _, _, positions, _ = step(**beach, resolution=3.0)
        assert [p["distance"] for p in positions] == pytest.approx([70, 72, 74] * 2, abs=1e-6)

    def test_dates_without_a_crossing_are_left_out(self, beach, step, make_raster, listener):
        beach["dsms"] = *beach["dsms"], make_raster("n_20230101", plane(50.0))
        _, lines, positions, rates = step(**beach)
        assert len(lines) == 3
        assert len(positions) == 6
        assert rates[0]["to_date"] == "2022-01-01"
        assert any("2023-01-01 has no shoreline" in text for text in listener.warnings)

    def test_without_transects(self, beach, step, tmp_path, progress):
        del beach["transects"]
        page = tmp_path / "page.html"
        result, lines, _, _ = step(**beach, output_html_file=str(page))
        assert (result.transect_count, result.mean_nsm) == (0, None)
        assert len(lines) == 3
        assert "://" not in page.read_text()
        shape = shapely.from_wkb(pyogrio.raw.read(tmp_path / "output.gpkg")[2])[0]
        assert shapely.get_coordinates(shape)[:, 0] == pytest.approx(np.full(40, WEST + 80.5), abs=1e-6)


def test_refused(beach, step, make_lines, tmp_path):
    for told, kind, options in (
        (r"No DSM passes through DATUM=99 m: their heights range from -0.95 to 5.20 m", NotEnoughData, {"datum": 99.0}),
        ("MIN_LENGTH", NotEnoughData, {"min_length": 1000.0}),
        ("MIN_LENGTH=-1", InputError, {"min_length": -1.0}),
        ("finer than the cells", InputError, {"resolution": 0.1}),
        ("KEEP=seaward needs TRANSECTS", InputError, {"keep": "seaward", "transects": None}),
        ("No line of TRANSECTS", InputError, {"transects": make_lines("far", [shapely.LineString([(900, 0), (950, 0)])])}),
    ):
        with pytest.raises(kind, match=told):
            step(**{**beach, **options})
        assert not (tmp_path / "output.gpkg").exists()


class TestTrend:
    """Rates by hand, and how often their interval holds the truth."""

    T = np.array([0.0, 1.0, 2.0])

    def test_weights(self):
        # Weights 1, 1, 1/4 about 2/3: S = 4/9 + 1/9 + 16/36 = 1; sum w (t - mean) y = 1/3 x 1 + 1/4 x 4/3 x 4 = 5/3.
        trend = fit_trend(self.T, np.array([0.0, 1.0, 4.0]), np.array([1.0, 1.0, 2.0]), 0.95)
        assert trend.rate == pytest.approx(5 / 3)
        assert trend.sigma == pytest.approx(1.0)  # that of the sigmas, larger than that of the scatter
        assert trend.half == pytest.approx(12.7062 * 2 / 3, rel=1e-4)  # chi^2 = 4/9, one degree of freedom

    def test_two_dates_have_no_rate(self):
        trend = fit_trend(self.T, np.array([[0.0, 0.0], [np.nan, 1.0], [4.0, 2.0]]), None, 0.95)
        assert np.isnan(trend.rate[0])
        assert trend.rate[1] == pytest.approx(1.0)
        assert trend.significant.tolist() == [False, True]

    @pytest.mark.parametrize(("scatter", "most"), [(0.0, 0.995), (2.0, 0.985)])
    def test_coverage(self, scatter, most):
        """4,000 lines of 6 dates with known sigmas, without and with a scatter of the coast itself."""
        random = np.random.default_rng(11)
        t = np.array([0.0, 0.3, 1.1, 1.9, 2.4, 4.0])
        sigma = np.array([1.0, 2.0, 1.0, 0.5, 1.0, 1.5])[:, None] * np.ones((6, 4000))
        values = 0.7 * t[:, None] + sigma * random.standard_normal((6, 4000)) + scatter * random.standard_normal((6, 4000))
        trend = fit_trend(t, values, sigma, 0.95)
        inside = float((np.abs(trend.rate - 0.7) <= trend.half).mean())
        assert 0.93 < inside < most  # the wider of two intervals holds the truth a little more often than it says
