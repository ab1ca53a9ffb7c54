"""The original photographs, reduced to the size a level needs, a few of them kept at hand in each worker.

RAW is reduced while it is proportional to light; the gamma curve of a JPG comes after that, because what the correlation
takes for noise is told in the grey levels of a JPG. Its colours have the white balance that its camera noted, no colour matrix.
"""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..photographs.raw import SATURATION, RawPhotograph, colours, decode_raw, summed
from ..photographs.reading import decode_pixels, gamma_coded, is_raw

COARSEST = 6  # the strongest reduction: 1 / 2**6
_DECODER = {0: cv2.IMREAD_COLOR, 1: cv2.IMREAD_REDUCED_COLOR_2, 2: cv2.IMREAD_REDUCED_COLOR_4, 3: cv2.IMREAD_REDUCED_COLOR_8}


class Pictures:
    """Reads photographs at 1 / 2**level of their size and keeps the last read, up to ``limit`` bytes."""

    def __init__(self, limit: int = 500_000_000) -> None:
        self._limit, self._kept = limit, OrderedDict[tuple[str, int, bool], NDArray[Any]]()

    def colour(self, path: str, level: int) -> NDArray[Any]:
        """Return a photograph (rows, columns, 3: red, green, blue), as stored, never rotated."""
        return self._get(path, level, True)

    def grey(self, path: str, level: int) -> NDArray[Any]:
        """Return the sum of the channels of a photograph (rows, columns), see ``read_grey``."""
        return self._get(path, level, False)

    def _get(self, path: str, level: int, colour: bool) -> NDArray[Any]:
        key = (path, level, colour)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        self._kept[key] = read_reduced(path, level) if colour else read_grey(path, level)
        while len(self._kept) > 1 and sum(p.nbytes for p in self._kept.values()) > self._limit:
            self._kept.popitem(last=False)
        return self._kept[key]


def read_reduced(path: str, level: int) -> NDArray[Any]:
    """Return the photograph (rows, columns, 3: red, green, blue) at 1 / 2**``level`` of its size; sizes are rounded up.

    JPEG is reduced while it is decoded, as far as it can be; the rest are means over whole squares of pixels, so that
    pixel (i, j) covers the same ground as the square it stands for.

    Raises
    ------
    InputError
        When it cannot be decoded.
    """
    if is_raw(path):
        return _coloured(_raw(path), level)
    jpeg = Path(path).suffix.lower() in (".jpg", ".jpeg")
    decoded = min(level, 3) if jpeg else 0
    picture = _reduced_jpeg(path, decoded) if jpeg else _whole(path)
    if picture is None:
        raise _broken(path)
    return np.ascontiguousarray(_mean_over(picture, 2 ** (level - decoded))[:, :, ::-1])


def read_grey(path: str, level: int) -> NDArray[Any]:
    """Return the sum of a photograph's channels (rows, columns) at 1 / 2**``level`` of its size.

    In thirds of 8-bit grey levels: no luma, whose rounding would cost sand half a bit.

    Raises
    ------
    InputError
        When it cannot be decoded.
    """
    if is_raw(path):
        raw = _raw(path)
        light = _mean_over(summed(raw).astype(np.float32), 2**level) / np.float32(raw.channels * SATURATION)
        return (3.0 * 255.0 * gamma_coded(light)).astype(np.float32)
    picture = read_reduced(path, level)
    if picture.dtype == np.uint8:
        return picture.sum(axis=2, dtype=np.uint16)
    return picture.sum(axis=2, dtype=np.float32) * np.float32(255.0 / np.iinfo(picture.dtype).max)


def _coloured(raw: RawPhotograph, level: int) -> NDArray[np.uint16]:
    """Return a RAW at 1 / 2**``level`` of its size, white-balanced and on a gamma curve; grey unless it has three colours."""
    light = _mean_over(colours(raw), 2**level).reshape(-1, raw.channels)
    shades = np.arange(SATURATION + 1) / SATURATION
    out = np.empty((len(light), 3), np.uint16)
    for k in range(3):
        # A curve for each channel, from a table: the power of millions of pixels takes longer than all the rest.
        gain = raw.balance[k] if raw.channels == 3 else 1.0
        table = np.rint(SATURATION * gamma_coded(np.minimum(gain * shades, 1.0))).astype(np.uint16)
        out[:, k] = table[light[:, k] if raw.channels == 3 else light.mean(axis=1).astype(np.uint16)]
    rows, columns = (-(-n // 2**level) for n in raw.values.shape[:2])
    return out.reshape(rows, columns, 3)


def _mean_over(picture: NDArray[Any], square: int) -> NDArray[Any]:
    """Return the means over squares of ``square`` pixels; what is missing at the right and at the bottom repeats the edge."""
    if square == 1:
        return picture
    rows, columns = (-(-n // square) * square for n in picture.shape[:2])
    whole = cv2.copyMakeBorder(picture, 0, rows - picture.shape[0], 0, columns - picture.shape[1], cv2.BORDER_REPLICATE)
    return cv2.resize(whole, (columns // square, rows // square), interpolation=cv2.INTER_AREA)


def _reduced_jpeg(path: str, decoded: int) -> NDArray[Any] | None:
    return cv2.imread(path, _DECODER[decoded] | cv2.IMREAD_IGNORE_ORIENTATION | cv2.IMREAD_ANYDEPTH)


def _whole(path: str) -> NDArray[Any] | None:
    """Return the pixels (rows, columns, 3) of a TIFF or PNG as stored, None when they cannot be decoded."""
    try:
        pixels = decode_pixels(Path(path).read_bytes())
    except (OSError, ValueError):
        return None
    return np.repeat(pixels[:, :, None], 3, axis=2) if pixels.ndim == 2 else pixels


def _raw(path: str) -> RawPhotograph:
    try:
        return decode_raw(Path(path).read_bytes())
    except (OSError, ValueError) as error:
        raise _broken(path) from error


def _broken(path: str) -> InputError:
    return InputError(f"The photograph {path} cannot be decoded: put a sound copy in its place, or leave it out.")
