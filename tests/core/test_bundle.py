"""Kernels of the bundle adjustment against hand-made derivatives and dense normal equations."""

import numpy as np
import pytest
from strandline.core.block import View
from strandline.core.camera import Camera
from strandline.core.orientation import bundle, interior
from strandline.core.orientation.cameras import Cameras, Rays, rotations
from strandline.core.orientation.collinearity import project
from strandline.core.orientation.evenness import even_choice

CAMERA = Camera("FULL_OPENCV", 1800, 1350, (1650, 1655, 906, 671, -0.06, 0.035, 4e-4, -3e-4, 0.01, 0.02, -0.01, 0.005))
NADIR = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def projected(point, rotation, centre, brown):
    out = np.empty(2), np.empty((2, 3)), np.empty((2, 6)), np.empty((2, 12))
    assert project(point, rotation, centre, brown, *out)
    return out


def derivative(function, count, step=1e-6):
    return np.stack([(function(step * e) - function(-step * e)) / (2 * step) for e in np.eye(count)], axis=1)


@pytest.fixture
def place():
    rotation = rotations(np.array([[0.1, -0.05, 0.3]]))[0] @ NADIR
    return np.array([8.0, -5.0, 1.0]), rotation, np.array([1.0, 2.0, 50.0]), CAMERA.brown()


def test_pixels_are_those_of_the_camera(place):
    point, rotation, centre, brown = place
    view = View("a", CAMERA, rotation, -rotation @ centre)
    assert projected(*place)[0] == pytest.approx(view.project(point[None])[0], abs=1e-9)


def test_derivatives_are_those_of_small_differences(place):
    """Central differences of 1e-6 are good to 1e-7 of the derivative."""
    point, rotation, centre, brown = place
    _, by_point, by_pose, by_brown = projected(*place)
    assert by_point == pytest.approx(
        derivative(lambda d: projected(point + d, rotation, centre, brown)[0], 3), rel=1e-6, abs=1e-6
    )

    def posed(d):
        return projected(point, rotations(d[None, :3])[0] @ rotation, centre + d[3:], brown)[0]

    assert by_pose == pytest.approx(derivative(posed, 6), rel=1e-6, abs=1e-5)
    assert by_brown == pytest.approx(
        derivative(lambda d: projected(point, rotation, centre, brown + d)[0], 12), rel=1e-6, abs=1e-5
    )


def test_what_lies_behind_or_beyond_the_fold_is_not_seen(place):
    point, rotation, centre, brown = place
    out = np.empty(2), np.empty((2, 3)), np.empty((2, 6)), np.empty((2, 12))
    assert not project(centre + [0.0, 0.0, 5.0], rotation, centre, brown, *out)
    folding = brown.copy()
    folding[4:] = 0.0
    folding[4] = -0.5  # r (1 - r^2 / 2) falls from r = 0.816 on
    level = np.array([0.0, 0.0, 0.0])
    assert project(level + [0.8, 0.0, 0.0], NADIR, np.array([0.0, 0.0, 1.0]), folding, *out)
    assert not project(level + [0.83, 0.0, 0.0], NADIR, np.array([0.0, 0.0, 1.0]), folding, *out)


def test_rotations_of_any_size():
    vectors = np.array([[0.0, 0.0, 0.0], [1e-8, 0.0, 0.0], [0.0, 0.0, np.pi / 2], [0.4, -2.0, 1.0]])
    made = rotations(vectors)
    assert made[2] == pytest.approx(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]), abs=1e-12)
    assert made @ made.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(3), (4, 1, 1)), abs=1e-12)


@pytest.fixture(scope="module")
def small():
    """Four views of two cameras, nine points, all seen by all but for a few."""
    rng = np.random.default_rng(1)
    centres = np.array([[0, 0, 30.0], [6, 0, 31.0], [0, 6, 29.5], [6, 6, 30.2]])
    turns = rotations(rng.normal(size=(4, 3)) * 0.05) @ NADIR
    camera = np.array([0, 0, 1, 1])
    cameras = [
        Camera("OPENCV", 1800, 1350, (1650, 1655, 906, 671, -0.06, 0.035, 4e-4, -3e-4)),
        Camera("SIMPLE_RADIAL", 1600, 1200, (1400, 800, 600, 0.02)),
    ]
    basis, free = interior.merged({i: interior.free(c, None) for i, c in enumerate(cameras)})
    brown = np.array([c.brown() for c in cameras])
    made = Cameras(turns, centres, camera, brown, basis, free)
    points = np.column_stack([rng.uniform(-2, 8, (9, 2)), rng.uniform(-1, 1, 9)])
    seen = [[v for v in range(4) if (p + v) % 4] for p in range(9)]
    start = np.concatenate([[0], np.cumsum([len(s) for s in seen])])
    view = np.concatenate(seen)
    xy = []
    for p, views in enumerate(seen):
        xy += [projected(points[p], turns[v], centres[v], brown[camera[v]])[0] + rng.normal(size=2) * 0.3 for v in views]
    return made, Rays(start.astype(np.int64), view.astype(np.int64), np.array(xy)), points


def dense(cameras, rays, points, weight):
    """Return the design (2m, columns + 3p), residuals (2m,) and weights (2m,)."""
    size = cameras.columns
    design, left = np.zeros((2 * len(rays.view), size + 3 * len(points))), np.zeros(2 * len(rays.view))
    for i, (p, v) in enumerate(zip(rays.point, rays.view, strict=True)):
        c = cameras.camera[v]
        at, by_point, by_pose, by_brown = projected(points[p], cameras.rotation[v], cameras.centre[v], cameras.brown[c])
        part = slice(2 * i, 2 * i + 2)
        first, free = cameras.interior_column[c], cameras.free[c]
        design[part, 6 * v : 6 * v + 6] = by_pose
        design[part, first : first + free] = by_brown @ cameras.basis[c, :, :free]
        design[part, size + 3 * p : size + 3 * p + 3] = by_point
        left[part] = rays.xy[i] - at
    return design, left, np.repeat(weight, 2)


def arguments(cameras, rays, points, weight):
    return rays.arrays, weight, points, cameras.arrays


def test_reduced_equations_are_schurs_complement(small):
    cameras, rays, points = small
    weight = np.linspace(0.5, 2.0, len(rays.view))
    design, left, w = dense(cameras, rays, points, weight)
    normal, right = design.T @ (w[:, None] * design), design.T @ (w * left)
    n = cameras.columns
    back = np.linalg.solve(normal[n:, n:], np.column_stack([normal[n:, :n], right[n:]]))
    matrix, side, residuals = bundle.reduce(*arguments(cameras, rays, points, weight), cameras.interior_column, n)
    full = np.triu(matrix) + np.triu(matrix, 1).T
    wanted = normal[:n, :n] - normal[:n, n:] @ back[:, :n]
    scale = np.sqrt(np.outer(np.diag(normal)[:n], np.diag(normal)[:n]))
    assert full / scale == pytest.approx(wanted / scale, abs=1e-10)
    assert side / np.sqrt(np.diag(scale)) == pytest.approx(
        (right[:n] - normal[:n, n:] @ back[:, n]) / np.sqrt(np.diag(scale)), abs=1e-8
    )
    assert residuals.ravel() == pytest.approx(left, abs=1e-9)


def test_points_follow_and_their_covariance_is_the_whole_ones(small):
    cameras, rays, points = small
    weight = np.full(len(rays.view), 4.0)
    design, left, w = dense(cameras, rays, points, weight)
    n = cameras.columns
    prior = np.zeros(n + 3 * len(points))
    prior[:n] = 1e4  # something that holds the block in place
    normal = design.T @ (w[:, None] * design) + np.diag(prior)
    right = design.T @ (w * left)
    solved, whole = np.linalg.solve(normal, right), np.linalg.inv(normal)
    follows, held = bundle.influence(
        *arguments(cameras, rays, points, weight), cameras.interior_column, n, np.arange(len(points))
    )
    got = held + follows @ whole[:n, :n] @ follows.transpose(0, 2, 1)
    for p in range(len(points)):
        part = slice(n + 3 * p, n + 3 * p + 3)
        assert got[p] == pytest.approx(whole[part, part], rel=1e-6, abs=1e-12)
    alike = bundle.covariances(*arguments(cameras, rays, points, weight), cameras.interior_column, whole[:n, :n])
    assert alike == pytest.approx(got, rel=1e-9, abs=1e-14)
    moved = bundle.follow(*arguments(cameras, rays, points, weight), cameras.interior_column, solved[:n])
    assert (moved - points).ravel() == pytest.approx(solved[n:], rel=1e-6, abs=1e-9)


def test_intersection_finds_the_point_again(small):
    cameras, rays, points = small
    exact = np.array([
        projected(points[p], cameras.rotation[v], cameras.centre[v], cameras.brown[cameras.camera[v]])[0]
        for p, v in zip(rays.point, rays.view, strict=True)
    ])  # fmt: skip
    rays = Rays(rays.start, rays.view, exact)
    found, left = bundle.intersect(*arguments(cameras, rays, points + 0.5, np.ones(len(rays.view))), 8)
    assert found == pytest.approx(points, abs=1e-8)
    assert np.abs(left).max() < 1e-7


def test_two_runs_are_the_same_to_the_bit(small):
    cameras, rays, points = small
    weight = np.ones(len(rays.view))
    one = bundle.reduce(*arguments(cameras, rays, points, weight), cameras.interior_column, cameras.columns)
    two = bundle.reduce(*arguments(cameras, rays, points, weight), cameras.interior_column, cameras.columns)
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


def tracks(*seen):
    """Return the rays of points given as {view: (x, y)}."""
    start = np.concatenate([[0], np.cumsum([len(s) for s in seen])]).astype(np.int64)
    view = np.array([v for s in seen for v in s], np.int64)
    return Rays(start, view, np.array([xy for s in seen for xy in s.values()], float))


def test_an_even_choice_takes_long_tracks_and_leaves_no_patch_empty():
    """Two photographs; points 0 to 2 share a patch, and the longest of them is taken; point 3 alone fills another."""
    rays = tracks(
        *[{0: (1, 1), 1: (1, 1), 2: (1, 1), 3: (1, 1)}] * 60,  # links that are held
        {0: (12, 2), 1: (12, 2)}, {0: (13, 3), 1: (13, 3), 2: (13, 3)}, {0: (14, 3), 1: (14, 3)}, {0: (400, 300), 1: (401, 301)},
    )  # fmt: skip
    chosen = even_choice(rays, np.zeros(64), np.array([[480, 360]] * 4))  # patches of 10 pixels
    assert chosen[60:].tolist() == [False, True, False, True]
    assert chosen[:60].sum() == 50


def test_an_even_choice_keeps_every_link():
    """The only points that tie photograph 3 to the others lie in a patch that is full."""
    rays = tracks(*[{0: (5, 5), 1: (5, 5), 2: (5, 5)}] * 60, *[{2: (5, 5), 3: (5, 5)}] * 7)
    chosen = even_choice(rays, np.zeros(67), np.array([[480, 360]] * 4))
    assert chosen[60:].all()
