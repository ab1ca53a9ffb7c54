"""How bright each photograph is against the others, and how it darkens to its corners, from the tie points' colours.

    log value(photograph v, point p, channel c) = shade(p, c) + gain(v, c) + a(c) r^2 + b(c) r^4,    r = 1 in the frame's corner.

The shades are eliminated, for each point's values are compared with their own mean only; the gains' mean is 0, so that the
orthophoto is as bright as the photographs on average.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..block import Block, View
from ..parallel import run_calls
from ..progress import Progress
from .pictures import read_reduced

Array = NDArray[np.float64]

_REDUCTION = 3  # values are means over 8 x 8 pixels: a tie point is a corner or a grain, its surroundings are sand
_MOST = 400  # observations of a photograph that are looked at
_DARK, _BRIGHT = 0.02, 0.97  # of the white level: beyond, values are clipped or noise
_ROUNDS = 8
_HOLD = 1e-2  # weight of a gain of 0, per observation: what is tied to nothing stays as it is
_LARGEST = 0.7  # of a gain's logarithm: a factor of two


@dataclass(frozen=True)
class Balance:
    """Logarithms of ``gain`` (views, 3) and of the ``fall`` (3, 2: r^2, r^4) to the corners."""

    gain: Array
    fall: Array

    @classmethod
    def none(cls, views: int) -> Balance:
        """Return the balance that changes nothing."""
        return cls(np.zeros((views, 3)), np.zeros((3, 2)))


def corner_distance(view: View, pixels: Array) -> Array:
    """Return how far pixels (n, 2) are from the middle of the frame, 1 in its corners."""
    size = np.array([view.camera.width, view.camera.height], float)
    return np.asarray(2.0 * np.linalg.norm(pixels - 0.5 * size, axis=1) / np.linalg.norm(size))


def shades(path: str, pixels: Array) -> Array:
    """Return the colours (n, 3; 0..1) of a photograph around pixels (n, 2; full size).

    Raises
    ------
    InputError
        When it cannot be decoded.
    """
    if not len(pixels):
        return np.zeros((0, 3))
    picture = read_reduced(path, _REDUCTION)
    x, y = (pixels / 2**_REDUCTION - 0.5).astype(np.float32).T
    found = cv2.remap(picture, x[None], y[None], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found[0], float) / np.iinfo(picture.dtype).max


def find_balance(block: Block, paths: Sequence[str], *, workers: int, scheduler: str | None, progress: Progress) -> Balance:
    """Return the balance of a block's photographs; ``paths`` are theirs, in order.

    Raises
    ------
    InputError
        When a photograph cannot be decoded.
    """
    points, pixels, radii = [], [], []
    for n, view in enumerate(block.views):
        mine = block.observed_point[block.observed_view == n]
        # The points of many rays tie best; of those alike, in the model's order.
        mine = np.sort(mine[np.argsort(-block.rays[mine], kind="stable")][:_MOST])
        places = view.project(block.points[mine])
        framed = np.isfinite(places).all(axis=1)
        points.append(mine[framed])
        pixels.append(places[framed])
        radii.append(corner_distance(view, places[framed]))
    found: list[Array] = [np.zeros((0, 3))] * len(paths)
    for n, colours in run_calls(
        shades, zip(paths, pixels, strict=True), workers=workers, scheduler=scheduler, progress=progress, total=len(paths)
    ):
        found[n] = colours
    view_of = np.repeat(np.arange(len(paths)), [len(p) for p in points])
    return solve(np.concatenate(found), np.concatenate(points), view_of, np.concatenate(radii), len(paths))


def solve(colours: Array, point: NDArray[np.integer], view: NDArray[np.integer], radius: Array, views: int) -> Balance:
    """Return the balance from ``colours`` (n, 3; 0..1) of ``point`` (n,) in ``view`` (n,) at ``radius`` (n,), robustly."""
    gain, fall = np.zeros((views, 3)), np.zeros((3, 2))
    for channel in range(3):
        fine = (colours[:, channel] > _DARK) & (colours[:, channel] < _BRIGHT)
        _, number, count = np.unique(point[fine], return_inverse=True, return_counts=True)
        tied = count[number] >= 2
        if not tied.any():
            continue
        value = np.log(colours[fine, channel][tied])
        _, number = np.unique(number[tied], return_inverse=True)
        answer = _solve(value, number, view[fine][tied], radius[fine][tied], views)
        gain[:, channel] = np.clip(answer[:views] - answer[:views].mean(), -_LARGEST, _LARGEST)
        fall[channel] = answer[views:]
    return Balance(gain, fall)


def _solve(value: Array, point: NDArray[np.integer], view: NDArray[np.integer], radius: Array, views: int) -> Array:
    """Return gains and the two terms of the fall by iterated least squares; points' own shades are eliminated."""
    points, size = int(point.max()) + 1, views + 2
    entries, rows = np.arange(len(value)), np.arange(len(value))
    terms = np.column_stack([radius**2, radius**4])
    design = sparse.hstack([sparse.csr_array((np.ones(len(value)), (rows, view)), (len(value), views)), sparse.csr_array(terms)])
    member = sparse.csr_array((np.ones(len(value)), (point, entries)), (points, len(value)))
    # Noise and scattered light are alike in dark and bright colours: the brighter, the better is the logarithm known.
    sure = np.exp(2.0 * (value - value.mean()))
    weight, answer = sure, np.zeros(size)
    for _ in range(_ROUNDS):
        weighted = design.multiply(weight[:, None]).tocsr()
        total, means = member @ weight, member @ weighted
        own = np.asarray(weighted.sum(axis=0))[:views]
        normal = (design.T @ weighted - means.T @ means.multiply(1.0 / total[:, None])).toarray()
        normal[np.arange(size), np.arange(size)] += _HOLD * np.concatenate([np.maximum(own, 1.0), [1.0, 1.0]])
        mean_value = (member @ (weight * value)) / total
        answer = np.linalg.solve(normal, weighted.T @ (value - mean_value[point]))
        model = answer[view] + terms @ answer[views:]
        shade = np.bincount(point, weight * (value - model), points) / total
        residual = value - model - shade[point]
        scaled = np.abs(residual) * np.sqrt(sure)
        weight = sure / np.maximum(1.0, scaled / (1.5 * 1.4826 * np.median(scaled) + 1e-6))
    return answer
