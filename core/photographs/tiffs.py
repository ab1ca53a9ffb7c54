"""The skeleton of TIFF files and of RAW files that are built like them: where the pixels should lie."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

# Olympus (IIRO, IIRS, MMOR) and Panasonic (IIU) write other numbers where TIFF has 42.
_HEADS = (b"II*\0", b"MM\0*", b"IIRO", b"IIRS", b"MMOR", b"IIU\0")
_FORMATS = {1: "B", 3: "H", 4: "I", 13: "I"}  # of the types that offsets and counts may have
_SUB_IFDS = 330
_PIXELS = ((273, 279), (324, 325), (513, 514))  # strips, tiles, a JPG: tags of their offsets and lengths
_MOST = 10_000_000  # strips or tiles, more than any file has
_UNUSED = 0xFFFFFFFF  # what Panasonic writes as the offset of its one strip


@dataclass(frozen=True)
class Part:
    """A strip, a tile or a whole JPG in the file, in bytes."""

    offset: int
    length: int


def is_tiff(data: bytes) -> bool:
    """Tell whether a file is built like a TIFF."""
    return data.startswith(_HEADS)


def as_tiff(data: bytes) -> bytes:
    """Return a file that is built like a TIFF with the head that TIFF has."""
    return (b"II*\0" if data.startswith(b"II") else b"MM\0*") + data[4:]


def pictures(data: bytes) -> list[list[Part]]:
    """Return the parts of each picture in a TIFF: its main image, previews and, in sub-directories, the RAW.

    Raises
    ------
    ValueError
        When a directory lies beyond the end of the file.
    """
    order = "<" if data.startswith(b"II") else ">"
    waiting, seen, found = [_number(data, order + "I", 4)], set[int](), []
    while waiting:
        place = waiting.pop()
        if place in seen or place == 0:
            continue
        seen.add(place)
        tags = {}
        count = _number(data, order + "H", place)
        for entry in range(place + 2, place + 2 + 12 * count, 12):
            tags[_number(data, order + "H", entry)] = entry
        waiting.append(_number(data, order + "I", place + 2 + 12 * count))
        if _SUB_IFDS in tags:
            waiting += _values(data, order, tags[_SUB_IFDS])
        for offsets, lengths in _PIXELS:
            if offsets in tags and lengths in tags:
                both = zip(_values(data, order, tags[offsets]), _values(data, order, tags[lengths]), strict=False)
                found.append([Part(o, n) for o, n in both if o != _UNUSED])
    return [picture for picture in found if picture]


def _number(data: bytes, form: str, place: int) -> int:
    try:
        (value,) = struct.unpack_from(form, data, place)
    except struct.error as error:
        raise ValueError("truncated") from error
    return int(value)


def _values(data: bytes, order: str, entry: int) -> Iterator[int]:
    """Return the whole numbers of a directory's entry; those of another type are none."""
    form = _FORMATS.get(_number(data, order + "H", entry + 2))
    count = _number(data, order + "I", entry + 4)
    if form is None or count > _MOST:
        return iter(())
    size = struct.calcsize(form) * count
    place = entry + 8 if size <= 4 else _number(data, order + "I", entry + 8)
    if place + size > len(data):
        raise ValueError("truncated")
    return iter(struct.unpack_from(f"{order}{count}{form}", data, place))
