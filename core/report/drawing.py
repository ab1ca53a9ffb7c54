"""Tie points and coverage drawn on a photograph.

Pictures are 8-bit arrays (rows, columns, 3) of red, green and blue, reduced to what a page can show. Places on the photograph
are in its own pixels, whatever the size of the picture that is drawn on.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]

KEPT = (0, 120, 255)  # blue and orange are told apart by everybody, and sand is neither
REJECTED = (255, 72, 0)
WIDTH = 900  # pixels of a picture's longer side
_SHARE = 0.25  # of the picture that the dots cover at most, however many they are
_LARGEST = 3.0  # pixels, the radius of a dot
_SMALLEST = 0.8  # below it a dot is not made smaller but fainter
_BARE = (214, 39, 40)
_MAP = "viridis"


def reduced(pixels: NDArray[Any], longer: int = WIDTH) -> Picture:
    """Return a photograph, grey (rows, columns) or RGB (rows, columns, 3), in its own tones with ``longer`` pixels at most."""
    grey = pixels if pixels.dtype == np.uint8 else (pixels >> 8).astype(np.uint8)
    factor = min(1.0, longer / max(grey.shape[:2]))
    size = max(1, round(grey.shape[1] * factor)), max(1, round(grey.shape[0] * factor))
    small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    return np.repeat(small[:, :, None], 3, axis=2) if small.ndim == 2 else small


def draw_tie_points(
    pixels: NDArray[Any],
    xy: NDArray[np.floating],
    kept: NDArray[np.bool_],
    *,
    frame: tuple[int, int] | None = None,
    longer: int = WIDTH,
) -> Picture:
    """Return the photograph with its points (n, 2), blue where ``kept`` and orange where not.

    ``pixels`` are the photograph or a reduction of it, ``frame`` the width and height that ``xy`` are counted in (that of
    ``pixels`` by default). Dots shrink as they grow in number, so that they never cover more than a quarter of the picture;
    those of the rarer kind lie on top. Points beyond the frame are not drawn.
    """
    picture = reduced(pixels, longer)
    rows, columns = picture.shape[:2]
    width, height = frame or (pixels.shape[1], pixels.shape[0])
    places = np.asarray(xy, np.float64).reshape(-1, 2) * [columns / width, rows / height]
    inside = np.all((places >= 0) & (places < [columns, rows]), axis=1)
    places, good = places[inside], np.asarray(kept, bool)[inside]
    radius = min(_LARGEST, float(np.sqrt(_SHARE * rows * columns / max(1, len(places)) / np.pi)))
    groups = sorted(((places[good], KEPT), (places[~good], REJECTED)), key=lambda group: -len(group[0]))
    canvas = picture.astype(np.float32)
    for points, colour in groups:
        if radius >= _LARGEST:  # few dots can afford a rim, which shows them on any ground
            _blend(canvas, _discs(points, radius + 1.2, 1.0, (rows, columns)), (20, 20, 20))
        strength = min(1.0, (radius / _SMALLEST) ** 2)
        _blend(canvas, _discs(points, max(radius, _SMALLEST), strength, (rows, columns)), colour)
    return np.asarray(np.rint(canvas), np.uint8)


def _discs(points: NDArray[np.float64], radius: float, strength: float, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return how far discs about points (n, 2) in the picture hide each pixel, 0 to 1; one alone hides ``strength`` of it."""
    reach = int(np.ceil(radius + 0.5))
    # The logarithm of what is left to see: discs one over the other add up.
    left = np.zeros((shape[0] + 2 * reach, shape[1] + 2 * reach))
    x, y = points.T
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            distance = np.hypot(column + dx + 0.5 - x, row + dy + 0.5 - y)
            hidden = strength * np.clip(radius + 0.5 - distance, 0, 1)
            np.add.at(left, (row + dy + reach, column + dx + reach), np.log1p(-np.minimum(hidden, 0.999)))
    return (1.0 - np.exp(left[reach : reach + shape[0], reach : reach + shape[1]])).astype(np.float32)


def _blend(canvas: NDArray[np.float32], cover: NDArray[np.float32], colour: tuple[int, int, int]) -> None:
    """Lay a colour over the canvas, in place."""
    canvas += cover[:, :, None] * (np.asarray(colour, np.float32) - canvas)


def draw_coverage(pixels: NDArray[Any], counts: NDArray[np.integer], *, longer: int = 440) -> Picture:
    """Return the photograph under its cells coloured by ``counts`` (rows, columns) of tie points, with the numbers.

    Colours run with the logarithm, from dark blue (1) to yellow (1,000 and more); a cell without a point is red.
    """
    from matplotlib import colormaps

    picture = reduced(pixels, longer)
    rows, columns = picture.shape[:2]
    tint = colormaps[_MAP](np.clip(np.log10(np.maximum(counts, 1)) / 3.0, 0, 1))[:, :, :3] * 255
    tint[counts == 0] = _BARE
    row = np.minimum(np.arange(rows) * counts.shape[0] // rows, counts.shape[0] - 1)
    column = np.minimum(np.arange(columns) * counts.shape[1] // columns, counts.shape[1] - 1)
    canvas = np.rint(0.5 * picture + 0.5 * tint[row[:, None], column[None]]).astype(np.uint8)
    for (i, j), count in np.ndenumerate(counts):
        text = f"{count}" if count < 1000 else f"{count // 1000}k"
        (wide, high), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.36, 1)
        place = (int((j + 0.5) * columns / counts.shape[1] - wide / 2), int((i + 0.5) * rows / counts.shape[0] + high / 2))
        for colour, thick in (((0, 0, 0), 2), ((255, 255, 255), 1)):
            cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.36, colour, thick, cv2.LINE_AA)
    return canvas


def side_by_side(*pictures: Picture) -> Picture:
    """Return pictures in a row with a white gap, each as high as the lowest."""
    height = min(len(p) for p in pictures)
    parts: list[Picture] = []
    for picture in pictures:
        if parts:
            parts.append(np.full((height, 8, 3), 255, np.uint8))
        size = max(1, round(picture.shape[1] * height / len(picture))), height
        parts.append(picture if len(picture) == height else cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
    return np.ascontiguousarray(np.hstack(parts))
