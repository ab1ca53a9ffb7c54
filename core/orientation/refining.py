"""From predicted to measured marks: a photograph at a time, then what the photographs say of each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..photographs.reading import read_channel_sum
from ..survey import Photograph
from .codes import find_code
from .prediction import Prediction
from .targets import ACCEPT, Found, find_target, largest_radius
from .triangulation import triangulate

Array = NDArray[np.float64]
Refine = Literal["none", "target", "code"]

_REACH = 4.0  # sigmas: one mark in 3000 lies beyond
_SPARE = 2.0  # px
_WIDEST, _SHARE = 600.0, 0.25  # px, and of the shorter side: beyond it a circle holds too much to be searched in earnest
_SIGMA_MARK = 0.5  # px, what marks may differ by beside the tie points' own residuals
PICTURE = 150  # px, the side of a picture
_SHOWN, _CLOSE = 24.0, 90.0  # px, the least half a side of what a picture shows, and the most around a mark
_SAME_PLACE = 3.0  # px


@dataclass(frozen=True)
class Search:
    """A circle of a photograph to look into (px from the corner of the top-left pixel); ``code`` is a coded target's number."""

    key: int
    x: float
    y: float
    radius: float
    code: int | None = None
    pictured: bool = False


@dataclass(frozen=True)
class Sight:
    """What was found in a circle, None for nothing, and a picture of it: grey, from ``corner`` on, enlarged by ``scale``."""

    key: int
    found: Found | None
    picture: NDArray[np.uint8] | None
    corner: tuple[float, float] = (0.0, 0.0)
    scale: float = 1.0


def circle(prediction: Prediction, width: int, height: int) -> tuple[float, bool]:
    """Return the radius (px) to search, four sigmas, and whether it had to be cut short or guessed."""
    widest = min(_WIDEST, _SHARE * min(width, height))
    wanted = _REACH * prediction.reach + _SPARE
    return (wanted, False) if wanted <= widest else (widest, True)


def look(path: str, photograph: Photograph, refine: Refine, searches: Sequence[Search]) -> list[Sight]:
    """Read a photograph and look into circles of it.

    Raises
    ------
    InputError
        When it cannot be read, or is not the one that the survey lists.
    """
    values = read_channel_sum(Path(path), photograph).values
    largest = largest_radius(photograph.width, photograph.height)
    sights = []
    for search in searches:
        around = search.radius + 1.5 * largest
        left, top = (max(0, int(c - around)) for c in (search.x, search.y))
        crop = np.asarray(values[top : int(search.y + around) + 1, left : int(search.x + around) + 1], np.float32)
        centre, found = np.array([search.x - left, search.y - top]), None
        if min(crop.shape) >= 2 * _SHOWN:
            if refine == "target":
                found = find_target(crop, centre, search.radius, largest)
            elif refine == "code" and search.code is not None:
                found = find_code(crop, search.code, centre, search.radius)
        if found is not None:
            found = Found(found.x + left, found.y + top, found.sigma, found.score, found.what)
        sights.append(_pictured(values, search, found) if search.pictured else Sight(search.key, found, None))
    return sights


def agreeing(block: Block, predictions: Sequence[Prediction], found: Mapping[int, Found]) -> tuple[dict[int, Found], set[int]]:
    """Return the marks to take, by the index of their prediction, and those of the rest that others of the same point contradict.

    A mark is taken from ``ACCEPT`` on, when no other point was found at the same place, and when the rays of all that are taken
    of its point meet in one point of the block within five sigmas; where some do not and nothing tells which, none is taken. A
    point's only mark stands on its score alone.
    """
    sigma = float(np.hypot(_SIGMA_MARK, np.median(block.errors) if len(block.errors) else 0.0))
    taken: dict[int, Found] = {}
    contradicted: set[int] = set()
    by_point: dict[int, list[int]] = {}
    good_enough = [k for k, mark in found.items() if mark.score >= ACCEPT]
    for key in good_enough:
        if any(k != key and _one_place(k, key, predictions, found) for k in good_enough):
            contradicted.add(key)
        else:
            by_point.setdefault(predictions[key].point, []).append(key)
    for keys in by_point.values():
        good = keys
        if len(keys) > 1:
            marks = np.array([[found[k].x, found[k].y] for k in keys])
            met = triangulate([block.views[predictions[k].view] for k in keys], marks, sigma)
            good = [] if met is None or not met.agree else [k for k, used in zip(keys, met.used, strict=True) if used]
        taken.update({k: found[k] for k in good})
        contradicted.update(set(keys) - set(good))
    return taken, contradicted


def _one_place(a: int, b: int, predictions: Sequence[Prediction], found: Mapping[int, Found]) -> bool:
    apart = np.hypot(found[a].x - found[b].x, found[a].y - found[b].y)
    return predictions[a].view == predictions[b].view and bool(apart < _SAME_PLACE)


def _pictured(values: NDArray[np.generic], search: Search, found: Found | None) -> Sight:
    half, x, y = max(_SHOWN, 1.2 * search.radius), search.x, search.y
    if found is not None and half > _CLOSE:
        half, x, y = _CLOSE, found.x, found.y
    left, top = (max(0, round(c - half)) for c in (x, y))
    crop = np.asarray(values[top : max(round(y + half), 0), left : max(round(x + half), 0)], np.float32)
    if not crop.size:
        return Sight(search.key, found, None)
    low, high = np.percentile(crop, [1, 99])
    grey = np.clip(255.0 * (crop - low) / max(float(high - low), 1e-9), 0, 255).astype(np.uint8)
    scale = PICTURE / (2 * half)
    size = (max(1, round(crop.shape[1] * scale)), max(1, round(crop.shape[0] * scale)))
    picture = cv2.resize(grey, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    return Sight(search.key, found, np.asarray(picture, np.uint8), (float(left), float(top)), scale)
