"""Decoding: depth, channels, the stored frame, and files that are not whole."""

import contextlib
import io

import numpy as np
import pytest
from PIL import Image
from strandline.core.photographs.metadata import read_metadata
from strandline.core.photographs.reading import channel_sum, decode_pixels, frame_size

RNG = np.random.default_rng(7)
NOISE = RNG.integers(90, 130, (48, 64, 3)).astype(np.uint8)


def saved(pixels, kind, **options):
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, kind, **options)
    return stream.getvalue()


def encoded(pixels, suffix):
    import cv2

    return cv2.imencode(suffix, pixels)[1].tobytes()


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_depth_and_channels(suffix, dtype, channels):
    pixels = RNG.integers(0, np.iinfo(dtype).max + 1, (9, 7, channels)).astype(dtype)
    data = encoded(pixels if channels > 1 else pixels[:, :, 0], suffix)
    total = channel_sum(decode_pixels(data))
    colours = min(channels, 3)
    assert total.channels == colours
    assert total.white == colours * np.iinfo(dtype).max
    assert (total.values == pixels[:, :, :colours].sum(2, dtype=np.int64)).all()
    assert frame_size(data) == (7, 9)


def test_the_sum_of_white_does_not_overflow():
    for dtype in (np.uint8, np.uint16):
        total = channel_sum(np.full((2, 2, 3), np.iinfo(dtype).max, dtype))
        assert (total.values == total.white).all()


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "TIFF"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_the_stored_frame_is_never_turned(kind, orientation):
    exif = Image.Exif()
    exif[274] = orientation
    plain = decode_pixels(saved(NOISE, kind))
    assert (decode_pixels(saved(NOISE, kind, exif=exif)) == plain).all()
    assert frame_size(saved(NOISE, kind, exif=exif)) == (64, 48)


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("JPEG", {}),
        ("JPEG", {"progressive": True}),
        ("JPEG", {"quality": 100}),
        ("PNG", {}),
        ("TIFF", {}),
        ("TIFF", {"compression": "tiff_lzw"}),
    ],
)
def test_a_file_cut_short_anywhere_is_found(kind, options):
    data = saved(NOISE, kind, **options)
    # Without the last byte a PNG's pixels and their checksum are still there.
    last = len(data) - (4 if kind == "PNG" else 0)
    for length in {*range(0, last, max(1, last // 40)), last - 1, last - 2}:
        with pytest.raises(ValueError, match="empty|truncated|not decodable|not an image"):
            frame_size(data[:length])


def test_a_jpg_whose_end_was_never_written_is_found():
    # A full card or a broken copy leaves zeros of the right length.
    data = saved(NOISE, "JPEG")
    for length in range(len(data) // 2, len(data), 97):
        with pytest.raises(ValueError, match="truncated|not decodable"):
            frame_size(data[:length] + bytes(len(data) - length))


def test_what_follows_a_whole_jpg_does_not_matter():
    # DJI appends previews, others pad.
    data = saved(NOISE, "JPEG")
    for tail in (bytes(1000), data[: len(data) // 2]):
        assert frame_size(data + tail) == (64, 48)


def test_a_thumbnail_does_not_pass_for_the_photograph():
    exif = Image.Exif()
    exif[0x927C] = saved(NOISE[:8, :8], "JPEG")  # a whole JPG inside the EXIF
    data = saved(NOISE, "JPEG", exif=exif)
    with pytest.raises(ValueError, match="truncated"):
        frame_size(data[: len(data) - 300])


@pytest.mark.parametrize("data", [b"", b"\xff\xd8", b"hello", bytes(5000), b"\x89PNG\r\n\x1a\n", b"II*\0"])
def test_no_image(data):
    with pytest.raises(ValueError, match="empty|truncated|not an image"):
        frame_size(data)


def test_float_pixels_are_refused():
    with pytest.raises(ValueError, match="float32"):
        frame_size(saved(np.ones((4, 4), np.float32), "TIFF"))


def test_a_tiny_jpg_is_whole():
    assert frame_size(saved(NOISE[:3, :5], "JPEG")) == (5, 3)


def test_damaged_bytes_never_end_in_another_error():
    # A ValueError names the photograph; anything else would pass for a bug.
    rng = np.random.default_rng(9)
    for kind in ("JPEG", "PNG"):
        data = np.frombuffer(saved(NOISE, kind), np.uint8)
        for _ in range(300):
            damaged = data.copy()
            damaged[rng.integers(2, len(data), 6)] = rng.integers(0, 256, 6)
            with contextlib.suppress(ValueError):
                frame_size(damaged.tobytes())
            read_metadata(damaged.tobytes())
