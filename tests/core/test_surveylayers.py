"""Footprints by hand; layers of a survey that stands."""

import numpy as np
import pytest
from strandline.core.block import View
from strandline.core.camera import Camera
from strandline.core.orientation.surveylayers import footprint

DOWN = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])  # x east, y south, z down


def view(rotation, centre):
    camera = Camera("PINHOLE", 400, 300, (500.0, 500.0, 200.0, 150.0))
    return View("a.jpg", camera, rotation, -rotation @ np.asarray(centre, float))


def test_a_photograph_straight_down_shows_a_rectangle():
    """From 50 m above the ground a frame of 400 x 300 px at f = 500 px covers 40 x 30 m."""
    outline = footprint(view(DOWN, (10.0, 20.0, 55.0)), 5.0)
    assert outline[:, 2] == pytest.approx(5.0)
    assert outline[:, :2].min(axis=0) == pytest.approx([-10.0, 5.0])
    assert outline[:, :2].max(axis=0) == pytest.approx([30.0, 35.0])


def test_a_photograph_that_sees_the_horizon_has_no_footprint():
    angle = np.radians(80.0)
    tilt = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    assert footprint(view(tilt @ DOWN, (0.0, 0.0, 50.0)), 0.0) is None


def test_a_photograph_from_below_the_ground_has_none():
    assert footprint(view(DOWN, (0.0, 0.0, -5.0)), 0.0) is None
