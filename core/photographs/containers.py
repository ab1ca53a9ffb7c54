"""Where files keep their EXIF and XMP: JPG, PNG, whatever is built like a TIFF, Canon's CR3 and Fujifilm's RAF."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from PIL import ExifTags, Image

from .tiffs import as_tiff, is_tiff

_RAF = b"FUJIFILMCCD-RAW"
_CANON = bytes.fromhex("85c0b687820f11e08111f4ce462b6a48")  # the box with Canon's directories
_XMP = bytes.fromhex("be7acfcb97a942e89c71999491e3afac")


@dataclass(frozen=True)
class Tags:
    """EXIF by number: the main directory, that of the exposure, that of the GNSS; and the XMP packet, None without one."""

    base: dict[int, Any] = field(default_factory=dict)
    exposure: dict[int, Any] = field(default_factory=dict)
    gps: dict[int, Any] = field(default_factory=dict)
    xmp: bytes | str | None = None


def read_tags(data: bytes) -> Tags:
    """Return the tags of a photograph's file; what is built in another way has none.

    Raises
    ------
    Exception
        One of ``reading.BROKEN`` when the tags are broken.
    """
    if is_tiff(data):
        exif = _exif(as_tiff(data))
        # Kodak and others follow TIFF/EP, which has the exposure's tags in the main directory.
        exposure = {**exif, **exif.get_ifd(ExifTags.IFD.Exif)}
        return Tags(dict(exif), exposure, dict(exif.get_ifd(ExifTags.IFD.GPSInfo)), exif.get(ExifTags.Base.XMLPacket))
    if data.startswith(_RAF):
        start, length = (int.from_bytes(data[place : place + 4], "big") for place in (84, 88))
        return read_tags(data[start : start + length])
    if data[4:8] == b"ftyp":
        return _cr3(data)
    if data.startswith((b"\xff\xd8", b"\x89PNG")):
        with Image.open(io.BytesIO(data)) as image:
            exif, packet = image.getexif(), image.info.get("xmp") or image.info.get("XML:com.adobe.xmp")
        return Tags(dict(exif), dict(exif.get_ifd(ExifTags.IFD.Exif)), dict(exif.get_ifd(ExifTags.IFD.GPSInfo)), packet)
    return Tags()


def _exif(data: bytes) -> Image.Exif:
    exif = Image.Exif()
    exif.load_from_fp(io.BytesIO(data))
    return exif


def _cr3(data: bytes) -> Tags:
    directories: dict[bytes, dict[int, Any]] = {}
    packet = None
    for kind, content in boxes(data):
        if kind == b"uuid" and content.startswith(_XMP):
            packet = content[len(_XMP) :]
        if kind == b"moov":
            for inner, canon in boxes(content):
                if inner == b"uuid" and canon.startswith(_CANON):
                    for name, tiff in boxes(canon[len(_CANON) :]):
                        if name in (b"CMT1", b"CMT2", b"CMT4"):
                            directories[name] = dict(_exif(tiff))
    base, exposure, gps = (directories.get(name, {}) for name in (b"CMT1", b"CMT2", b"CMT4"))
    return Tags(base, exposure, gps, packet)


def boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield kind and content of the boxes of an ISO base media file (ISO/IEC 14496-12), or of one of its boxes.

    Raises
    ------
    ValueError
        When a box is longer than what holds it.
    """
    place = 0
    while place + 8 <= len(data):
        size, kind, head = int.from_bytes(data[place : place + 4], "big"), data[place + 4 : place + 8], 8
        if size == 1:
            size, head = int.from_bytes(data[place + 8 : place + 16], "big"), 16
        elif size == 0:  # to the end
            size = len(data) - place
        if size < head or place + size > len(data):
            raise ValueError("truncated")
        yield kind, data[place + head : place + size]
        place += size
