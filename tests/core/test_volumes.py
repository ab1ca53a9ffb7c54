"""Zones by shares, volumes by hand, error models by simulation."""

import numpy as np
import pytest
import shapely
from strandline.core.change.coregistration import Shift, fit_shift, nmad, statistics
from strandline.core.change.sampling import Sample
from strandline.core.change.significance import beyond_detection, coherent, coverage_factor
from strandline.core.change.terms import Moments
from strandline.core.change.uncertainty import ErrorModel, Fitted, correlated_variance, fit_covariance, total
from strandline.core.change.variogram import correlation, fit_variogram
from strandline.core.change.volumes import Cells, Tally
from strandline.core.change.zones import cell_shares, touched
from strandline.core.errors import NotEnoughData
from strandline.core.raster import Grid

GRID = Grid(1000.0, 2000.0, 2.0, 6, 5, "", 1.0)


def correlated_field(random, side, reach):
    """A field of unit variance with spherical correlation (circulant embedding; Dietrich & Newsam 1997)."""
    i = np.minimum(np.arange(2 * side), 2 * side - np.arange(2 * side))
    spectrum = np.fft.fft2(correlation(np.hypot(i[:, None], i[None]), reach)).real
    noise = random.standard_normal((2 * side, 2 * side))
    return np.fft.ifft2(np.fft.fft2(noise) * np.sqrt(np.maximum(spectrum, 0))).real[:side, :side]


class TestShares:
    def test_box_cuts_cells(self):
        row, column, shares = cell_shares(shapely.box(1001.0, 1997.5, 1004.5, 1999.75), GRID)
        assert (row, column) == (0, 0)
        np.testing.assert_allclose(shares, np.outer([0.75, 1.0, 0.5], [0.5, 1.0, 0.25]), atol=1e-9)

    def test_whole_window_and_nothing(self):
        row, column, shares = cell_shares(shapely.box(0, 0, 9999, 9999), GRID)
        assert (row, column, shares.shape, shares.min()) == (0, 0, (5, 6), 1.0)
        assert cell_shares(shapely.box(0, 0, 10, 10), GRID) is None
        assert cell_shares(shapely.box(1012.0, 1990, 1020, 2001), GRID) is None  # touches the edge only

    def test_areas_add_up(self):
        random = np.random.default_rng(0)
        for _ in range(50):
            shape = shapely.convex_hull(shapely.multipoints(random.uniform((1000, 1995), (1012, 2000), (6, 2))))
            _, _, shares = cell_shares(shape, GRID)
            assert shares.sum() * GRID.cell_area == pytest.approx(shapely.area(shape), rel=1e-6)

    def test_touched(self):
        mask = touched([shapely.box(1002.0, 1998.0, 1004.0, 1999.0), shapely.box(1011.9, 1995, 1012, 1995.1)], GRID)
        assert np.argwhere(mask).tolist() == [[1, 1], [4, 5]]
        assert touched([shapely.box(1000, 1998.6, 1002, 2000)], GRID, 0.5)[:, 0].tolist() == [True, False, False, False, False]


class TestSignificance:
    def test_two_sided(self):
        assert coverage_factor(0.95) == pytest.approx(1.959964, abs=1e-6)
        assert coverage_factor(0.8) == pytest.approx(1.281552, abs=1e-6)
        change = np.array([[0.19, 0.20, -0.20, np.nan]])
        assert beyond_detection(change, 0.1, 0.95).tolist() == [[False, True, True, False]]

    def test_coherence_by_hand(self):
        """25 rises of one sigma: p_E = 0.683, p_A = 1, kept; alone: p_A = 0, not kept however large."""
        change = np.full((7, 7), 0.1)
        assert coherent(change, 0.1, 0.95).all()
        change = np.full((7, 7), -1e-6)
        change[3, 3] = 5.0
        assert not coherent(change, 0.1, 0.95)[3, 3]

    def test_posterior_at_eighty_per_cent_like(self):
        """20 of 25 alike: p_A = 0.5 leaves the posterior at p_E, so 1.96 sigma decides again."""
        change = np.full((5, 5), 0.1959)
        change[0] = -0.1
        assert not coherent(change, 0.1, 0.95)[2, 2]
        change[change > 0] = 0.1961
        assert coherent(change, 0.1, 0.95)[2, 2]

    def test_no_change_and_no_value(self):
        change = np.full((7, 7), 0.1)
        change[3, 3], change[0, 0] = 0.0, np.nan
        kept = coherent(change, 0.1, 0.95)
        assert not kept[3, 3]
        assert not kept[0, 0]
        assert kept[0, 1]  # its neighbours with a value agree

    def test_false_alarms(self):
        random = np.random.default_rng(2)
        noise = random.normal(0, 0.1, (400, 400))
        # 5 % of 160,000: +- 0.05 % (1 sigma)
        assert beyond_detection(noise, 0.1, 0.95).mean() == pytest.approx(0.05, abs=0.002)
        assert coherent(noise, 0.1, 0.95).mean() < 0.05


class TestStableGround:
    def test_statistics_by_hand(self):
        s = statistics(np.array([-1.0, 0.0, 1.0, 2.0, 8.0]))
        assert (s.count, s.mean, s.median, s.std) == (5, 2.0, 1.0, pytest.approx(np.sqrt(10)))
        assert s.nmad == pytest.approx(1.4826)
        assert s.q68 == pytest.approx(1.732)  # between 1 and 2 of 0, 1, 1, 2, 8
        assert s.q95 == pytest.approx(6.8)
        assert nmad(np.random.default_rng(0).normal(0, 2, 100_000)) == pytest.approx(2.0, rel=0.02)

    def test_plane_is_robust(self):
        random = np.random.default_rng(4)
        x, y = random.uniform(0, 100, (2, 2000)) + 5e6
        change = 0.1 + 0.001 * (x - x.mean()) - 0.002 * (y - y.mean()) + random.normal(0, 0.03, 2000)
        change[:100] += 3.0
        shift = fit_shift("plane", x, y, change)
        # 0.7 mm for the level, 0.02 mm/m for the slopes (1 sigma); 5 % outliers add a tenth of a sigma: 3 mm.
        assert shift.coefficients == pytest.approx((0.1, 0.001, -0.002), abs=5e-3)
        assert shift.coefficients[1:] == pytest.approx((0.001, -0.002), abs=1.5e-4)
        assert shift.at(x[:1], y[:1])[0] == pytest.approx(0.1 + 0.001 * (x[0] - x.mean()) - 0.002 * (y[0] - y.mean()), abs=0.02)

    def test_what_does_not_determine_it(self):
        line = np.arange(50.0)
        with pytest.raises(NotEnoughData, match="one line"):
            fit_shift("plane", line, 2 * line, line)
        with pytest.raises(NotEnoughData, match="larger stable areas"):
            fit_shift("vertical", line[:5], line[:5], line[:5])
        assert fit_shift("none", line, line, line) == Shift("none")


class TestMeanTerms:
    def test_systematic_sigma_is_that_of_the_sum_over_cells(self):
        """Shares, holes and two tiles, far from the coordinates' origin: to 1e-9 of the plain sum."""
        random = np.random.default_rng(5)
        grid = Grid(300_000.0, 5_774_000.0, 0.5, 60, 40, "", 0.4)
        change, before = random.normal(0, 0.1, (40, 60)), random.normal(5, 2, (40, 60))
        change[10:14, 20:30] = np.nan
        zone = shapely.Point(300_016.3, 5_773_991.1).buffer(6.7)
        tally = Tally(zone.area)
        every = np.zeros((40, 60))
        ringed = np.pad(before + change, 1, constant_values=np.nan)
        for first, width in ((0, 35), (35, 25)):
            window = grid.window(first, 0, width, 40)
            part = np.s_[:, first : first + width]
            row, column, shares = cell_shares(zone, window)
            tally.add(
                Cells(window, first, 60, change[part], None, None, before[part], ringed[:, first : first + width + 2]),
                row,
                column,
                shares,
            )
            every[part][row : row + shares.shape[0], column : column + shares.shape[1]] = shares
        sizes = np.array([0.01, 1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6])
        root = sizes[:, None] * random.standard_normal((7, 7))
        fitted = Fitted(root @ root.T, (299_900.0, 5_774_200.0, 3.0), tuple((root @ np.ones(7)).tolist()))
        rows, columns = np.nonzero((every > 0) & np.isfinite(change))
        x, y = grid.centres(rows, columns)
        dx, dy, dz = x - 299_900.0, y - 5_774_200.0, before[rows, columns] - 3.0
        g = every[rows, columns] @ np.column_stack([np.ones(len(x)), dx, dy, dz, dx * dx, dx * dy, dy * dy])
        expected = grid.cell_area * np.sqrt(g @ fitted.covariance @ g + (g @ fitted.left) ** 2)
        volume = tally.volume(ErrorModel(None, None), fitted)
        assert volume.sigma.systematic == pytest.approx(expected, rel=1e-9)


class TestSample:
    def test_order_does_not_matter(self):
        random = np.random.default_rng(0)
        cells = random.permutation(100_000).astype(np.int64)
        samples = []
        for parts in (1, 7):
            sample = Sample(500, 1)
            for part in np.array_split(cells if parts == 1 else cells[::-1], parts):
                sample.add(part, part.astype(float))
            assert sample.count == 100_000
            samples.append(sample.values)
        np.testing.assert_array_equal(*samples)
        # Uniform over the cells: the mean of 500 has a sigma of 1,290.
        assert samples[0].mean() == pytest.approx(50_000, abs=4000)

    def test_patches_stay_whole(self):
        rows, columns = (v.ravel() for v in np.mgrid[0:256, 0:256])
        sample = Sample(6400, 2)
        for part in np.array_split(np.random.default_rng(0).permutation(256 * 256), 5):
            patches = (rows[part] // 16) * 16 + columns[part] // 16
            sample.add(part, rows[part].astype(float), columns[part].astype(float), patches=patches)
        r, c = sample.values.astype(int).T
        sizes = np.bincount((r // 16) * 16 + c // 16, minlength=256)
        assert np.sort(sizes)[::-1][:25].tolist() == [256] * 25
        assert (sizes > 0).sum() == 25


class TestCorrelation:
    def test_variogram_of_a_known_field(self):
        found = []
        rows, columns = np.nonzero(np.ones((150, 60), bool))
        for seed in range(12):
            random = np.random.default_rng(seed)
            field = 0.8 * correlated_field(random, 150, 15.0) + 0.6 * random.standard_normal((150, 150))
            variogram = fit_variogram(rows, columns, field[rows, columns], (1.0, 1.0))
            found.append((variogram.nugget, variogram.sill, variogram.reach))
        # Medians of twelve fields, each of some 50 independent patches.
        nugget, sill, reach = np.median(found, axis=0)
        assert nugget == pytest.approx(0.36, abs=0.04)
        assert sill == pytest.approx(0.64, abs=0.12)
        assert reach == pytest.approx(15.0, abs=3.0)

    def test_variogram_of_patches(self):
        """A tenth of a large area in whole patches tells what the whole tells: near pairs inside, far pairs between them."""
        random = np.random.default_rng(3)
        field = 0.8 * correlated_field(random, 400, 60.0) + 0.6 * random.standard_normal((400, 400))
        rows, columns = (v.ravel() for v in np.mgrid[0:400, 0:400])
        sample = Sample(16_000, 3)
        patches = (rows // 16) * 400 + columns // 16
        sample.add(rows * 400 + columns, rows.astype(float), columns.astype(float), field.ravel(), patches=patches)
        r, c, values = sample.values.T
        part = fit_variogram(r.astype(int), c.astype(int), values, (1.0, 1.0))
        whole = fit_variogram(rows, columns, field.ravel(), (1.0, 1.0))
        assert part.nugget == pytest.approx(whole.nugget, abs=0.05)
        assert part.sill == pytest.approx(whole.sill, rel=0.25)
        assert part.reach == pytest.approx(whole.reach, rel=0.35)
        assert len(part.lags) > 20

    def test_nested_ranges(self):
        """Two structures ten times apart are both found."""
        found = []
        rows, columns = (v.ravel() for v in np.mgrid[0:300, 0:300])
        for seed in range(5):
            random = np.random.default_rng(seed)
            field = 0.6 * correlated_field(random, 300, 6.0) + 0.8 * correlated_field(random, 300, 60.0)
            variogram = fit_variogram(rows, columns, field.ravel(), (1.0, 1.0))
            found.append([variogram.at(np.array([h]))[0] for h in (3.0, 8.0, 30.0)])
        truth = [0.36 * (1 - correlation(h, 6.0)) + 0.64 * (1 - correlation(h, 60.0)) for h in (3.0, 8.0, 30.0)]
        # Some 25 independent patches of the long structure in each field.
        np.testing.assert_allclose(np.median(found, axis=0), truth, rtol=0.12)

    def test_a_long_range_is_not_resolved(self):
        rows, columns = np.nonzero(np.ones((40, 40), bool))
        slope = columns / 40.0
        assert np.isinf(fit_variogram(rows, columns, slope, (1.0, 1.0)).reach)
        assert fit_variogram(rows[:50], columns[:50], slope[:50], (1.0, 1.0)) is None

    def test_pure_noise_has_no_sill(self):
        rows, columns = np.nonzero(np.ones((100, 100), bool))
        variogram = fit_variogram(rows, columns, np.random.default_rng(1).normal(size=10_000), (0.5, 0.5))
        assert variogram.nugget + variogram.sill == pytest.approx(1.0, abs=0.05)

    def test_double_sum_exact(self):
        """All cells sampled: the sum is the plain matrix sum."""
        random = np.random.default_rng(0)
        x, y, s = random.uniform(0, 30, 80), random.uniform(0, 30, 80), random.uniform(0.5, 1.5, 80)
        sample = np.column_stack([x, y, s])
        matrix = correlation(np.hypot(x[:, None] - x, y[:, None] - y), 10.0)
        assert correlated_variance(sample, 80, float(s @ s), 10.0) == pytest.approx(float(s @ matrix @ s))
        assert correlated_variance(sample, 80, float(s @ s), np.inf) == pytest.approx(float(s.sum()) ** 2)
        assert correlated_variance(sample, 80, float(s @ s), 0.0) == pytest.approx(float(s @ s))

    def test_strip_of_1000_by_10_metres(self):
        """The double sum on a strip, where the disk formula is 41 % too large; against one-dimensional quadrature."""
        x, y = np.meshgrid(np.arange(1000) + 0.5, np.arange(10) + 0.5)
        every = np.random.default_rng(0).permutation(x.size)[:2500]
        sample = np.column_stack([x.ravel()[every], y.ravel()[every], np.ones(2500)])
        variance = correlated_variance(sample, x.size, x.size, 20.0)
        lag_x, lag_y = np.meshgrid(np.arange(-999, 1000), np.arange(-9, 10))
        exact = ((1000 - abs(lag_x)) * (10 - abs(lag_y)) * correlation(np.hypot(lag_x, lag_y), 20.0)).sum()
        # 2 % of the pairs lie within the range: 65,000 pairs.
        assert variance == pytest.approx(exact, rel=0.03)
        disk = 1e4 * np.sqrt(0.2) * 20 / np.sqrt(1e4 / np.pi)
        assert disk / np.sqrt(exact) == pytest.approx(1.41, abs=0.02)

    def test_stable_ground_of_15_by_40_metres(self):
        """3 cm sill, 20 m range: the shift keeps 1.45 cm, whatever the number of cells."""
        x, y = (v.ravel() for v in np.meshgrid(np.arange(0.25, 15, 0.5), np.arange(0.25, 40, 0.5)))
        covariance = fit_covariance(np.ones((len(x), 1)), np.column_stack([x, y]), 0.0, ((0.03**2, 20.0),), len(x))
        assert np.sqrt(covariance[0, 0]) == pytest.approx(0.0145, abs=0.0002)
        assert Fitted(covariance, (0.0, 0.0)).sigma(Moments((5.0, 5.0, 0.0))) == pytest.approx(0.0145, abs=0.0002)

    def test_fitted_plane_covers_the_truth(self):
        """Least-squares planes on correlated fields: their extrapolation scatters as the covariance says."""
        side = np.arange(60)
        x, y = (v.ravel().astype(float) for v in np.meshgrid(side, side))
        centre = (x.mean(), y.mean())
        design = np.column_stack([np.ones(len(x)), x - centre[0], y - centre[1]])
        pick = np.random.default_rng(0).permutation(len(x))[:1500]
        covariance = fit_covariance(design[pick], np.column_stack([x, y])[pick], 0.0, ((1.0, 12.0),), len(x))
        predicted = Fitted(covariance, centre).sigma(Moments((100.0, 30.0, 0.0)))
        random = np.random.default_rng(1)
        g = np.array([1.0, 100.0 - centre[0], 30.0 - centre[1]])
        at = [g @ np.linalg.lstsq(design, correlated_field(random, 60, 12.0).ravel(), rcond=None)[0] for _ in range(300)]
        # 300 draws: 4 % (1 sigma)
        assert np.std(at) == pytest.approx(predicted, rel=0.12)

    def test_zone_sums_cover_the_truth(self):
        random = np.random.default_rng(6)
        rows, columns = np.mgrid[0:80, 0:80]
        zone = (np.abs(rows - 40) < 15) & (np.abs(columns - 30) < 25)
        sample = np.column_stack([columns[zone], rows[zone], np.ones(zone.sum())]).astype(float)
        pick = random.permutation(len(sample))[:1000]
        predicted = np.sqrt(correlated_variance(sample[pick], len(sample), len(sample), 15.0))
        sums = [correlated_field(random, 80, 15.0)[zone].sum() for _ in range(400)]
        assert np.std(sums) == pytest.approx(predicted, rel=0.1)


def test_total_is_known_only_when_all_parts_are():
    assert total(3.0, 4.0, 0.0) == 5.0
    assert total(3.0, None, 0.0) is None
