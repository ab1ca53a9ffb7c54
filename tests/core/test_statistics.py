"""MicMac's statistics, coverage and the weakest link, against numbers worked out by hand."""

import numpy as np
import pytest
from strandline.core.tiepoints.statistics import (
    MOST_RAYS,
    cell_counts,
    coverage_percent,
    micmac_statistics,
    ray_histograms,
    rays_per_point,
    weakest_link,
)


def test_statistics_of_four_points_in_three_photographs():
    # Point 0 is seen by all three, points 1 and 2 by two, point 3 by all three.
    photograph = np.array([0, 1, 2, 0, 1, 1, 2, 0, 1, 2])
    track = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 3])
    residual = np.array([0.3, 0.4, 0.0, 1.0, 9.0, 1.0, 2.0, 0.0, 0.0, 9.0])
    kept = residual < 3.0
    s = micmac_statistics(photograph, track, residual, kept, 3)
    assert [(p.observations, p.kept, p.multi, p.multi_kept) for p in s.photographs] == [(3, 3, 2, 2), (4, 3, 2, 2), (3, 2, 2, 1)]
    assert s.mtp == pytest.approx(10 / 3)
    assert s.mtp_percent == pytest.approx((100 + 75 + 200 / 3) / 3)
    assert s.mmtp == 2.0
    assert s.mmtp_percent == pytest.approx((100 + 100 + 50) / 3)
    assert s.mse == pytest.approx(np.sqrt((0.09 + 0.16 + 1 + 1 + 4) / 8))
    assert s.photographs[0].rms == pytest.approx(np.sqrt((0.09 + 1.0) / 3))


def test_two_observations_of_a_point_in_one_photograph_are_one_ray():
    s = micmac_statistics(np.array([0, 0, 1]), np.array([0, 0, 0]), np.zeros(3), np.ones(3, bool), 2)
    assert s.mmtp == 0.0
    assert s.mmtp_percent is None


def test_a_photograph_without_observations_counts_in_the_mean_but_not_in_the_percentage():
    s = micmac_statistics(np.array([0, 1]), np.array([0, 0]), np.array([0.5, 5.0]), np.array([True, False]), 3)
    assert s.mtp == pytest.approx(2 / 3)
    assert s.mtp_percent == 50.0
    assert s.photographs[2].rms is None
    assert s.mse == 0.5


def test_statistics_agree_with_counting_one_photograph_after_the_other():
    rng = np.random.default_rng(3)
    photograph, track = rng.integers(0, 9, 4000), rng.integers(0, 900, 4000)
    residual = rng.rayleigh(0.5, 4000)
    kept = residual < 1.2
    s = micmac_statistics(photograph, track, residual, kept, 10)
    rays = [len(set(photograph[track == t].tolist())) for t in range(900)]
    multi = np.array(rays)[track] >= 3
    for i, p in enumerate(s.photographs):
        mine = photograph == i
        numbers = [int(m.sum()) for m in (mine, mine & kept, mine & multi, mine & multi & kept)]
        assert [p.observations, p.kept, p.multi, p.multi_kept] == numbers
        assert p.rms == (pytest.approx(np.sqrt(np.mean(residual[mine & kept] ** 2))) if numbers[1] else None)


def test_nothing_kept_has_no_residual():
    s = micmac_statistics(np.array([0, 1]), np.array([0, 0]), np.full(2, np.inf), np.zeros(2, bool), 2)
    assert s.mse is None
    assert s.mtp_percent == 0.0


def test_coverage_counts_cells():
    # A photograph of 100 x 50: cells of 10 x 5. The edge belongs to the last cell.
    xy = np.array([[0.0, 0.0], [9.9, 4.9], [10.1, 0.0], [100.0, 50.0]])
    assert coverage_percent(xy, 100, 50) == 3.0
    assert coverage_percent(np.zeros((0, 2)), 100, 50) == 0.0


def test_cells_are_counted_by_row_and_column():
    xy = np.array([[0.0, 0.0], [1.0, 1.0], [95.0, 2.0], [5.0, 49.0], [100.0, 50.0]])
    counts = cell_counts(xy, 100, 50)
    assert counts.shape == (10, 10)
    assert (counts[0, 0], counts[0, 9], counts[9, 0], counts[9, 9], counts.sum()) == (2, 1, 1, 1, 5)


def test_rays_are_counted_per_point_and_per_photograph():
    # Point 0: photographs 0, 1, 2; point 1: 0 (twice) and 1; point 2: none; point 3: only 2.
    photograph = np.array([0, 1, 2, 0, 0, 1, 2])
    track = np.array([0, 0, 0, 1, 1, 1, 3])
    assert rays_per_point(photograph, track).tolist() == [3, 2, 0, 1]
    histograms = ray_histograms(photograph, track, 4)
    assert histograms[:, :4].tolist() == [[0, 0, 1, 1], [0, 0, 1, 1], [0, 1, 0, 1], [0, 0, 0, 0]]
    assert histograms[:, 4:].sum() == 0


def test_many_rays_are_told_together():
    n = MOST_RAYS + 3
    histograms = ray_histograms(np.arange(n), np.zeros(n, int), n)
    assert histograms[:, MOST_RAYS].tolist() == [1] * n
    assert histograms.sum() == n


def chain(links):
    """Observations of points that the given photographs see: {photographs: number of points}."""
    photograph, track, n = [], [], 0
    for group, points in links.items():
        for _ in range(points):
            photograph += group
            track += [n] * len(group)
            n += 1
    return np.array(photograph), np.array(track)


def test_the_weakest_link_is_found_and_the_smaller_part_named():
    photograph, track = chain({(0, 1, 2): 50, (1, 2, 3): 7, (3, 4, 5): 40, (4, 5, 6): 30, (2, 3): 500})
    # Photographs 2 and 3 share 500 points of two rays, which do not count, and 7 of three.
    assert weakest_link(photograph, track, 7) == (7, [0, 1, 2])


def test_parts_that_no_point_of_three_rays_joins_have_a_link_of_zero():
    photograph, track = chain({(0, 1, 2): 5, (3, 4, 5): 5, (2, 3): 9})
    assert weakest_link(photograph, track, 6) == (0, [0, 1, 2])
    assert weakest_link(np.array([0, 1]), np.array([0, 0]), 2) is None
