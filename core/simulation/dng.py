"""RAW files of simulated photographs: the least that a DNG (Adobe 2012, version 1.4) needs, in a plain TIFF 6.0."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags

from . import sensor
from .exif import MAKER, MODEL, Metadata, tags, xmp

Entry = tuple[int, int, bytes]  # kind, count, content

_BYTE, _ASCII, _SHORT, _LONG, _RATIONAL, _SRATIONAL = 1, 2, 3, 4, 5, 10
_HEADER = 8
_CFA = 32803  # PhotometricInterpretation: a mosaic of colour filters
_D65 = 21  # LightSource: daylight
# Linear sRGB of CIE XYZ (IEC 61966-2-1), which is what this camera sees but for its neutral.
_SRGB_FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
_MILLION = 10**6

_CFA_REPEAT, _CFA_PATTERN, _CFA_COLOURS, _CFA_LAYOUT = 33421, 33422, 50710, 50711
_DNG_VERSION, _DNG_BACKWARD, _CAMERA = 50706, 50707, 50708
_BLACK_LEVEL, _WHITE_LEVEL, _CROP_ORIGIN, _CROP_SIZE = 50714, 50717, 50719, 50720
_COLOUR_MATRIX, _AS_SHOT_NEUTRAL, _ILLUMINANT = 50721, 50728, 50778


def save_dng(path: Path, mosaic: NDArray[np.uint16], metadata: Metadata) -> None:
    """Write ``mosaic`` (rows, columns; DN) with its metadata, which are those of the JPG.

    Samples take 16 bits: packed to 12 they would save a quarter of the file, but are read bit by bit.
    """
    rows, columns = mosaic.shape
    shared = tags(metadata, columns, rows)
    photo, gps = ({tag: _inferred(value) for tag, value in values.items()} for values in (shared.photo, shared.gps))
    first = {tag: _inferred(value) for tag, value in shared.base.items()}
    first |= _picture(rows, columns) | {ExifTags.Base.XMLPacket: _bytes(xmp(metadata).encode())}
    # The places of what follows are known once the lengths are.
    photo_at = _HEADER + len(_directory(first, _HEADER))
    gps_at = photo_at + len(_directory(photo, photo_at))
    strip_at = gps_at + len(_directory(gps, gps_at))
    first |= {
        ExifTags.Base.ExifOffset: _longs(photo_at),
        ExifTags.Base.GPSInfo: _longs(gps_at),
        ExifTags.Base.StripOffsets: _longs(strip_at),
    }
    head = struct.pack("<2sHL", b"II", 42, _HEADER)
    directories = _directory(first, _HEADER) + _directory(photo, photo_at) + _directory(gps, gps_at)
    path.write_bytes(head + directories + mosaic.astype("<u2").tobytes())


def _picture(rows: int, columns: int) -> dict[int, Entry]:
    """Return the tags that tell a reader what the samples are; the three places are still to be filled in."""
    base = ExifTags.Base
    matrix = np.array(sensor.NEUTRAL)[:, None] * _SRGB_FROM_XYZ
    return {
        base.NewSubfileType: _longs(0),
        base.ImageWidth: _longs(columns),
        base.ImageLength: _longs(rows),
        base.BitsPerSample: _shorts(16),
        base.Compression: _shorts(1),
        base.PhotometricInterpretation: _shorts(_CFA),
        base.StripOffsets: _longs(0),
        base.SamplesPerPixel: _shorts(1),
        base.RowsPerStrip: _longs(rows),
        base.StripByteCounts: _longs(2 * rows * columns),
        base.PlanarConfiguration: _shorts(1),
        base.ExifOffset: _longs(0),
        base.GPSInfo: _longs(0),
        _CFA_REPEAT: _shorts(*sensor.PATTERN.shape),
        _CFA_PATTERN: _bytes(sensor.PATTERN.astype(np.uint8).tobytes()),
        _CFA_COLOURS: _bytes(b"\0\1\2"),
        _CFA_LAYOUT: _shorts(1),
        _DNG_VERSION: _bytes(b"\1\4\0\0"),
        _DNG_BACKWARD: _bytes(b"\1\1\0\0"),
        _CAMERA: _text(f"{MAKER} {MODEL}"),
        _BLACK_LEVEL: _shorts(sensor.BLACK),
        _WHITE_LEVEL: _shorts(sensor.WHITE),
        _CROP_ORIGIN: _longs(0, 0),
        _CROP_SIZE: _longs(columns, rows),
        _COLOUR_MATRIX: _fractions(((round(v * _MILLION), _MILLION) for v in matrix.flat), signed=True),
        _AS_SHOT_NEUTRAL: _fractions((round(v * _MILLION), _MILLION) for v in sensor.NEUTRAL),
        _ILLUMINANT: _shorts(_D65),
    }


def _directory(entries: Mapping[int, Entry], start: int) -> bytes:
    """Return an image file directory that lies at ``start``, and behind it the contents longer than four bytes."""
    place = start + 2 + 12 * len(entries) + 4
    fields, contents = struct.pack("<H", len(entries)), b""
    for tag, (kind, count, content) in sorted(entries.items()):
        if len(content) <= 4:
            held = content.ljust(4, b"\0")
        else:
            held = struct.pack("<L", place + len(contents))
            contents += content + bytes(len(content) % 2)  # each begins at an even place
        fields += struct.pack("<HHL", tag, kind, count) + held
    return fields + struct.pack("<L", 0) + contents


def _inferred(value: Any) -> Entry:
    """Return the entry of what EXIF holds: text, bytes, a whole number, a fraction or several."""
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bytes):
        return _bytes(value)
    if isinstance(value, int):
        return _shorts(value) if value < 1 << 16 else _longs(value)
    several = value if isinstance(value, tuple) else (value,)
    return _fractions((v.numerator, v.denominator) for v in several)


def _bytes(content: bytes) -> Entry:
    return _BYTE, len(content), content


def _text(text: str) -> Entry:
    content = text.encode("ascii") + b"\0"
    return _ASCII, len(content), content


def _shorts(*values: int) -> Entry:
    return _SHORT, len(values), struct.pack(f"<{len(values)}H", *values)


def _longs(*values: int) -> Entry:
    return _LONG, len(values), struct.pack(f"<{len(values)}L", *values)


def _fractions(values: Iterable[tuple[int, int]], *, signed: bool = False) -> Entry:
    parts = [struct.pack("<2l" if signed else "<2L", *value) for value in values]
    return (_SRATIONAL if signed else _RATIONAL), len(parts), b"".join(parts)
