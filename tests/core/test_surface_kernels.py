"""The compiled kernels of the surface against plain references on small arrays."""

import numpy as np
import pytest
from strandline.core.camera import Camera
from strandline.core.surface.correlation import BLOCK, correlate, fill_costs
from strandline.core.surface.regularisation import DIRECTIONS, aggregate, decide, refine, regularise
from strandline.core.surface.sampling import inside, project, sample, visible

CAMERA = Camera("FULL_OPENCV", 64, 48, (70.0, 72.0, 31.0, 25.0, -0.05, 0.02, 1e-3, -2e-3, 0.01, 0.02, 0.01, 0.005))
LOOKING_DOWN = np.array([[1.0, 0, 0, 0.3], [0, -1, 0, -0.2], [0, 0, -1, 10.0]])
FLOAT32 = 1e-4  # relative rounding of sums over a window in 32 bits


def camera_arrays(camera=CAMERA):
    return camera.brown(), camera.fold_radius() ** 2


def test_project_agrees_with_the_camera():
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-3, 3, 50), rng.uniform(-3, 3, 50), rng.uniform(-1, 1, 50)])
    brown, fold2 = camera_arrays()
    found = np.array([project(LOOKING_DOWN, brown, fold2, *p) for p in points])
    expected = CAMERA.project(points @ LOOKING_DOWN[:, :3].T + LOOKING_DOWN[:, 3])
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_project_knows_what_is_behind_and_what_folds_back():
    brown, fold2 = camera_arrays()
    assert np.isnan(project(LOOKING_DOWN, brown, fold2, 0.0, 0.0, 11.0)).all()
    assert np.isnan(project(LOOKING_DOWN, brown, 0.01, 5.0, 0.0, 0.0)).all()


def test_sample_is_bilinear_between_pixel_centres():
    # f = 1, 10 m up: ground x m falls at pixel x / 10 * 100 + 5 with f = 100, and pixel centres are at .5.
    camera = Camera("PINHOLE", 10, 10, (100.0, 100.0, 5.0, 5.0))
    image = np.arange(100, dtype=np.float32).reshape(10, 10)
    matrix = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 10.0]])
    out = np.empty((2, 2), np.float32)
    brown, fold2 = camera.brown(), camera.fold_radius() ** 2
    # Cells of 0.1 m = one pixel, whose centres fall on corners of pixels: the mean of four.
    sample(image, np.array([1.0, 0, 0]), matrix, brown, fold2, -0.05, 0.05, 0.1, np.zeros((2, 2), np.float32), 0.0, out)
    np.testing.assert_allclose(out, [[49.5, 50.5], [59.5, 60.5]], atol=1e-3)
    # The same from a window that starts at column 2, row 1.
    window = np.ascontiguousarray(image[1:, 2:])
    sample(window, np.array([1.0, 2, 1]), matrix, brown, fold2, -0.05, 0.05, 0.1, np.zeros((2, 2), np.float32), 0.0, out)
    np.testing.assert_allclose(out, [[49.5, 50.5], [59.5, 60.5]], atol=1e-3)
    # Raised to half the distance the cells spread to two pixels.
    sample(image, np.array([1.0, 0, 0]), matrix, brown, fold2, -0.05, 0.05, 0.1, np.zeros((2, 2), np.float32), 5.0, out)
    np.testing.assert_allclose(out, [[49.5, 51.5], [69.5, 71.5]], atol=1e-3)


def test_sample_marks_what_is_outside():
    image = np.zeros((48, 64), np.float32)
    out = np.zeros((1, 3), np.float32)
    brown, fold2 = camera_arrays()
    sample(image, np.array([1.0, 0, 0]), LOOKING_DOWN, brown, fold2, -30.0, 10.5, 20.0, np.zeros((1, 3), np.float32), 0.0, out)
    assert np.isnan(out[0]).tolist() == [True, False, True]


def plain_score(views, seen, small, large, noise, knee):
    """Return the score cell by cell, as its docstring has it, in 64 bits."""
    m, rows, columns = views.shape
    out = np.full((rows - 2 * large, columns - 2 * large), np.nan)
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            r, c = y + large, x + large
            patches = {}
            for half in (small, large):
                patches[half] = views[:, r - half : r + half + 1, c - half : c + half + 1].reshape(m, -1).astype(float)
            used = [i for i in range(m) if seen[i, y, x] and not np.isnan(patches[large][i]).any()]
            if len(used) < 2:
                continue
            texture = np.mean([patches[small][i].var() for i in used])
            share = texture / (texture + knee * noise) if large > small else 0.0
            rho = {}
            for i in used:
                for j in used:
                    values = []
                    for half in (small, large):
                        a, b = patches[half][i], patches[half][j]
                        covariance = ((a - a.mean()) * (b - b.mean())).mean()
                        values.append(covariance / np.sqrt((a.var() + noise) * (b.var() + noise)))
                    rho[i, j] = share * values[0] + (1 - share) * values[1]
            weight = {i: max(0.1, np.mean([rho[i, j] for j in used if j != i])) for i in used}
            pairs = [(i, j) for i in used for j in used if i < j]
            total = sum(weight[i] * weight[j] for i, j in pairs)
            out[y, x] = sum(weight[i] * weight[j] * rho[i, j] for i, j in pairs) / total
    return out


@pytest.mark.parametrize(("small", "large"), [(1, 1), (2, 2), (3, 3), (4, 4), (5, 5), (1, 3), (2, 4)])
def test_correlate_equals_the_plain_score(small, large):
    rng = np.random.default_rng(1)
    common = rng.normal(0, 10, (20, 23))
    views = (common + rng.normal(0, 4, (4, 20, 23))).astype(np.float32)
    views[2, 12:, 15:] = np.nan
    seen = rng.random((4, 20 - 2 * large, 23 - 2 * large)) > 0.2
    score = np.empty(seen.shape[1:], np.float32)
    correlate(views, seen, small, large, 2.0, 12.0, score)
    expected = plain_score(views, seen, small, large, 2.0, 12.0)
    np.testing.assert_array_equal(np.isnan(score), np.isnan(expected))
    np.testing.assert_allclose(score, expected, atol=10 * FLOAT32)


def test_equal_views_score_their_share_of_signal():
    rng = np.random.default_rng(2)
    view = rng.normal(0, 3, (11, 11)).astype(np.float32)
    views = np.stack([view, 2 * view + 7])  # contrast and brightness do not matter but for the noise
    score = np.empty((1, 1), np.float32)
    variance = float(view.var())
    correlate(views, np.ones((2, 1, 1), bool), 5, 5, 0.0, 0.0, score)
    assert score[0, 0] == pytest.approx(1.0, abs=FLOAT32)
    correlate(views, np.ones((2, 1, 1), bool), 5, 5, 3.0, 0.0, score)
    expected = 2 * variance / np.sqrt((variance + 3) * (4 * variance + 3))
    assert score[0, 0] == pytest.approx(expected, rel=10 * FLOAT32)


def test_costs_of_blocks_are_those_of_single_planes():
    """A surface larger than a block, with bands that differ from cell to cell, against one plane per hypothesis."""
    rng = np.random.default_rng(3)
    camera = Camera("PINHOLE", 220, 200, (200.0, 200.0, 110.0, 100.0))
    brown, fold2 = camera.brown(), camera.fold_radius() ** 2
    matrices = [np.array([[1.0, 0, 0, dx], [0, -1, 0, 0], [0, 0, -1, 10.0]]) for dx in (-1.0, 0.0, 1.0)]
    images = [rng.normal(100, 20, (200, 220)).astype(np.float32) for _ in matrices]
    rows, columns, large, cell, step = BLOCK + 9, BLOCK + 5, 2, 0.05, 0.1
    base = rng.normal(0, 0.1, (rows + 2 * large, columns + 2 * large)).astype(np.float32)
    first = rng.integers(-2, 1, (rows, columns)).astype(np.int32)
    count = rng.integers(1, 4, (rows, columns)).astype(np.int32)
    offset = (np.cumsum(count.ravel()) - count.ravel()).reshape(rows, columns)
    costs = np.full(int(count.sum()), np.nan, np.float32)
    seen = np.ones((3, rows, columns), bool)
    seen[0, :5] = False
    west, north = -2.0, 2.0
    fill_costs(
        np.concatenate([i.ravel() for i in images]),
        np.arange(3) * images[0].size,
        np.array([i.shape for i in images]),
        np.tile([1.0, 0, 0], (3, 1)),
        np.array(matrices),
        np.tile(brown, (3, 1)),
        np.full(3, fold2),
        west,
        north,
        cell,
        base,
        step,
        first,
        count,
        offset,
        seen,
        large,
        large,
        1.0,
        0.0,
        costs,
    )
    planes = {}
    for d in range(-2, 4):
        views = np.empty((3, *base.shape), np.float32)
        for i in range(3):
            sample(images[i], np.array([1.0, 0, 0]), matrices[i], brown, fold2, west, north, cell, base, d * step, views[i])
        planes[d] = np.empty((rows, columns), np.float32)
        correlate(views - 100.0, seen, large, large, 1.0, 0.0, planes[d])
    for r, c in rng.integers(0, [rows, columns], (300, 2)):
        for k in range(count[r, c]):
            score = planes[first[r, c] + k][r, c]
            expected = 1.0 if np.isnan(score) else 1.0 - score
            assert costs[offset[r, c] + k] == pytest.approx(expected, abs=1e-3)


def plain_paths(costs, base, step, down, right, p1, p2):
    """Return the least costs along one direction, from dictionaries of hypothesis to cost."""
    rows, columns = base.shape
    out = {}
    down_rows = range(rows) if down >= 0 else reversed(range(rows))
    for r, c in [(r, c) for r in down_rows for c in (range(columns) if right >= 0 else reversed(range(columns)))]:
        before = (r - down, c - right)
        if before not in out:
            out[r, c] = dict(costs[r, c])
            continue
        there = out[before]
        least = min(there.values())
        rise = (base[r, c] - base[before]) / step
        shift = 0 if abs(rise) <= 1.5 else int(np.rint(rise))
        out[r, c] = {}
        for d, cost in costs[r, c].items():
            options = [least + p2]
            for change, penalty in ((0, 0.0), (-1, p1), (1, p1)):
                if d + shift + change in there:
                    options.append(there[d + shift + change] + penalty)
            out[r, c][d] = cost + min(options) - least
    return out


@pytest.mark.parametrize(("down", "right"), DIRECTIONS)
def test_aggregate_equals_the_plain_recursion(down, right):
    rng = np.random.default_rng(4)
    rows, columns, step = 6, 7, 0.1
    base = rng.normal(0, 0.1, (rows, columns)).astype(np.float32)
    base[:, 4:] += 0.6  # a jump of six steps
    first = rng.integers(-4, -1, (rows, columns)).astype(np.int32)
    count = rng.integers(3, 9, (rows, columns)).astype(np.int32)
    offset = (np.cumsum(count.ravel()) - count.ravel()).reshape(rows, columns)
    costs = rng.random(int(count.sum())).astype(np.float32)
    total = np.zeros_like(costs)
    aggregate(costs, offset, first, count, base, step, down, right, 0.1, 0.4, total)
    named = {
        (r, c): {int(first[r, c]) + k: float(costs[offset[r, c] + k]) for k in range(count[r, c])}
        for r in range(rows)
        for c in range(columns)
    }
    expected = plain_paths(named, base, step, down, right, 0.1, 0.4)
    for (r, c), costs_here in expected.items():
        for k in range(count[r, c]):
            assert total[offset[r, c] + k] == pytest.approx(costs_here[int(first[r, c]) + k], abs=1e-5)


def test_decide_finds_the_vertex_of_a_parabola():
    # Costs 0.3 + 2 (z - 0.13)^2 at z = -0.2 .. 0.3: vertex 0.13.
    z = np.arange(-2, 4) * 0.1
    costs = (0.3 + 2 * (z - 0.13) ** 2).astype(np.float32)
    one = np.ones((1, 1))
    height, doubt = decide(
        costs, costs, np.zeros((1, 1), np.int64), np.full((1, 1), -2, np.int32), (6 * one).astype(np.int32), 5 * one, 0.1
    )
    assert height[0, 0] == pytest.approx(5.13, abs=1e-4)
    assert doubt[0, 0] == 0


def test_refine_finds_the_vertex_its_score_and_its_curvature():
    z = np.arange(-3, 4) * 0.05
    costs = np.tile(0.3 + 2 * (z - 0.06) ** 2, (9, 9, 1)).astype(np.float32)
    correction, score, curvature = refine(costs, 0.05)
    np.testing.assert_allclose(correction, 0.06, atol=1e-4)
    np.testing.assert_allclose(score, 0.7, atol=1e-3)  # at the hypothesis next to the vertex
    np.testing.assert_allclose(curvature, 4.0, rtol=1e-3)
    # A minimum at the end of the search corrects nothing.
    correction, _, _ = refine(np.tile(np.linspace(1, 0, 7), (9, 9, 1)).astype(np.float32), 0.05)
    assert (correction == 0).all()


def test_decide_stays_on_the_base_when_nothing_speaks():
    flat = np.ones(7, np.float32)
    base = np.full((1, 1), 3.0, np.float32)
    height, *_ = decide(
        flat, flat, np.zeros((1, 1), np.int64), np.full((1, 1), -4, np.int32), np.full((1, 1), 7, np.int32), base, 0.5
    )
    assert height[0, 0] == 3.0


def test_regularisation_mends_a_single_wrong_cell_and_keeps_a_step():
    rows, columns, count = 15, 16, 21
    z = np.arange(count)
    truth = np.where(np.arange(columns) < 8, 5, 15)
    costs = np.abs(z[None, None, :] - truth[None, :, None]) / count * np.ones((rows, 1, 1))
    costs[7, 3] = 0.2
    costs[7, 3, 18] = 0.0
    shape = np.zeros((rows, columns), np.float32)
    height, doubt = regularise(
        costs.astype(np.float32).ravel(),
        np.arange(rows * columns, dtype=np.int64).reshape(rows, columns) * count,
        np.zeros((rows, columns), np.int32),
        np.full((rows, columns), count, np.int32),
        shape,
        step=1.0,
        small=0.05,
        large=0.3,
    )
    assert np.abs(height - truth).max() < 0.5
    assert doubt[7, 3] == 13


def test_a_wall_hides_what_lies_behind():
    surface = np.zeros((1, 40), np.float32)
    surface[0, 20] = 5.0
    # The camera stands 10 m high above column 30 (1 m cells): the shadow of 5 m reaches 10 cells beyond the wall.
    seen = visible(surface, 1.0, 0.0, 0.5, np.array([30.5, 0.0, 10.0]), 0.1, 100)
    assert seen[0, 20:].all()
    hidden = np.flatnonzero(~seen[0])
    assert hidden.tolist() == list(range(11, 20))
    # Followed for three cells only, it hides three.
    near = visible(surface, 1.0, 0.0, 0.5, np.array([30.5, 0.0, 10.0]), 0.1, 3)
    assert np.flatnonzero(~near[0]).tolist() == [17, 18, 19]


def test_inside_is_the_frame():
    camera = Camera("PINHOLE", 10, 10, (100.0, 100.0, 5.0, 5.0))
    matrix = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 10.0]])
    found = inside(np.array([10.0, 10.0]), matrix, camera.brown(), np.inf, -1.0, 0.05, 0.1, np.zeros((1, 20), np.float32))
    assert np.flatnonzero(found[0]).tolist() == list(range(5, 15))
