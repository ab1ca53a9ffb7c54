"""Which photographs measure a tile."""

import numpy as np
from strandline.core.block import View
from strandline.core.camera import Camera
from strandline.core.frames import LocalFrame
from strandline.core.surface.views import choose, tile_views

CAMERA = Camera("PINHOLE", 100, 100, (100.0, 100.0, 50.0, 50.0))
DOWN = np.diag([1.0, -1.0, -1.0])
UTM = 32630


def strip(count, spacing):
    """Return photographs from 20 m above flat ground, each 20 m wide, in a row eastwards."""
    centres = [np.array([i * spacing, 0.0, 20.0]) for i in range(count)]
    views = tuple(View(f"{i}.jpg", CAMERA, DOWN, -DOWN @ centre) for i, centre in enumerate(centres))
    frame = LocalFrame.at(f"EPSG:{UTM}", 500_000.0, 5_500_000.0, 0.0)
    return tile_views(views, frame, np.array([500_000.0, 5_500_000.0, 0.0]), 200.0)


def seen_by(views, west, length):
    """Return how many views see each metre of a line eastwards."""
    flat = np.zeros((1, length), np.float32)
    return sum(view.inside(west, 0.5, 1.0, flat).astype(int) for view in views)[0]


def test_a_tile_over_the_whole_survey_has_views_everywhere():
    views = strip(30, 5.0)  # 150 m of ground, of which a view sees 20: eight views could not cover it twice
    chosen = choose(views, -5.0, 2.0, 1.0, np.zeros((4, 155), np.float32), most=3)
    possible, taken = seen_by(views, -5.0, 155), seen_by(chosen, -5.0, 155)
    assert np.all(taken >= np.minimum(possible, 3))
    assert len(chosen) < len(views)


def test_no_more_views_than_needed_where_all_see_the_tile():
    views = strip(12, 0.5)
    chosen = choose(views, 0.0, 2.0, 1.0, np.zeros((4, 4), np.float32), most=5)
    assert len(chosen) == 5
    # The widest base is among them.
    assert {chosen[0].index, chosen[-1].index} == {0, 11}
