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


@nb.njit(cache=True, error_model="numpy", inline="always")
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


@nb.njit(cache=True, error_model="numpy")
def _row_places(
    matrix: Array,
    brown: Array,
    fold2: float,
    x: float,
    y: float,
    step: float,
    height: Floats,
    rise: float,
    corner: Array,
    column: Floats,
    row: Floats,
) -> None:
    """Write where a row of cells falls in a photograph's window; far outside where the camera cannot see it.

    Without branches, so that it runs in vector registers. Differences are taken in 64 bits; 32 bits hold the place to 1e-3 pixel.
    """
    a = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 3]
    b = matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 3]
    c = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 3]
    du, dv, dw = matrix[0, 0] * step, matrix[1, 0] * step, matrix[2, 0] * step
    uz, vz, wz = matrix[0, 2], matrix[1, 2], matrix[2, 2]
    scale, left, top = corner[0], corner[1] + 0.5, corner[2] + 0.5
    fx, fy, cx, cy = scale * brown[0], scale * brown[1], scale * brown[2] - left, scale * brown[3] - top
    k1, k2, p1, p2, k3 = brown[4], brown[5], brown[6], brown[7], brown[8]
    k4, k5, k6 = brown[9], brown[10], brown[11]
    for i in range(len(height)):
        z = height[i] + rise
        depth = c + i * dw + wz * z
        inverse = 1.0 / depth
        u, v = (a + i * du + uz * z) * inverse, (b + i * dv + vz * z) * inverse
        r2 = u * u + v * v
        radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        hidden = (depth <= 0.0) | (r2 > fold2)
        column[i] = -1e9 if hidden else fx * (u * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u)) + cx
        row[i] = -1e9 if hidden else fy * (v * radial + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v) + cy


@nb.njit(cache=True, error_model="numpy")
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
) -> None:
    """Resample a photograph on the surface ``height + rise`` (rows, columns) into ``out``, bilinearly; NaN outside the window.

    ``image`` is a window of a reduced photograph; ``corner`` holds the reduction (0.5 = half size) and the window's first
    column and row. ``west``, ``north`` are the grid's corner in tile coordinates.
    """
    rows, columns = height.shape
    width = np.int32(image.shape[1])
    flat = image.ravel()
    right, bottom = np.float32(image.shape[1] - 1), np.float32(image.shape[0] - 1)
    zero, nan = np.float32(0.0), np.float32(np.nan)
    x, y = np.empty(columns, np.float32), np.empty(columns, np.float32)
    for r in range(rows):
        _row_places(matrix, brown, fold2, west + 0.5 * cell, north - (r + 0.5) * cell, cell, height[r], rise, corner, x, y)
        line = out[r]
        for c in range(columns):
            px, py = x[c], y[c]
            if not (px >= zero and py >= zero and px < right and py < bottom):
                line[c] = nan
                continue
            j, i = np.int32(px), np.int32(py)
            fx, fy = px - np.float32(j), py - np.float32(i)
            # Unsigned, so that no index is tested for counting from the end.
            place = np.uint32(i * width + j)
            below = np.uint32(i * width + j + width)
            one = np.uint32(1)
            upper = flat[place] + fx * (flat[place + one] - flat[place])
            lower = flat[below] + fx * (flat[below + one] - flat[below])
            line[c] = upper + fy * (lower - upper)


@nb.njit(cache=True, error_model="numpy")
def visible(
    surface: Floats, cell: float, west: float, north: float, centre: Array, tolerance: float, furthest: int
) -> NDArray[np.bool_]:
    """Tell for each cell of ``surface`` whether nothing of it stands between the cell and the projection ``centre``.

    The ray is followed cell by cell until it is above the highest of the surface, or over ``furthest`` cells; ``tolerance``
    (m, vertical) is what the surface may rise over it.
    """
    rows, columns = surface.shape
    top = surface.max()
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
            steps = min(min(int((top - z) / step_z) + 1, int(reach)), furthest)
            for k in range(1, steps + 1):
                i, j = int(r + k * step_r + 0.5), int(c + k * step_c + 0.5)
                if i < 0 or j < 0 or i >= rows or j >= columns:
                    break
                if surface[i, j] > z + k * step_z + tolerance:
                    seen[r, c] = False
                    break
    return seen


@nb.njit(cache=True, error_model="numpy")
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
