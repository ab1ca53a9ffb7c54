"""Bent blocks in the height error of a difference: by hand, summed over cells, and against simulated georeferencings."""

import json

import numpy as np
import pytest
import shapely
from strandline.core.change import heighterror, variogram
from strandline.core.change.coregistration import Shift
from strandline.core.change.difference import Stable
from strandline.core.change.dsmdifference import Request, run
from strandline.core.change.georeferencing import Georeferenced, georeferenced
from strandline.core.change.heighterror import HeightError, from_both
from strandline.core.change.terms import Moments, height_terms
from strandline.core.change.uncertainty import Fitted
from strandline.core.change.variogram import correlation
from strandline.core.frames import LocalFrame
from strandline.core.progress import SILENT

WEST, NORTH = 300_000.0, 5_774_000.0
UTM = "EPSG:32755"
FRAME = LocalFrame.at(UTM, WEST + 50, NORTH - 40, 0.0)
PIVOT = (0.0, 0.0, 5.0)
TURN = np.radians(1.4)  # of the grid's north against the frame's


def rigid(level, tilt, scale):
    """Independent shift up, rotations about east and north, and scale (7, 7)."""
    return np.diag([0.0, 0.0, level**2, tilt**2, tilt**2, 0.0, scale**2])


def bent(level, tilt, scale, dome):
    """The same with bending of ``dome`` (1/m) along both axes, mostly alike, and less of a twist (10, 10)."""
    matrix = np.zeros((10, 10))
    matrix[:7, :7] = rigid(level, tilt, scale)
    matrix[7:, 7:] = dome**2 * np.array([[1.0, 0.0, 0.8], [0.0, 0.1, 0.0], [0.8, 0.0, 1.0]])
    return matrix


def tags(matrix, pivot=PIVOT, frame=FRAME):
    frame = {"crs": frame.crs, "longitude": frame.longitude, "latitude": frame.latitude, "height": frame.height}
    return {"STRANDLINE_GEOREFERENCING": json.dumps({"frame": frame, "pivot": pivot, "covariance": matrix.ravel().tolist()})}


def block(matrix, **options):
    return georeferenced("BEFORE", tags(matrix, **options))


def ten(local, pivot):
    """Return what the ten numbers do to the height of local points (n, 10), written out."""
    e, n, u = (local - pivot).T
    zero = np.zeros(len(e))
    return np.column_stack([zero, zero, zero + 1, n, -e, zero, u, e * e, e * n, n * n])


def strip(change, west, width, height, south, noise):
    """Stable ground of 1 m cells; ``change`` of x, y (m from the corner of the scene)."""
    column, row = (v.ravel() for v in np.meshgrid(np.arange(width), np.arange(height)))
    order = np.random.default_rng(0).permutation(column.size)
    column, row = column[order], row[order]
    x, y = west + column + 0.5, south + height - row - 0.5
    values = change(x, y) + np.random.default_rng(1).normal(0, noise, x.size)
    return Stable(row, column, WEST + x, NORTH + y, np.full(x.size, 5.0), values, None, x.size)


class TestGeoreferencing:
    def test_transport_is_exact(self):
        """Between any places the terms' covariance says what the ten numbers' says, a kilometre off and turned by 1.8 degrees."""
        frame = LocalFrame.at(UTM, 765_000.0, 5_774_000.0, 20.0)
        random = np.random.default_rng(3)
        sizes = np.array([0.01, 0.01, 0.01, 1e-4, 1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6])
        root = sizes[:, None] * random.standard_normal((10, 10))
        matrix, pivot = root @ root.T, (30.0, -20.0, 4.0)
        places = np.array([765_900.0, 5_774_300.0, 12.0]) + random.uniform(-100, 100, (40, 3)) * (1, 1, 0.1)
        design = ten(frame.from_crs(places), pivot)
        expected = design @ matrix @ design.T
        centre = (765_850.0, 5_774_350.0, 3.0)
        both = Georeferenced(block(matrix, pivot=pivot, frame=frame), block(0 * matrix), UTM)
        terms = height_terms(*places.T, centre)
        # The CRS is bent against the frame: scale by the height, which a quadratic term in the plane does not hold, by some 1e-6.
        np.testing.assert_allclose(terms @ both.covariance(centre) @ terms.T, expected, atol=1e-5 * expected.max())

    def test_a_dome_about_another_centre_by_hand(self):
        """1e-5 / m about the pivot, all else sure: 30 m to the east it lifts by 9 mm and tilts by 0.6 mm/m, the same way."""
        matrix = np.zeros((10, 10))
        matrix[np.ix_([7, 9], [7, 9])] = 1e-10
        centre = tuple(FRAME.to_crs(np.array([[30.0, 0.0, 5.0]]))[0].tolist())
        found = Georeferenced(block(matrix), block(0 * matrix), UTM).covariance(centre)
        # The grid's north is turned against the frame's, and so is the tilt; a dome does not feel it.
        sizes = np.array([9e-3, 6e-4 * np.cos(TURN), 6e-4 * np.sin(TURN), 0.0, 1e-5, 0.0, 1e-5])
        np.testing.assert_allclose(np.sqrt(np.diag(found)), sizes, rtol=0.02, atol=1e-8)
        assert found[0, 4] == pytest.approx(9e-8, rel=2e-3)
        assert found[0, 1] == pytest.approx(5.4e-6, rel=2e-3)

    def test_a_similarity_does_not_bend(self):
        seven, wide = rigid(0.02, 1e-3, 1e-4), bent(0.02, 1e-3, 1e-4, 0.0)
        centre = tuple(FRAME.to_crs(np.array([[30.0, 0.0, 5.0]]))[0].tolist())
        old, new = (Georeferenced(block(m), block(m), UTM) for m in (seven, wide))
        np.testing.assert_array_equal(old.covariance(centre), new.covariance(centre))
        assert (old.bends, new.bends) == (False, False)
        dome = block(bent(0.02, 1e-3, 1e-4, 1e-6))
        assert not Georeferenced(dome, block(seven), UTM).bends
        assert Georeferenced(dome, dome, UTM).bends
        assert block(np.zeros((8, 8))) is None


class TestByHand:
    def test_shift_about_another_centre(self):
        shift = Shift("combined", (1.0, 0.1, 0.2, 0.01, 5e-3, -2e-3, 1e-3), (10.0, 20.0, 5.0))
        moved = Shift("combined", tuple(shift.about((300.0, -50.0, 1.0)).tolist()), (300.0, -50.0, 1.0))
        x, y, z = np.random.default_rng(0).uniform(-100, 100, (3, 20))
        np.testing.assert_allclose(moved.at(x, y, z), shift.at(x, y, z), rtol=1e-10)
        plane = Shift("plane", (1.0, 0.1, 0.2), (10.0, 20.0))
        assert plane.about((12.0, 21.0, 5.0)).tolist() == pytest.approx([1.4, 0.1, 0.2, 0, 0, 0, 0])

    def test_words(self):
        # 50 m off: 2500 m2 times the terms; to the north-east half of each of the three.
        words = Shift("combined", (0.0, 0.0, 0.0, 0.0, 4e-6, 2e-6, -2e-6), (0.0, 0.0, 0.0)).describe()
        assert words.endswith("bending at 50 m +10.00 mm to the east, -5.00 mm to the north, +5.00 mm to the north-east")

    def test_what_a_plane_leaves_of_it(self):
        """A dome of 1e-5 / m is expected, and a plane through another place is taken off; 1e-6 / m is not known."""
        about = (100.0, 200.0, 5.0)
        sure = np.diag([1e-3, 1e-5, 1e-5, 0.0, 1e-6, 1e-6, 1e-6]) ** 2
        known = HeightError(Shift("combined", (0.1, 0.001, 0.0, 0.0, 1e-5, 0.0, 1e-5), about), sure)
        plane = Shift("plane", (0.11, 0.001, 0.0), (110.0, 200.0))
        left = known.left_by(plane)
        assert left == pytest.approx((0.0, 0.0, 0.0, 0.0, 1e-5, 0.0, 1e-5), abs=1e-12)
        assert known.exceeded_by(plane)
        assert not known.exceeded_by(known.shift)
        unsure = HeightError(known.shift, sure + np.diag([0.0] * 4 + [1e-10] * 3))
        assert not unsure.exceeded_by(plane)
        # 30 m east and 40 m north: 25 mm are left.
        sigma = Fitted(0 * sure, about, left).sigma(Moments((130.0, 240.0, 5.0)))
        assert sigma == pytest.approx(0.025)

    def test_the_square_of_the_mean_place_is_not_enough(self):
        """Two cells at -10 and 10 m: on average they stand in the middle, but a bow of 1e-4 / m lifts both by 1 cm."""
        fitted = Fitted(np.diag([0.0, 0.0, 0.0, 0.0, 1e-8, 0.0, 0.0]), (0.0, 0.0, 0.0))
        assert fitted.sigma(Moments((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0, 100.0, 0.0, 0.0))) == pytest.approx(0.01)
        # The same told about a place 10 m to the west: 0 and 20 m.
        assert fitted.sigma(Moments((-10.0, 0.0, 0.0), (1.0, 10.0, 0.0, 0.0, 200.0, 0.0, 0.0))) == pytest.approx(0.01)


class TestStableGround:
    def test_what_it_does_not_fit_shows_as_level(self):
        """Along a line to the north y^2 lifts by its mean, which is the line's variance: (200^2 - 1) / 12."""
        ground = strip(lambda x, y: 0.05 + 0 * x, 49.5, 1, 200, -210.0, 0.01)
        seen = heighterror._observe(ground, heighterror._centre(ground), None, (1.0, 1.0))
        np.testing.assert_allclose(seen.design[0], [1, 0, 0, 0, 0, 0, (200**2 - 1) / 12], atol=1e-6)

    def test_a_strip_tells_a_dome(self):
        """A strip 30 m off shows a dome as level, tilt and curvature: where all else is sure it is known on the other side."""
        truth, matrix = 2e-5, bent(1e-6, 1e-8, 0.0, 1e-5)
        ground = strip(lambda x, y: truth * ((x - 50) ** 2 + (y + 40) ** 2), 80.0, 15, 60, -70.0, 0.01)
        error = from_both(ground, Georeferenced(block(matrix), block(matrix), UTM), (1.0, 1.0), SILENT)
        x, y, z = np.array([WEST + 10.0]), np.array([NORTH - 40.0]), np.array([5.0])
        sigma = Fitted(error.covariance, error.shift.centre).sigma(Moments((x[0], y[0], z[0])))
        # Along one axis only it bends as it pleases: 0.6 of 1.4e-5 / m at 1600 m2.
        assert error.shift.at(x, y, z)[0] == pytest.approx(truth * 1600, abs=3 * sigma)
        assert sigma < 0.5 * np.sqrt(2) * 1e-5 * 1600


def test_a_zone_sums_its_cells_errors(make_raster, make_polygons, tmp_path):
    """The systematic sigma of an L-shaped zone with a hole in the data is that of the sum over its cells, bending and all."""
    rows, columns = np.mgrid[0:80, 0:100]
    values = 5 + 0.05 * columns + np.sin(rows / 9)
    values[30:45, 20:40] = np.nan
    zones = make_polygons("zones", [shapely.union(shapely.box(5, -75, 30, -5), shapely.box(5, -25.5, 90.25, -5))])
    matrix, pivots = bent(0.015, 5e-4, 2e-4, 1e-5), (PIVOT, (25.0, -10.0, 7.0))
    pair = [make_raster(name, values, tags=tags(matrix, pivot)) for name, pivot in zip("ba", pivots, strict=True)]
    page = tmp_path / "report.html"
    result = run(Request(*pair, str(tmp_path / "o.tif"), zones=zones, output_html_file=str(page)))
    share = np.zeros((80, 100))
    share[5:75, 5:30] = share[5:25, 5:90] = 1.0
    share[25, 30:90], share[5:25, 90], share[25, 90] = 0.5, 0.25, 0.125
    share[np.isnan(values)] = 0.0
    inside = share > 0
    local = FRAME.from_crs(np.column_stack([WEST + columns[inside] + 0.5, NORTH - rows[inside] - 0.5, values[inside]]))
    sums = [share[inside] @ ten(local, pivot) for pivot in pivots]
    # The CRS's scale changes over 100 m by 5e-7, which is a cubic term.
    assert result.net_systematic == pytest.approx(np.sqrt(sum(s @ matrix @ s for s in sums)), rel=1e-5)
    text = page.read_text(encoding="utf-8")
    assert "bending at 50 m to the north-east" in text
    assert "knows of no dome" not in text
    pair = [make_raster(name, values, tags=tags(rigid(0.015, 5e-4, 2e-4))) for name in "ba"]
    run(Request(*pair, str(tmp_path / "o.tif"), zones=zones, output_html_file=str(page)))
    assert "knows of no dome" in page.read_text(encoding="utf-8")


def test_a_dome_without_noise_is_taken_off(make_raster, make_polygons, tmp_path):
    """A strip that shows a dome as it is tells it everywhere: 1 cm at 40 m leaves less than a tenth of a millimetre."""
    rows, columns = np.mgrid[0:80, 0:100]
    values = 5 + 0.01 * rows
    dome = 6.25e-6 * ((columns - 50.0) ** 2 + (rows - 40.0) ** 2)
    told = tags(bent(0.02, 1e-3, 1e-4, 1e-5))
    stable = make_polygons("stable", [shapely.box(80, -75, 100, -5)])
    pair = make_raster("b", values, tags=told), make_raster("a", values + dome, tags=told)
    result = run(Request(*pair, str(tmp_path / "o.tif"), stable=stable))
    assert abs(result.net) / result.area < 1e-4
    left = run(Request(*pair, str(tmp_path / "o.tif"), stable=stable, coregister="plane"))
    # What the plane leaves is known, and counts.
    assert left.net / left.area > 0.01
    assert left.net_systematic == pytest.approx(left.net, rel=0.02)


class TestCoverage:
    """Two blocks whose true errors are drawn from their ten numbers' covariances: a dome of 1.6 cm at 40 m is one sigma.

    Cells of 2 m; a strip of stable ground in the east with white and correlated noise; zones from beside it to 77 m off.
    """

    STEP, SIDE, RANGE, WHITE, ALIKE = 2.0, 64, 8.0, 0.014, 0.02
    ZONES = (np.s_[5:35, 30:40], np.s_[5:35, 15:25], np.s_[5:35, 2:12])
    PIVOTS = (PIVOT, (20.0, -10.0, 6.0))
    MATRIX = bent(0.015, 2e-4, 2e-4, 1e-5)

    def draws(self, count, seed):
        """Yield stable ground, and the change of all cells with their places."""
        random = np.random.default_rng(seed)
        rows, columns = np.mgrid[0:40, 0:50]
        x, y = WEST + self.STEP * (columns + 0.5), NORTH - self.STEP * (rows + 0.5)
        z = 8 + 0.1 * (columns - 25) + np.sin(rows / 5)
        i = np.minimum(np.arange(self.SIDE), self.SIDE - np.arange(self.SIDE)) * self.STEP
        spectrum = np.sqrt(np.maximum(np.fft.fft2(correlation(np.hypot(i[:, None], i[None]), self.RANGE)).real, 0))
        local = FRAME.from_crs(np.column_stack([x.ravel(), y.ravel(), z.ravel()]))
        designs = [ten(local, pivot) for pivot in self.PIVOTS]
        stable = np.zeros(z.shape, bool)
        stable[2:38, 43:] = True
        order = random.permutation(stable.sum())
        ground = [v[stable][order] for v in (rows, columns, x, y, z)]
        for _ in range(count):
            before, after = (d @ random.multivariate_normal(np.zeros(10), self.MATRIX) for d in designs)
            field = np.fft.ifft2(np.fft.fft2(random.standard_normal(spectrum.shape)) * spectrum).real[:40, :50]
            change = (after - before).reshape(z.shape) + self.ALIKE * field + self.WHITE * random.standard_normal(z.shape)
            yield Stable(*ground, change[stable][order], None, len(order)), change, (x, y, z)

    def noise(self):
        """Return the sigma of a zone's mean by white and correlated noise."""
        x, y = (self.STEP * v.ravel() for v in np.mgrid[0:30, 0:10])
        alike = correlation(np.hypot(x[:, None] - x, y[:, None] - y), self.RANGE).mean()
        return np.hypot(self.ALIKE * np.sqrt(alike), self.WHITE / np.sqrt(len(x)))

    def scores(self, matrix, count, seed):
        """Return the errors of the zones' mean changes over their sigmas (count, 3) when the tags say ``matrix``."""
        prior = Georeferenced(*(block(matrix, pivot=pivot) for pivot in self.PIVOTS), UTM)
        origin, noise, found = (WEST, NORTH, 0.0), self.noise(), []
        for ground, change, places in self.draws(count, seed):
            error = from_both(ground, prior, (self.STEP, self.STEP), SILENT)
            fitted = Fitted(error.covariance, error.shift.centre)
            rest = change - error.shift.at(*places)
            for zone in self.ZONES:
                terms = height_terms(*(v[zone].ravel() for v in places), origin).mean(axis=0)
                found.append(rest[zone].mean() / np.hypot(fitted.sigma(Moments(origin, tuple(terms))), noise))
        return np.reshape(found, (count, 3))

    def test_intervals_hold_the_truth(self, monkeypatch):
        # Fewer pairs and ranges of the variogram: there are 252 cells only, and more than a hundred draws.
        monkeypatch.setattr(variogram, "_PAIRS", 2000)
        monkeypatch.setattr(variogram, "_FAR_PAIRS", 20_000)
        monkeypatch.setattr(variogram, "_RANGES", 12)
        scores = self.scores(self.MATRIX, 120, 5)
        # 120 draws of three zones that err much alike: 95 % is met to 1.5 % (1 sigma), a standard deviation of one to 6 %.
        assert 0.91 < np.mean(np.abs(scores) < 1.96) < 0.98
        assert np.std(scores, axis=0) == pytest.approx(np.ones(3), abs=0.18)
        assert np.abs(np.mean(scores, axis=0)).max() < 0.25
        unbent = self.scores(self.MATRIX[:7, :7], 60, 5)
        assert np.mean(np.abs(unbent) < 1.96) < 0.85
