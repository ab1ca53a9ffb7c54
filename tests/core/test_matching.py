"""Matching: guided by a known geometry, and of real photographs of sand."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from strandline.core.camera import Camera
from strandline.core.photographs.enhancement import enhance_photograph
from strandline.core.photographs.reading import channel_sum
from strandline.core.tiepoints.features import Features, detect
from strandline.core.tiepoints.guided import by_homography, guided_matches
from strandline.core.tiepoints.matching import LEAST, match_pair, match_predicted, mutual_matches, read_matches, write_matches
from strandline.core.tiepoints.thinning import thinned

DATA = Path(os.environ.get("STRANDLINE_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data")


def features(xy, descriptors, scale=2.0, angle=0.0):
    count = len(xy)
    return Features(
        np.asarray(xy, np.float32), np.full(count, scale, np.float32), np.full(count, angle, np.float32), np.array(descriptors)
    )


def one_hot(*bins):
    """Descriptors of norm 512 in two bins: equal ones have product 1, others 0."""
    result = np.zeros((len(bins), 128), np.uint8)
    for row, b in enumerate(bins):
        result[row, [4 * b, 4 * b + 1, 4 * b + 2, 4 * b + 3]] = 255
    return result


GUIDE = {"band": 3.0, "turn": 0.0, "zoom": 1.0, "ratio": 0.8, "least": 0.8}
SHIFT = np.array([[1.0, 0, 100], [0, 1.0, 0], [0, 0, 1.0]])
ROWS = np.array([[0.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # equal rows: the epipolar lines of a shift along x


def guided(first, second, lines, homography=SHIFT, reach=20.0, **other):
    """Return guided matches where one homography predicts all."""
    back = np.linalg.inv(homography)
    predicted = by_homography(first, homography, reach), by_homography(second, back, reach)
    return guided_matches(first, second, *predicted, lines, **GUIDE | other)


def test_only_candidates_near_the_prediction_and_the_line_count():
    first = features([[50, 50], [50, 150], [50, 250], [50, 350]], one_hot(0, 1, 2, 3))
    second = features([[152, 51], [175, 150], [155, 254], [150, 350]], one_hot(0, 1, 2, 4))
    # The second is beyond reach, the third off its line, the fourth looks different.
    assert guided(first, second, ROWS).tolist() == [[0, 0]]
    assert guided(first, second, None).tolist() == [[0, 0], [2, 2]]


def test_a_rival_nearby_makes_it_ambiguous_but_not_another_orientation_nor_one_elsewhere():
    first = features([[50, 50]], one_hot(0))
    near, same, far = [152, 50], [150.5, 50], [400, 50]
    assert len(guided(first, features([[150, 50], near], one_hot(0, 0)), ROWS, ratio=0.8)) == 1
    rival = features([[150, 50], [155, 50]], one_hot(0, 0))
    rival.descriptors[:, 0] = 240  # not quite equal to the first
    assert len(guided(first, rival, ROWS)) == 0
    for other in (same, far):
        harmless = features([[150, 50], other], rival.descriptors)
        assert len(guided(first, harmless, ROWS)) == 1


def test_turn_and_zoom_are_checked_around_the_circle():
    first = features([[50, 50]], one_hot(0), angle=np.radians(175))
    turned = features([[150, 50]], one_hot(0), scale=3.0, angle=np.radians(-175))
    assert len(guided(first, turned, ROWS)) == 1  # 10 degrees and a factor of 1.5
    assert len(guided(first, turned, ROWS, turn=np.radians(-60))) == 0
    assert len(guided(first, turned, ROWS, zoom=0.9)) == 0


def test_mutual_matches_by_hand():
    assert mutual_matches(one_hot(0, 1, 2), one_hot(2, 5, 0), ratio=0.8).tolist() == [[0, 2], [2, 0]]
    assert mutual_matches(one_hot(0), one_hot(0, 0), ratio=0.8).tolist() == []


def test_thinning_keeps_the_longest_tracks_and_weak_pairs():
    xy = [np.array([[10.0, 10], [12, 12], [14, 14]], np.float32)] * 3
    many = np.repeat([[0, 0]], 201, axis=0)  # a strong pair: more than 200 matches of which one is chosen
    pairs = {(0, 1): np.concatenate([many, [[1, 1]]]).astype(np.int32), (1, 2): np.array([[0, 0]], np.int32)}
    kept = thinned(pairs, xy, [(320, 320)] * 3, 1)
    # Track 0 has three features, track 1 two, and all lie in one cell: each photograph keeps one.
    assert np.unique(kept[0, 1], axis=0).tolist() == [[0, 0]]
    assert kept[1, 2].tolist() == [[0, 0]]
    assert len(thinned(pairs, xy, [(320, 320)] * 3, 2)[0, 1]) == 202


def quarter(name):
    pixels = cv2.imread(str(DATA / "copr" / "images" / name), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    assert pixels is not None, f"the shared data are missing: {DATA}"
    small = cv2.resize(pixels, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    return enhance_photograph(channel_sum(small), "arctan", 51)[0]


@pytest.fixture(scope="module")
def sand():
    images = [quarter(f"IMG_00{n}.jpg") for n in ("61", "64", "22")]
    found = [detect(image, max_features=4000, max_size=0) for image in images]
    height, width = images[0].shape
    return found, Camera("SIMPLE_RADIAL", width, height, (1.2 * width, width / 2, height / 2, 0.0))


def test_photographs_of_sand_match_and_the_same_twice(sand, tmp_path):
    (first, second, _), camera = sand
    pair = match_pair(first, second, (camera, camera))
    assert len(pair.matches) > 800
    assert len(np.unique(pair.matches[:, 0])) == len(pair.matches)
    # The residuals to the pair's homography are relief and distortion: far below a tenth of the photograph.
    mapped = cv2.perspectiveTransform(first.xy[pair.matches[:, 0]][None], pair.homography)[0]
    assert np.median(np.hypot(*(mapped - second.xy[pair.matches[:, 1]]).T)) < 15
    again = match_pair(first, second, (camera, camera))
    assert np.array_equal(pair.matches, again.matches)
    write_matches(tmp_path / "m.npz", pair)
    kept = read_matches(tmp_path / "m.npz")
    assert np.array_equal(kept.matches, pair.matches)
    assert kept.config == pair.config
    # From a rough prediction alone the same is found.
    rough = pair.homography.copy()
    rough[:2, 2] += 10.0
    assert len(match_predicted(first, second, (camera, camera), rough).matches) > 0.8 * len(pair.matches)


def test_photographs_of_different_places_do_not(sand):
    (first, _, other), camera = sand
    assert len(match_pair(first, other, (camera, camera)).matches) == 0
    assert len(match_predicted(first, other, (camera, camera), np.eye(3)).matches) < 2 * LEAST
    nothing = Features(np.zeros((0, 2), np.float32), *(np.zeros(0, np.float32),) * 2, np.zeros((0, 128), np.uint8))
    assert len(match_pair(first, nothing, (camera, camera)).matches) == 0
