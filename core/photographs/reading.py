"""Decoding photographs, and telling the whole from the broken.

Pixels are those of the stored frame: the EXIF orientation is never applied.
"""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray
from PIL import Image

from ..errors import InputError
from ..files import bytes_digest
from ..survey import Photograph
from .raw import SATURATION, colours, decode_raw, summed
from .signal import STRIP, block_means, strip_starts

JPG = frozenset({".jpg", ".jpeg", ".jpe"})
TIFF = frozenset({".tif", ".tiff"})
PNG = frozenset({".png"})
_RAW = "3fr arw cr2 cr3 crw dng erf fff iiq kdc mos mrw nef nrw orf pef raf raw rw2 rwl sr2 srw x3f"
RAW = frozenset(f".{kind}" for kind in _RAW.split())
_ORIENTATION = 274  # TIFF tag

DECODABLE = JPG | TIFF | PNG

# What Pillow raises on broken files.
BROKEN: tuple[type[Exception], ...] = (
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    LookupError,
    ArithmeticError,
    EOFError,
    struct.error,
    Image.DecompressionBombError,
)

# In entropy-coded data 0xFF is followed by 0x00, by a restart marker, or by more 0xFF; anything else is a marker.
# Where power 1 / 2.222 meets the toe of slope 4.5 with the same value and slope.
_TOE, _OFFSET = 0.01805016, 0.09925781

_MARKER = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")


@dataclass(frozen=True)
class ChannelSum:
    """The sum of a photograph's colour channels, weight 1 each.

    ``values`` (rows, columns) are uint16 for 8-bit photographs and uint32 for 16-bit and RAW ones; ``white`` is the
    largest value that can occur: ``channels * 255`` or ``channels * 65535``. ``step`` is what one digital number (DN) of
    the file is in ``values``: 1, and for RAW what its levels were scaled by. ``linear`` tells that the values are proportional to
    light (RAW), not gamma-coded. ``means`` (strips, 16, n, channels) are ``block_means`` of strips of the colours, in the unit of
    ``values``; empty where nobody asked for them. The sum keeps what an 8-bit luma rounds away: up to log2(3) = 1.6 bits where
    the three channels see one grey signal, as on sand.
    """

    values: NDArray[Any]
    channels: int
    white: int
    step: float = 1.0
    linear: bool = False
    means: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))


def is_raw(name: str) -> bool:
    """Tell whether a photograph of this name is a RAW file."""
    return PurePosixPath(name).suffix.casefold() in RAW


def read_channel_sum(path: Path, photograph: Photograph, *, means: bool = False) -> ChannelSum:
    """Return the sum of a photograph's channels, after making sure that the file is the one the survey lists.

    With ``means`` it holds those of the colours too.

    Raises
    ------
    InputError
        When the file cannot be read or decoded, or has changed.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"The photograph {path} cannot be read ({error.strerror}): put it back.") from error
    if bytes_digest(data) != photograph.digest:
        raise InputError(f"The photograph {path} has changed since the survey was made: run 'Create survey' again.")
    try:
        if is_raw(photograph.name):
            raw = decode_raw(data)
            total = ChannelSum(summed(raw), raw.channels, raw.channels * SATURATION, raw.step, linear=True)
            # Strips start where every colour filter array starts again.
            parts = (colours(replace(raw, values=raw.values[top : top + STRIP])) for top in _starts(raw.values, means))
            return replace(total, means=_means(parts))
        pixels = decode_pixels(data)
        parts = (pixels[top : top + STRIP].reshape(STRIP, pixels.shape[1], -1) for top in _starts(pixels, means))
        return replace(channel_sum(pixels), means=_means(parts))
    except ValueError as error:
        raise InputError(f"The photograph {path} is {error}: copy it again from the camera.") from error


def _starts(pixels: NDArray[Any], wanted: bool) -> range:
    return strip_starts(len(pixels)) if wanted else range(0)


def _means(strips: Iterable[NDArray[Any]]) -> NDArray[np.float32]:
    found = [block_means(strip) for strip in strips]
    return np.stack(found) if found else np.zeros(0, np.float32)


def decode_pixels(data: bytes) -> NDArray[Any]:
    """Return the pixels (rows, columns) or (rows, columns, channels) in BGR order, uint8 or uint16, alpha dropped.

    Raises
    ------
    ValueError
        In a few words, when ``data`` is not a whole JPG, TIFF or PNG of 8 or 16 bits a channel.
    """
    if not data:
        raise ValueError("empty")
    try:
        # "Unchanged" keeps the depth and, but for TIFF, the stored orientation.
        pixels = cv2.imdecode(np.frombuffer(_upright(data), np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise ValueError("truncated or not an image") from error
    if pixels is None:
        raise ValueError("truncated or not an image")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"of {pixels.dtype} pixels, not of 8 or 16 bits a channel")
    if pixels.ndim == 3 and pixels.shape[2] in (2, 4):
        pixels = pixels[:, :, :-1]
    return pixels[:, :, 0] if pixels.ndim == 3 and pixels.shape[2] == 1 else pixels


def channel_sum(pixels: NDArray[Any]) -> ChannelSum:
    """Return the sum of the channels of ``pixels`` (rows, columns) or (rows, columns, channels)."""
    stack = pixels[:, :, None] if pixels.ndim == 2 else pixels
    values = np.empty(stack.shape[:2], np.uint16 if pixels.dtype == np.uint8 else np.uint32)
    _add_channels(stack, values)
    return ChannelSum(values, stack.shape[2], stack.shape[2] * int(np.iinfo(pixels.dtype).max))


@njit(cache=True)
def _add_channels(stack: NDArray[Any], out: NDArray[Any]) -> None:
    rows, columns, channels = stack.shape
    for r in range(rows):
        if channels == 3:  # written out, so that the compiler can use vector instructions
            for c in range(columns):
                out[r, c] = np.uint32(stack[r, c, 0]) + np.uint32(stack[r, c, 1]) + np.uint32(stack[r, c, 2])
        else:
            for c in range(columns):
                total = np.uint32(0)
                for k in range(channels):
                    total += np.uint32(stack[r, c, k])
                out[r, c] = total


def mean_level(photograph: ChannelSum) -> NDArray[np.uint8]:
    """Return the mean of the channels at 8 bits (rows, columns), rounded; linear values get the usual gamma curve first."""
    share = np.arange(photograph.white + 1) / photograph.white
    table = np.floor(255.0 * (gamma_coded(share) if photograph.linear else share) + 0.5).astype(np.uint8)
    return table[photograph.values]


def gamma_coded(light: NDArray[Any]) -> NDArray[np.float64]:
    """Return light in [0, 1] on the gamma curve of dcraw and BT.709: power 1 / 2.222, slope 4.5 next to black.

    ``4.5 x`` up to where ``1.0993 x^0.45 - 0.0993`` continues it smoothly.
    """
    return np.where(light < _TOE, 4.5 * light, (1.0 + _OFFSET) * np.power(light, 1 / 2.222) - _OFFSET)


def frame_size(data: bytes) -> tuple[int, int]:
    """Return width and height of a photograph after making sure that it is whole.

    A JPG must run from marker to marker to its end of image, which finds a file cut short wherever the cut lies, and
    must decode at an eighth of its size, which takes less than half the time of a full decoding; a TIFF or PNG is decoded.

    Raises
    ------
    ValueError
        In a few words, when it is empty, truncated, or no image.
    """
    if not data.startswith(b"\xff\xd8"):
        pixels = decode_pixels(data)
        return pixels.shape[1], pixels.shape[0]
    if not _reaches_end_of_image(data):
        raise ValueError("truncated")
    try:
        with Image.open(io.BytesIO(data)) as image:
            size = image.size
            image.draft(None, (max(1, size[0] // 8), max(1, size[1] // 8)))
            image.load()
    except BROKEN as error:
        raise ValueError(f"not decodable, {error}") from error
    return size


def _upright(data: bytes) -> bytes:
    """Return a TIFF with its orientation tag set to 1, so that decoding does not turn it; other files as they are."""
    if not data.startswith((b"II*\0", b"MM\0*")):
        return data
    order: Literal["little", "big"] = "little" if data.startswith(b"II") else "big"
    first = int.from_bytes(data[4:8], order)
    for entry in range(first + 2, first + 2 + 12 * int.from_bytes(data[first : first + 2], order), 12):
        if int.from_bytes(data[entry : entry + 2], order) == _ORIENTATION:
            return data[: entry + 8] + (1).to_bytes(2, order) + data[entry + 10 :]
    return data


def _reaches_end_of_image(data: bytes) -> bool:
    """Tell whether a JPG's segments lead to its own end of image, not to that of a thumbnail or of a second image."""
    place = 2
    while place + 1 < len(data) and data[place] == 0xFF:
        marker = data[place + 1]
        if marker == 0xD9:
            return True
        if marker == 0xFF:  # padding
            place += 1
        elif marker == 0x01 or 0xD0 <= marker <= 0xD7:  # without content
            place += 2
        else:
            place += 2 + int.from_bytes(data[place + 2 : place + 4], "big")
            if marker == 0xDA:
                following = _MARKER.search(data, place)
                if following is None:
                    return False
                place = following.start()
    return False
