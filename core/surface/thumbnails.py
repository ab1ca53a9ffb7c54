"""The whole surface in pictures of a size that a page can show, collected patch by patch."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster import Grid

Floats = NDArray[np.float32]

LONGEST = 1400  # pixels along the longer side


class Thumbnails:
    """Layers ``height``, ``score``, ``sigma`` (NaN: none), ``views``, ``colour`` (8 bits, alpha): each ``thinning``-th cell."""

    def __init__(self, grid: Grid) -> None:
        self.thinning = max(1, -(-max(grid.width, grid.height) // LONGEST))
        rows, columns = -(-grid.height // self.thinning), -(-grid.width // self.thinning)
        self._numbers = {name: np.full((rows, columns), np.nan, np.float32) for name in ("height", "score", "sigma")}
        self._views = np.zeros((rows, columns), np.uint8)
        self._colour = np.zeros((rows, columns, 4), np.uint8)

    def put(
        self, row: int, column: int, height: Floats, score: Floats, sigma: Floats, views: NDArray[np.uint8],
        colour: NDArray[np.uint8],
    ) -> None:  # fmt: skip
        """Take a patch whose first cell is at ``row``, ``column``; ``colour`` is the mean over what a pixel stands for."""
        s = self.thinning
        first = -row % s, -column % s
        r, c = (row + first[0]) // s, (column + first[1]) // s
        if s > 1:
            colour = cv2.blur(colour, (s, s))
        thin = slice(first[0], None, s), slice(first[1], None, s)
        part = colour[thin]
        place = slice(r, r + part.shape[0]), slice(c, c + part.shape[1])
        self._colour[place], self._views[place] = part, views[thin]
        for name, layer in (("height", height), ("score", score), ("sigma", sigma)):
            self._numbers[name][place] = layer[thin]

    def layers(self) -> dict[str, Any]:
        """Return the layers by name."""
        return {**self._numbers, "views": self._views, "colour": self._colour}
