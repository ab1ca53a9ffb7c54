"""Small holes in a surface closed by interpolation between their rims."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

Floats = NDArray[np.float32]


def margin(most: int) -> int:
    """Return how many cells a window must reach over a tile to hold each fillable hole of up to ``most`` cells whole."""
    return int(np.ceil(4 * np.sqrt(most))) + 2 if most else 0


def fill(height: Floats, sigma: Floats, good: NDArray[np.bool_], most: int) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Return height and sigma with holes of up to ``most`` cells filled, and which cells were (rows, columns).

    A hole is a connected set of cells that are not ``good``; one that touches the window's edge, or is longer than
    ``margin(most) - 2`` cells, is left, so that every window that holds a hole decides alike. Heights are linear between
    the rim's cells (Delaunay); sigma is the rim's, with the rim's own roughness about its plane added.
    """
    height, sigma, filled = height.copy(), sigma.copy(), np.zeros_like(good)
    if most <= 0:
        return height, sigma, filled
    rows, columns = good.shape
    number, labels, boxes, _ = cv2.connectedComponentsWithStats((~good).astype(np.uint8), connectivity=4)
    for n in range(1, number):
        left, top, width, tall, area = (int(v) for v in boxes[n])
        at_edge = left == 0 or top == 0 or left + width == columns or top + tall == rows
        if at_edge or area > most or max(width, tall) > margin(most) - 2:
            continue
        window = slice(max(0, top - 2), top + tall + 2), slice(max(0, left - 2), left + width + 2)
        hole = labels[window] == n
        rim = (cv2.dilate(hole.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0) & good[window]
        places, values = np.argwhere(rim).astype(float), height[window][rim].astype(float)
        if len(values) < 4:
            continue
        wanted = np.argwhere(hole).astype(float)
        found = LinearNDInterpolator(places, values)(wanted)
        outside = np.isnan(found)
        if outside.any():
            found[outside] = NearestNDInterpolator(places, values)(wanted[outside])
        design = np.column_stack([np.ones(len(places)), places])
        rough = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
        height[window][hole] = found
        sigma[window][hole] = np.hypot(np.nanmedian(sigma[window][rim]), 1.4826 * np.median(np.abs(rough)))
        filled[window] |= hole
    return height, sigma, filled
