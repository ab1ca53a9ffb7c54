"""Small holes in a surface closed by interpolation between their rims."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

MOST = 100_000  # cells of the largest hole that is filled; the windows that must hold one whole grow with it
_RIM = 2  # cells: how wide the rim is that a hole's heights come from


def margin(most: int) -> int:
    """Return how many cells a window must reach over a tile to hold each fillable hole of up to ``most`` cells whole."""
    return int(np.ceil(4 * np.sqrt(most))) + _RIM + 1 if most else 0


def fill(height: Floats, sigma: Floats, good: Mask, most: int, barred: Mask | None = None) -> tuple[Floats, Floats, Mask]:
    """Return height and sigma with holes of up to ``most`` cells filled, and which cells were (rows, columns).

    A hole is a set of cells that are not ``good`` or are ``barred`` (left out by the user), connected by their sides. It is left
    when it holds a barred cell, touches the window's edge, or is longer than a window is sure to hold, so that every window
    decides alike. Heights are linear between the rim's cells (Delaunay), a band two cells wide.

    Sigma is never less than that of any cell of the rim: sigma^2 = max(sigma of the rim)^2 + max(1.5 r^2, w^2 d / 2). What the
    ground may do between is taken from what its rim does: r is the rim's rms about its own plane (once for the cell, half for
    the two or so cells that it is interpolated from), w its rms from cell to cell, and w^2 d / 2 the variance of a random walk
    pinned on both sides, d cells from either.
    """
    height, sigma, filled = height.copy(), sigma.copy(), np.zeros_like(good)
    if most <= 0:
        return height, sigma, filled
    if barred is not None:
        good = good & ~barred
    rows, columns = good.shape
    number, labels, boxes, _ = cv2.connectedComponentsWithStats((~good).astype(np.uint8), connectivity=4)
    shut = np.zeros(number, bool)
    if barred is not None:
        shut[np.unique(labels[barred])] = True
    longest = margin(most) - _RIM - 1
    for n in range(1, number):
        left, top, width, tall, area = (int(v) for v in boxes[n])
        at_edge = left == 0 or top == 0 or left + width == columns or top + tall == rows
        if shut[n] or at_edge or area > most or max(width, tall) > longest:
            continue
        window = (
            slice(max(0, top - _RIM), top + tall + _RIM),
            slice(max(0, left - _RIM), left + width + _RIM),
        )
        hole = labels[window] == n
        side = 2 * _RIM + 1
        rim = (cv2.dilate(hole.astype(np.uint8), np.ones((side, side), np.uint8)) > 0) & good[window]
        if rim.sum() < 4:
            continue
        heights, sigmas = _interpolated(height[window], sigma[window], hole, rim)
        height[window][hole], sigma[window][hole] = heights, sigmas
        filled[window] |= hole
    return height, sigma, filled


def _interpolated(height: Floats, sigma: Floats, hole: Mask, rim: Mask) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return heights and sigmas of a hole's cells, from its rim's."""
    places, values = np.argwhere(rim).astype(float), height[rim].astype(float)
    wanted = np.argwhere(hole).astype(float)
    found = LinearNDInterpolator(places, values)(wanted)
    outside = np.isnan(found)
    if outside.any():
        found[outside] = NearestNDInterpolator(places, values)(wanted[outside])
    design = np.column_stack([np.ones(len(places)), places - places.mean(axis=0)])
    plane = np.linalg.lstsq(design, values, rcond=None)[0]
    rough = float(np.sqrt(np.mean((values - design @ plane) ** 2)))
    worst = float(np.nanmax(sigma[rim])) if np.isfinite(sigma[rim]).any() else np.nan
    distance = cv2.distanceTransform(hole.astype(np.uint8), cv2.DIST_L2, 5)[hole].astype(float)
    walk = _from_cell_to_cell(height, rim)
    return found, np.hypot(worst, np.maximum(np.sqrt(1.5) * rough, walk * np.sqrt(distance / 2)))


def _from_cell_to_cell(height: Floats, rim: Mask) -> float:
    """Return the rms difference of neighbouring cells of the rim, their mean slope taken off; 0 when there are none."""
    steps = []
    for axis in (0, 1):
        both = (rim[1:] & rim[:-1]) if axis == 0 else (rim[:, 1:] & rim[:, :-1])
        difference = np.diff(height, axis=axis)[both].astype(float)
        if len(difference):
            steps.append(difference - difference.mean())
    return float(np.sqrt(np.mean(np.concatenate(steps) ** 2))) if steps else 0.0
