"""The seven-parameter similarity: exact cases, then coverage and robustness by simulation."""

import numpy as np
import pytest
from scipy import stats
from strandline.core.errors import NotEnoughData
from strandline.core.orientation.similarity import Shared, Similarity, design_matrix, fit, umeyama

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # 90 degrees about z: x to y, y to -x
TRUTH = Similarity(20.0, QUARTER, np.array([100.0, 50.0, 5.0]))
# Six targets on a beach of 200 x 40 m with 3 m of relief, in a free frame of a twentieth of that.
BEACH = np.array([[0, 0, 0], [5, 0.2, 0.05], [10, 0, 0.1], [0, 2, 0.15], [5, 1.8, 0.1], [10, 2, 0.0]], float)
SIGMAS = np.array([0.01, 0.01, 0.02])


def covariances(count, sigmas=SIGMAS):
    return np.tile(np.diag(np.square(sigmas)), (count, 1, 1))


def test_umeyama_of_a_tetrahedron_by_hand():
    model = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    # Scaled by 2, turned by 90 degrees about z, shifted by (10, 20, 30).
    ground = np.array([[10, 20, 30], [10, 22, 30], [8, 20, 30], [10, 20, 32]], float)
    similarity = umeyama(model, ground)
    assert similarity.scale == pytest.approx(2.0, abs=1e-12)
    assert similarity.rotation == pytest.approx(QUARTER, abs=1e-12)
    assert similarity.shift == pytest.approx([10, 20, 30], abs=1e-12)


def test_umeyama_by_hand_with_misfit():
    # Two opposite corners of a square drawn out to 3, the others left at 1.
    model = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], float)
    ground = np.array([[3, 0, 0], [0, 1, 0], [-3, 0, 0], [0, -1, 0]], float)
    # The covariance is diag(6, 2, 0) / 4 and the model's spread 1, so the scale is (6 + 2) / 4 = 2.
    similarity = umeyama(model, ground)
    assert similarity.scale == pytest.approx(2.0)
    assert similarity.rotation == pytest.approx(np.eye(3))
    assert np.abs(similarity.apply(model) - ground).max() == pytest.approx(1.0)


def test_umeyama_never_mirrors():
    model = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    assert np.linalg.det(umeyama(model, model * [1, 1, -1]).rotation) == pytest.approx(1.0)


def test_points_in_a_plane_are_enough():
    model = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [3, 2, 0]], float)
    assert umeyama(model, TRUTH.apply(model)).rotation == pytest.approx(QUARTER, abs=1e-9)


@pytest.mark.parametrize("model", [[[0, 0, 0], [1, 1, 1], [3, 3, 3], [4, 4, 4]], [[0, 0, 0], [1, 0, 0]]])
def test_a_line_or_two_points_are_not(model):
    model = np.array(model, float)
    with pytest.raises(NotEnoughData, match="one line"):
        umeyama(model, TRUTH.apply(model))


def test_design_matrix_is_the_derivative():
    pivot, point = np.array([10.0, 20.0, 3.0]), np.array([[14.0, 25.0, 5.0]])
    still = Similarity(1.0, np.eye(3), np.zeros(3))
    design = design_matrix(point, pivot)[0]
    for k in range(7):
        change = np.zeros(7)
        change[k] = 1e-6
        moved = still.moved(change, pivot).apply(point)[0] - still.moved(-change, pivot).apply(point)[0]
        assert moved / 2e-6 == pytest.approx(design[:, k], abs=1e-8)


def test_exact_points_give_the_exact_similarity():
    solved = fit(BEACH, TRUTH.apply(BEACH), covariances(6))
    assert solved.similarity.scale == pytest.approx(20.0, rel=1e-9)
    assert solved.similarity.rotation == pytest.approx(QUARTER, abs=1e-9)
    assert np.abs(solved.residuals).max() < 1e-8
    assert solved.redundancy == 11


@pytest.mark.parametrize(("scaled", "trust"), [(1.0, True), (180.0, True), (30.0, False)])
def test_covariance_covers_the_truth(scaled, trust):
    """The 95 % region (Fisher's where the variance is estimated) holds the truth in about 95 % of 400 blocks of six points.

    Binomial scatter is 1.1 %. Known sigmas are never taken for too large, which raises the share by up to 2.5 %; Huber's weights
    lose up to 3 % at 11 degrees of freedom.
    """
    rng = np.random.default_rng(1)
    place = TRUTH.apply(np.array([[7.0, 1.0, 0.1]]))
    inside = 0
    for _ in range(400):
        ground = TRUTH.apply(BEACH) + rng.normal(size=(6, 3)) * SIGMAS * scaled
        solved = fit(BEACH, ground, covariances(6), trust=trust)
        error = (solved.similarity.apply(np.array([[7.0, 1.0, 0.1]])) - place)[0]
        square = error @ np.linalg.solve(solved.uncertainty(place)[0], error)
        limit = stats.chi2.ppf(0.95, 3) if scaled == 1.0 else 3 * stats.f.ppf(0.95, 3, solved.redundancy)
        inside += square <= limit
    assert 0.91 < inside / 400 < 0.985


def test_uncertainty_grows_away_from_the_points():
    solved = fit(BEACH, TRUTH.apply(BEACH), covariances(6))
    middle, far = np.sqrt(np.diagonal(solved.uncertainty(TRUTH.apply(np.array([[5, 1, 0], [5, 40, 0]]))), axis1=1, axis2=2))
    assert middle[2] == pytest.approx(0.02 / np.sqrt(6), rel=0.2)  # in the middle the mean of six heights
    # Across the narrow beach the tilt is known from a lever of +-20 m only: 780 m away it is 780 / 20 times the mean's sigma.
    assert far[2] == pytest.approx(middle[2] * 780 / 20, rel=0.25)


def test_a_blunder_hardly_moves_the_rest():
    rng = np.random.default_rng(2)
    ground = TRUTH.apply(BEACH) + rng.normal(size=(6, 3)) * SIGMAS
    clean = fit(BEACH, ground, covariances(6))
    ground[4, 2] += 3.0
    solved = fit(BEACH, ground, covariances(6))
    moved = solved.similarity.apply(BEACH) - clean.similarity.apply(BEACH)
    assert np.abs(moved).max() < 0.08  # bounded by a few of its sigmas; least squares moves by 1.5 m
    assert solved.weights[4, 1] < 0.05
    assert solved.weights[[0, 1, 2, 3, 5]].min() > 0.3


def test_a_shared_error_takes_part_in_the_covariance():
    rng = np.random.default_rng(3)
    ground = TRUTH.apply(BEACH) + rng.normal(size=(6, 3)) * 0.1
    shared = Shared(np.ones(6, bool), np.array([2.0, 2.0, 10.0]))
    solved = fit(BEACH, ground, covariances(6, [1, 1, 1]), shared=shared, trust=False)
    sigmas = np.sqrt(np.diag(solved.covariance))
    assert sigmas[:3] == pytest.approx([2.0, 2.0, 10.0], rel=0.01)
    assert np.sqrt(solved.factor) == pytest.approx(0.1, rel=0.35)  # 11 degrees of freedom: 21 % of scatter


def test_a_free_shared_error_leaves_the_level_to_the_others():
    ground = TRUTH.apply(BEACH)
    ground[1:] += [3.0, -2.0, 30.0]
    mask = np.array([False] + [True] * 5)
    solved = fit(BEACH, ground, covariances(6), shared=Shared(mask, np.full(3, np.inf)))
    assert solved.similarity.apply(BEACH) == pytest.approx(TRUTH.apply(BEACH), abs=1e-5)
    assert solved.shared == pytest.approx([3.0, -2.0, 30.0], abs=1e-5)
