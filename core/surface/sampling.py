"""Where ground points fall in a photograph, and what it shows there: compiled kernels.

Ground coordinates are a tile's own: metres east, north, up of its origin. A photograph is the 3x4 matrix ``camera_from_tile``,
Brown's twelve numbers (``Camera.brown``) and the squared radius beyond which the distortion folds back.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@nb.njit(cache=True, inline="always")
def project(matrix: Array, brown: Array, fold2: float, x: float, y: float, z: float) -> tuple[float, float]:
    """Return the pixel (COLMAP's convention, full size) of a ground point; NaN where the camera cannot see it."""
    depth = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
    if depth <= 0.0:
        return np.nan, np.nan
    u = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) / depth
    v = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) / depth
    r2 = u * u + v * v
    if r2 > fold2:
        return np.nan, np.nan
    radial = 1.0 + r2 * (brown[4] + r2 * (brown[5] + r2 * brown[8]))
    if brown[9] != 0.0 or brown[10] != 0.0 or brown[11] != 0.0:
        radial /= 1.0 + r2 * (brown[9] + r2 * (brown[10] + r2 * brown[11]))
    du = u * radial + 2.0 * brown[6] * u * v + brown[7] * (r2 + 2.0 * u * u)
    dv = v * radial + brown[6] * (r2 + 2.0 * v * v) + 2.0 * brown[7] * u * v
    return brown[0] * du + brown[2], brown[1] * dv + brown[3]


@nb.njit(cache=True)
def sample(
    image: Floats,
    corner: Array,
    matrix: Array,
    brown: Array,
    fold2: float,
    west: float,
    north: float,
    cell: float,
    height: Floats,
    rise: float,
    out: Floats,
) -> float:
    """Resample a photograph on the surface ``height + rise`` (rows, columns) into ``out``, bilinearly; return the mean.

    ``image`` is a window of a reduced photograph; ``corner`` holds the reduction (0.5 = half size) and the window's first
    column and row. ``west``, ``north`` are the grid's corner in tile coordinates. NaN outside the window; the mean is of the
    rest (0 when nothing is left).
    """
    rows, columns = height.shape
    scale, left, top = corner[0], corner[1] + 0.5, corner[2] + 0.5
    last_row, last_column = image.shape[0] - 1, image.shape[1] - 1
    total, number = 0.0, 0
    for r in range(rows):
        y = north - (r + 0.5) * cell
        for c in range(columns):
            px, py = project(matrix, brown, fold2, west + (c + 0.5) * cell, y, height[r, c] + rise)
            px = px * scale - left
            py = py * scale - top
            # Written so that NaN fails it too.
            if not (px >= 0.0 and py >= 0.0 and px < last_column and py < last_row):
                out[r, c] = np.nan
                continue
            j, i = int(px), int(py)
            fx, fy = np.float32(px - j), np.float32(py - i)
            upper = image[i, j] + fx * (image[i, j + 1] - image[i, j])
            lower = image[i + 1, j] + fx * (image[i + 1, j + 1] - image[i + 1, j])
            value = upper + fy * (lower - upper)
            out[r, c] = value
            total += value
            number += 1
    return total / number if number else 0.0


@nb.njit(cache=True)
def visible(
    surface: Floats, cell: float, west: float, north: float, centre: Array, tolerance: float, top: float
) -> NDArray[np.bool_]:
    """Tell for each cell of ``surface`` whether nothing of it stands between the cell and the projection ``centre``.

    The ray is followed cell by cell until it is above ``top``, the highest of the surface; ``tolerance`` (m, vertical) is
    what the surface may rise over it.
    """
    rows, columns = surface.shape
    seen = np.ones((rows, columns), np.bool_)
    for r in range(rows):
        y = north - (r + 0.5) * cell
        for c in range(columns):
            x = west + (c + 0.5) * cell
            z = surface[r, c]
            dx, dy, dz = centre[0] - x, centre[1] - y, centre[2] - z
            reach = max(abs(dx), abs(dy)) / cell  # cells along the longer axis up to the camera
            if dz <= 0.0 or reach < 1.0:
                continue
            step_c, step_r, step_z = dx / cell / reach, -dy / cell / reach, dz / reach
            steps = min(int((top - z) / step_z) + 1, int(reach))
            for k in range(1, steps + 1):
                i, j = int(r + k * step_r + 0.5), int(c + k * step_c + 0.5)
                if i < 0 or j < 0 or i >= rows or j >= columns:
                    break
                if surface[i, j] > z + k * step_z + tolerance:
                    seen[r, c] = False
                    break
    return seen


@nb.njit(cache=True)
def inside(
    size: Array, matrix: Array, brown: Array, fold2: float, west: float, north: float, cell: float, height: Floats
) -> NDArray[np.bool_]:
    """Tell for each cell whether it falls into the photograph's frame, ``size`` = (width, height)."""
    rows, columns = height.shape
    out = np.zeros((rows, columns), np.bool_)
    for r in range(rows):
        for c in range(columns):
            px, py = project(matrix, brown, fold2, west + (c + 0.5) * cell, north - (r + 0.5) * cell, height[r, c])
            out[r, c] = px >= 0.0 and py >= 0.0 and px <= size[0] and py <= size[1]
    return out
