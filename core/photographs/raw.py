"""RAW photographs: what the sensor saw, in the frame of the camera's JPG, proportional to light.

LibRaw (through rawpy) unpacks the file; the levels and the interpolation of colours are done here, because LibRaw's processing
cuts off what noise puts below black, has one white level for all colours, and brightens by what it finds in the picture.

A colour that a pixel lacks is the mean over its 3 x 3 neighbours, weighted by (1, 2, 1) along both axes; and so is the colour it
has. Each colour of a Bayer pattern then goes through one and the same filter wherever the pixel lies, whose zeros are where the
pattern repeats: no trace of it is left. On simulated sand (12 bits, 9,000 electrons, 4 % texture) it gave 1.8 times the right
matches of LibRaw's default, which follows edges and finds them in the noise, and 1.07 times those of its bilinear interpolation
(tests/benchmarks/bench_raw.py).
"""

from __future__ import annotations

import io
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from PIL import Image

from .tiffs import default_crop, is_tiff

SATURATION = 65535  # of one channel, after scaling
Frame = tuple[int, int, int, int]  # top, left, height, width
_THREADS = "OMP_NUM_THREADS"
_PERIOD = 48  # pixels after which every colour filter array there is repeats itself
_NEARLY_ALL = 0.95  # a preview at least so large as what the sensor sees shows the camera's frame


@dataclass(frozen=True)
class RawPhotograph:
    """A RAW photograph as the file has it, never turned, in the frame of the camera's JPG.

    ``values`` are uint16 DN: (rows, columns) behind a colour filter array, whose ``pattern`` (side, side) holds the number of the
    channel at each place; or (rows, columns, channels) where every pixel has them all, with ``pattern`` None. ``black`` are
    levels (side, side) or (channels,), ``white`` is the level of saturation. ``balance`` (channels,) are the multipliers of the
    camera's white balance, the least of them 1.
    """

    values: NDArray[np.uint16]
    pattern: NDArray[np.int64] | None
    black: NDArray[np.float64]
    white: int
    balance: NDArray[np.float64]

    @property
    def channels(self) -> int:
        """How many colours there are."""
        return len(self.balance)

    @property
    def step(self) -> float:
        """What one DN is in the unit of ``summed`` and ``colours``."""
        return float(np.mean(SATURATION / (self.white - self.black)))


def decode_raw(data: bytes) -> RawPhotograph:
    """Return the content of a RAW file.

    Raises
    ------
    ValueError
        In a few words, when it is truncated or not of a kind that can be decoded.
    """
    if not data:
        raise ValueError("empty")
    if data.startswith(b"FOVb"):
        raise ValueError("an X3F file, which is not supported unless it is converted to a linear DNG")
    rawpy = _library()
    try:
        with rawpy.imread(io.BytesIO(data)) as raw:
            return _content(raw, rawpy, default_crop(data) if is_tiff(data) else None)
    except rawpy.LibRawIOError as error:
        raise ValueError("truncated or damaged") from error
    except (rawpy.LibRawFileUnsupportedError, rawpy.LibRawNotImplementedError) as error:
        raise ValueError("not a RAW photograph that LibRaw can decode") from error
    except (rawpy.LibRawError, RuntimeError, OSError) as error:
        raise ValueError(f"not decodable ({error})") from error


def summed(raw: RawPhotograph) -> NDArray[np.uint32]:
    """Return the sum of the channels (rows, columns), each scaled so that ``SATURATION`` is white and 0 is black.

    Noise below black counts; only a sum below 0 is raised to 0.
    """
    return _developed(raw, np.ones((1, raw.channels)), np.uint32)[:, :, 0]


def colours(raw: RawPhotograph) -> NDArray[np.uint16]:
    """Return the channels (rows, columns, channels), each scaled so that ``SATURATION`` is white and 0 is black."""
    return _developed(raw, np.eye(raw.channels), np.uint16)


def _content(raw: Any, rawpy: Any, crop: Frame | None) -> RawPhotograph:
    sizes, count = raw.sizes, raw.num_colors
    if not 0.99 < sizes.pixel_aspect < 1.01:
        raise ValueError("of pixels that are not square")
    image = raw.raw_image
    if image is None:
        raise ValueError("without pixels")
    top, left, height, width = _frame(raw, rawpy, crop)
    levels, letters = np.array(raw.black_level_per_channel, float), raw.color_desc.decode("ascii")
    gains = np.array(raw.camera_whitebalance, float)
    if not (gains[:count] > 0).all():
        gains = np.array(raw.daylight_whitebalance, float)
    values = image[top : top + height, left : left + width]
    if count == 1:
        pattern, black, balance = None, levels[:1], np.ones(1)
        values = values[:, :, None]
    elif raw.raw_type == rawpy.RawType.Stack:
        pattern, black, balance = None, levels[:count], gains[:count]
        values = values[:, :, :count]
    else:
        # Two numbers may be of one colour: both greens of a Bayer pattern.
        numbers = np.array([[raw.raw_color(top + i, left + j) for j in range(_PERIOD)] for i in range(_PERIOD)])
        numbers = _once(numbers)
        names = list(dict.fromkeys(letters))
        pattern = np.array([[names.index(letters[n]) for n in row] for row in numbers])
        black, balance = levels[numbers], gains[[letters.index(name) for name in names]]
        _neighbours(pattern, len(names))  # refuses what could not be developed
    white = int(raw.white_level)
    if white <= black.max():
        raise ValueError("without a white level above its black level")
    if min(values.shape[:2]) < 3:
        raise ValueError("too small to be a photograph")
    balance = balance / balance.min() if (balance > 0).all() else np.ones(len(balance))
    return RawPhotograph(values.copy(), pattern, black, white, balance)


def _frame(raw: Any, rawpy: Any, default: Frame | None) -> Frame:
    """Return top, left, height and width of the camera's frame in the sensor's pixels.

    The frame that the file names (``default``, of a DNG, or the makers' own notes), else one of the size of a full preview
    in the middle of what the sensor sees, else all of that.
    """
    sizes = raw.sizes
    top, left, height, width = sizes.top_margin, sizes.left_margin, sizes.height, sizes.width
    noted = sizes.crop_top_margin, sizes.crop_left_margin, sizes.crop_height, sizes.crop_width
    for crop, slack in ((default, 1), (noted, 0)):  # LibRaw moves the margins of an odd active area by a pixel
        if crop is None or min(crop[2:]) <= 0:
            continue
        if (
            crop[0] >= max(top - slack, 0)
            and crop[1] >= max(left - slack, 0)
            and crop[0] + crop[2] <= min(top + height + slack, sizes.raw_height)
            and crop[1] + crop[3] <= min(left + width + slack, sizes.raw_width)
        ):
            return crop
    try:
        preview = raw.extract_thumb()
    except rawpy.LibRawError:  # none, or one that cannot be read: it tells nothing
        return top, left, height, width
    if preview.format == rawpy.ThumbFormat.JPEG:
        try:
            with Image.open(io.BytesIO(preview.data)) as image:
                columns, rows = image.size
        except OSError:
            return top, left, height, width
        if _NEARLY_ALL * height <= rows <= height and _NEARLY_ALL * width <= columns <= width:
            return top + (height - rows) // 2, left + (width - columns) // 2, rows, columns
    return top, left, height, width


def _once(pattern: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the smallest square (side, side) that ``pattern`` repeats."""
    for side in (2, 4, 6, 8, 16):
        square = pattern[:side, :side]
        if (np.tile(square, (_PERIOD // side, _PERIOD // side)) == pattern).all():
            return square
    raise ValueError("of a colour filter array that is not supported")


def _developed(raw: RawPhotograph, mix: NDArray[np.float64], kind: Any) -> NDArray[Any]:
    """Return mixtures of the scaled channels (rows, columns, mixtures), of the ``kind`` of whole numbers; ``mix`` is theirs."""
    gain = SATURATION / (raw.white - raw.black)
    largest = mix.sum(axis=1) * SATURATION
    out = np.empty((*raw.values.shape[:2], len(mix)), kind)
    if raw.pattern is None:
        tables = ((np.minimum(np.arange(SATURATION + 1)[:, None], raw.white) - raw.black) * gain).astype(np.float32)
        for m, shares in enumerate(mix):
            total = sum(np.float32(s) * tables[raw.values[:, :, k], k] for k, s in enumerate(shares) if s)
            out[:, :, m] = np.clip(total, 0, largest[m]) + np.float32(0.5)
        return out
    around, shares = _neighbours(raw.pattern, raw.channels)
    weights = np.einsum("mk,ijkyx->ijmyx", mix, shares) * gain[around][:, :, None]
    offsets = np.einsum("ijmyx,ijyx->ijm", weights, raw.black[around])
    _interpolate(raw.values, raw.white, weights.astype(np.float32), offsets.astype(np.float32), largest.astype(np.float32), out)
    return out


def _neighbours(pattern: NDArray[np.int64], channels: int) -> tuple[Any, NDArray[np.float64]]:
    """Return the places in the pattern of each place's 3 x 3 neighbours, and their shares in each channel.

    The places are an index that makes (side, side) into (side, side, 3, 3); the shares are (side, side, channels, 3, 3).

    Raises
    ------
    ValueError
        When a colour is missing among the neighbours.
    """
    side, steps = len(pattern), np.arange(-1, 2)
    around = (np.arange(side)[:, None] + steps) % side
    index = around[:, None, :, None], around[None, :, None, :]
    taps = np.outer((1.0, 2.0, 1.0), (1.0, 2.0, 1.0))
    shares = taps * (pattern[index][:, :, None] == np.arange(channels)[:, None, None])
    totals = shares.sum(axis=(3, 4), keepdims=True)
    if not totals.all():
        raise ValueError("of a colour filter array that is not supported")
    return index, shares / totals


@njit(cache=True)
def _interpolate(
    values: NDArray[np.uint16],
    white: int,
    weights: NDArray[np.float32],
    offsets: NDArray[np.float32],
    largest: NDArray[np.float32],
    out: NDArray[Any],
) -> None:
    """Write the weighted sums over 3 x 3 pixels; the outermost pixels get what their inner neighbours have."""
    rows, columns = values.shape
    side = len(weights)
    for r in range(rows):
        i = min(max(r, 1), rows - 2)
        for c in range(columns):
            j = min(max(c, 1), columns - 2)
            for k in range(len(largest)):
                total = -offsets[i % side, j % side, k]
                for y in range(3):
                    for x in range(3):
                        value = np.float32(min(values[i + y - 1, j + x - 1], white))
                        total += weights[i % side, j % side, k, y, x] * value
                out[r, c, k] = np.uint32(min(max(total, np.float32(0.0)), largest[k]) + np.float32(0.5))


def _library() -> Any:
    """Return rawpy, loaded so that LibRaw uses one thread: work is shared out by photographs."""
    former = os.environ.get(_THREADS)
    os.environ[_THREADS] = "1"
    try:
        import rawpy
    finally:
        if former is None:
            del os.environ[_THREADS]
        else:
            os.environ[_THREADS] = former
    return rawpy
