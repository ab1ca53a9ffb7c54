"""The bundle adjustment of simulated blocks whose truth is known: its errors, its sigmas, and what it finds wrong."""

from dataclasses import replace

import numpy as np
import pytest
from blocks import FRAME, Scene, flown
from strandline.core.camera import Camera
from strandline.core.errors import NotEnoughData
from strandline.core.orientation import interior
from strandline.core.orientation.adjustment import adjust
from strandline.core.orientation.cameras import Cameras
from strandline.core.orientation.common import bending_design, of_adjustment
from strandline.core.orientation.network import Control, Network, Positions
from strandline.core.orientation.reliability import tests as observation_tests
from strandline.core.orientation.reliability import without
from strandline.core.orientation.sightings import Sighting
from strandline.core.simulation.flight import lens

SMALL = Scene(length=30.0, width=30.0, height=40.0, size=(1200, 900), focal=1100.0, points=200, checks=10)
GSD = SMALL.height / SMALL.focal
SEEDS = range(1, 9)


@pytest.fixture(scope="module")
def clean():
    """Eight small blocks with five control points and RTK, adjusted."""
    made = [flown(replace(SMALL, seed=seed)) for seed in SEEDS]
    return [(f, f.adjusted()) for f in made]


def rms(values):
    return np.sqrt(np.mean(np.square(values), axis=0))


def test_check_points_are_right_to_a_fraction_of_a_pixel(clean):
    """Against the truth; a pixel is 3.6 cm. Ten check points in eight blocks."""
    errors = rms(np.concatenate([f.truth_errors(s) for f, s in clean]))
    assert np.hypot(*errors[:2]) < 0.3 * GSD
    assert errors[2] < 0.6 * GSD


def test_predicted_sigmas_are_true(clean):
    """80 check points: the RMS of error over sigma scatters by 8 % where all are independent, and those of a block are not."""
    checks = [np.array([p.check for p in f.points]) for f, _ in clean]
    ratios = np.concatenate([s.errors[c] / s.predicted[c] for (_, s), c in zip(clean, checks, strict=True)])
    assert np.all((rms(ratios) > 0.75) & (rms(ratios) < 1.3))
    left_out = np.concatenate([(s.loo / s.loo_sigma)[~c] for (_, s), c in zip(clean, checks, strict=True)])
    assert np.all((rms(left_out) > 0.65) & (rms(left_out) < 1.4))


def test_nothing_is_named_where_nothing_is_wrong(clean):
    """One false name in a hundred blocks is asked for; two in eight would happen once in 300."""
    assert sum(bool(s.blunders or s.wrong_marks or s.gnss_blunders) for _, s in clean) <= 1


def test_the_camera_is_found_again(clean):
    true = np.array(lens(*SMALL.size, SMALL.focal).params)
    ratios = np.array([(s.cameras[0].values - true) / s.cameras[0].sigma for _, s in clean])
    assert np.all(rms(ratios) < 2.0)  # eight values: 1.4 is the 99 % quantile of one of the eight parameters
    assert np.all(np.abs(np.mean([s.cameras[0].values[0] for _, s in clean]) - SMALL.focal) < 0.003 * SMALL.focal)


def test_a_wrong_mark_is_named_with_its_size():
    flight = flown(replace(SMALL, seed=3, wrong_mark=30.0))
    solution = flight.adjusted()
    (mark,) = solution.wrong_marks
    assert (mark.gcp, mark.image) == ("P0", flight.points[0].marks[0].image)
    assert mark.error == pytest.approx(30.0, abs=2.0)
    assert np.abs(flight.truth_errors(solution)[:, 2]).max() < 2 * GSD
    assert not solution.blunders


def test_a_small_wrong_mark_that_no_triangulation_shows_is_named():
    """Three pixels are twelve sigmas, yet less than what rays of a block in its free shape may be apart."""
    (mark,) = flown(replace(SMALL, seed=3, wrong_mark=3.0)).adjusted().wrong_marks
    assert mark.gcp == "P0"
    assert mark.error == pytest.approx(3.0, abs=1.0)
    assert mark.ratio > 4


@pytest.mark.parametrize(("field", "part"), [("wrong_gcp", "plan"), ("wrong_height", "height")])
def test_a_wrong_coordinate_is_named_with_its_size(field, part):
    flight = flown(replace(SMALL, seed=4, **{field: 0.5}))
    solution = flight.adjusted()
    assert [(b.name, b.part) for b in solution.blunders] == [("P1", part)]
    assert solution.blunders[0].error == pytest.approx(0.5, abs=0.08)
    assert np.abs(flight.truth_errors(solution)).max() < 2 * GSD


def test_sigmas_that_are_all_too_small_are_no_blunders():
    """Handheld control under a surveyor's sigma: all of it is off, so that nobody is to be named."""
    flight = flown(replace(SMALL, seed=5, gcp=(0.5, 0.5), control=9, gnss=(3.0, 3.0), declared=False))
    told = [replace(p, sigma_h=0.01, sigma_v=0.02) for p in flight.points]
    solution = replace(flight, points=tuple(told)).adjusted()
    assert not [b for b in solution.blunders if not b.name.startswith("P1")] or len(solution.blunders) <= 1
    assert any("times worse in plan" in note for note in solution.notes)
    middle = solution.common.uncertainty(solution.common.pivot[None])[0]
    assert 0.05 < np.sqrt(middle[2, 2]) < 0.8  # half a metre over the root of nine, three times either way


def test_one_control_point_takes_off_what_gnss_is_off():
    flight = flown(replace(SMALL, seed=6, control=1, checks=12, bias=(0.6, -0.5, 0.6)))
    solution = flight.adjusted()
    errors = flight.truth_errors(solution)
    assert rms(errors)[2] < 0.08
    assert any("-0.60 m east" in n or "+0.6" in n or "-0.6" in n for n in solution.notes)
    assert solution.alternatives == ()


def test_without_control_the_sigma_knows_what_the_focal_length_leaves():
    """Vertical views of flat sand do not tell the focal length: the predicted sigma is decimetres, and the errors fit it."""
    flat, hilly = [], []
    for seed in (1, 2, 3, 4, 5, 6):
        for found, scene in ((flat, {"tilt": 0.3, "relief": 0.1}), (hilly, {"tilt": 3.0, "relief": 1.5})):
            flight = flown(replace(SMALL, seed=seed, control=0, checks=8, **scene))
            solution = flight.adjusted()
            middle = np.sqrt(solution.common.uncertainty(solution.common.pivot[None])[0, 2, 2])
            found.append((middle, np.mean(flight.truth_errors(solution)[:, 2])))
    flat, hilly = np.array(flat), np.array(hilly)
    assert flat[:, 0].mean() > 2.5 * hilly[:, 0].mean()
    assert 0.3 < rms(flat[:, 1] / flat[:, 0]) < 2.0
    assert 0.3 < rms(hilly[:, 1] / hilly[:, 0]) < 2.0


def test_a_calibration_from_elsewhere_holds_heights_without_control():
    flight = flown(replace(SMALL, seed=7, control=0, checks=8, tilt=0.3, relief=0.1))
    true = lens(*SMALL.size, SMALL.focal)
    covariance = np.diag([0.3, 0.3, 0.5, 0.5, 1e-4, 1e-4, 1e-6, 1e-6]) ** 2
    known = interior.calibrated(flight.assembly.block.views[0].camera, true, covariance)
    loose = flight.adjusted()
    tight = flight.adjusted(known)
    sigma = [np.sqrt(s.common.uncertainty(s.common.pivot[None])[0, 2, 2]) for s in (loose, tight)]
    assert sigma[1] < 0.6 * sigma[0]


def test_the_positions_alternatives_and_points_of_the_whole_are_told(clean):
    flight, _ = clean[0]
    solution = flight.adjusted(compare=True)
    rows = [(a.method, a.control) for a in solution.alternatives]
    assert rows == [("similarity", n) for n in (0, 1, 3, 5)] + [("adjustment", n) for n in (0, 1, 3, 5)]
    heights = [a.predicted_alti for a in solution.alternatives if a.method == "adjustment"]
    assert heights == sorted(heights, reverse=True)  # a further point never makes it worse
    assert solution.kept.all()
    assert len(solution.block.points) == len(flight.assembly.block.points)
    assert solution.centre_sigma.shape == (len(solution.block.views), 3)
    assert solution.tie_sigma.shape == (len(solution.block.points), 3)


def test_the_sigma_of_each_tie_point_is_true(clean):
    """Error over sigma of 1,400 points. Those of a block share its error, which eight blocks tell to some 20 %.

    So that the sigmas follow the geometry and are not only right on average, points of few rays, which err twice as much, are
    judged apart from those of many.
    """
    errors = [s.block.points - f.true_ties for f, s in clean]
    ratios = np.concatenate([e / s.tie_sigma for e, (_, s) in zip(errors, clean, strict=True)])
    rays = np.concatenate([s.block.rays for _, s in clean])
    few, many = rays == 2, rays >= 5
    assert min(few.sum(), many.sum()) > 200
    for chosen in (few, many):
        assert np.all((rms(ratios[chosen]) > 0.8) & (rms(ratios[chosen]) < 1.25))
    sigmas = np.concatenate([s.tie_sigma for _, s in clean])
    assert np.median(sigmas[few, 2]) > 1.4 * np.median(sigmas[many, 2])


# A control point with a single mark


def test_a_single_mark_takes_part():
    """A third point, marked once, brings the plan that two points and positions leave; the predicted sigma says so."""
    better = []
    for seed in (1, 2, 3):
        three = flown(replace(SMALL, seed=seed, control=3, single=1, gnss=(0.5, 0.5)))
        two = replace(three, points=tuple(p for k, p in enumerate(three.points) if k != 2))
        with_, without_ = three.adjusted(), two.adjusted()
        assert with_.single == {"P2"}
        assert np.isnan(with_.errors[2]).all()  # one ray meets nothing
        assert np.isnan(with_.loo[2]).all()
        assert np.isfinite(with_.loo[:2]).all()
        check = np.array([p.check for p in three.points])
        z = with_.errors[check] / with_.predicted[check]
        assert rms(z).max() < 2.0
        better.append(rms(without_.predicted[check[np.arange(len(check)) != 2]]) / rms(with_.predicted[check]))
    assert np.all(np.array(better)[:, :2] > 1.1)


def test_a_wrong_single_mark_is_named_and_harmless():
    clean_run = flown(replace(SMALL, seed=4, control=5, single=1)).adjusted()
    assert not clean_run.wrong_marks
    wrong = flown(replace(SMALL, seed=4, control=5, single=1, wrong_single=60.0)).adjusted()
    (named,) = wrong.wrong_marks
    assert named.gcp == "P4"
    assert named.error == pytest.approx(60.0, abs=4.0)
    assert np.nanmax(np.abs(wrong.errors - clean_run.errors)) < 0.1 * GSD


def test_a_single_mark_beside_positions_is_control_enough():
    """Positions that are all off by 0.78 m in plan, and one point marked once: its ray takes most of that off.

    Along the ray nothing holds the heights, so that the slant of the ray leaves some plan, and the sigma knows.
    """
    flight = flown(replace(SMALL, seed=5, control=1, single=1, bias=(0.6, -0.5, 0.0)))
    solution = flight.adjusted()
    errors = flight.truth_errors(solution)
    assert np.hypot(*np.mean(errors[:, :2], axis=0)) < 0.78 / 3
    check = np.array([p.check for p in flight.points])
    assert rms(errors / solution.predicted[check]).max() < 2.5


def test_the_same_twice(clean):
    flight, first = clean[0]
    again = flight.adjusted()
    assert np.array_equal(again.errors, first.errors)
    assert np.array_equal(again.common.covariance, first.common.covariance)


# The adjustment alone


@pytest.fixture(scope="module")
def alone():
    """Return network, control and positions of one block in the local frame."""
    flight = flown(replace(SMALL, seed=2))
    views, camera = flight.true_views, flight.assembly.block.views[0].camera
    known = interior.free(camera, interior.file_focal(SMALL.focal))
    basis, free = interior.merged({1: known})
    cameras = Cameras(
        np.array([v.rotation for v in views]), np.array([v.centre for v in views]), np.zeros(len(views), np.int64),
        camera.brown()[None], basis, free,
    )  # fmt: skip
    solution = flight.start()
    network = Network(cameras, (known,), flight.assembly.rays, solution.block.points)
    index = {v.name: i for i, v in enumerate(views)}
    control = []
    for point in flight.points[:5]:
        view = np.array([index[m.image] for m in point.marks], np.int64)
        sighting = Sighting(point.name, view, np.array([(m.x, m.y) for m in point.marks]), np.full(len(view), 0.25))
        control.append(Control(sighting, FRAME.from_crs(point.coordinates[None])[0], np.diag([0.007, 0.007, 0.01]) ** 2))
    antenna = FRAME.from_crs(flight.gnss.coordinates)
    positions = Positions(flight.gnss.view, antenna, np.full((len(views), 3), 0.03), np.zeros(3), np.array([2.0, 2.0, 10.0]))
    return network, control, positions


def test_leaving_out_is_what_an_adjustment_without_the_point_gives(alone):
    """To first order: a fiftieth of the sigma."""
    network, control, positions = alone
    whole = adjust(network, control, positions, sigma=0.3)
    for k in (0, 3):
        rest = adjust(whole.network, control[:k] + control[k + 1 :], positions, sigma=whole.sigma, fixed_sigma=True)
        change, cofactor = without(whole, k)
        place, covariance = whole.intersect(control[k].sighting, cofactor, change)
        wanted, spread = rest.intersect(control[k].sighting)
        sigma = np.sqrt(np.diag(spread))
        assert np.abs((place - wanted) / sigma).max() < 0.02
        assert np.sqrt(np.diag(covariance)) == pytest.approx(sigma, rel=0.01)


def test_redundancies_add_up(alone):
    """A mark's redundancy lies between none and two, and long-seen points hold nearly all of it."""
    network, control, positions = alone
    found = observation_tests(adjust(network, control, positions, sigma=0.3))
    marks = [t.redundancy for t in found if t.part == "mark"]
    assert min(marks) > 0.5
    assert max(marks) < 2.0
    assert 0.2 < np.mean([t.statistic / 2 for t in found if t.part == "mark"]) < 2.0


def test_the_common_error_is_the_whole_covariance_on_smooth_ground(alone):
    """Ten numbers hold the heights' sigma of tie points to a quarter; with the rest they do not tell too little."""
    network, control, positions = alone
    adjusted = adjust(network, control, positions, sigma=0.3)
    common = of_adjustment(adjusted)
    chosen = np.flatnonzero(np.diff(network.ties.start) >= 4)[::40].astype(np.int64)
    follows, _ = adjusted.influence(chosen)
    exact = np.sqrt(np.einsum("sj,jk,sk->s", follows[:, 2], adjusted.cofactor, follows[:, 2]))
    held = np.sqrt(common.uncertainty(adjusted.network.points[chosen])[:, 2, 2])
    assert np.median(np.abs(held / exact - 1)) < 0.25
    assert common.rest < np.median(exact)
    assert np.median(np.hypot(held, common.rest) / exact) > 0.95


def test_bending_rises_with_the_square():
    design = bending_design(np.array([[3.0, 4.0, 1.0]]), np.array([1.0, 1.0, 1.0]))
    assert design[0, 2] == pytest.approx([0, 0, 1, 3, -2, 0, 0, 4, 6, 9])


def test_nothing_that_holds_the_block_is_refused(alone):
    network, _, _ = alone
    nowhere = Positions(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(3), np.zeros(3))
    with pytest.raises(NotEnoughData):
        adjust(network, [], nowhere, sigma=0.3)


# Interior orientation


def test_square_pixels_and_a_known_focal_length():
    """fx and fy are known to 1.5 % together and to 0.05 % against each other."""
    camera = Camera("OPENCV", 1800, 1350, (1650, 1650, 900, 675, 0, 0, 0, 0))
    known = interior.free(camera, interior.file_focal(1600.0))
    covariance = np.linalg.inv(known.information)
    mean, ratio = np.array([0.5, 0.5, 0, 0, 0, 0, 0, 0]), np.array([1.0, -1, 0, 0, 0, 0, 0, 0])
    assert np.sqrt(mean @ covariance @ mean) == pytest.approx(0.015 * 1600)
    assert np.sqrt(ratio @ covariance @ ratio) == pytest.approx(5e-4 * 1600)
    assert known.known == pytest.approx([1600, 1600, 900, 675, 0, 0, 0, 0])


def test_one_focal_length_moves_both():
    camera = Camera("SIMPLE_RADIAL", 1000, 800, (900, 500, 400, 0.01))
    known = interior.free(camera, None)
    assert known.names == ("f", "cx", "cy", "k1")
    assert known.basis[:, 0].tolist() == [1, 1] + [0] * 10
    assert known.values(camera.brown()) == pytest.approx([900, 500, 400, 0.01])
    assert known.sigma[0] == pytest.approx(90.0)


def test_a_parameter_that_rests_on_its_prior_is_told():
    camera = Camera("OPENCV", 1800, 1350, (1650, 1650, 900, 675, 0, 0, 0, 0))
    known = interior.free(camera, interior.file_focal(1650.0))
    adjusted = np.diag((known.sigma * np.array([0.1, 0.1, 0.9, 0.1, 0.01, 0.01, 0.1, 0.1])) ** 2)
    (sentence,) = interior.told("camera X", known, adjusted, known.known)
    assert "does not determine cx of camera X" in sentence
