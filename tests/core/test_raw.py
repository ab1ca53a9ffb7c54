"""RAW: levels, colours, the frame, files that are not whole, metadata, and what the steps make of it."""

import io
import os
import sqlite3
import struct
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import rawpy
from PIL import ExifTags, Image
from strandline.core.contract import encode
from strandline.core.errors import InputError
from strandline.core.photographs import createsurvey, enhance, wholeness
from strandline.core.photographs.containers import read_tags
from strandline.core.photographs.enhancement import enhance_photograph
from strandline.core.photographs.inspection import inspect
from strandline.core.photographs.metadata import Metadata, focal_pixels, read_metadata
from strandline.core.photographs.raw import SATURATION, _frame, colours, decode_raw, summed
from strandline.core.photographs.reading import ChannelSum, gamma_coded, mean_level, read_channel_sum
from strandline.core.photographs.wholeness import whole_raw
from strandline.core.surface.pictures import read_grey, read_reduced
from strandline.core.survey import Survey
from strandline.core.tiepoints import tiepoints

BYTE, ASCII, SHORT, LONG, RATIONAL, SRATIONAL = 1, 2, 3, 4, 5, 10
SIZES = {BYTE: 1, ASCII: 1, SHORT: 2, LONG: 4, RATIONAL: 8, SRATIONAL: 8}
XTRANS = "GGRGGBGGBGGRBRGRBGGGBGGRGGRGGBRBGBRG"
SAMPLES = ["colorchart.dng", "copr_0136_quarter_simulated.dng", "kodak_dc50.kdc"]
KERNEL = np.outer([1, 2, 1], [1, 2, 1]) / 4


def content(kind, values, order):
    if kind == ASCII:
        return values.encode() + b"\0"
    if kind in (RATIONAL, SRATIONAL):
        form = order + ("II" if kind == RATIONAL else "ii")
        return b"".join(struct.pack(form, round(v * 10000), 10000) for v in values)
    if isinstance(values, bytes):
        return values
    return struct.pack(f"{order}{len(values)}{'H' if kind == SHORT else 'I'}", *values)


def directory(entries, at, order="<"):
    """Return a TIFF directory with its data, to stand at ``at``."""
    head, body = struct.pack(order + "H", len(entries)), b""
    start = at + 2 + 12 * len(entries) + 4
    for tag, kind, values in sorted(entries):
        data = content(kind, values, order)
        place = data.ljust(4, b"\0")
        if len(data) > 4:
            place = struct.pack(order + "I", start + len(body))
            body += data + b"\0" * (len(data) % 2)
        head += struct.pack(order + "HHI", tag, kind, len(data) // SIZES[kind]) + place
    return head + bytes(4) + body


def tiff(entries, order="<"):
    return (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "I", 8) + directory(entries, 8, order)


def dng(mosaic, *, pattern="RGGB", black=(0,), white=4095, crop=None, more=(), exif=(), gps=(), strip=None, per=None, order="<"):
    """Return a DNG of ``mosaic`` (rows, columns) or (rows, columns, 3); ``crop`` is x, y, width, height, ``per`` rows a strip."""
    rows, columns = mosaic.shape[:2]
    samples = 1 if mosaic.ndim == 2 else mosaic.shape[2]
    coloured = samples == 1 and pattern is not None
    stride, data = columns * samples * 2, mosaic.astype(order + "u2").tobytes()
    per = per or rows
    strips = [strip] if strip else [data[i * stride : (i + per) * stride] for i in range(0, rows, per)]
    entries = [
        *[(254, LONG, (0,)), (256, LONG, (columns,)), (257, LONG, (rows,)), (258, SHORT, (16,) * samples)],
        *[(259, SHORT, (7 if strip else 1,)), (262, SHORT, (32803 if coloured else 34892,)), (271, ASCII, "Test")],
        *[(272, ASCII, "Camera"), (277, SHORT, (samples,)), (278, LONG, (per,)), (284, SHORT, (1,))],
        *[(50706, BYTE, bytes((1, 4, 0, 0))), (50708, ASCII, "Test Camera"), (50717, LONG, (white,) * samples)],
    ]
    if coloured or samples == 3:
        identity = (1, 0, 0, 0, 1, 0, 0, 0, 1)
        entries += [(50721, SRATIONAL, identity), (50728, RATIONAL, (0.5, 1.0, 0.8)), (50778, SHORT, (21,))]
    if coloured:
        side = round(len(pattern) ** 0.5)
        entries += [(33421, SHORT, (side, side)), (33422, BYTE, bytes("RGB".index(c) for c in pattern))]
    if any(black):
        repeat = (1, 1) if len(black) == 1 or samples == 3 else (2, 2)
        entries += [(50713, SHORT, repeat), (50714, RATIONAL, black)]
    if crop:
        entries += [(50719, RATIONAL, crop[:2]), (50720, RATIONAL, crop[2:])]
    entries += more

    def head(exif_at, gps_at, places):
        extra = ([(34665, LONG, (exif_at,))] if exif else []) + ([(34853, LONG, (gps_at,))] if gps else [])
        return tiff([*entries, *extra, (273, LONG, places), (279, LONG, tuple(map(len, strips)))], order)

    exif_at = len(head(0, 0, (0,) * len(strips)))
    exif_part = directory(exif, exif_at, order) if exif else b""
    gps_at = exif_at + len(exif_part)
    gps_part = directory(gps, gps_at, order) if gps else b""
    places = tuple(np.cumsum([gps_at + len(gps_part), *map(len, strips)])[:-1].tolist())
    return head(exif_at, gps_at, places) + exif_part + gps_part + b"".join(strips)


def lossless_jpeg(samples, precision):
    """Return samples (rows, columns, components) as lossless JPEG (ITU T.81, annex H), each category with a code of 5 bits."""
    values = samples.astype(np.int64)
    before = np.empty_like(values)
    before[:, 1:], before[1:, 0], before[0, 0] = values[:, :-1], values[:-1, 0], 1 << (precision - 1)
    difference = (values - before).ravel()
    size = np.array([int(abs(d)).bit_length() for d in difference])
    low = np.where(difference < 0, difference + (1 << size) - 1, difference)
    bits = "".join(f"{s:05b}" + (f"{v:0{s}b}" if s else "") for s, v in zip(size, low, strict=True))
    bits += "1" * (-len(bits) % 8)
    data = int(bits, 2).to_bytes(len(bits) // 8, "big").replace(b"\xff", b"\xff\0")

    def segment(marker, body):
        return struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body

    rows, columns, components = samples.shape
    table = bytes([0, 0, 0, 0, 0, 17]) + bytes(11) + bytes(range(17))
    frame = struct.pack(">BHHB", precision, rows, columns, components) + b"".join(bytes([i, 17, 0]) for i in range(components))
    scan = bytes([components]) + b"".join(bytes([i, 0]) for i in range(components)) + bytes([1, 0, 0])
    return b"\xff\xd8" + segment(0xC4, table) + segment(0xC3, frame) + segment(0xDA, scan) + data + b"\xff\xd9"


def bayer(red, green, blue, rows=40, columns=64):
    mosaic = np.full((rows, columns), green, float)
    mosaic[0::2, 0::2], mosaic[1::2, 1::2] = red, blue
    return mosaic


def noisy(seed=3, rows=200, columns=300, level=1000):
    rng = np.random.default_rng(seed)
    wave = 1 + 0.2 * np.sin(np.arange(columns) / 30)
    return rng.poisson(bayer(level, 2 * level, 1.2 * level, rows, columns) * wave).astype(np.uint16)


# Levels and colours


@pytest.mark.parametrize("order", ["<", ">"])
def test_the_sum_of_a_flat_patch_by_hand(order):
    black, values = np.array([256, 260, 264, 268]), np.array([1000, 2000, 2010, 1200])
    mosaic = bayer(values[0], values[1], values[3])
    mosaic[1::2, 0::2] = values[2]
    raw = decode_raw(dng(mosaic, black=tuple(black), white=3900, order=order))
    shares = (values - black) / (3900 - black)
    expected = SATURATION * np.array([shares[0], (shares[1] + shares[2]) / 2, shares[3]])
    assert np.abs(colours(raw) - expected).max() < 0.51
    assert np.abs(summed(raw) - expected.sum()).max() < 0.52  # rounding, and 32 bits
    assert raw.step == pytest.approx(SATURATION / (3900 - 262), rel=1e-4)
    assert raw.balance == pytest.approx([2.0, 1.0, 1.25], abs=1e-3)


def test_one_pixel_spreads_alike_wherever_it_lies():
    """The weights 1, 2, 1 of each colour: a red or blue pixel counts whole, each of the two greens half."""
    flat = np.full((32, 40), 100.0)
    for (r, c), share in {(6, 6): 1.0, (6, 7): 0.5, (7, 6): 0.5, (7, 7): 1.0}.items():
        mosaic = flat.copy()
        mosaic[r, c] += 16
        change = summed(decode_raw(dng(mosaic, white=65535))).astype(int) - 300
        expected = np.zeros((32, 40))
        expected[r - 1 : r + 2, c - 1 : c + 2] = 16 * share * KERNEL
        assert (change == expected).all()


def test_noise_hardly_depends_on_the_place_in_the_pattern():
    """Squares of the weights: 1 + 4/16 + 4/16 at red and blue, 1/4 + 4/64 + 2/4 + 2/4 at green. Bilinear has 1.5 and 2."""
    rng = np.random.default_rng(1)
    raw = decode_raw(dng(1000 + rng.normal(0, 20, (600, 800)), white=65535))
    total = summed(raw)[2:-2, 2:-2].astype(float)
    for i in range(2):
        for j in range(2):
            variance = 1.5 if i == j else 1.3125
            assert total[i::2, j::2].std() == pytest.approx(20 * np.sqrt(variance), rel=0.01)  # of 120,000 pixels


def test_nothing_below_saturation_is_cut_off_and_nothing_is_brightened():
    rng = np.random.default_rng(2)
    dark = np.rint(rng.normal(64 + 30, 20, (300, 400))).clip(0)  # 7 % of the pixels lie below black
    total = summed(decode_raw(dng(dark, black=(64,), white=4095)))
    step = SATURATION / (4095 - 64)
    assert total.mean() == pytest.approx(3 * (dark.mean() - 64) * step, rel=0.003)  # 2 % if they were cut
    bright = np.rint(rng.normal(3000, 50, (300, 400)))
    half = summed(decode_raw(dng(np.rint(bright / 2), white=4095))).mean()
    assert summed(decode_raw(dng(bright, white=4095))).mean() == pytest.approx(2 * half, rel=1e-4)
    bright[100:110, 100:110] = 5000  # beyond white, as hot pixels are
    whole = summed(decode_raw(dng(bright, white=4095)))
    assert whole.max() == whole[105, 105] == 3 * SATURATION


@pytest.mark.parametrize("pattern", ["RGGB", "BGGR", "GRBG", "GBRG", XTRANS])
def test_every_pattern(pattern):
    side = round(len(pattern) ** 0.5)
    levels = {"R": 500, "G": 1500, "B": 900}
    mosaic = np.tile(np.array([levels[c] for c in pattern]).reshape(side, side), (20, 24))
    raw = decode_raw(dng(mosaic, pattern=pattern, white=2000))
    assert len(raw.pattern) == side
    assert np.abs(colours(raw) - np.array([500, 1500, 900]) * SATURATION / 2000).max() < 0.51


def test_linear_and_monochrome_files():
    rng = np.random.default_rng(4)
    pixels = rng.integers(64, 4000, (40, 50, 3))
    raw = decode_raw(dng(pixels, black=(64, 64, 64)))
    expected = (pixels - 64).sum(2) * SATURATION / (4095 - 64)
    assert np.abs(summed(raw) - expected).max() < 0.51
    assert raw.channels == 3
    grey = decode_raw(dng(pixels[:, :, 0], pattern=None, black=(64,)))
    assert grey.channels == 1
    assert np.abs(summed(grey) - (pixels[:, :, 0] - 64) * SATURATION / (4095 - 64)).max() < 0.51


@pytest.mark.parametrize("name", SAMPLES)
def test_real_files_against_the_mosaic(shared_data, name):
    data = (shared_data / "raw" / name).read_bytes()
    raw, total = decode_raw(data), None
    total = summed(raw)
    with rawpy.imread(io.BytesIO(data)) as library:
        visible, numbers = library.raw_image_visible, library.raw_colors_visible
        assert visible.shape == total.shape  # none of these has a crop of its own
        black, white = library.black_level_per_channel[0], library.white_level
        shares = (np.minimum(visible, white).astype(float) - black) / (white - black) * SATURATION
        # Over a smooth area the sum of channels is the sum of the means of each colour's own pixels.
        rows, columns = slice(300, 340), slice(400, 440)
        means = [shares[rows, columns][np.isin(numbers[rows, columns], n)].mean() for n in ((0,), (1, 3), (2,))]
    assert total[rows, columns].mean() == pytest.approx(sum(means), rel=0.004)  # edges of the area
    assert raw.step == pytest.approx(SATURATION / (white - black))


def test_the_gamma_curve_is_that_of_bt709():
    assert gamma_coded(np.array([0.0, 0.01, 0.18, 1.0])) == pytest.approx([0.0, 0.045, 0.409, 1.0], abs=5e-4)
    below, above = gamma_coded(np.array([0.01805, 0.018051]))
    assert above - below == pytest.approx(4.5e-6, abs=1e-7)  # value and slope go on
    shown = mean_level(ChannelSum(np.array([[0, 1966, 35389, 196605]], np.uint32), 3, 196605, linear=True))
    assert shown.tolist() == [[0, 11, 104, 255]]


# The frame


@pytest.mark.parametrize("orientation", range(1, 9))
def test_never_turned(orientation):
    mosaic = noisy()
    raw = decode_raw(dng(mosaic, more=[(274, SHORT, (orientation,))]))
    assert (raw.values == mosaic).all()


@pytest.mark.parametrize(
    ("active", "crop"),
    [
        (None, (8, 6, 200, 100)),
        (None, (9, 5, 201, 101)),
        ((10, 12, 190, 290), (4, 6, 200, 100)),
        ((11, 13, 190, 290), (5, 7, 99, 98)),
    ],
)
def test_the_frame_is_the_default_crop(active, crop):
    mosaic = noisy()
    more = [(50829, LONG, active)] if active else []
    y, x = (active or (0, 0))[:2]
    top, left = y + crop[1], x + crop[0]
    # The pattern starts with the active area.
    raw = decode_raw(dng(mosaic, crop=crop, more=more))
    assert (raw.values == mosaic[top : top + crop[3], left : left + crop[2]]).all()
    phase = np.array([[0, 1], [1, 2]])
    assert (raw.pattern == np.roll(phase, (-crop[1], -crop[0]), (0, 1))).all()


def test_without_a_crop_a_full_preview_tells_the_frame():
    sizes = SimpleNamespace(top_margin=10, left_margin=20, height=400, width=600, raw_height=420, raw_width=630)
    sizes.crop_top_margin = sizes.crop_left_margin = sizes.crop_height = sizes.crop_width = 0

    def frame(width, height, crop=None):
        stream = io.BytesIO()
        Image.new("RGB", (width, height)).save(stream, "JPEG")
        thumb = SimpleNamespace(format=rawpy.ThumbFormat.JPEG, data=stream.getvalue())
        if crop:
            sizes.crop_top_margin, sizes.crop_left_margin, sizes.crop_height, sizes.crop_width = crop
        return _frame(SimpleNamespace(sizes=sizes, extract_thumb=lambda: thumb), rawpy, None)

    assert frame(592, 390) == (15, 24, 390, 592)
    assert frame(160, 120) == (10, 20, 400, 600)  # a thumbnail
    assert frame(592, 390, (12, 22, 380, 580)) == (12, 22, 380, 580)  # the file's own word goes first
    assert frame(592, 390, (0, 0, 380, 580)) == (15, 24, 390, 592)  # a crop outside what the sensor sees is none


# Whole or broken


def compressed():
    mosaic = noisy()
    return dng(mosaic, white=16383, strip=lossless_jpeg(mosaic.reshape(200, 150, 2), 14)), mosaic


@pytest.fixture(params=[*SAMPLES, "compressed", "strips"])
def sample(request, shared_data):
    if request.param == "compressed":
        return compressed()[0]
    if request.param == "strips":
        return dng(noisy(), per=16, order=">")
    return (shared_data / "raw" / request.param).read_bytes()


def test_lossless_jpeg_is_decoded():
    data, mosaic = compressed()
    assert (whole_raw(data).values == mosaic).all()


def test_a_whole_file_passes(sample):
    assert whole_raw(sample).values.size


def test_a_file_cut_short_anywhere_is_found(sample):
    for length in {*np.linspace(0, len(sample) - 1, 12).astype(int).tolist(), 100, len(sample) - 10, len(sample) - 300}:
        with pytest.raises(ValueError, match="empty|truncated|not a RAW"):
            whole_raw(sample[:length])


def test_a_file_that_was_never_filled_is_found(sample):
    # All but the last part of a row: 1,000 bytes.
    for length in np.linspace(600, len(sample) - 1000, 10).astype(int):
        with pytest.raises(ValueError, match="truncated|damaged|not a RAW|alike|not decodable"):
            whole_raw(sample[:length] + bytes(len(sample) - length))
    for size in (4096, 20000):
        middle = len(sample) // 2
        with pytest.raises(ValueError, match="truncated|damaged|not decodable"):
            whole_raw((sample[:middle] + bytes(size) + sample[middle + size :])[: len(sample)])


@pytest.mark.parametrize("name", [*SAMPLES[:2], "compressed", "strips"])
def test_random_bytes_are_found(name, shared_data):
    sample = {"compressed": compressed()[0], "strips": dng(noisy(), per=16)}.get(name)
    sample = sample or (shared_data / "raw" / name).read_bytes()
    for length in np.linspace(600, len(sample) - 20000, 8).astype(int):
        with pytest.raises(ValueError, match="truncated|damaged|not a RAW|random|not decodable"):
            whole_raw(sample[:length] + np.random.default_rng(length).bytes(len(sample) - length))


def test_strips_beyond_the_end_are_found():
    data = dng(noisy())
    place = data.index(struct.pack("<HHI", 279, LONG, 1)) + 8
    longer = data[:place] + struct.pack("<I", len(data)) + data[place + 4 :]
    with pytest.raises(ValueError, match=r"truncated, \d+ bytes are missing"):
        whole_raw(longer)


def test_other_files_are_no_raw(shared_data):
    stream = io.BytesIO()
    Image.fromarray(np.arange(30000, dtype=np.uint8).reshape(100, 100, 3)).save(stream, "TIFF")
    jpg = (shared_data / "copr" / "images" / "IMG_0022.jpg").read_bytes()
    for data in (b"hello world\n" * 300, jpg, stream.getvalue(), bytes(5000)):
        with pytest.raises(ValueError, match="not a RAW photograph"):
            whole_raw(data)
    with pytest.raises(ValueError, match="X3F"):
        whole_raw(b"FOVb" + bytes(1000))


def test_what_is_too_bright_or_too_dark_is_not_broken():
    mosaic = noisy()
    mosaic[50:90, 20:290] = 3800  # a sensor that saturates below the level that the file gives
    mosaic[mosaic > 3800] = 3800
    assert whole_raw(dng(mosaic, white=4095)).values.shape == mosaic.shape
    mosaic[120:150, 5:290] = 0  # and one that takes the black off before it writes
    assert whole_raw(dng(mosaic, white=4095)).values.shape == mosaic.shape
    smooth = np.random.default_rng(6).poisson(1000, (200, 300, 3))
    smooth[40:80, :290] = 700  # developed, and its noise taken away
    assert whole_raw(dng(smooth)).values.shape == smooth.shape
    smooth[150:] = 0  # never written
    with pytest.raises(ValueError, match="repeat themselves in row 150"):
        whole_raw(dng(smooth))


def test_a_file_that_decodes_to_other_pixels_each_time_is_found(monkeypatch):
    frames = iter([noisy(1), noisy(2)])
    monkeypatch.setattr(wholeness, "decode_raw", lambda _: decode_raw(dng(next(frames))))
    with pytest.raises(ValueError, match="other pixels each time"):
        whole_raw(dng(noisy()))


def test_damaged_bytes_never_end_in_another_error():
    rng = np.random.default_rng(9)
    data = np.frombuffer(dng(noisy(rows=48, columns=64), exif=[(37386, RATIONAL, (4.0,))]), np.uint8)
    refused = 0
    for _ in range(150):
        damaged = data.copy()
        damaged[rng.integers(4, 500, 4)] = rng.integers(0, 256, 4)
        try:
            whole_raw(damaged.tobytes())
        except ValueError:
            refused += 1
        read_metadata(damaged.tobytes())
    assert refused


# Metadata


EXIF = [
    (37386, RATIONAL, (8.8,)),
    (41989, SHORT, (24,)),
    (36867, ASCII, "2024:05:06 10:11:12"),
    (41486, RATIONAL, (4100.0,)),
    (41488, SHORT, (3,)),
    (40962, SHORT, (5184,)),
    (40963, SHORT, (3456,)),
]
GPS = [
    (1, ASCII, "N"),
    (2, RATIONAL, (43.0, 30.0, 0.0)),
    (3, ASCII, "E"),
    (4, RATIONAL, (5.0, 0.0, 36.0)),
    (6, RATIONAL, (71.5,)),
]
XMP = (
    b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description '
    b'xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/" drone-dji:RelativeAltitude="+60.2" drone-dji:GimbalYawDegree="12.5"/>'
    b"</rdf:RDF></x:xmpmeta>"
)


def box(kind, data):
    return struct.pack(">I", len(data) + 8) + kind + data


def cr3():
    canon = bytes.fromhex("85c0b687820f11e08111f4ce462b6a48")
    parts = [(b"CMT1", tiff([(271, ASCII, "Test"), (272, ASCII, "Camera")])), (b"CMT2", tiff(EXIF)), (b"CMT4", tiff(GPS))]
    moov = box(b"uuid", canon + box(b"CNCV", b"x") + b"".join(box(k, d) for k, d in parts))
    xmp = box(b"uuid", bytes.fromhex("be7acfcb97a942e89c71999491e3afac") + XMP)
    return box(b"ftyp", b"crx isom") + box(b"moov", moov) + xmp + box(b"mdat", bytes(100))


def raf():
    exif = Image.Exif()
    exif[271], exif[272] = "Test", "Camera"
    exif.get_ifd(ExifTags.IFD.Exif).update({37386: 8.8, 41989: 24, 36867: "2024:05:06 10:11:12"})
    exif.get_ifd(ExifTags.IFD.GPSInfo).update({1: "N", 2: (43.0, 30.0, 0.0), 3: "E", 4: (5.0, 0.0, 36.0), 6: 71.5})
    stream = io.BytesIO()
    Image.new("RGB", (32, 24)).save(stream, "JPEG", exif=exif, xmp=XMP)
    jpg = stream.getvalue()
    head = (b"FUJIFILMCCD-RAW 0201FF".ljust(84, b"\0") + struct.pack(">6I", 108, len(jpg), 0, 0, 0, 0)).ljust(108, b"\0")
    return head + jpg


def like_tiff(head):
    data = dng(noisy(), exif=EXIF, gps=GPS, more=[(700, BYTE, XMP)])
    return head + data[len(head) :]


@pytest.mark.parametrize(
    "data", [like_tiff(b"II*\0"), like_tiff(b"IIRO"), like_tiff(b"IIRS"), like_tiff(b"IIU\0"), cr3(), raf()],
    ids=["dng", "orf", "orf2", "rw2", "cr3", "raf"],
)  # fmt: skip
def test_exif_xmp_and_gnss(data):
    told = read_metadata(data)
    assert told.problems == ()
    assert told.body == "Test Camera"
    assert (told.focal_length, told.focal_length_35mm) == (8.8, 24.0)
    assert told.time == "2024-05-06T10:11:12"
    assert (told.position.longitude, told.position.latitude) == pytest.approx((5.01, 43.5))
    assert told.position.height == 71.5
    assert (told.relative_height, told.yaw) == (60.2, 12.5)


def test_exposure_tags_in_the_main_directory(shared_data):
    tags = read_tags((shared_data / "raw" / "kodak_dc50.kdc").read_bytes())
    assert float(tags.exposure[ExifTags.Base.FocalLength]) == 37.0
    assert read_metadata(tiff([(272, ASCII, "Camera"), (37386, RATIONAL, (8.8,))])).focal_length == 8.8


def test_a_raw_that_shows_more_than_its_jpg_keeps_the_pitch():
    told = Metadata(focal_length=8.8, focal_plane=410.0, exif_side=5184)
    assert focal_pixels(told, 5184, 3456) == focal_pixels(told, 5202, 3465) == pytest.approx(8.8 * 410)
    assert focal_pixels(told, 2592, 1728) == pytest.approx(8.8 * 410 / 2)  # made smaller


# Steps


@pytest.fixture
def flight(tmp_path):
    folder = tmp_path / "images"
    folder.mkdir()
    for i in range(2):
        (folder / f"a{i}.dng").write_bytes(dng(noisy(i), crop=(4, 2, 280, 190), exif=EXIF[:3], gps=GPS))
    return folder


def test_a_survey_of_raw(flight, tmp_path):
    createsurvey.run(createsurvey.Request(str(flight), str(tmp_path / "survey")))
    survey = Survey.open(tmp_path / "survey")
    first = survey.photographs[0]
    assert (first.name, first.width, first.height) == ("a0.dng", 280, 190)
    assert first.camera == "Test Camera, 8.8 mm, 280 x 190"
    assert first.focal == pytest.approx(24.0 * np.hypot(280, 190) / np.hypot(36, 24))
    assert first.position.height == 71.5
    total = read_channel_sum(survey.path(first), first)
    assert total.values.shape == (190, 280)
    assert (total.channels, total.white, total.linear) == (3, 3 * SATURATION, True)
    assert total.step == pytest.approx(SATURATION / 4095)
    (flight / "a0.dng").write_bytes((flight / "a1.dng").read_bytes())
    with pytest.raises(InputError, match=r"a0\.dng has changed"):
        read_channel_sum(flight / "a0.dng", first)


def test_broken_raw_is_named_and_costs_nothing(flight, tmp_path):
    whole = (flight / "a0.dng").read_bytes()
    (flight / "cut.dng").write_bytes(whole[:-5000])
    (flight / "text.nef").write_text("not a photograph" * 100)
    Image.new("RGB", (64, 48)).save(flight / "jpg.arw", "JPEG")
    with pytest.raises(InputError, match=r"3 of 5 photographs") as refused:
        createsurvey.run(createsurvey.Request(str(flight), str(tmp_path / "survey")))
    text = str(refused.value)
    assert "cut.dng (truncated, 5000 bytes are missing)" in text
    assert "text.nef (not a RAW photograph that LibRaw can decode)" in text
    assert "jpg.arw (not a RAW" in text
    assert text.count(". ") == 0
    assert not (tmp_path / "survey").exists()


def test_a_survey_of_an_engine_that_could_not_read_raw(flight, tmp_path):
    import json

    request = createsurvey.Request(str(flight), str(tmp_path / "survey"))
    createsurvey.run(request)
    path = tmp_path / "survey" / "survey.json"
    today = json.loads(path.read_text())
    for decodable, standing in ((True, True), (False, False)):
        photographs = [{**p, "decodable": decodable} for p in today["photographs"]]
        path.write_text(json.dumps({**today, "photographs": photographs}))
        assert (Survey.open(tmp_path / "survey").record("createsurvey") is not None) == standing
    createsurvey.run(request)
    assert Survey.open(tmp_path / "survey").require("createsurvey")


def test_the_surface_sees_balanced_colours_and_all_bits(tmp_path):
    # A grey card under the light that the file calls neutral: 0.5, 1, 0.8.
    path = tmp_path / "card.dng"
    path.write_bytes(dng(bayer(500, 1000, 800), white=4000))
    picture = read_reduced(str(path), 0)
    level = 65535 * float(gamma_coded(np.array(0.25)))
    assert picture.dtype == np.uint16
    assert picture.shape == (40, 64, 3)
    # A DN of the weakest colour is a 4,000th of white; where the gamma curve has a slope of about 1 that is 16 shades.
    assert (np.abs(picture - level) <= 20).all()
    assert read_reduced(str(path), 2).shape == (10, 16, 3)
    grey = read_grey(str(path), 1)
    assert grey.dtype == np.float32
    assert grey == pytest.approx(3 * 255 * float(gamma_coded(np.array(2300 / 12000))), abs=5e-3)  # rounding
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(InputError, match=r"card\.dng cannot be decoded"):
        read_grey(str(path), 0)


def test_enhanced_sand_does_not_move_with_the_pattern(shared_data):
    """The same ground under another phase of the pattern looks the same: two frames of one photograph, an odd shift apart."""
    data = (shared_data / "raw" / SAMPLES[1]).read_bytes()
    raw = decode_raw(data)
    mosaic, (dy, dx) = raw.values, (41, 25)
    totals = []
    for pattern, part in (("RGGB", mosaic[:600, :800]), ("BGGR", mosaic[dy : 600 + dy, dx : 800 + dx])):
        cut = decode_raw(dng(part, pattern=pattern, black=(512,), white=16383))
        totals.append(ChannelSum(summed(cut), 3, 3 * SATURATION, cut.step, True))
    first, second = (enhance_photograph(total, "arctan", 51)[0].astype(int) for total in totals)
    assert np.abs(first[100 + dy : 500 + dy, 100 + dx : 700 + dx] - second[100:500, 100:700]).max() <= 1
    assert first[100:500, 100:700].std() > 40  # contrast there is


@pytest.mark.parametrize("source", ["enhanced", "original"])
def test_tie_points_of_raw(shared_data, tmp_path, source):
    mosaic = decode_raw((shared_data / "raw" / SAMPLES[1]).read_bytes()).values
    (tmp_path / "images").mkdir()
    for name, pattern, part in (("a", "RGGB", mosaic[:480, :640]), ("b", "BGGR", mosaic[41:521, 25:665])):
        (tmp_path / "images" / f"{name}.dng").write_bytes(dng(part, pattern=pattern, black=(512,), white=16383))
    survey = str(tmp_path / "survey")
    createsurvey.run(createsurvey.Request(str(tmp_path / "images"), survey))
    if source == "enhanced":
        enhance.run(enhance.Request(survey, window=51, workers=1))
    result = tiepoints.run(tiepoints.Request(survey, source=source, max_features=2000, workers=1))
    assert (result.pair_count, result.match_count > 400) == (1, True)
    with sqlite3.connect(tmp_path / "survey" / "features.db") as database:
        tables = database.execute("select rows, cols, data from keypoints order by image_id").fetchall()
        rows, columns, data = database.execute("select rows, cols, data from two_view_geometries").fetchone()
    first, second = (np.frombuffer(d, np.float32).reshape(r, c)[:, :2] for r, c, d in tables)
    pairs = np.frombuffer(data, np.uint32).reshape(rows, columns)
    shift = first[pairs[:, 0]] - second[pairs[:, 1]]
    assert np.median(shift, axis=0) == pytest.approx([25, 41], abs=0.02)  # the pixels are the same


def test_libraw_uses_one_thread_and_the_environment_stays(shared_data):
    code = (
        "import os, sys\n"
        "from strandline.core.photographs.raw import decode_raw, _library\n"
        "decode_raw(open(sys.argv[1], 'rb').read())\n"
        "assert os.environ.get('OMP_NUM_THREADS') == '7'\n"
        "print(len(os.listdir('/proc/self/task')) if os.path.isdir('/proc/self/task') else 1)\n"
    )
    environment = {**os.environ, "OMP_NUM_THREADS": "7", "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    path = str(shared_data / "raw" / SAMPLES[0])
    subprocess.run([sys.executable, "-c", code, path], check=True, env=environment)


def test_an_inspection_crosses_to_other_processes(flight):
    found = inspect(str(flight / "a0.dng"), "a0.dng")
    assert encode(found.photograph)["width"] == 280
