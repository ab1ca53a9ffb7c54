"""Features of one photograph: SIFT (Lowe 2004) with RootSIFT descriptors (Arandjelovic & Zisserman 2012), evenly spread.

The search starts at the photograph's own pixels, not at twice their number as Lowe's: on sand the finest octave holds the
sensor's noise, and leaving it out costs no tie point while it saves three quarters of time and memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import whole

VERSION = 1  # part of the key under which features are kept: raise it when the same image would give others
_LAYERS = 3  # scales per octave, as Lowe's
_CONTRAST = 0.002  # a twentieth of OpenCV's default: sand has little; the grid keeps the best of what is found
_EDGE = 10.0
_SIGMA = 1.6
_CELLS = 32  # cells along the longer side among which the features are shared out
_UNIT = 512.0  # descriptor norm in 8 bits; no element of a RootSIFT reaches 255


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

    def keypoints(self) -> NDArray[np.float32]:
        """Return x, y, scale, angle (n, 4), as a COLMAP database holds them."""
        return np.column_stack([self.xy, self.scale, self.angle])


def detect(image: NDArray[np.uint8], *, max_features: int, max_size: int) -> Features:
    """Return the features of a grey image (rows, columns).

    ``max_features`` 0 keeps all; ``max_size`` is the longer side (pixels) of the image searched, 0 the image as it is.
    """
    height, width = image.shape
    longer = max(width, height)
    wanted = min(max_size, longer) if max_size else longer
    # OpenCV always starts at twice the pixels it is given, so it is given half of those wanted.
    size = (max(1, round(width * wanted / longer / 2)), max(1, round(height * wanted / longer / 2)))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    factor = np.array([width / size[0], height / size[1]], np.float32)
    sift = cv2.SIFT.create(0, _LAYERS, _CONTRAST, _EDGE, _SIGMA, True)
    found = sift.detect(small)
    if not found:
        empty = np.zeros(0, np.float32)
        return Features(np.zeros((0, 2), np.float32), empty, empty, np.zeros((0, 128), np.uint8))
    # The order OpenCV finds them in is not promised; an order by their numbers is the same anywhere.
    numbers = np.array([(*k.pt, k.size, k.angle, k.response) for k in found], np.float32)
    order = np.lexsort(tuple(numbers.T))
    best = order[spread(numbers[order, :2], numbers[order, 4], size, max_features or len(found))]
    kept, described = sift.compute(small, [found[i] for i in best])
    numbers = np.array([(*k.pt, k.size, k.angle) for k in kept], np.float32)
    return Features(
        (numbers[:, :2] + np.float32(0.5)) * factor,  # OpenCV counts from the centre of the first pixel
        numbers[:, 2] / 2 * factor.mean(),  # OpenCV's size is a diameter
        np.radians(numbers[:, 3]),
        root_sift(described),
    )


def spread(xy: NDArray[np.float32], score: NDArray[np.float32], size: tuple[int, int], count: int) -> NDArray[np.intp]:
    """Return the indices (ascending) of ``count`` points (n, 2) such that every grid cell gives its best in turn.

    ``size`` is width, height. A cell with fewer points than its share leaves the rest to the others.
    """
    if len(xy) <= count:
        return np.arange(len(xy))
    cell = max(size) / _CELLS
    column, row = (xy // cell).astype(np.int64).T
    index = row * (_CELLS + 1) + column
    order = np.lexsort((-score, index))
    starts = np.flatnonzero(np.diff(index[order], prepend=-1))
    rank = np.empty(len(xy), np.int64)
    rank[order] = np.arange(len(xy)) - np.repeat(starts, np.diff(starts, append=len(xy)))
    return np.sort(np.lexsort((-score, rank))[:count])


def root_sift(descriptors: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return RootSIFT of SIFT descriptors (n, 128): the square root of the L1-normalised, in 8 bits."""
    total = np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9)
    return np.clip(np.rint(_UNIT * np.sqrt(descriptors / total)), 0, 255).astype(np.uint8)


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
