"""MicMac's statistics, coverage and the weakest link, against numbers worked out by hand."""

import numpy as np
import pytest
from strandline.core.tiepoints.statistics import coverage_percent, micmac_statistics, weakest_link


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


def test_nothing_kept_has_no_residual():
    s = micmac_statistics(np.array([0, 1]), np.array([0, 0]), np.full(2, np.inf), np.zeros(2, bool), 2)
    assert s.mse is None
    assert s.mtp_percent == 0.0


def test_coverage_counts_cells():
    # A photograph of 100 x 50: cells of 10 x 5. The edge belongs to the last cell.
    xy = np.array([[0.0, 0.0], [9.9, 4.9], [10.1, 0.0], [100.0, 50.0]])
    assert coverage_percent(xy, 100, 50) == 3.0
    assert coverage_percent(np.zeros((0, 2)), 100, 50) == 0.0


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
