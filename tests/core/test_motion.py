"""The motion of the ground around each match: on grounds made by hand, sloping and with a step, turned, with wrong matches."""

import numpy as np
import pytest
from strandline.core.tiepoints.motion import by_neighbours, consistent

TURN = np.radians(170.0)
PLANE = np.array([[np.cos(TURN), -np.sin(TURN), 900.0], [np.sin(TURN), np.cos(TURN), 700.0], [1e-5, 0.0, 1.0]])


def mapped(xy):
    out = np.column_stack([xy, np.ones(len(xy))]) @ PLANE.T
    return out[:, :2] / out[:, 2:]


def pair(count, noise, parallax, seed=0):
    """Return places in two photographs turned by 170 degrees, of which the second are moved by ``parallax`` of the first."""
    rng = np.random.default_rng(seed)
    first = rng.uniform(0, 800, (count, 2))
    true = mapped(first) + np.column_stack([parallax(first), np.zeros(count)])
    return first, true, true + rng.normal(0, noise, true.shape)


def flat(xy):
    return np.zeros(len(xy))


def slope(xy):
    return 0.05 * xy[:, 0]  # 40 pixels over the photograph


def test_wrong_matches_stray_and_right_ones_do_not():
    first, true, second = pair(3000, 0.25, slope)
    wrong = np.arange(0, 3000, 20)
    second[wrong, 0] += np.where(wrong % 40 == 0, 4.0, -4.0)  # along the epipolar line, which cannot tell them
    kept = consistent(first, second)
    assert kept[wrong].sum() == 0
    right = np.setdiff1d(np.arange(3000), wrong)
    # Three times the median distance of normal errors holds all but one in five hundred; of twelve, which are few, fifty.
    assert kept[right].mean() > 0.98


def test_a_step_of_the_ground_is_kept_to_its_edge():
    def boulder(xy):
        return np.where(np.hypot(*(xy - 400).T) < 40, 8.0, 0.0)

    first, _, second = pair(3000, 0.15, boulder)
    on_it = boulder(first) > 0
    assert 10 < on_it.sum() < 50
    # Twenty matches of three thousand, up to 8 pixels off all around. Those at its rim have hardly a neighbour on it.
    inside = np.hypot(*(first - 400).T) < 30
    assert consistent(first, second)[inside].all()
    assert consistent(first, second)[on_it].mean() > 0.7
    assert consistent(first, second).mean() > 0.98


def test_few_matches_are_not_judged():
    first, _, second = pair(12, 0.1, flat)
    second[3] += 50
    assert consistent(first, second).all()
    assert len(consistent(first[:0], second[:0])) == 0


@pytest.mark.parametrize("parallax", [flat, slope])
def test_features_are_expected_where_the_matches_around_them_move(parallax):
    first, _, second = pair(2000, 0.5, parallax)
    second[::5] += np.random.default_rng(1).uniform(-30, 30, (400, 2))  # a fifth is wrong
    xy = np.random.default_rng(2).uniform(50, 750, (500, 2))
    found = by_neighbours(xy.astype(np.float32), first, second, PLANE, 40.0)
    error = np.linalg.norm(found.places - mapped(xy) - np.column_stack([parallax(xy), np.zeros(500)]), axis=1)
    # The median of twelve has a sigma of 0.2 px; a slope of 5 % moves by half a pixel from one place of the lattice to the next.
    assert np.median(error) < 0.6
    assert (error <= found.reach).all()
    assert found.reach.min() >= 2.5
    assert np.median(found.reach) < 5.0


def test_the_search_widens_at_a_step_and_never_beyond_its_limit():
    def step(xy):
        return np.where(xy[:, 0] > 400, 12.0, 0.0)

    first, _, second = pair(4000, 0.3, step)
    xy = np.array([[100.0, 400.0], [400.0, 400.0], [700.0, 400.0]], np.float32)
    reach = by_neighbours(xy, first, second, PLANE, 10.0).reach
    assert reach[0] == reach[2] == 2.5
    assert reach.max() <= 10.0
    xy = np.column_stack([np.full(50, 400.0), np.linspace(50, 750, 50)]).astype(np.float32)
    edge = by_neighbours(xy, first, second, PLANE, 10.0)
    assert edge.reach.max() == 10.0  # where half of the neighbours lie on either side
    one = by_neighbours(xy, first[:1], second[:1], PLANE, 10.0)  # a single match tells one motion
    assert np.isfinite(one.places).all()
