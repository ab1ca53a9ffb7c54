"""Features: where they are, how they are spread, and that the same image gives the same."""

import cv2
import numpy as np
import pytest
from strandline.core.errors import InputError
from strandline.core.tiepoints.features import detect, read_features, spread, write_features


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
    assert len(off) > 0.7 * len(centres)
    # A blob is found to 0.1 px here; half a pixel, or the quarter that enlarging may lose, would show in the mean of a hundred.
    assert np.abs(off.mean(axis=0)).max() < 0.05
    assert np.hypot(*off.T).mean() < 0.15


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


def test_every_cell_gives_its_best_in_turn():
    # Cells are 1/32 of 320 pixels: the first three points share a cell.
    xy = np.array([[1, 1], [2, 2], [3, 3], [15, 1], [100, 100]], np.float32)
    score = np.array([5, 9, 7, 1, 2], np.float32)
    assert spread(xy, score, (320, 200), 3).tolist() == [1, 3, 4]
    assert spread(xy, score, (320, 200), 4).tolist() == [1, 2, 3, 4]
    assert spread(xy, score, (320, 200), 9).tolist() == [0, 1, 2, 3, 4]
