"""Painted and coded targets with a known centre, found to a small part of a pixel; and nothing found where there is none."""

import cv2
import numpy as np
import pytest
from strandline.core.orientation.codes import DICTIONARIES, code_of, find_code
from strandline.core.orientation.targetfit import fit_target, starts_at
from strandline.core.orientation.targets import ACCEPT, find_target

SIZE, FINE = 160, 4  # px of a picture, samples per pixel each way
BLACK, WHITE = 0.25, 1.9  # relative to sand
CIRCLE, LARGEST = 32.0, 60.0


def quadrants(u, v):
    return np.where(u * v > 0, WHITE, BLACK), (abs(u) < 1) & (abs(v) < 1)


def cross(u, v):
    return np.where((abs(u) < 0.14) | (abs(v) < 0.14), WHITE, BLACK), (abs(u) < 1) & (abs(v) < 1)


def black_cross(u, v):
    return np.where((abs(u) < 0.14) | (abs(v) < 0.14), BLACK, WHITE), (abs(u) < 1) & (abs(v) < 1)


def square(u, v):
    return np.full_like(u, BLACK), (abs(u) < 1) & (abs(v) < 1)


def disc(u, v):
    return np.full_like(u, BLACK), u * u + v * v < 1


def bar(u, v):
    return np.full_like(u, BLACK), (abs(u) < 4) & (abs(v) < 0.25)


def halves(u, v):
    return np.where(u > 0, WHITE, BLACK), (abs(u) < 1) & (abs(v) < 1)


def sand_alone(u, v):
    return np.zeros_like(u), np.zeros(u.shape, bool)


def code(family, number):
    dictionary = cv2.aruco.getPredefinedDictionary(DICTIONARIES[family])
    modules = dictionary.markerSize + 2
    bits = np.pad(cv2.aruco.generateImageMarker(dictionary, number, modules) > 0, 1, constant_values=True)

    def paint(u, v):
        column, row = (np.floor((w + 1) * modules / 2 + 1).astype(int) for w in (u, v))
        inside = (row >= 0) & (column >= 0) & (row < modules + 2) & (column < modules + 2)
        return np.where(bits[row.clip(0, modules + 1), column.clip(0, modules + 1)], WHITE, BLACK), inside

    return paint


def sand(rng):
    grains, patches = (cv2.GaussianBlur(rng.standard_normal((SIZE, SIZE)), (0, 0), s) for s in (1.5, 8.0))
    return 1 + 0.04 * grains / grains.std() + 0.03 * patches / patches.std()


def rendered(paint, half, rng, *, lean=0.15, noise=0.02, blur=0.8, gamma=1.0, at=None, on=None):
    """A picture of a target of half a side ``half`` px, turned at random, seen aslant; its centre from the corner."""
    centre = SIZE / 2 + rng.uniform(-1, 1, 2) if at is None else np.asarray(at, float)
    turn = rng.uniform(0, 2 * np.pi)
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    slant = np.array([[1, rng.uniform(-lean, lean)], [0, 1 - rng.uniform(0, lean)]])
    fall = rng.uniform(-lean, lean, 2) * 0.3
    image_from_target = np.eye(3)
    image_from_target[:2, :2] = turned @ slant * half + np.outer(centre, fall)
    image_from_target[2, :2], image_from_target[:2, 2] = fall, centre
    grid = (np.arange(SIZE * FINE) + 0.5) / FINE
    x, y = np.meshgrid(grid, grid)
    u, v, w = np.linalg.inv(image_from_target) @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    light, inside = paint((u / w).reshape(x.shape), (v / w).reshape(x.shape))
    ground = np.kron(sand(rng) if on is None else on, np.ones((FINE, FINE)))
    image = np.where(inside, light, ground).reshape(SIZE, FINE, SIZE, FINE).mean((1, 3))
    image = cv2.GaussianBlur(image, (0, 0), blur) + noise * rng.standard_normal((SIZE, SIZE))
    return (np.clip(image, 0, None) ** gamma).astype(np.float32), centre


def errors(paint, half, count=6, **options):
    """Errors (n, 2) of the accepted of ``count`` targets, and their claimed sigmas."""
    rng = np.random.default_rng(7)
    found = []
    for _ in range(count):
        image, centre = rendered(paint, half, rng, **options)
        mark = find_target(image, centre + rng.normal(0, 8, 2), CIRCLE, LARGEST)
        if mark is not None and mark.score >= ACCEPT:
            found.append((mark.x - centre[0], mark.y - centre[1], mark.sigma))
    return np.array(found).reshape(-1, 3)


@pytest.mark.parametrize(
    ("paint", "half", "limit"),
    # Two per cent of noise on so large a step lets four edges of 2 x 10 pixels fix a centre to about 0.01 px.
    [(quadrants, 10, 0.03), (quadrants, 18, 0.02), (quadrants, 40, 0.02), (cross, 25, 0.05), (black_cross, 25, 0.05)],
)
def test_a_target_is_found_to_a_small_part_of_a_pixel(paint, half, limit):
    found = errors(paint, half)
    assert len(found) >= 5
    assert np.sqrt(np.mean(found[:, :2] ** 2)) < limit
    assert np.sqrt(np.mean((found[:, :2] / found[:, 2:]) ** 2)) < 1.5


def test_a_tone_curve_and_strong_blur_and_noise_do_not_move_the_centre():
    found = errors(quadrants, 18, gamma=0.45, blur=2.0, noise=0.08)
    assert len(found) == 6
    assert np.abs(found[:, :2].mean(axis=0)).max() < 0.1
    assert np.sqrt(np.mean(found[:, :2] ** 2)) < 0.15


@pytest.mark.parametrize("paint", [square, disc, bar, halves, sand_alone])
@pytest.mark.parametrize("half", [8, 25])
def test_nothing_is_found_where_there_is_no_target(paint, half):
    assert len(errors(paint, half, count=4)) == 0


def test_two_targets_in_the_circle_are_not_told_apart():
    rng = np.random.default_rng(1)
    first, centre = rendered(quadrants, 14, rng, at=(50, 80), noise=0.0, blur=0.01)
    image, _ = rendered(quadrants, 14, rng, at=(115, 80), on=first.astype(float))
    alone = find_target(image, centre, 20.0, LARGEST)
    assert alone is not None
    assert alone.score >= ACCEPT
    both = find_target(image, np.array([82.0, 80.0]), 45.0, LARGEST)
    assert both is None or both.score < 0.3


def test_the_place_counts_from_the_corner_of_the_top_left_pixel():
    image = np.zeros((60, 60), np.float32)
    image[:30, :30] = image[30:, 30:] = 1.0  # the corner of four pixels is at (30, 30)
    mark = find_target(image, np.array([31.0, 28.0]), 8.0, 20.0)
    assert mark is not None
    assert mark.x == pytest.approx(30.0, abs=0.01)
    assert mark.y == pytest.approx(30.0, abs=0.01)


def test_the_fit_finds_lines_and_contrast():
    x, y = np.meshgrid(np.arange(61.0), np.arange(61.0))
    first, second = np.radians(20.0), np.radians(95.0)
    s1, s2 = (np.cos(t) * (y - 30.3) - np.sin(t) * (x - 29.6) for t in (first, second))
    image = (5.0 + 2.0 * np.tanh(s1) * np.tanh(s2)).astype(np.float32)
    (start,) = starts_at("quadrants", 31.0, 29.0, np.radians(115.0), 15.0)
    fitted = fit_target(image, "quadrants", start, 15.0)
    assert fitted is not None
    assert fitted.centre == pytest.approx([29.6, 30.3], abs=0.005)
    assert sorted(np.degrees(fitted.parameters[2:4]) % 180) == pytest.approx([20.0, 95.0], abs=0.2)
    assert (fitted.level, fitted.gain) == pytest.approx((5.0, 2.0), abs=0.02)
    assert fitted.likeness > 0.995


@pytest.mark.parametrize("family", ["ArUco 4x4", "ArUco 6x6", "AprilTag 16h5", "AprilTag 36h11"])
def test_a_code_is_read_and_its_diagonals_meet_in_the_mark(family):
    rng = np.random.default_rng(3)
    marks = []
    for number in (0, 7, 22, 29):
        image, centre = rendered(code(family, number), 16, rng, lean=0.25)
        mark = find_code(image, number, centre + rng.normal(0, 8, 2), 40.0)
        assert mark is not None
        assert mark.score > 0.9
        assert mark.what == f"{family}, number {number}"
        marks.append([mark.x - centre[0], mark.y - centre[1]])
        assert find_code(image, number + 1, centre, 40.0) is None
        assert find_code(image, number, centre + 60.0, 40.0) is None
    assert np.sqrt(np.mean(np.square(marks))) < 0.04


def test_a_code_seen_twice_is_not_told_apart():
    rng = np.random.default_rng(4)
    first, _ = rendered(code("ArUco 4x4", 5), 14, rng, at=(50, 80), noise=0.0, blur=0.01)
    image, _ = rendered(code("ArUco 4x4", 5), 14, rng, at=(115, 80), on=first.astype(float))
    mark = find_code(image, 5, np.array([82.0, 80.0]), 60.0)
    assert mark is not None
    assert mark.score < 0.3


def test_no_code_in_sand():
    assert find_code(sand(np.random.default_rng(5)).astype(np.float32), 3, np.array([80.0, 80.0]), 60.0) is None


def test_a_name_tells_the_code_by_the_number_it_ends_with():
    assert [code_of(n) for n in ("12", "GCP_007", "tag 3 ", "G1b", "north", "")] == [12, 7, 3, None, None, None]
