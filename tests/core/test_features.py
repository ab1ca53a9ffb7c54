"""Features: where they are, what contrast they need, how they are spread, and that the same image gives the same."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from strandline.core.errors import InputError
from strandline.core.tiepoints import scalespace
from strandline.core.tiepoints.descriptors import SUPPORT, describe
from strandline.core.tiepoints.features import detect, read_features, spread, write_features
from strandline.core.tiepoints.noise import noise_gain, noise_map

DATA = Path(os.environ.get("STRANDLINE_DATA", Path(__file__).parents[3] / "shared" / "data"))


def blobs(centres, size, sigma=4.0):
    """Draw Gaussian blobs whose centres count from the corner of the first pixel."""
    y, x = np.mgrid[0 : size[1], 0 : size[0]] + 0.5
    image = np.full((size[1], size[0]), 100.0)
    for cx, cy in centres:
        image += 120.0 * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * sigma**2))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def sand(size=(400, 300), seed=0):
    """Return grains at several scales, of low contrast."""
    rng = np.random.default_rng(seed)
    noise = sum(cv2.GaussianBlur(rng.normal(0, 1, size[::-1]), (0, 0), s) * s for s in (1.0, 2.0, 4.0, 8.0))
    return np.clip(np.rint(128 + 12 * noise / noise.std()), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("size", [(640, 480), (641, 481)])
@pytest.mark.parametrize("max_size", [0, 500])
def test_features_are_where_they_are(size, max_size):
    rng = np.random.default_rng(1)
    column, row = np.meshgrid(np.arange(40, 620, 40), np.arange(40, 460, 40))
    centres = np.stack([column, row], axis=-1).reshape(-1, 2) + rng.uniform(-3, 3, (column.size, 2))
    found = detect(blobs(centres, size), max_features=0, max_size=max_size)
    off = found.xy[None] - centres[:, None]
    nearest = np.hypot(off[..., 0], off[..., 1]).argmin(axis=1)
    off = off[np.arange(len(centres)), nearest]
    off = off[np.hypot(*off.T) < 1.0]
    assert len(off) > 0.95 * len(centres)
    # A blob is found to 0.02 px here; half a pixel, or the quarter that enlarging may lose, would show in the mean of a hundred.
    assert np.abs(off.mean(axis=0)).max() < 0.01
    assert np.hypot(*off.T).mean() < 0.05


def test_the_scale_of_a_blob_is_its_own():
    found = detect(blobs([[80.0, 80.0]], (160, 160), sigma=5.0), max_features=0, max_size=0)
    nearest = np.hypot(*(found.xy - 80.0).T).argmin()
    # The extremum of the difference of Gaussians of a blob lies near its sigma, within one of three layers per octave.
    assert found.scale[nearest] == pytest.approx(5.0, rel=0.25)


def test_a_blank_image_has_none():
    found = detect(np.full((100, 120), 128, np.uint8), max_features=100, max_size=0)
    assert len(found) == 0
    assert found.keypoints().shape == (0, 4)


def test_low_contrast_is_enough_and_the_number_is_kept():
    image = (128 + (sand().astype(float) - 128) / 6).round().astype(np.uint8)  # a standard deviation of 2 grey levels
    assert len(detect(image, max_features=0, max_size=0)) > 200
    assert len(detect(image, max_features=150, max_size=0)) == 150


def test_the_same_image_gives_the_same_features(tmp_path):
    first, second = (detect(sand(), max_features=300, max_size=0) for _ in range(2))
    for name in ("xy", "scale", "angle", "descriptors"):
        assert np.array_equal(getattr(first, name), getattr(second, name))
    write_features(tmp_path / "f.npz", first)
    assert np.array_equal(read_features(tmp_path / "f.npz").keypoints(), second.keypoints())


def test_damaged_features_are_told(tmp_path):
    (tmp_path / "f.npz").write_bytes(b"PK nothing")
    with pytest.raises(InputError, match="delete them"):
        read_features(tmp_path / "f.npz")


def white(sigma, size=(1000, 800), seed=0):
    """Return noise without texture, rounded to whole grey levels."""
    values = np.random.default_rng(seed).normal(128, sigma, size[::-1])
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def test_the_gain_of_noise_by_hand():
    # Variances 1 and 2^(2/3) = 1.587: (1 + 0.62996 - 4 / 2.58740) / (4 pi) = 0.006685, root 0.08176.
    assert noise_gain(np.ones(1, np.float32))[0] == pytest.approx(0.08176, abs=1e-5)
    # Blurred noise is measured to have it; a Gaussian of two pixels is nearly free of sampling.
    noise = np.random.default_rng(0).normal(0, 1, (1000, 1000))
    fine, coarse = (cv2.GaussianBlur(noise, (0, 0), 2.0 * s) for s in (1.0, 2.0 ** (1 / 3)))
    assert noise_gain(np.full(1, 2, np.float32))[0] == pytest.approx((coarse - fine).std(), rel=0.03)


@pytest.mark.parametrize("sigma", [0.5, 2.0, 8.0, 25.0])
def test_noise_is_measured(sigma):
    # Rounding adds a twelfth of a squared grey level.
    assert np.median(noise_map(white(sigma)).sigma) == pytest.approx(np.hypot(sigma, 12**-0.5), rel=0.03)
    # A slope, and an edge along the columns, are no noise.
    image = np.clip(white(sigma).astype(int) // 2 + np.arange(1000) // 50 + 40 * (np.arange(1000) > 500), 0, 255)
    plain = white(sigma) // 2
    assert np.median(noise_map(image.astype(np.uint8)).sigma) == pytest.approx(np.median(noise_map(plain).sigma), rel=0.05)


@pytest.mark.parametrize("sigma", [0.1, 0.4, 1.0, 3.0, 10.0, 30.0])
def test_independent_noise_of_any_level_gives_few_features(sigma):
    # Extrema of white noise beyond 2.5 sigmas: 0.8 megapixels, about 1,000 each; fixed contrast gives none to 4,500.
    assert len(detect(white(sigma), max_features=0, max_size=0)) < 1200 * 0.8


def test_noise_that_varies_over_the_image_is_followed():
    ramp = np.linspace(1, 20, 1000) * np.random.default_rng(0).normal(0, 1, (800, 1000))
    found = detect(np.clip(np.rint(128 + ramp), 0, 255).astype(np.uint8), max_features=0, max_size=0)
    assert len(found) < 1200 * 0.8
    # One threshold for all would find them where the noise is strong.
    left = (found.xy[:, 0] < 500).mean()
    assert 0.3 < left < 0.7


def test_correlated_noise_is_held_below_its_stated_rate():
    bayer = cv2.cvtColor(np.clip(np.rint(np.random.default_rng(0).normal(2000, 96, (800, 1000))), 0, None).astype(np.uint16), 46)
    grey = np.rint(bayer.mean(axis=2) / 16).astype(np.uint8)
    coded = cv2.imdecode(cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, 90])[1], cv2.IMREAD_GRAYSCALE)
    for image in (grey, coded):
        # Interpolated colours double the noise at the scale of features; white noise gives 1,000.
        assert len(detect(image, max_features=0, max_size=0)) < 22000 * 0.8


def test_faint_coarse_features_in_noise_are_found():
    rng = np.random.default_rng(2)
    column, row = np.meshgrid(np.arange(60, 600, 80), np.arange(60, 440, 80))
    centres = np.stack([column, row], axis=-1).reshape(-1, 2) + rng.uniform(-3, 3, (column.size, 2))
    faint = (blobs(centres, (640, 480), sigma=6.0).astype(float) - 100) / 120 * 4 + 100  # 4 grey levels high in noise of 3
    image = np.clip(np.rint(faint + rng.normal(0, 3, faint.shape)), 0, 255).astype(np.uint8)
    near = [
        np.hypot(*(detect(image, max_features=0, max_size=0, threshold=t).xy[:, None] - centres).T) for t in ("noise", "fixed")
    ]
    found = [(d.min(axis=1) < 2.5).mean() if d.size else 0.0 for d in near]
    assert found[0] > 0.9
    assert found[1] < 0.5


def test_fixed_contrast_is_that_of_a_feature():
    # The largest difference of Gaussians of a blob is its height times 1 / (1 + 1 / k) - 1 / (1 + k), k = 2^(1/3): 0.115 of it.
    # 0.85 grey levels are wanted, which is a height of 7.4.
    for height, wanted in ((6.0, 0), (9.0, 1)):
        image = np.rint((blobs([[80.0, 80.0]], (160, 160), sigma=5.0).astype(float) - 100) / 120 * height + 100)
        found = detect(image.astype(np.uint8), max_features=0, max_size=0, threshold="fixed")
        assert (np.hypot(*(found.xy - 80).T) < 3).sum() == wanted


def test_no_feature_reaches_out_of_the_mask_or_into_clipped_parts():
    image = sand((600, 400))
    mask = np.ones(image.shape, bool)
    mask[100:200, 200:300] = False
    image[300:340, 400:460] = 255
    # Distances are between the middles of pixels; where the image is reduced, a pixel at the rim is half clipped.
    for max_size, near in ((0, 1.3), (450, 3.0)):
        found = detect(image, max_features=0, max_size=max_size, mask=mask)
        assert len(found) > 500
        for top, left, bottom, right in ((100, 200, 200, 300), (300, 400, 340, 460)):
            x, y = found.xy.T
            gap = np.hypot(np.maximum(0, np.maximum(left - x, x - right)), np.maximum(0, np.maximum(top - y, y - bottom)))
            assert (gap > SUPPORT * found.scale - near).all()
    everything = detect(sand((600, 400)), max_features=0, max_size=0)
    assert len(detect(sand((600, 400)), max_features=0, max_size=0, mask=np.ones((400, 600), bool))) == len(everything)
    assert len(detect(sand((600, 400)), max_features=0, max_size=0, mask=np.zeros((400, 600), bool))) == 0


def test_twice_the_pixels_are_searched_where_features_are_wanted():
    own = detect(sand(), max_features=20, max_size=0)
    every = detect(sand(), max_features=0, max_size=0)
    assert own.scale.min() > 1.6
    assert every.scale.min() < 1.2
    assert len(detect(sand(), max_features=len(every) - 5, max_size=0)) == len(every) - 5


def test_strips_give_what_the_whole_gives(monkeypatch):
    image = sand((400, 700))
    whole = detect(image, max_features=0, max_size=0)
    monkeypatch.setattr(scalespace, "_STRIP", 50_000)
    strips = detect(image, max_features=0, max_size=0)
    for name in ("xy", "scale", "angle", "descriptors"):
        assert np.array_equal(getattr(whole, name), getattr(strips, name))


def test_a_turned_image_has_turned_features():
    image = sand((300, 300), seed=3)
    first = detect(image, max_features=0, max_size=0)
    second = detect(np.ascontiguousarray(np.rot90(image, -1)), max_features=0, max_size=0)  # clockwise, x to y
    turned = np.column_stack([300 - first.xy[:, 1], first.xy[:, 0]])
    distance = np.hypot(*(turned[:, None] - second.xy[None]).transpose(2, 0, 1))
    same = distance.min(axis=1) < 0.05
    # The border of an octave is not whole pixels of the next: some differ.
    assert same.mean() > 0.7
    partner = distance.argmin(axis=1)[same]
    turn = (second.angle[partner] - first.angle[same]) / (2 * np.pi)
    assert np.median(np.abs(turn - 0.25 - np.rint(turn - 0.25))) < 0.01
    product = (first.descriptors[same].astype(int) * second.descriptors[partner].astype(int)).sum(axis=1) / 512**2
    assert np.median(product) > 0.98


def test_root_sift_by_hand():
    # A slope to the right: one orientation in all 16 cells, those at the rim with less weight than those inside.
    layers = np.broadcast_to(np.arange(101, dtype=np.float32), (4, 101, 101)).copy()
    angle, descriptor = describe(layers, *(np.array([v], np.float32) for v in (50.0, 50.0, 1.0, 2.0)))
    assert min(angle[0], 2 * np.pi - angle[0]) < 1e-3
    filled = descriptor[0].reshape(16, 8)
    assert (filled[:, 0] > 0).all()
    assert filled[:, 1:7].sum() == 0
    # Its norm is 512: the roots of shares that add up to one.
    assert np.sqrt((filled.astype(float) ** 2).sum()) == pytest.approx(512, abs=4)


@pytest.mark.parametrize("name", ["IMG_0043.jpg", "IMG_0064.jpg"])
def test_noise_finds_more_on_real_sand_than_fixed_contrast_and_covers_it(name):
    image = cv2.imread(str(DATA / "copr" / "images" / name), cv2.IMREAD_GRAYSCALE)
    assert image is not None, f"The photograph {name} of the shared data is missing."
    found = {t: detect(image, max_features=8000, max_size=1200, threshold=t) for t in ("noise", "fixed")}
    assert len(found["noise"]) == 8000
    assert len(found["noise"]) >= len(found["fixed"])
    cells = np.unique((found["noise"].xy // (np.array(image.shape[::-1]) / 10)).astype(int), axis=0)
    assert len(cells) >= 98


def test_every_cell_gives_its_best_in_turn():
    # Cells are 1/32 of 320 pixels: the first three points share a cell.
    xy = np.array([[1, 1], [2, 2], [3, 3], [15, 1], [100, 100]], np.float32)
    score = np.array([5, 9, 7, 1, 2], np.float32)
    assert spread(xy, score, (320, 200), 3).tolist() == [1, 3, 4]
    assert spread(xy, score, (320, 200), 4).tolist() == [1, 2, 3, 4]
    assert spread(xy, score, (320, 200), 9).tolist() == [0, 1, 2, 3, 4]
