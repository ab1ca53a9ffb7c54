"""The height error of one model against the other: by hand, in its limits, and against simulated georeferencings."""

import json

import numpy as np
import pyogrio
import pytest
import shapely
from strandline.core.change.coregistration import Shift, fit_shift, nmad
from strandline.core.change.difference import Stable
from strandline.core.change.dsmdifference import Request, run
from strandline.core.change.georeferencing import Georeferenced, georeferenced
from strandline.core.change.heighterror import HeightError, from_both, from_georeferencing, from_stable
from strandline.core.change.terms import Moments
from strandline.core.change.uncertainty import Fitted
from strandline.core.change.variogram import correlation
from strandline.core.change.zones import Zone
from strandline.core.frames import LocalFrame
from strandline.core.progress import SILENT, Progress

WEST, NORTH = 300_000.0, 5_774_000.0
UTM = "EPSG:32755"
STEPS = (1.0, 1.0)
FRAME = LocalFrame.at(UTM, WEST + 50, NORTH - 40, 0.0)
CENTRE = tuple(FRAME.to_crs(np.array([[0.0, 0.0, 5.0]]))[0].tolist())


def covariance(level, tilt, scale=0.0):
    """Independent shift up, rotations about east and north, and scale."""
    return np.diag([0.0, 0.0, level**2, tilt**2, tilt**2, 0.0, scale**2])


def tags(matrix):
    frame = {"crs": FRAME.crs, "longitude": FRAME.longitude, "latitude": FRAME.latitude, "height": FRAME.height}
    return {
        "STRANDLINE_GEOREFERENCING": json.dumps({"frame": frame, "pivot": [0.0, 0.0, 5.0], "covariance": matrix.ravel().tolist()})
    }


def prior(level, tilt, scale=0.0):
    block = georeferenced("BEFORE", tags(covariance(level, tilt, scale)))
    return Georeferenced(block, block, UTM)


def strip(change, west=80.0, south=-70.0, width=15, height=60, lift=0.0):
    """Stable ground of 1 m cells, 15 m wide; ``change`` of x, y (m from the corner of the scene)."""
    column, row = (v.ravel() for v in np.meshgrid(np.arange(width), np.arange(height)))
    order = np.random.default_rng(0).permutation(column.size)
    column, row = column[order], row[order]
    x, y = west + column + 0.5, south + height - row - 0.5
    values = change(x, y) + np.random.default_rng(1).normal(0, 0.01, x.size)
    return Stable(row, column, WEST + x, NORTH + y, 5 + lift * column, values, None, x.size)


def level_of(ground):
    return fit_shift("vertical", ground.x, ground.y, ground.change)


ZONES = [Zone("far", shapely.box(WEST, NORTH - 70, WEST + 20, NORTH - 10))]


class TestByHand:
    def test_prior(self):
        """2 cm up, 1 mrad and a scale of 1e-4 in each of two models: twice the variances; 50 m off the centre 5 cm more."""
        error = from_georeferencing(prior(0.02, 1e-3, 1e-4), CENTRE)
        # The grid is turned against the frame by the meridian's convergence, which equal tilts do not feel.
        expected = 2 * np.diag([0.02**2, 1e-6, 1e-6, 1e-8, 0.0, 0.0, 0.0])
        np.testing.assert_allclose(error.covariance, expected, rtol=2e-3, atol=1e-9)
        sigma = Fitted(error.covariance, error.shift.centre).sigma(Moments((CENTRE[0] + 50, CENTRE[1], CENTRE[2] + 100)))
        assert sigma == pytest.approx(np.sqrt(2 * (0.02**2 + 0.05**2 + 0.01**2)), rel=2e-3)

    def test_what_is_left_counts(self):
        known = HeightError(Shift("plane", (0.1, 0.002, 0.0), (100.0, 200.0)), np.diag([0.01**2, 0.0, 0.0]))
        left = known.left_by(Shift("vertical", (0.08,)))
        assert left == pytest.approx((0.02, 0.002, 0.0))
        # 30 m east of the centre: 0.02 + 0.06 m are left, 0.01 m is not known, 0.03 m stands beside.
        sigma = Fitted(known.covariance, known.shift.centre, left, 0.03).sigma(Moments((130.0, 200.0, 0.0)))
        assert sigma == pytest.approx(np.sqrt(0.08**2 + 0.01**2 + 0.03**2))
        assert known.left_by(known.shift) == ()
        assert known.left_by(Shift("plane", (0.1 + 0.02, 0.002, 0.0), (110.0, 200.0))) == pytest.approx((0, 0, 0), abs=1e-12)

    def test_shift_with_height(self):
        shift = Shift("combined", (1.0, 0.1, 0.2, 0.01, 0.5, 0.25, -0.125), (10.0, 20.0, 5.0))
        assert shift.at(np.array([11.0]), np.array([22.0]), np.array([105.0])).tolist() == pytest.approx([2.5 + 0.5 + 0.5 - 0.5])
        assert "per metre of height" in shift.describe()
        with pytest.raises(ValueError, match="needs it"):
            shift.at(np.array([11.0]), np.array([22.0]))


class TestLimits:
    """A strip of stable ground with 1 cm of noise, tilted by 1 mm/m across and 0.5 mm/m along."""

    @staticmethod
    def tilted(x, y):
        return 0.05 + 1e-3 * (x - 87.5) + 5e-4 * (y + 40)

    def test_sure_tilts_make_it_vertical(self):
        ground = strip(lambda x, y: 0.05 + 0 * x)
        error = from_both(ground, prior(1.0, 1e-9), STEPS, SILENT)
        assert error.shift.coefficients[0] == pytest.approx(level_of(ground).coefficients[0], abs=1e-3)
        assert error.shift.coefficients[1:] == pytest.approx((0.0,) * 6, abs=1e-9)
        assert np.sqrt(error.covariance[0, 0]) == pytest.approx(0.01 / 30, rel=0.3)  # 900 cells

    def test_unsure_tilts_make_it_a_plane(self):
        ground = strip(self.tilted)
        error = from_both(ground, prior(1.0, 1.0), STEPS, SILENT)
        plane = fit_shift("plane", ground.x, ground.y, ground.change)
        assert error.shift.coefficients[:3] == pytest.approx(plane.coefficients, abs=1e-7)
        assert error.covariance[:3, :3] == pytest.approx(error.stable[1], rel=1e-3, abs=1e-12)

    def test_one_line_leaves_the_tilt_across_to_the_prior(self):
        # On the pivot's meridian, where its level does not speak of that tilt.
        ground = strip(self.tilted, west=49.5, width=1, height=200, south=-210.0)
        error = from_both(ground, prior(0.02, 1e-3), STEPS, SILENT)
        along, across = error.covariance[2, 2], error.covariance[1, 1]
        assert error.shift.coefficients[2] == pytest.approx(5e-4, abs=1e-4)
        assert np.sqrt(across) == pytest.approx(1e-3 * np.sqrt(2), rel=0.01)
        assert np.sqrt(along) < 1e-4
        assert error.shift.coefficients[1] == pytest.approx(0.0, abs=1e-6)

    def test_few_cells_tell_the_level_only(self):
        ground = strip(lambda x, y: 0.05 + 0 * x, west=48.0, south=-42.0, width=4, height=4)
        error = from_both(ground, prior(0.05, 1e-3), STEPS, SILENT)
        assert error.shift.coefficients[0] == pytest.approx(0.05, abs=0.01)
        # As one observation, not sixteen.
        assert np.sqrt(error.covariance[0, 0]) == pytest.approx(nmad(ground.change), rel=0.03)
        assert np.sqrt(error.covariance[1, 1]) == pytest.approx(1e-3 * np.sqrt(2), rel=0.01)

    def test_contradiction_is_told_and_widens(self, progress, listener):
        ground = strip(lambda x, y: 0.05 + 0.01 * (x - 87.5))
        error = from_both(ground, prior(0.02, 1e-4), STEPS, progress)
        assert any("STABLE contradicts" in w for w in listener.warnings)
        # A tilt of 10 mm/m, 70 times what is allowed: stable ground leads.
        assert error.shift.coefficients[1] == pytest.approx(0.01, rel=0.05)
        listener.warnings.clear()
        from_both(strip(lambda x, y: 0.02 + 0 * x), prior(0.02, 1e-3), STEPS, progress)
        assert not listener.warnings


class TestWithoutGeoreferencing:
    def test_a_tilt_that_shows_is_taken_off(self, progress):
        ground = strip(TestLimits.tilted)
        error = from_stable(ground, level_of(ground), ZONES, STEPS, progress)
        assert error.shift.method == "plane"
        sigma = Fitted(error.covariance, error.shift.centre).sigma(Moments((WEST + 10, NORTH - 40, 0.0)))
        truth = TestLimits.tilted(10.0, -40.0)
        found = float(error.shift.at(np.array(WEST + 10), np.array(NORTH - 40)))
        assert found == pytest.approx(truth, abs=3 * sigma)
        assert sigma < 0.03  # 1 cm / 30 / 4.3 m, 77 m away: 6 mm and what correlation adds

    def test_a_tilt_that_cannot_be_told_is_said(self, progress, listener):
        ground = strip(lambda x, y: 0.05 + 0 * x)
        error = from_stable(ground, level_of(ground), ZONES, STEPS, progress)
        assert (error.shift.method, error.free) == ("plane", False)
        (warning,) = listener.warnings
        assert "from west to east" in warning
        assert "makes NET_SIGMA large" in warning
        # 77 m off the middle of a strip that is 4.3 m wide (one sigma), the tilt is the error, and it counts.
        near, far = (
            Fitted(error.covariance, error.shift.centre).sigma(Moments((WEST + e, NORTH - 40, 0.0))) for e in (87.5, 10.0)
        )
        assert far > 10 * near

    def test_ground_all_around_tells_it(self, progress, listener):
        ground = strip(lambda x, y: 0.05 + 0 * x, west=0.0, south=-80.0, width=100, height=80)
        error = from_stable(ground, level_of(ground), ZONES, STEPS, progress)
        assert (error.shift.method, error.free, listener.warnings) == ("plane", False, [])

    def test_one_line(self, progress, listener):
        ground = strip(lambda x, y: 2e-3 * y, width=1, height=200, south=-210.0)
        error = from_stable(ground, level_of(ground), ZONES, STEPS, progress)
        assert error.shift.coefficients[1:] == pytest.approx((0.0, 2e-3), abs=1e-4)
        assert error.free
        assert "NET_SIGMA leaves it out" in listener.warnings[0]


class Scene:
    """A beach of 80 x 100 m, a strip of stable ground in its east, three zones further and further west, correlated noise."""

    HEIGHT, WIDTH, SIDE, RANGE, RISE = 80, 100, 256, 8.0, 0.3
    ZONES = (shapely.box(60, -70, 80, -10), shapely.box(30, -70, 50, -10), shapely.box(5, -70, 25, -10))

    def __init__(self, make_raster, make_polygons, tmp_path):
        self.make_raster, self.volumes, self.output = make_raster, str(tmp_path / "v.gpkg"), str(tmp_path / "change.tif")
        self.layers = {
            "stable": make_polygons("stable", [shapely.box(85, -75, 100, -5)]),
            "zones": make_polygons("zones", list(self.ZONES)),
        }
        i = np.minimum(np.arange(self.SIDE), self.SIDE - np.arange(self.SIDE))
        self.spectrum = np.sqrt(np.maximum(np.fft.fft2(correlation(np.hypot(i[:, None], i[None]), self.RANGE)).real, 0))
        rows, columns = np.mgrid[0 : self.HEIGHT, 0 : self.WIDTH]
        self.x, self.y = columns + 0.5 - 50, 40 - rows - 0.5
        self.rise = self.RISE * (columns < 82)
        self.truth = np.array([z.area * self.RISE for z in self.ZONES])

    def pair(self, random, tilt, tagged=True):
        """Two models with shift, tilts and scale drawn from the covariances in their tags."""
        ground = 8 + 0.05 * (self.x - 50) + np.where(self.x > 20, np.sin(self.y / 9), 0)
        sources = []
        for name, rise in (("b", 0.0), ("a", self.rise)):
            matrix = covariance(0.015, tilt, 2e-4)
            t = random.multivariate_normal(np.zeros(7), matrix)
            error = t[2] + t[3] * self.y - t[4] * self.x + t[6] * (ground - 5)
            field = np.fft.ifft2(np.fft.fft2(random.standard_normal((self.SIDE, self.SIDE))) * self.spectrum).real
            noise = 0.014 * field[: self.HEIGHT, : self.WIDTH] + 0.01 * random.standard_normal(ground.shape)
            sources.append(self.make_raster(name, ground + rise + error + noise, tags=tags(matrix) if tagged else None))
        return sources

    def scores(self, pair, listener=None, **options):
        """Error over sigma of the zones' nets."""
        sigma = {"before_sigma": 0.02, "after_sigma": 0.02}
        request = Request(*pair, self.output, volumes=self.volumes, **self.layers, **sigma, **options)
        run(request, Progress(listener) if listener else SILENT)
        meta, _, _, columns = pyogrio.raw.read(self.volumes)
        table = dict(zip(meta["fields"], columns, strict=True))
        return (table["net"] - self.truth) / table["sigma"]


@pytest.fixture
def scene(make_raster, make_polygons, tmp_path):
    return Scene(make_raster, make_polygons, tmp_path)


def test_intervals_hold_the_truth(scene):
    """Tilts of 1.4 mrad between the models, zones up to 77 m off the strip: the 95 % intervals hold the truth.

    (In 260 draws 94.9 % do, and the errors over their sigmas scatter by 1.02.)
    """
    random = np.random.default_rng(12)
    auto, vertical = [], []
    for k in range(60):
        pair = scene.pair(random, 1e-3)
        auto.append(scene.scores(pair))
        if k % 3 == 0:
            vertical.append(scene.scores(pair, coregister="vertical"))
    # 60 draws: a share of 95 % is met to 2.8 % (1 sigma), a standard deviation of one to 9 %.
    assert np.mean(np.abs(auto) < 1.96) == pytest.approx(0.95, abs=0.056)
    assert np.std(auto, axis=0) == pytest.approx(np.ones(3), abs=0.25)
    assert np.abs(np.mean(auto, axis=0)).max() < 0.4
    assert np.mean(np.abs(vertical) < 1.96) >= 0.90


def test_what_a_method_leaves_in_is_told_and_counted(scene, listener):
    pair = scene.pair(np.random.default_rng(5), 3e-3)
    sure = scene.scores(pair, listener)
    assert not [w for w in listener.warnings if "leaves an error" in w]
    for method in ("vertical", "none"):
        listener.warnings.clear()
        left = scene.scores(pair, listener, coregister=method)
        assert any(f"COREGISTER={method} leaves an error" in w for w in listener.warnings)
        assert np.abs(left).max() < 2.0
    assert np.abs(sure).max() < 3.0


def test_models_without_noise(make_raster, make_polygons, tmp_path):
    """A tilt without any noise is taken off to rounding; no change at all stays none."""
    rows, columns = np.mgrid[0:60, 0:60]
    values = 5 + 0.01 * rows
    stable = make_polygons("stable", [shapely.box(0, -60, 20, 0)])
    before = make_raster("b", values)
    for matrix in (None, covariance(0.02, 1e-3)):
        before = make_raster("b", values, tags=matrix is not None and tags(matrix))
        after = make_raster("a", values + 1e-3 * columns, tags=matrix is not None and tags(matrix))
        result = run(Request(before, after, str(tmp_path / "o.tif"), stable=stable))
        assert result.net == pytest.approx(0.0, abs=0.01)
        assert run(Request(before, before, str(tmp_path / "o.tif"), stable=stable)).net == pytest.approx(0.0, abs=1e-6)


def test_registration_sigma_stands_for_a_tilt_that_is_not_known(scene, make_raster, make_polygons, listener):
    pair = scene.pair(np.random.default_rng(7), 0.0, tagged=False)
    # Two columns of cells from south to north.
    scene.layers["stable"] = make_polygons("line", [shapely.box(90, -79, 92, -1)])
    sigma = {"before_sigma": 0.02, "after_sigma": 0.02}
    request = Request(*pair, scene.output, **scene.layers, **sigma)
    alone = run(request, Progress(listener))
    assert any("from west to east" in w for w in listener.warnings)
    given = run(Request(*pair, scene.output, registration_sigma=0.05, **scene.layers, **sigma))
    assert given.net_systematic == pytest.approx(np.hypot(alone.net_systematic, 0.05 * given.area))
