"""Original photographs as the surface reads them."""

import numpy as np
import pytest
from PIL import Image
from strandline.core.errors import InputError
from strandline.core.surface.pictures import read_reduced

STORED = np.arange(8 * 12 * 3, dtype=np.uint8).reshape(8, 12, 3)


@pytest.mark.parametrize("suffix", ["tif", "png"])
def test_pixels_are_those_stored_whatever_the_orientation_tag_says(tmp_path, suffix):
    path = tmp_path / f"turned.{suffix}"
    turned = Image.Exif()
    turned[274] = 6
    Image.fromarray(STORED).save(path, exif=turned)
    assert np.array_equal(read_reduced(str(path), 0), STORED)
    half = read_reduced(str(path), 1)
    assert half.shape == (4, 6, 3)
    assert half[0, 0, 0] == pytest.approx(STORED[:2, :2, 0].mean(), abs=0.5)


def test_a_grey_photograph_has_three_channels_alike(tmp_path):
    Image.fromarray(STORED[:, :, 0]).save(tmp_path / "grey.png")
    assert np.array_equal(read_reduced(str(tmp_path / "grey.png"), 0), np.repeat(STORED[:, :, :1], 3, axis=2))


def test_a_truncated_photograph_is_named(tmp_path):
    path = tmp_path / "cut.tif"
    Image.fromarray(STORED).save(path)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(InputError, match=r"cut\.tif cannot be decoded"):
        read_reduced(str(path), 0)
