"""Features of one photograph: SIFT (Lowe 2004) with a threshold that follows the noise, evenly spread.

A fixed contrast would take noise for features where a photograph is noisy or its contrast enhanced, and leave out faint
coarse features that stand clear of it. The search starts at the photograph's own pixels; only where these give fewer
features than wanted does it go on to twice their number, as Lowe's, at four times the cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import whole
from .descriptors import SUPPORT, describe
from .noise import LEAST_NOISE, NoiseMap, noise_gain, noise_map
from .scalespace import LAYERS, Octave, differences, extrema, finer_octave, gaussians, layer_of, octaves, sigma_of

Threshold = Literal["noise", "fixed"]

VERSION = 4  # part of the key under which features are kept: raise it when the same image would give others
_TIMES_NOISE = 2.5  # independent noise of any level leaves some 1,000 features per megapixel above it, of 4,500
_FIXED = 0.01 * 255 / LAYERS  # grey levels: the contrast 0.01 as OpenCV counts it
_CELLS = 16  # along the longer side, among which features are shared out: more cells cost matches and cover no more ground
_LEAST = 16  # pixels of the shorter side of the smallest image that is searched
_FOUND = np.dtype([("xy", np.float32, 2), ("scale", np.float32), ("score", np.float32), ("pixel", np.float32)])


@dataclass(frozen=True)
class Features:
    """``n`` features in the pixels of the stored photograph (``core.__init__`` says where they count from).

    ``xy`` (n, 2) float32; ``scale`` (n,) float32, the Gaussian's sigma in pixels; ``angle`` (n,) float32, radians, x towards y;
    ``descriptors`` (n, 128) uint8, RootSIFT times 512, so that the product of two is 512**2 for equal ones.
    """

    xy: NDArray[np.float32]
    scale: NDArray[np.float32]
    angle: NDArray[np.float32]
    descriptors: NDArray[np.uint8]

    def __len__(self) -> int:
        """Return the number of features."""
        return len(self.xy)

    @classmethod
    def none(cls) -> Features:
        """Return what a blank image has."""
        nothing = np.zeros(0, np.float32)
        return cls(np.zeros((0, 2), np.float32), nothing, nothing, np.zeros((0, 128), np.uint8))

    def keypoints(self) -> NDArray[np.float32]:
        """Return x, y, scale, angle (n, 4), as a COLMAP database holds them."""
        return np.column_stack([self.xy, self.scale, self.angle])


def detect(
    image: NDArray[np.uint8],
    *,
    max_features: int,
    max_size: int,
    threshold: Threshold = "noise",
    mask: NDArray[np.bool_] | None = None,
) -> Features:
    """Return the features of a grey image (rows, columns).

    Parameters
    ----------
    image
        The photograph, or its enhanced image.
    max_features
        Largest number of features, spread over the image; 0 for all.
    max_size
        Longer side (pixels) of the image searched; 0 for the image as it is.
    threshold
        The contrast a feature needs: ``noise``, 2.5 times what the noise where it stands leaves at its scale; ``fixed``,
        0.01 as OpenCV counts it.
    mask
        Where features may lie (rows, columns). None is found whose descriptor reaches out of it, or to where the
        image is clipped.
    """
    small, factor = _reduced(image, max_size)
    if min(small.shape) < _LEAST:
        return Features.none()
    free = _free_radius(small, mask)
    noise = noise_map(small)
    found = np.concatenate([_search(octave, noise, free, threshold) for octave in octaves(small)])
    finer = not max_features or len(found) < max_features
    if finer:
        found = np.concatenate([_search(finer_octave(small), noise, free, threshold), found])
    if max_features:
        width, height = small.shape[::-1]
        found = found[spread(found["xy"], found["score"], (width, height), max_features, cells=_CELLS)]
    angle = np.empty(len(found), np.float32)
    descriptors = np.empty((len(found), 128), np.uint8)
    for octave in chain([finer_octave(small)] if finer else [], octaves(small)):
        own = np.flatnonzero(found["pixel"] == octave.pixel)
        angle[own], descriptors[own] = _described(octave, found[own])
    return Features(found["xy"] * factor, found["scale"] * factor.mean(), angle, descriptors)


def spread(
    xy: NDArray[np.float32], score: NDArray[np.float32], size: tuple[int, int], count: int, *, cells: int = 32
) -> NDArray[np.intp]:
    """Return the indices (ascending) of ``count`` points (n, 2) such that every grid cell gives its best in turn.

    ``size`` is width, height; there are ``cells`` along the longer. A cell with fewer points than its share leaves the rest to
    the others.
    """
    if len(xy) <= count:
        return np.arange(len(xy))
    cell = max(size) / cells
    column, row = (xy // cell).astype(np.int64).T
    index = row * (cells + 1) + column
    order = np.lexsort((-score, index))
    starts = np.flatnonzero(np.diff(index[order], prepend=-1))
    rank = np.empty(len(xy), np.int64)
    rank[order] = np.arange(len(xy)) - np.repeat(starts, np.diff(starts, append=len(xy)))
    return np.sort(np.lexsort((-score, rank))[:count])


def write_features(path: Path, features: Features) -> None:
    """Write features to an npz, whole or not at all."""
    with whole(path) as part, part.open("wb") as stream:
        np.savez(stream, xy=features.xy, scale=features.scale, angle=features.angle, descriptors=features.descriptors)


def read_features(path: Path) -> Features:
    """Read what ``write_features`` wrote.

    Raises
    ------
    InputError
        When the file is damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            return Features(data["xy"], data["scale"], data["angle"], data["descriptors"])
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"The features {path} cannot be read ({error}): delete them and run strandline:tiepoints.") from error


def _reduced(image: NDArray[np.uint8], max_size: int) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Return the image searched, and the sides (x, y) of its pixels in those of ``image``."""
    height, width = image.shape
    longer = max(width, height)
    if not max_size or max_size >= longer:
        return image, np.ones(2, np.float32)
    size = (max(1, round(width * max_size / longer)), max(1, round(height * max_size / longer)))
    small = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    return small, np.array([width / size[0], height / size[1]], np.float32)


def _free_radius(image: NDArray[np.uint8], mask: NDArray[np.bool_] | None) -> NDArray[np.float32] | None:
    """Return each pixel's distance (pixels) to the next where no feature may lie; None where there is none."""
    # A single black or white pixel may be noise; a square of three is clipped.
    clipped = ((image == 0) | (image == 255)).astype(np.uint8)
    free = 1 - cv2.morphologyEx(clipped, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    if mask is not None:
        share = cv2.resize(mask.astype(np.uint8) * np.uint8(255), image.shape[::-1], interpolation=cv2.INTER_AREA)
        free &= share == 255
    return None if free.all() else np.asarray(cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)


def _search(octave: Octave, noise: NoiseMap, free: NDArray[np.float32] | None, threshold: Threshold) -> NDArray[Any]:
    """Return the features of an octave, in pixels of the image searched; ``score`` is their contrast over its noise."""
    pixel = np.float32(octave.pixel)
    # No threshold of the octave is below that of the least noise at its coarsest scale.
    coarsest = sigma_of(np.array([LAYERS + 1], np.float32)) * pixel
    least = _FIXED if threshold == "fixed" else _TIMES_NOISE * LEAST_NOISE * float(noise_gain(coarsest)[0])
    parts = []
    for strip in differences(octave):
        column, row, layer, contrast = extrema(strip, least).T
        part = np.empty(len(column), _FOUND)
        part["xy"] = np.column_stack([column, row]) * pixel + np.float32(0.5)
        part["scale"] = sigma_of(layer) * pixel
        part["pixel"] = pixel
        part["score"] = np.abs(contrast) / (noise.at(part["xy"]) * noise_gain(part["scale"]))
        if threshold == "noise":
            part = part[part["score"] >= _TIMES_NOISE]
        if free is not None:
            x, y = part["xy"].astype(np.int64).T
            part = part[free[y, x] > SUPPORT * part["scale"]]
        parts.append(part)
    found = np.concatenate(parts)
    # Two searches may end at one place, with the same numbers. As whole numbers, pairs of coordinates sort by rows.
    _, first = np.unique(np.ascontiguousarray(found["xy"]).view("<u8"), return_index=True)
    return found[first]


def _described(octave: Octave, found: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return orientation and descriptor of an octave's features."""
    pixel = np.float32(octave.pixel)
    column, row = ((found["xy"] - np.float32(0.5)) / pixel).T
    sigma = np.asarray(found["scale"] / pixel, np.float32)
    layer = layer_of(sigma)
    angle = np.empty(len(found), np.float32)
    descriptors = np.empty((len(found), 128), np.uint8)
    for strip in gaussians(octave):
        own = np.flatnonzero((np.rint(row) >= strip.first) & (np.rint(row) < strip.last))
        angle[own], descriptors[own] = describe(
            strip.layers, column[own], row[own] - np.float32(strip.top), layer[own], sigma[own]
        )
    return angle, descriptors
