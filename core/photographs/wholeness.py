"""Telling whole RAW files from broken ones, where LibRaw decodes what is left without a word.

A file that was cut short is found by its length, against what its directories say. One that has the right length but was
never filled (a full card, a copy that was broken off) is found by its pixels: no sensor repeats itself to the last bit, and
no lens shows neighbours that differ by a third of the range all over.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .containers import boxes
from .raw import RawPhotograph, decode_raw
from .tiffs import is_tiff, pictures

_RUN = 256  # pixels of a row that are not the same by chance: light itself is noisier
_BLOCK = 4, 128  # rows and columns over which differences are averaged
_WILD = 1 / 6  # of the range from black to white: mean difference of neighbours of a colour that no picture has


def whole_raw(data: bytes) -> RawPhotograph:
    """Return the content of a RAW file after making sure that it is whole.

    Raises
    ------
    ValueError
        In a few words, when it is truncated, damaged, or cannot be decoded.
    """
    _require_length(data)
    raw = decode_raw(data)
    again = decode_raw(data)
    if raw.values.shape != again.values.shape or not np.array_equal(raw.values, again.values):
        raise ValueError("damaged, for it decodes to other pixels each time")
    distance = 1 if raw.pattern is None else len(raw.pattern)
    # Where the maker took the black off, what is dark is 0 over and over, and in pictures that were developed before they were
    # written noise may be gone; but not along a whole row.
    run = raw.values.shape[1] - distance
    if raw.pattern is not None and raw.black.min() > 0:
        run = min(run, _RUN)
    limit = _WILD * (raw.white - float(raw.black.mean()))
    for channel in np.atleast_3d(raw.values).transpose(2, 0, 1):
        if channel.min() == channel.max():
            raise ValueError("without a picture, for its pixels are all alike")
        # Some sensors saturate below the level that LibRaw knows.
        brightest = np.array([[channel[i::distance, j::distance].max() for j in range(distance)] for i in range(distance)])
        if (row := _first_frozen(channel, np.minimum(brightest, raw.white), run)) >= 0:
            raise ValueError(f"damaged or copied in part, for its pixels repeat themselves in row {row}")
        if (row := _first_wild(channel, distance, limit, *_BLOCK)) >= 0:
            raise ValueError(f"damaged or copied in part, for its pixels are random from row {row} on")
    return raw


def _require_length(data: bytes) -> None:
    """Make sure that a file is as long as it says.

    Raises
    ------
    ValueError
        When it is shorter.
    """
    if is_tiff(data):
        ends = [part.offset + part.length for picture in pictures(data) for part in picture]
    elif data.startswith(b"FUJIFILMCCD-RAW"):
        # The places and lengths of the preview, of the sensor's description, and of the pixels.
        numbers = [int.from_bytes(data[place : place + 4], "big") for place in range(84, 108, 4)]
        ends = [numbers[i] + numbers[i + 1] for i in (0, 2, 4)]
    elif data[4:8] == b"ftyp":
        for _ in boxes(data):  # raises when one ends beyond the file
            pass
        return
    else:
        return
    missing = max(ends, default=0) - len(data)
    if missing > 0:
        raise ValueError(f"truncated, {missing} bytes are missing")


@njit(cache=True)
def _first_frozen(values: NDArray[Any], saturated: NDArray[Any], run: int) -> int:
    """Return the first row where ``run`` pixels equal those of their colour to their right; -1 when there is none.

    Pixels from the levels ``saturated`` (side, side) on, which repeat like the colour filter array, do not count.
    """
    rows, columns = values.shape
    distance = len(saturated)
    for r in range(rows):
        alike = 0
        for c in range(columns - distance):
            if values[r, c] == values[r, c + distance] and values[r, c] < saturated[r % distance, c % distance]:
                alike += 1
                if alike >= run:
                    return r
            else:
                alike = 0
    return -1


@njit(cache=True)
def _first_wild(values: NDArray[Any], distance: int, limit: float, block_rows: int, block_columns: int) -> int:
    """Return the first row of a block whose pixels differ from those to their right and below by more than ``limit``.

    On average over the block, both ways (an edge is but one), ``distance`` pixels away; -1 when there is none. Blocks that the
    border cuts to less than half are passed over.
    """
    rows, columns = values.shape[0] - distance, values.shape[1] - distance
    for top in range(0, rows, block_rows):
        bottom = min(top + block_rows, rows)
        for left in range(0, columns, block_columns):
            right = min(left + block_columns, columns)
            if right - left < block_columns // 2:
                continue
            across, down = np.int64(0), np.int64(0)
            for r in range(top, bottom):
                for c in range(left, right):
                    here = np.int64(values[r, c])  # unsigned differences would wrap
                    across += abs(here - np.int64(values[r, c + distance]))
                    down += abs(here - np.int64(values[r + distance, c]))
            if min(across, down) > limit * (bottom - top) * (right - left):
                return top
    return -1
