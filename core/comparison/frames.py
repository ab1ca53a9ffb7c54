"""Where the frame of a JPG lies in the pixels of its RAW, measured on the exposures themselves.

A camera may cut its JPG out of the RAW, and may straighten the lens's distortion in it. Both files show the same light, down to
its noise, so that phase correlation of tiles (Kuglin and Hines 1975) tells where each part of one lies in the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..photographs.reading import mean_level, read_channel_sum
from ..survey import Photograph
from .exposures import Exposures, Source

_TILES = 5, 4  # across and down
_LEAST = 6  # tiles that must tell
_RESPONSE = 0.4  # of phase correlation: tiles of one exposure reach 0.8 to 1.1, of neighbouring exposures less than 0.3
_FRACTION = 0.25  # px, less than what demosaicing and compression leave unsure
_SPREAD = 0.5  # px; a frame that is only cut out is shifted alike everywhere


@dataclass(frozen=True)
class Offset:
    """``raw = jpg + (x, y)`` in pixels, how far tiles differ from that (px, 90 % of them), and how many tiles told."""

    x: float
    y: float
    spread: float
    tiles: int


def frame_offset(jpg: NDArray[np.uint8], raw: NDArray[np.uint8]) -> Offset | None:
    """Return where the JPG's frame lies in the RAW's, both grey (rows, columns); None when the two have nothing in common."""
    side = _tile(min(jpg.shape[0], raw.shape[0]), min(jpg.shape[1], raw.shape[1]))
    if side < 32:
        return None
    guess = np.array([(raw.shape[1] - jpg.shape[1]) // 2, (raw.shape[0] - jpg.shape[0]) // 2])
    window = cv2.createHanningWindow((side, side), cv2.CV_32F)
    shifts = []
    for corner in _corners(jpg.shape, side):
        there = corner + guess
        if (there < 0).any() or there[0] + side > raw.shape[1] or there[1] + side > raw.shape[0]:
            continue
        a, b = (p[y : y + side, x : x + side].astype(np.float32) for p, (x, y) in ((jpg, corner), (raw, there)))
        shift, response = cv2.phaseCorrelate(a, b, window)
        if response > _RESPONSE:
            shifts.append(guess + shift)
    if len(shifts) < _LEAST:
        return None
    found = np.array(shifts, float)
    middle = np.median(found, axis=0)
    spread = float(np.quantile(np.hypot(*(found - middle).T), 0.9))
    return Offset(float(middle[0]), float(middle[1]), spread, len(found))


def raw_offsets(exposures: Exposures) -> dict[str, tuple[float, float]]:
    """Return what to add to a place in each JPG, by its name, to find it in its RAW.

    It is measured on the middle exposure of those whose sizes are alike.

    Raises
    ------
    InputError
        When it is not one shift for the whole photograph, or cannot be told.
    """
    jpg, raw = exposures.jpg, exposures.raw
    if raw is None:
        return {}
    groups: dict[Any, list[int]] = {}
    for i, (a, b) in enumerate(zip(jpg.photographs, raw.photographs, strict=True)):
        groups.setdefault((a.width, a.height, b.width, b.height), []).append(i)
    offsets: dict[str, tuple[float, float]] = {}
    for (width, height, raw_width, raw_height), members in groups.items():
        i = members[len(members) // 2]
        a, b = jpg.photographs[i], raw.photographs[i]
        measured = frame_offset(_grey(jpg, a), _grey(raw, b))
        sizes = f"{a.name} ({width} x {height}) and {b.name} ({raw_width} x {raw_height})"
        if measured is None:
            raise InputError(
                f"{sizes} do not show how their frames lie to each other: check that they are one exposure, and give MARKS_RAW, "
                "the marks in the RAW."
            )
        if measured.spread > _SPREAD:
            raise InputError(
                f"The frames of {sizes} differ by more than a shift ({measured.spread:.1f} px), as when the camera straightens "
                "its JPG: give MARKS_RAW, the marks in the RAW."
            )
        offset = _whole(measured.x), _whole(measured.y)
        offsets |= {jpg.photographs[k].name: offset for k in members}
    return offsets


def _whole(shift: float) -> float:
    """Return a shift as the whole pixels that a camera cuts by, where it may be one."""
    return float(round(shift)) if abs(shift - round(shift)) < _FRACTION else shift


def _grey(source: Source, photograph: Photograph) -> NDArray[np.uint8]:
    return mean_level(read_channel_sum(Path(source.images) / photograph.name, photograph))


def _tile(rows: int, columns: int) -> int:
    """Return the side of a tile: a power of two, a quarter of the photograph's shorter side at most."""
    return 1 << int(np.log2(max(1, min(512, min(rows, columns) // 4))))


def _corners(shape: tuple[int, ...], side: int) -> NDArray[np.int64]:
    """Return the top-left corners (n, 2) of tiles spread evenly over a photograph."""
    x, y = (np.linspace(0.05, 0.95, n) * (size - side) for n, size in zip(_TILES, (shape[1], shape[0]), strict=True))
    return np.array([[a, b] for b in y for a in x]).astype(np.int64)
