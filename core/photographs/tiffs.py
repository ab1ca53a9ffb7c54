"""The skeleton of TIFF files and of RAW files that are built like them: where the pixels should lie, and which count."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

# Olympus (IIRO, IIRS, MMOR) and Panasonic (IIU) write other numbers where TIFF has 42.
_HEADS = (b"II*\0", b"MM\0*", b"IIRO", b"IIRS", b"MMOR", b"IIU\0")
_RATIONAL = "II"
_FORMATS = {1: "B", 3: "H", 4: "I", 5: _RATIONAL, 13: "I"}  # of the types of TIFF that are used here
_SUB_IFDS = 330
_PIXELS = ((273, 279), (324, 325), (513, 514))  # strips, tiles, a JPG: tags of their offsets and lengths
_CROP_ORIGIN, _CROP_SIZE, _ACTIVE = 50719, 50720, 50829
_MOST = 1_000_000  # strips or tiles, more than any file has
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
        When the list of parts lies beyond the end of the file.
    """
    found = []
    for tags in _directories(data):
        for offsets, lengths in _PIXELS:
            both = zip(_values(data, tags.get(offsets)), _values(data, tags.get(lengths)), strict=False)
            found.append([Part(int(o), int(n)) for o, n in both if o != _UNUSED])
    return [picture for picture in found if picture]


def default_crop(data: bytes) -> tuple[int, int, int, int] | None:
    """Return top, left, height and width of the frame that a DNG names, in the pixels it holds; None when it names none.

    ``DefaultCropOrigin`` counts from the corner of ``ActiveArea`` (DNG 1.4). LibRaw moves odd corners by a pixel.

    Raises
    ------
    ValueError
        When the tags lie beyond the end of the file.
    """
    for tags in _directories(data):
        origin, size = (_values(data, tags.get(tag)) for tag in (_CROP_ORIGIN, _CROP_SIZE))
        if len(origin) == len(size) == 2:
            top, left, *_ = _values(data, tags.get(_ACTIVE)) or [0, 0]
            return round(top + origin[1]), round(left + origin[0]), round(size[1]), round(size[0])
    return None


def _directories(data: bytes) -> Iterator[dict[int, int]]:
    """Yield where the entries of each directory are, by tag; what some makers write where none follows is passed over."""
    order = _order(data)
    waiting, seen = [_number(data, order + "I", 4)], set[int]()
    while waiting:
        place = waiting.pop()
        if place in seen or place == 0 or place + 2 > len(data):
            continue
        seen.add(place)
        end = place + 2 + 12 * _number(data, order + "H", place)
        if end + 4 > len(data):
            continue
        tags = {_number(data, order + "H", entry): entry for entry in range(place + 2, end, 12)}
        waiting += [_number(data, order + "I", end), *(int(v) for v in _values(data, tags.get(_SUB_IFDS)))]
        yield tags


def _order(data: bytes) -> str:
    return "<" if data.startswith(b"II") else ">"


def _number(data: bytes, form: str, place: int) -> int:
    try:
        (value,) = struct.unpack_from(form, data, place)
    except struct.error as error:
        raise ValueError("truncated") from error
    return int(value)


def _values(data: bytes, entry: int | None) -> list[float]:
    """Return the numbers of a directory's entry; none without an entry, or when they are not numbers."""
    if entry is None:
        return []
    order = _order(data)
    form = _FORMATS.get(_number(data, order + "H", entry + 2))
    count = _number(data, order + "I", entry + 4)
    if form is None or count > _MOST:
        return []
    size = struct.calcsize("=" + form) * count
    place = entry + 8 if size <= 4 else _number(data, order + "I", entry + 8)
    if place + size > len(data):
        raise ValueError("truncated")
    numbers = struct.unpack_from(order + form * count, data, place)
    if form == _RATIONAL:
        return [a / b if b else 0.0 for a, b in zip(numbers[::2], numbers[1::2], strict=True)]
    return list(numbers)
