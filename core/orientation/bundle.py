"""Kernels of the bundle adjustment: collinearity with Brown's distortion, its derivatives, and reduced normal equations.

Tie points are eliminated one by one (Brown 1958; Schur's complement), so that what remains are poses and interior orientations.
A pose is a rotation R, changed to exp(w) R, and the projection centre C: ``x_camera = R (X - C)``. The columns of the
reduced system hold w and C of each view (6), then the free interior parameters of each camera. Everything runs on one thread in
one order: two runs give the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

POSE = 6  # columns of a view: rotation (rad, about the camera's axes), projection centre (m)
_WEAK = 1e-12  # of a point's normal matrix: below, its rays are parallel and it says nothing


@dataclass(frozen=True)
class Rays:
    """Observations of points, sorted by point: point ``p`` has the observations ``start[p]`` to ``start[p + 1]``.

    ``view`` (m,) indexes the views, ``xy`` (m, 2) are pixels.
    """

    start: Index
    view: Index
    xy: Array

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.start) - 1

    @property
    def point(self) -> Index:
        """The point (m,) of each observation."""
        return np.repeat(np.arange(len(self)), np.diff(self.start))

    def only(self, points: NDArray[np.bool_]) -> Rays:
        """Return the rays of some points (n,)."""
        counts = np.diff(self.start)
        kept = np.repeat(points, counts)
        return Rays(np.concatenate([[0], np.cumsum(counts[points])]).astype(np.int64), self.view[kept], self.xy[kept])


@dataclass(frozen=True)
class Cameras:
    """Exterior and interior orientation: ``rotation`` (n, 3, 3), ``centre`` (n, 3), the ``camera`` (n,) of each view.

    ``brown`` (c, 12) are fx, fy, cx, cy, k1, k2, p1, p2, k3 to k6 of each camera; ``basis`` (c, 12, q) are their derivatives by
    the free interior parameters, padded with zero columns, of which the first ``free`` (c,) count.
    """

    rotation: Array
    centre: Array
    camera: Index
    brown: Array
    basis: Array
    free: Index

    @property
    def interior_column(self) -> Index:
        """The first column (c,) of each camera's free parameters in the reduced system."""
        return np.asarray(POSE * len(self.centre) + np.concatenate([[0], np.cumsum(self.free)[:-1]]), np.int64)

    @property
    def columns(self) -> int:
        """The number of columns of the reduced system."""
        return POSE * len(self.centre) + int(self.free.sum())

    def moved(self, change: Array) -> Cameras:
        """Return the cameras after a change (columns,)."""
        n = len(self.centre)
        poses = change[: POSE * n].reshape(n, POSE)
        brown = self.brown.copy()
        for c, (column, free) in enumerate(zip(self.interior_column, self.free, strict=True)):
            brown[c] += self.basis[c, :, :free] @ change[column : column + free]
        turned = rotations(poses[:, :3]) @ self.rotation
        return Cameras(turned, self.centre + poses[:, 3:], self.camera, brown, self.basis, self.free)


def rotations(vectors: Array) -> Array:
    """Return the rotation matrices (n, 3, 3) of rotation vectors (n, 3), radians (Rodrigues 1840)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    cross = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross -= cross.transpose(0, 2, 1)
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    one = np.where(small, 1.0 - angle**2 / 6, np.sin(safe) / safe)
    two = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) + one * cross + two * cross @ cross)


@njit(cache=True)
def project(point, rotation, centre, brown, xy, by_point, by_pose, by_brown):  # type: ignore[no-untyped-def]
    """Write the pixel (2,) of ``point`` (3,) and its derivatives; tell whether the camera can see it.

    Derivatives are by point (2, 3), pose (2, 6) and the twelve interior parameters (2, 12). A point behind the camera, or beyond
    the radius from which the distortion folds back, cannot be seen.
    """
    d = point - centre
    x = rotation[0, 0] * d[0] + rotation[0, 1] * d[1] + rotation[0, 2] * d[2]
    y = rotation[1, 0] * d[0] + rotation[1, 1] * d[1] + rotation[1, 2] * d[2]
    z = rotation[2, 0] * d[0] + rotation[2, 1] * d[1] + rotation[2, 2] * d[2]
    if z <= 0.0:
        return False
    fx, fy, k1, k2, p1, p2 = brown[0], brown[1], brown[4], brown[5], brown[6], brown[7]
    k3, k4, k5, k6 = brown[8], brown[9], brown[10], brown[11]
    u, v = x / z, y / z
    r2 = u * u + v * v
    above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
    radial = above / below
    above_r2 = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3)
    below_r2 = k4 + r2 * (2.0 * k5 + 3.0 * r2 * k6)
    radial_r2 = (above_r2 - radial * below_r2) / below
    if radial + 2.0 * r2 * radial_r2 <= 0.0:
        return False
    du = u * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u)
    dv = v * radial + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v
    xy[0], xy[1] = fx * du + brown[2], fy * dv + brown[3]
    uu = radial + 2.0 * u * u * radial_r2 + 2.0 * p1 * v + 6.0 * p2 * u
    uv = 2.0 * u * v * radial_r2 + 2.0 * p1 * u + 2.0 * p2 * v
    vv = radial + 2.0 * v * v * radial_r2 + 6.0 * p1 * v + 2.0 * p2 * u
    # by x, y, z of the camera's frame
    ax, ay = fx * uu / z, fx * uv / z
    az = -(ax * u + ay * v)
    bx, by = fy * uv / z, fy * vv / z
    bz = -(bx * u + by * v)
    for j in range(3):
        by_point[0, j] = ax * rotation[0, j] + ay * rotation[1, j] + az * rotation[2, j]
        by_point[1, j] = bx * rotation[0, j] + by * rotation[1, j] + bz * rotation[2, j]
        by_pose[0, 3 + j] = -by_point[0, j]
        by_pose[1, 3 + j] = -by_point[1, j]
    # a turn w moves x_camera by w x x_camera
    by_pose[0, 0], by_pose[0, 1], by_pose[0, 2] = az * y - ay * z, ax * z - az * x, ay * x - ax * y
    by_pose[1, 0], by_pose[1, 1], by_pose[1, 2] = bz * y - by * z, bx * z - bz * x, by * x - bx * y
    by_brown[:, :] = 0.0
    by_brown[0, 0], by_brown[1, 1] = du, dv
    by_brown[0, 2], by_brown[1, 3] = 1.0, 1.0
    power = r2
    for k in (4, 5, 8):
        by_brown[0, k], by_brown[1, k] = fx * u * power / below, fy * v * power / below
        power *= r2
    power = r2
    for k in (9, 10, 11):
        by_brown[0, k], by_brown[1, k] = -fx * u * radial * power / below, -fy * v * radial * power / below
        power *= r2
    by_brown[0, 6], by_brown[1, 6] = fx * 2.0 * u * v, fy * (r2 + 2.0 * v * v)
    by_brown[0, 7], by_brown[1, 7] = fx * (r2 + 2.0 * u * u), fy * 2.0 * u * v
    return True


@njit(cache=True)
def _inverse(a, out):  # type: ignore[no-untyped-def]
    """Write the inverse of a symmetric positive 3 x 3 matrix; tell whether it has one."""
    c00 = a[1, 1] * a[2, 2] - a[1, 2] * a[1, 2]
    c01 = a[0, 2] * a[1, 2] - a[0, 1] * a[2, 2]
    c02 = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    determinant = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
    trace = (a[0, 0] + a[1, 1] + a[2, 2]) / 3.0
    if not determinant > _WEAK * trace * trace * trace:
        return False
    out[0, 0], out[0, 1], out[0, 2] = c00, c01, c02
    out[1, 1], out[1, 2] = a[0, 0] * a[2, 2] - a[0, 2] * a[0, 2], a[0, 1] * a[0, 2] - a[0, 0] * a[1, 2]
    out[2, 2] = a[0, 0] * a[1, 1] - a[0, 1] * a[0, 1]
    out[1, 0], out[2, 0], out[2, 1] = out[0, 1], out[0, 2], out[1, 2]
    out /= determinant
    return True


@njit(cache=True)
def _point_system(  # type: ignore[no-untyped-def]
    first, last, view, xy, weight, point, rotation, centre, camera, brown, basis, free, residual, jacobian, mixed, normal, right
):
    """Fill a point's normal matrix (3, 3) and right side (3,), and per ray the residual, its derivatives by what is reduced.

    ``jacobian`` (rays, 2, 6 + q) and ``mixed`` (rays, 6 + q, 3), the weighted product with the derivatives by the point.
    Tells whether all rays can be.
    """
    at, by_point, by_pose, by_brown = np.empty(2), np.empty((2, 3)), np.empty((2, 6)), np.empty((2, 12))
    normal[:, :] = 0.0
    right[:] = 0.0
    for i in range(first, last):
        k, c = i - first, camera[view[i]]
        if not project(point, rotation[view[i]], centre[view[i]], brown[c], at, by_point, by_pose, by_brown):
            return False
        residual[k, 0], residual[k, 1] = xy[i, 0] - at[0], xy[i, 1] - at[1]
        w = weight[i]
        for e in range(2):
            for j in range(6):
                jacobian[k, e, j] = by_pose[e, j]
            for j in range(free[c]):
                total = 0.0
                for b in range(12):
                    total += by_brown[e, b] * basis[c, b, j]
                jacobian[k, e, 6 + j] = total
            for a in range(3):
                right[a] += w * by_point[e, a] * residual[k, e]
                for b in range(3):
                    normal[a, b] += w * by_point[e, a] * by_point[e, b]
        for j in range(6 + free[c]):
            for a in range(3):
                mixed[k, j, a] = w * (jacobian[k, 0, j] * by_point[0, a] + jacobian[k, 1, j] * by_point[1, a])
    return True


@njit(cache=True)
def reduce(  # type: ignore[no-untyped-def]
    start, view, xy, weight, points, rotation, centre, camera, brown, basis, free, column, size
):
    """Return the reduced normal matrix (size, size; upper triangle), its right side (size,) and residuals (m, 2).

    ``weight`` (m,) is 1 / sigma^2 of each ray per axis (px^-2). Residuals are observed minus computed, NaN of points that cannot
    be seen or whose rays are parallel; such points take no part.
    """
    matrix, side = np.zeros((size, size)), np.zeros(size)
    residuals = np.full((len(view), 2), np.nan)
    most, q = 0, basis.shape[2]
    for p in range(len(start) - 1):
        most = max(most, start[p + 1] - start[p])
    residual, jacobian = np.empty((most, 2)), np.zeros((most, 2, 6 + q))
    mixed, gain = np.zeros((most, 6 + q, 3)), np.zeros((most, 6, 3))
    normal, right, inverse = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    shared, shared_gain = np.zeros((len(free), q, 3)), np.zeros((q, 3))
    for p in range(len(start) - 1):
        first, last = start[p], start[p + 1]
        if not _point_system(
            first, last, view, xy, weight, points[p], rotation, centre, camera, brown, basis, free, residual, jacobian, mixed,
            normal, right,
        ):  # fmt: skip
            continue
        if not _inverse(normal, inverse):
            continue
        half = np.zeros(3)
        for a in range(3):
            half[a] = inverse[a, 0] * right[0] + inverse[a, 1] * right[1] + inverse[a, 2] * right[2]
        shared[:, :, :] = 0.0
        for i in range(first, last):
            k, v, w = i - first, view[i], weight[i]
            c = camera[v]
            residuals[i, 0], residuals[i, 1] = residual[k, 0], residual[k, 1]
            for j in range(6 + free[c]):
                to = 6 * v + j if j < 6 else column[c] + j - 6
                side[to] += w * (jacobian[k, 0, j] * residual[k, 0] + jacobian[k, 1, j] * residual[k, 1])
                side[to] -= mixed[k, j, 0] * half[0] + mixed[k, j, 1] * half[1] + mixed[k, j, 2] * half[2]
                for b in range(j, 6 + free[c]):
                    other = 6 * v + b if b < 6 else column[c] + b - 6
                    matrix[to, other] += w * (jacobian[k, 0, j] * jacobian[k, 0, b] + jacobian[k, 1, j] * jacobian[k, 1, b])
            for j in range(6):
                for a in range(3):
                    gain[k, j, a] = (
                        mixed[k, j, 0] * inverse[0, a] + mixed[k, j, 1] * inverse[1, a] + mixed[k, j, 2] * inverse[2, a]
                    )
            for j in range(free[c]):
                for a in range(3):
                    shared[c, j, a] += mixed[k, 6 + j, a]
        for k in range(last - first):
            v = view[first + k]
            for m in range(last - first):
                o = view[first + m]
                if o < v:
                    continue
                for j in range(6):
                    for b in range(6):
                        matrix[6 * v + j, 6 * o + b] -= (
                            gain[k, j, 0] * mixed[m, b, 0] + gain[k, j, 1] * mixed[m, b, 1] + gain[k, j, 2] * mixed[m, b, 2]
                        )
            for c in range(len(free)):
                for j in range(6):
                    for b in range(free[c]):
                        matrix[6 * v + j, column[c] + b] -= (
                            gain[k, j, 0] * shared[c, b, 0] + gain[k, j, 1] * shared[c, b, 1] + gain[k, j, 2] * shared[c, b, 2]
                        )
        for c in range(len(free)):
            for j in range(free[c]):
                for a in range(3):
                    shared_gain[j, a] = (
                        shared[c, j, 0] * inverse[0, a] + shared[c, j, 1] * inverse[1, a] + shared[c, j, 2] * inverse[2, a]
                    )
            for o in range(c, len(free)):
                for j in range(free[c]):
                    for b in range(free[o]):
                        matrix[column[c] + j, column[o] + b] -= (
                            shared_gain[j, 0] * shared[o, b, 0]
                            + shared_gain[j, 1] * shared[o, b, 1]
                            + shared_gain[j, 2] * shared[o, b, 2]
                        )
    return matrix, side, residuals


@njit(cache=True)
def follow(  # type: ignore[no-untyped-def]
    start, view, xy, weight, points, rotation, centre, camera, brown, basis, free, column, change
):
    """Return the points (p, 3) that go with a ``change`` (size,) of the cameras; those that take no part stay."""
    moved = points.copy()
    most, q = 0, basis.shape[2]
    for p in range(len(start) - 1):
        most = max(most, start[p + 1] - start[p])
    residual, jacobian, mixed = np.empty((most, 2)), np.zeros((most, 2, 6 + q)), np.zeros((most, 6 + q, 3))
    normal, right, inverse = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for p in range(len(start) - 1):
        first, last = start[p], start[p + 1]
        if not _point_system(
            first, last, view, xy, weight, points[p], rotation, centre, camera, brown, basis, free, residual, jacobian, mixed,
            normal, right,
        ):  # fmt: skip
            continue
        if not _inverse(normal, inverse):
            continue
        for i in range(first, last):
            k, v = i - first, view[i]
            c = camera[v]
            for j in range(6 + free[c]):
                step = change[6 * v + j] if j < 6 else change[column[c] + j - 6]
                for a in range(3):
                    right[a] -= mixed[k, j, a] * step
        for a in range(3):
            moved[p, a] += inverse[a, 0] * right[0] + inverse[a, 1] * right[1] + inverse[a, 2] * right[2]
    return moved


@njit(cache=True)
def influence(  # type: ignore[no-untyped-def]
    start, view, xy, weight, points, rotation, centre, camera, brown, basis, free, column, size, chosen
):
    """Return how the points ``chosen`` (s,) follow the cameras (s, 3, size), and their covariance (s, 3, 3) with these held.

    The former is -Hpp^-1 Hpa: with the cameras' covariance Q a point's is ``held + follow Q follow^T``. NaN of points that take
    no part.
    """
    follows, held = np.zeros((len(chosen), 3, size)), np.full((len(chosen), 3, 3), np.nan)
    most, q = 0, basis.shape[2]
    for p in range(len(start) - 1):
        most = max(most, start[p + 1] - start[p])
    residual, jacobian, mixed = np.empty((most, 2)), np.zeros((most, 2, 6 + q)), np.zeros((most, 6 + q, 3))
    normal, right, inverse = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for s in range(len(chosen)):
        p = chosen[s]
        first, last = start[p], start[p + 1]
        if not _point_system(
            first, last, view, xy, weight, points[p], rotation, centre, camera, brown, basis, free, residual, jacobian, mixed,
            normal, right,
        ):  # fmt: skip
            continue
        if not _inverse(normal, inverse):
            continue
        held[s] = inverse
        for i in range(first, last):
            k, v = i - first, view[i]
            c = camera[v]
            for j in range(6 + free[c]):
                to = 6 * v + j if j < 6 else column[c] + j - 6
                for a in range(3):
                    follows[s, a, to] -= (
                        inverse[a, 0] * mixed[k, j, 0] + inverse[a, 1] * mixed[k, j, 1] + inverse[a, 2] * mixed[k, j, 2]
                    )
    return follows, held


@njit(cache=True)
def intersect(  # type: ignore[no-untyped-def]
    start, view, xy, weight, points, rotation, centre, camera, brown, basis, free, rounds
):
    """Return the points (p, 3) that fit their rays best with the cameras held, and residuals (m, 2).

    By ``rounds`` of Gauss-Newton from ``points``; residuals are observed minus computed, NaN where a point cannot be seen.
    """
    column = np.zeros(len(free), np.int64)
    none = np.zeros(len(free), np.int64)
    still = np.zeros(6 * len(centre) + 1)
    for _ in range(rounds):
        points = follow(start, view, xy, weight, points, rotation, centre, camera, brown, basis, none, column, still)
    residuals = np.full((len(view), 2), np.nan)
    at, by_point, by_pose, by_brown = np.empty(2), np.empty((2, 3)), np.empty((2, 6)), np.empty((2, 12))
    for p in range(len(start) - 1):
        for i in range(start[p], start[p + 1]):
            v = view[i]
            if project(points[p], rotation[v], centre[v], brown[camera[v]], at, by_point, by_pose, by_brown):
                residuals[i, 0], residuals[i, 1] = xy[i, 0] - at[0], xy[i, 1] - at[1]
    return points, residuals
