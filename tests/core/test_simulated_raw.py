"""RAW files of the simulation: read back by LibRaw to the bit, by Pillow and the engine to the metadata of the JPG."""

from pathlib import Path

import numpy as np
import pytest
import rawpy
from numpy.testing import assert_allclose
from PIL import ExifTags, Image
from strandline.core.photographs.metadata import focal_pixels, read_metadata
from strandline.core.simulation import dng, exif, sensor

NOTES = exif.Metadata(
    time="2024-03-12T10:40:02",
    longitude=-1.253218471,
    latitude=-44.520013,
    height=-3.217,
    relative_height=47.9,
    sigma_h=0.03,
    sigma_v=0.05,
    yaw=-172.0,
    focal=1650.0,
)


def beach(rows: int, columns: int) -> np.ndarray:
    """Return the mosaic of level sand with a smooth pattern on it."""
    x = np.arange(columns) / 40.0
    light = np.zeros((3, rows, columns), np.float32)
    light[0] = 1.0 + 0.1 * np.sin(x)
    return sensor.expose(light, 1.0, 1.0, np.random.default_rng(4))


@pytest.mark.parametrize(("rows", "columns"), [(200, 300), (201, 303)])
def test_libraw_reads_the_mosaic_to_the_bit(tmp_path: Path, rows: int, columns: int) -> None:
    mosaic = beach(rows, columns)
    dng.save_dng(tmp_path / "a.dng", mosaic, NOTES)
    with rawpy.imread(str(tmp_path / "a.dng")) as raw:
        assert np.array_equal(raw.raw_image, mosaic)
        assert np.array_equal(raw.raw_image_visible, mosaic)
        assert raw.black_level_per_channel == [256] * 4
        assert raw.white_level == 4095
        names = np.array(list(raw.color_desc.decode()))[raw.raw_colors_visible[:2, :2]]
        assert names.tolist() == [["R", "G"], ["G", "B"]]
        assert raw.sizes.flip == 0
        # What makes white white: one over the neutral.
        assert_allclose(raw.camera_whitebalance[:3], 1 / np.array(sensor.NEUTRAL), rtol=1e-5)
        assert_allclose(raw.daylight_whitebalance[:3], 1 / np.array(sensor.NEUTRAL), rtol=1e-3)
        with Image.open(_saved(tmp_path / "a.jpg", mosaic)) as picture:
            own = np.asarray(picture, float)
        theirs = raw.postprocess(
            use_camera_wb=True, no_auto_bright=True, gamma=(2.222, 4.5), output_color=rawpy.ColorSpace.sRGB, user_flip=0
        )
    # Another demosaicing and no JPEG: the same colours, and pixel by pixel the same but for their noise.
    assert_allclose(theirs.mean(axis=(0, 1)), own.mean(axis=(0, 1)), atol=1.0)
    assert np.abs(theirs - own).mean() < 3.0
    # The JPG is small, and the RAW no larger than its samples and some tags.
    assert (tmp_path / "a.dng").stat().st_size < 2 * rows * columns + 3000


def _saved(path: Path, mosaic: np.ndarray) -> Path:
    exif.save_jpeg(path, sensor.develop(mosaic), NOTES)
    return path


def test_metadata_are_those_of_the_jpg(tmp_path: Path) -> None:
    mosaic = beach(200, 300)
    dng.save_dng(tmp_path / "a.dng", mosaic, NOTES)
    of_raw, of_jpg = (read_metadata(p.read_bytes()) for p in (tmp_path / "a.dng", _saved(tmp_path / "a.jpg", mosaic)))
    assert of_raw == of_jpg
    assert of_raw.problems == ()
    assert of_raw.body == "Strandline Simulated"
    assert of_raw.time == "2024-03-12T10:40:02+00:00"
    assert of_raw.position is not None
    assert_allclose([of_raw.position.longitude, of_raw.position.latitude], [-1.253218471, -44.520013], atol=1e-9)
    assert (of_raw.position.height, of_raw.exif_height, of_raw.xmp_height) == (-3.217, -3.217, -3.217)
    assert (of_raw.yaw, of_raw.pitch, of_raw.relative_height) == (-172.0, -90.0, 47.9)
    focal = focal_pixels(of_raw, 300, 200)
    assert focal is not None
    assert_allclose(focal, 1650.0, rtol=1e-6)


def test_pillow_reads_every_tag(tmp_path: Path) -> None:
    mosaic = beach(40, 60)
    dng.save_dng(tmp_path / "a.dng", mosaic, NOTES)
    found = Image.Exif()
    with (tmp_path / "a.dng").open("rb") as stream:
        found.load_from_fp(stream)
        with Image.open(_saved(tmp_path / "a.jpg", mosaic)) as picture:
            of_jpg = picture.getexif()
            assert found[ExifTags.Base.XMLPacket] == picture.info["xmp"]
        for directory in (ExifTags.IFD.Exif, ExifTags.IFD.GPSInfo):
            assert dict(found.get_ifd(directory)) == dict(of_jpg.get_ifd(directory))
        base = ExifTags.Base
        assert [found[t] for t in (base.Make, base.Model, base.Orientation)] == ["Strandline", "Simulated", 1]
        assert found[base.DateTime] == of_jpg[base.DateTime]
        assert (found[base.ImageWidth], found[base.ImageLength], found[base.BitsPerSample]) == (60, 40, 16)
        assert found[dng._DNG_VERSION] == b"\1\4\0\0"
        assert found[dng._CFA_PATTERN] == b"\0\1\1\2"
        assert found[dng._CROP_SIZE] == (60, 40)
        # CIE XYZ of daylight (D65) is white, and white is the neutral.
        matrix = np.array([float(v) for v in found[dng._COLOUR_MATRIX]]).reshape(3, 3)
        neutral = [float(v) for v in found[dng._AS_SHOT_NEUTRAL]]
        assert_allclose(matrix @ [0.95047, 1.0, 1.08883], neutral, atol=2e-4)
        assert_allclose(neutral, sensor.NEUTRAL)
        # The samples are all that lies behind the tags.
        length = (tmp_path / "a.dng").stat().st_size
        assert found[base.StripOffsets] + found[base.StripByteCounts] == length
        assert found[base.StripByteCounts] == 2 * 40 * 60
        stream.seek(found[base.StripOffsets])
        assert np.array_equal(np.frombuffer(stream.read(), "<u2").reshape(40, 60), mosaic)


def test_directory_by_hand() -> None:
    entries = {258: dng._shorts(16), 256: dng._longs(7), 305: dng._text("abcde"), 282: dng._fractions([(1, 3)])}
    found = dng._directory(entries, 8)
    assert found == bytes.fromhex(
        "0400"
        "0001 0400 01000000 07000000"  # 256, one LONG: 7
        "0201 0300 01000000 10000000"  # 258, one SHORT: 16
        "1A01 0500 01000000 3E000000"  # 282, one RATIONAL at 62 = 8 + 2 + 4 x 12 + 4
        "3101 0200 06000000 46000000"  # 305, six characters at 70
        "00000000"
        "01000000 03000000"
        "616263646500"
    )
