"""Heights of another unit or kind than they are taken for, seen from a simulated block."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strandline.core.block import Block, View
from strandline.core.camera import Camera
from strandline.core.errors import InputError
from strandline.core.orientation.control import Control, GroundPoint
from strandline.core.orientation.gnss import Gnss
from strandline.core.orientation.marks import Mark
from strandline.core.orientation.plausible import Level, check_unit, level_of, refuse_absurd
from strandline.core.survey import Photograph

CAMERA = Camera("OPENCV", 4000, 3000, (3000.0, 3000.0, 2000.0, 1500.0, 0.0, 0.0, 0.0, 0.0))
ORIGIN = np.array([512000.0, 4983000.0, 0.0])
PLACES = np.array(
    [[-18, 22, 0.5], [18, 21, -0.3], [-17, -22, 3.2], [19, -20, 1.5], [1, 2, 0.8], [-16, 1, -0.5], [5, -9, 2.1]], float
)
GROUND = 4.0  # m above the sea, as the points are


def views(strips=2):
    made = []
    for k in range(5 * strips):
        strip, along = divmod(k, 5)
        centre = np.array([(strip - (strips - 1) / 2) * 20.0, (along - 2) * 10.0, 40.0])
        rotation = Rotation.from_euler("ZXY", [180.0 * strip + k, 180 + (k % 3) - 1, k % 2], degrees=True).as_matrix().T
        made.append(View(f"{k}.jpg", CAMERA, rotation, -rotation @ centre))
    return made


def scene(*, strips=2, noise=0.3, places=PLACES, height=lambda z: z, gnss=0.0, seed=0):
    """Return a block free by a scale of 8, its ground points with heights as ``height`` gives them, and GNSS ``gnss`` m up."""
    rng = np.random.default_rng(seed)
    seen = views(strips)
    points = []
    for n, place in enumerate(places):
        marks = []
        for view in seen:
            (pixels,) = view.project(place[None])
            if np.isfinite(pixels).all() and (pixels > 0).all() and pixels[0] < CAMERA.width and pixels[1] < CAMERA.height:
                marks.append(Mark(f"P{n}", view.name, *map(float, pixels + rng.normal(size=2) * noise)))
        given = ORIGIN + [place[0], place[1], height(place[2] + GROUND)] + rng.normal(size=3) * 0.01
        points.append(GroundPoint(f"P{n}", given, False, 0.01, 0.02, tuple(marks)))
    free = tuple(View(v.name, v.camera, v.rotation, v.translation / 8.0) for v in seen)
    nothing = np.zeros(0, np.int32)
    block = Block(free, np.zeros((0, 3)), np.zeros(0), nothing, nothing, nothing)
    positions = ORIGIN + [0, 0, GROUND + gnss] + np.array([v.centre for v in seen]) + rng.normal(size=(len(seen), 3)) * 0.5
    sigmas = np.full((len(seen), 2), 1.0)
    return block, Control(tuple(points), (), "gcps"), Gnss(np.arange(len(seen)), positions, sigmas, False, np.zeros(3))


# Units, by the shape of the ground alone


@pytest.mark.parametrize("seed", range(20))
def test_heights_in_metres_are_never_taken_for_another_unit(seed):
    check_unit(*scene(seed=seed)[:2])
    check_unit(*scene(seed=seed, noise=3.0, places=PLACES * [1, 1, 0.02])[:2])  # flat ground, careless marks
    block, control, _ = scene(seed=seed)
    wrong = [replace(p, coordinates=p.coordinates + [0, 0, 0.9 * (n == seed % 7)]) for n, p in enumerate(control.points)]
    check_unit(block, replace(control, points=tuple(wrong)))


@pytest.mark.parametrize(
    ("unit", "factor"), [("feet", 1 / 0.3048), ("feet", 3937 / 1200), ("centimetres", 100.0), ("millimetres", 1000.0)]
)
def test_heights_in_another_unit_are_refused_by_its_name(unit, factor):
    block, control, _ = scene(height=lambda z: z * factor)
    with pytest.raises(InputError, match=f"The heights of gcps fit the photographs as {unit} .* give them in metres"):
        check_unit(block, control)


def test_few_points_and_level_ground_tell_nothing():
    block, control, _ = scene(height=lambda z: z / 0.3048)
    check_unit(block, replace(control, points=control.points[:4]))
    check_unit(*scene(places=PLACES * [1, 1, 0], height=lambda z: z / 0.3048)[:2])


# Levels, by GNSS


@pytest.mark.parametrize("gnss", [0.0, 48.25, -31.5])
def test_the_level_of_gnss_over_the_ground_points(gnss):
    block, control, positions = scene(gnss=gnss)
    level = level_of(block, control, positions, [])
    # Ten positions of 0.5 m hold the block's middle to 0.2 m and its corners to some decimetres.
    assert level.above == pytest.approx(gnss, abs=0.6)
    assert level.differs == (gnss != 0.0)
    assert level.unit is None


def test_one_point_is_enough_and_one_wrong_position_no_harm():
    block, control, positions = scene(gnss=48.0)
    positions.coordinates[3] += [22.0, 0.0, 60.0]
    level = level_of(block, replace(control, points=control.points[4:5]), positions, [])
    assert level.above == pytest.approx(48.0, abs=0.8)


@pytest.mark.parametrize(("unit", "factor"), [("millimetres", 1000.0), ("feet", 1 / 0.3048)])
def test_a_unit_that_would_make_them_agree_is_named(unit, factor):
    # Level ground, so that its shape tells nothing: 4 m are 4,000 mm; 20 m are 65.6 feet, 46 m off.
    flat = PLACES * [1, 1, 0] + ([0, 0, 16] if unit == "feet" else [0, 0, 0])
    block, control, positions = scene(places=flat, height=lambda z: z * factor)
    level = level_of(block, control, positions, [])
    assert level.unit == unit
    if unit == "millimetres":
        with pytest.raises(
            InputError, match=r"lie 39\d\d m above the ground as GNSS positions show it; in millimetres they would"
        ):
            refuse_absurd(level, "gcps")
    else:
        refuse_absurd(level, "gcps")


def test_what_no_geoid_explains_is_refused():
    refuse_absurd(Level(-110.0, 5.0), "gcps")
    with pytest.raises(InputError, match="The heights of gcps lie 350 m below the ground as GNSS positions show it: give them"):
        refuse_absurd(Level(350.0, 5.0), "gcps")


def test_on_one_line_the_height_above_take_off_tells_roughly():
    block, control, positions = scene(strips=1, gnss=48.0)
    assert level_of(block, control, positions, []) is None
    flown = [Photograph(v.name, 1, "x", 4000, 3000, "c", relative_height=39.0) for v in block.views]
    level = level_of(block, control, positions, flown)
    # 4 + 48 + 40 m up and 39 m above take-off: 53 m, and the points' median is 4.8 m.
    assert level.above == pytest.approx(53.0 - 4.8, abs=0.6)
    assert level.differs
    assert not level_of(*scene(strips=1, gnss=20.0), flown).differs  # the take-off may have been that much higher


def test_nothing_to_compare():
    block, control, positions = scene()
    assert level_of(block, Control(), positions, []) is None
    none = Gnss(np.zeros(0, int), np.zeros((0, 3)), np.zeros((0, 2)), False, np.zeros(3))
    assert level_of(block, control, none, []) is None
    # A block that is not oriented yet, as the comparison of inputs checks it beforehand.
    still = replace(block, views=tuple(View(v.name, v.camera, np.eye(3), np.zeros(3)) for v in block.views))
    assert level_of(still, control, positions, []) is None
    check_unit(still, control)
