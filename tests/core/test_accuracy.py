"""Root mean square errors, and the test for a dome: exact by hand, then false alarms and power over many surveys."""

import numpy as np
import pytest
from strandline.core.orientation.accuracy import alti, doming, plani
from strandline.core.orientation.similarity import fit

GRID = np.array([[0, 0], [10, 0], [-10, 0], [0, 10], [0, -10], [5, 5], [-5, -5], [5, -5], [-5, 5]], float)
# Ten targets of a beach of 60 x 40 m; those in the corners have three marks, the others eight. The last four are check points.
TARGETS = np.array([[-28, -18], [28, -18], [28, 18], [-28, 18], [0, 3], [12, -5], [-15, 4], [8, 12], [-5, -12], [20, 2]], float)
SIGMAS = np.array([0.09, 0.09, 0.09, 0.09, 0.03, 0.03, 0.03, 0.03, 0.03, 0.03])
SURVEYS = 800
# Binomial scatter of a true rate of 5 % over the surveys is 0.8 %; three of these are allowed.
FALSE_ALARMS = 0.05 + 0.023


def test_root_mean_squares_by_hand():
    errors = np.array([[3.0, 4.0, 1.0], [0.0, 0.0, -7.0]])
    assert plani(errors) == pytest.approx(np.sqrt(12.5))
    assert alti(errors) == pytest.approx(5.0)
    assert plani(np.zeros((0, 3))) is None


@pytest.mark.parametrize("sigmas", [None, np.full(9, 0.02), np.linspace(0.01, 0.05, 9)])
def test_an_exact_dome_is_found_whatever_the_weights(sigmas):
    rise = 0.002 * np.sum(GRID**2, axis=1)  # 0.2 m at 10 m from the middle
    dome = doming(GRID, 0.3 + 0.01 * GRID[:, 0] - 0.004 * GRID[:, 1] + rise, sigmas, 0.01)
    assert dome.amplitude == pytest.approx(0.2)
    assert dome.significant


def test_its_sigma_by_hand():
    """A point in the middle against eight on a circle: the rise is their mean minus it, its variance s^2 (1/8 + 1)."""
    angle = np.arange(8) * np.pi / 4
    places = np.concatenate([[[0.0, 0.0]], 20 * np.stack([np.cos(angle), np.sin(angle)], axis=1)])
    heights = np.array([0.05, *np.full(8, 0.02)])
    dome = doming(places, heights, np.full(9, 0.04), 0.0)
    assert dome.amplitude == pytest.approx(-0.03)
    assert dome.sigma == pytest.approx(0.04 * np.sqrt(1.125))
    assert not dome.significant
    # A middle that is known four times worse counts accordingly.
    assert doming(places, heights, np.array([0.16, *np.full(8, 0.04)]), 0.0).sigma == pytest.approx(0.04 * np.sqrt(0.125 + 16))


def test_what_does_not_matter_or_is_not_determined():
    slight = 1e-6 * np.sum(GRID**2, axis=1)
    assert doming(GRID, slight, None, 0.0).significant
    assert not doming(GRID, slight, None, 0.01).significant  # below a pixel on the ground
    assert doming(GRID[:7], np.zeros(7), None, 0.01) is None
    assert doming(np.zeros((9, 2)), np.zeros(9), None, 0.01) is None
    line = np.stack([np.arange(9.0), np.zeros(9)], axis=1)
    assert doming(line, np.zeros(9), None, 0.01) is None


def test_a_bend_that_is_expected_is_no_alarm():
    """A dome of 30 cm is beyond chance where points err by 4 cm, and not where the block's own sigma of a dome is 20 cm."""
    rise = np.sum(GRID**2, axis=1) / 100.0
    alone = doming(GRID, 0.3 * rise, np.full(9, 0.04), 0.0)
    expected = doming(GRID, 0.3 * rise, np.full(9, 0.04), 0.0, 0.2**2 * np.outer(rise, rise))
    assert alone.significant
    assert not expected.significant
    assert expected.amplitude == alone.amplitude
    assert expected.sigma == pytest.approx(np.hypot(alone.sigma, 0.2))
    level = doming(GRID, 0.3 * rise, np.full(9, 0.04), 0.0, np.ones((9, 9)))
    assert level.sigma == pytest.approx(alone.sigma)  # a level in common is no dome


def domes(rise, scatter, count):
    """Yield the test on surveys with such a dome (m at the outermost target), the block fitted to six of the targets.

    ``scatter`` is how much larger the errors are than their sigmas say.
    """
    rng = np.random.default_rng(3)
    reach = np.sum((TARGETS - TARGETS.mean(axis=0)) ** 2, axis=1)
    truth = np.column_stack([TARGETS, 0.02 * TARGETS[:, 0] + 0.3 * np.sin(TARGETS[:, 1])])
    covariance = np.eye(3) * (np.stack([SIGMAS / 3, SIGMAS / 3, SIGMAS], axis=1) ** 2)[:, None, :]
    for _ in range(count):
        model = truth + rng.normal(size=(10, 3)) * scatter * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        model[:, 2] += rise * reach / reach.max()
        solved = fit(model[:6], truth[:6], covariance[:6])
        errors = solved.similarity.apply(model) - truth
        yield doming(TARGETS, errors[:, 2], SIGMAS, 0.038)


@pytest.mark.parametrize("scatter", [0.5, 1.0, 4.0])
def test_clean_surveys_rarely_alarm(scatter):
    assert np.mean([d.significant for d in domes(0.0, scatter, SURVEYS)]) <= FALSE_ALARMS


def test_the_georeferencing_takes_no_part_in_the_amplitude():
    """Shift, tilt and scale of the fit are free in the test, so that the amplitude scatters about the truth by its own sigma."""
    found = list(domes(0.2, 1.0, SURVEYS))
    amplitudes = np.array([d.amplitude for d in found])
    expected = doming(TARGETS, np.zeros(10), SIGMAS, 0.0).sigma
    # Means over the surveys are known to 1/28, standard deviations to 1/40 of a sigma; three of these are allowed.
    assert amplitudes.mean() == pytest.approx(0.2, abs=0.11 * expected)
    assert amplitudes.std() == pytest.approx(expected, rel=0.08)


def test_a_dome_of_four_sigmas_is_found():
    """Student's quantile is 2.45 for six degrees of freedom: four sigmas pass it in four cases of five or more."""
    size = 4 * doming(TARGETS, np.zeros(10), SIGMAS, 0.0).sigma
    assert np.mean([d.significant for d in domes(size, 1.0, SURVEYS)]) >= 0.8
