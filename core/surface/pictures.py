"""The original photographs, reduced to the size a level needs, a few of them kept at hand in each worker."""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..photographs.reading import decode_pixels

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
        """Return the ``channel_sum`` of a photograph (rows, columns)."""
        return self._get(path, level, False)

    def _get(self, path: str, level: int, colour: bool) -> NDArray[Any]:
        key = (path, level, colour)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        picture = read_reduced(path, level)
        self._kept[key] = picture if colour else channel_sum(picture)
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
    jpeg = Path(path).suffix.lower() in (".jpg", ".jpeg")
    decoded = min(level, 3) if jpeg else 0
    picture = _reduced_jpeg(path, decoded) if jpeg else _whole(path)
    if picture is None:
        raise InputError(f"The photograph {path} cannot be decoded: put a sound copy in its place, or leave it out.")
    square = 2 ** (level - decoded)
    if square > 1:
        rows, columns = (-(-n // square) * square for n in picture.shape[:2])
        picture = cv2.copyMakeBorder(picture, 0, rows - picture.shape[0], 0, columns - picture.shape[1], cv2.BORDER_REPLICATE)
        picture = cv2.resize(picture, (columns // square, rows // square), interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(picture[:, :, ::-1])


def _reduced_jpeg(path: str, decoded: int) -> NDArray[Any] | None:
    return cv2.imread(path, _DECODER[decoded] | cv2.IMREAD_IGNORE_ORIENTATION | cv2.IMREAD_ANYDEPTH)


def _whole(path: str) -> NDArray[Any] | None:
    """Return the pixels (rows, columns, 3) of a TIFF or PNG as stored, None when they cannot be decoded."""
    try:
        pixels = decode_pixels(Path(path).read_bytes())
    except (OSError, ValueError):
        return None
    return np.repeat(pixels[:, :, None], 3, axis=2) if pixels.ndim == 2 else pixels


def channel_sum(picture: NDArray[Any]) -> NDArray[Any]:
    """Return the sum of the channels in thirds of 8-bit grey levels: no luma, whose rounding would cost sand half a bit."""
    if picture.dtype == np.uint8:
        return picture.sum(axis=2, dtype=np.uint16)
    return picture.sum(axis=2, dtype=np.float32) * np.float32(255.0 / np.iinfo(picture.dtype).max)
