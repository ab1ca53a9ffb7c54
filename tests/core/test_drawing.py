"""Pictures of reports: dots where the points are, cells as counted, one light, clouds in one frame."""

import numpy as np
import pytest
from strandline.core.report.cloud import Cloud, cloud_from_above, cloud_in_perspective, exaggeration, levelled
from strandline.core.report.drawing import KEPT, REJECTED, draw_coverage, draw_tie_points, reduced, side_by_side
from strandline.core.report.relief import exaggeration as relief_exaggeration
from strandline.core.report.relief import hillshade, round_factor

GREY = np.full((300, 400), 128, np.uint8)
FLAT = np.sin(np.radians(45.0))


def dyed(picture, colour):
    """Where a picture is nearer to a colour than to grey."""
    distance = np.linalg.norm(picture.astype(float) - colour, axis=2)
    return distance < np.linalg.norm(picture.astype(float) - 128, axis=2)


def middle(where):
    """The centre (x, y) of the pixels that are true, counted from the corner of the first pixel."""
    rows, columns = np.nonzero(where)
    return columns.mean() + 0.5, rows.mean() + 0.5


def test_a_dot_lies_on_its_point():
    picture = draw_tie_points(GREY, np.array([[100.5, 50.5], [300.0, 200.0]]), np.array([True, False]))
    assert picture.shape == (300, 400, 3)
    assert middle(dyed(picture, KEPT)) == pytest.approx((100.5, 50.5), abs=0.01)
    assert middle(dyed(picture, REJECTED)) == pytest.approx((300.0, 200.0), abs=0.01)
    assert (picture[150:] == 128)[:, :250].all()  # the photograph keeps its tones elsewhere


def test_points_are_counted_in_the_frame_whatever_the_picture():
    # A frame of 4000 x 3000 on a picture of 400 x 300 that is reduced to 200 x 150: a twentieth.
    picture = draw_tie_points(GREY, np.array([[2000.0, 1000.0]]), np.array([True]), frame=(4000, 3000), longer=200)
    assert picture.shape == (150, 200, 3)
    assert middle(dyed(picture, KEPT)) == pytest.approx((100.0, 50.0), abs=0.01)


@pytest.mark.parametrize("count", [5_000, 50_000, 500_000])
def test_any_number_of_points_leaves_the_photograph_visible(count):
    xy = np.random.default_rng(0).uniform(0, [400, 300], (count, 2))
    picture = draw_tie_points(GREY, xy, np.ones(count, bool)).astype(float)
    strength = (128 - picture[:, :, 0]) / 128  # red goes from 128 to 0 in a dot
    # Discs are anti-aliased and overlap, so the share of a quarter is not met exactly.
    assert 0.05 < strength.mean() < 0.45


def test_the_rarer_kind_lies_on_top():
    xy = np.repeat([[200.0, 150.0]], 3, axis=0)
    assert dyed(draw_tie_points(GREY, xy, np.array([True, True, False])), REJECTED)[150, 200]
    assert dyed(draw_tie_points(GREY, xy, np.array([False, True, False])), KEPT)[150, 200]


def test_no_points_and_points_beyond_the_frame_draw_nothing():
    assert (draw_tie_points(GREY, np.zeros((0, 2)), np.zeros(0, bool)) == 128).all()
    assert (draw_tie_points(GREY, np.array([[-5.0, 10.0], [10.0, 301.0]]), np.ones(2, bool)) == 128).all()


def test_sixteen_bits_are_shown_by_their_upper_eight():
    assert (reduced(np.full((10, 20), 128 * 256, np.uint16)) == 128).all()


def test_cells_are_coloured_where_they_are_counted():
    counts = np.full((10, 10), 1000)
    counts[2, 7] = 0
    picture = draw_coverage(GREY, counts, longer=400).astype(int)
    red = picture[:, :, 0] - picture[:, :, 1] > 40
    assert red[62, 285]
    assert middle(red[60:90, 280:320]) == pytest.approx((20, 15), abs=1.5)  # the number in the middle is white and black
    red[60:90, 280:320] = False
    assert not red.any()


def test_pictures_in_a_row_have_one_height():
    row = side_by_side(np.zeros((100, 150, 3), np.uint8), np.zeros((50, 100, 3), np.uint8))
    assert row.shape == (50, 75 + 8 + 100, 3)
    assert (row[:, 75:83] == 255).all()


def test_level_ground_has_the_light_of_45_degrees():
    assert hillshade(np.zeros((4, 5)), 1.0) == pytest.approx(FLAT)


def test_a_slope_to_the_light_is_full_and_one_away_from_it_dark():
    # Rising to the south-east by one in one: its normal points to the north-west, 45 degrees high, as the light does.
    south, east = np.mgrid[0:5, 0:6].astype(float)
    facing = (south + east) / np.sqrt(2)
    assert hillshade(facing, 1.0) == pytest.approx(1.0, abs=1e-6)
    assert hillshade(-facing, 1.0) == pytest.approx(0.0, abs=1e-6)
    # A slope along the light's own direction only turns it away: cos(45) / sqrt(2).
    assert hillshade((south - east) / np.sqrt(2), 1.0) == pytest.approx(0.5, abs=1e-6)


def test_exaggeration_and_cells_of_two_sizes():
    south, east = np.mgrid[0:5, 0:6].astype(float)
    assert hillshade((2 * south + east) / np.sqrt(2) / 10, (2.0, 1.0), 10.0) == pytest.approx(1.0, abs=1e-6)


def test_holes_have_no_light():
    height = np.zeros((5, 5))
    height[2, 2] = np.nan
    dark = np.isnan(hillshade(height, 1.0))
    assert dark[2, 1]
    assert dark[1, 2]
    assert not dark[0, 0]
    assert np.isnan(hillshade(np.full((1, 9), 3.0), 1.0)).all()


def test_a_flat_beach_is_exaggerated_by_a_round_factor():
    assert [round_factor(v) for v in (0.2, 1.9, 2.0, 9.9, 30, 1e9)] == [1, 1, 2, 5, 20, 100]
    assert round_factor(50, most=20) == 20
    _, east = np.mgrid[0:50, 0:200].astype(float)
    ripples = 0.02 * east + np.sin(np.pi * east / 25)  # slopes up to pi / 25 = 0.126 about the beach's 0.02
    assert relief_exaggeration(ripples, 1.0) == 2.0  # 0.5 / 0.126 = 3.98
    assert relief_exaggeration(np.full((5, 5), np.nan), 1.0) == 1.0


def test_a_free_frame_is_levelled_by_its_photographs():
    rng = np.random.default_rng(4)
    centres = np.column_stack([np.linspace(0, 60, 9), rng.uniform(-5, 5, 9), np.full(9, 30.0)])
    points = np.column_stack([rng.uniform(0, 60, 200), rng.uniform(-20, 20, 200), rng.normal(0, 0.2, 200)])
    looking = np.tile([0.0, 0.0, -1.0], (9, 1))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    flat, flown = levelled(points @ turn.T + 5, centres @ turn.T + 5, looking @ turn.T)
    assert flown[:, 2] == pytest.approx(0.0, abs=1e-9)
    assert flat[:, 2] == pytest.approx(points[:, 2] - 30.0, abs=1e-9)
    assert flown[-1, 0] - flown[0, 0] > 59  # the length runs to the right
    wide, wider = (p[:, None] - p[None] for p in (points, flat))
    assert np.linalg.norm(wider, axis=2) == pytest.approx(np.linalg.norm(wide, axis=2), abs=1e-9)


@pytest.mark.parametrize("centres", [np.zeros((1, 3)), np.zeros((3, 3))])
def test_photographs_from_one_place_can_be_levelled(centres):
    points, places = levelled(np.array([[1.0, 2.0, 3.0]]), centres, np.tile([0.0, 0.0, 1.0], (len(centres), 1)))
    assert np.isfinite(places).all()
    assert points[0, 2] == pytest.approx(-3.0)


def beach(count, seed=0):
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, [40, 20], (count, 2))
    points = np.column_stack([xy, 0.03 * xy[:, 0]])
    points[: count // 500] += [0, 0, 50]  # wrong points do not make the frame
    return Cloud(points, rng.integers(2, 9, count), np.array([[10.0, 10.0, 25.0], [30.0, 10.0, 25.0]]))


def test_heights_are_exaggerated_to_a_quarter_of_the_shorter_side():
    # 0.25 * 20 / 1.2 = 4.2, and the next round factor below is 2.
    assert exaggeration({"": beach(5000)}) == 2.0


def test_cases_are_drawn_in_the_frame_of_the_richest():
    clouds = {"JPG": None, "RAW": beach(50), "CeRAW": beach(5000)}
    for figure in (cloud_from_above(clouds), cloud_in_perspective(clouds)):
        axes = [a for a in figure.axes if a.get_title()]
        assert [a.get_title() for a in axes] == ["JPG: not oriented", "RAW: 50 points", "CeRAW: 5,000 points"]
        assert len({(a.get_xlim(), a.get_ylim()) for a in axes}) == 1
    texts = [t.get_text() for a in cloud_in_perspective(clouds).axes for t in a.texts]
    assert any("relief 1.2 (m); heights 2 times exaggerated" in t for t in texts)


def test_a_cloud_from_above_by_rays_names_them():
    figure = cloud_from_above({"": beach(300)}, colour="rays")
    legend = figure.axes[0].get_legend()
    assert [t.get_text() for t in legend.get_texts()] == ["2 rays", "3", "4", "5 and more"]
