"""Kernels of the bundle adjustment: reduced normal equations of tie points, and how the points go with the cameras.

Tie points are eliminated one by one (Brown 1958; Schur's complement), so that what remains are poses and interior orientations,
in the columns that ``cameras`` describes. ``rays`` and ``cameras`` are ``Rays.arrays`` and ``Cameras.arrays``. Everything runs on
one thread in one order: two runs give the same bits.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .collinearity import project

_WEAK = 1e-12  # of a point's normal matrix: below, its rays are parallel and it says nothing


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
def _work(start, basis):  # type: ignore[no-untyped-def]
    """Return what ``_point_system`` fills, large enough for the point of most rays.

    Per ray the residual (rays, 2), its derivatives by what is reduced (rays, 2, 6 + q), and ``mixed`` (rays, 6 + q, 3), the
    weighted product of these with the derivatives by the point; of the point its normal matrix (3, 3), right side (3,) and the
    matrix's inverse (3, 3).
    """
    most, q = 0, basis.shape[2]
    for p in range(len(start) - 1):
        most = max(most, start[p + 1] - start[p])
    residual, jacobian, mixed = np.empty((most, 2)), np.zeros((most, 2, 6 + q)), np.zeros((most, 6 + q, 3))
    return residual, jacobian, mixed, np.empty((3, 3)), np.empty(3), np.empty((3, 3))


@njit(cache=True)
def _point_system(p, rays, weight, points, cameras, work):  # type: ignore[no-untyped-def]
    """Fill ``work`` with the equations of point ``p``; tell whether all its rays can be, and meet."""
    start, view, xy = rays
    rotation, centre, camera, brown, basis, free = cameras
    residual, jacobian, mixed, normal, right, inverse = work
    at, by_point, by_pose, by_brown = np.empty(2), np.empty((2, 3)), np.empty((2, 6)), np.empty((2, 12))
    normal[:, :] = 0.0
    right[:] = 0.0
    first = start[p]
    for i in range(first, start[p + 1]):
        k, c = i - first, camera[view[i]]
        if not project(points[p], rotation[view[i]], centre[view[i]], brown[c], at, by_point, by_pose, by_brown):
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
    return _inverse(normal, inverse)


@njit(cache=True)
def reduce(rays, weight, points, cameras, column, size):  # type: ignore[no-untyped-def]
    """Return the reduced normal matrix (size, size; upper triangle), its right side (size,) and residuals (m, 2).

    ``weight`` (m,) is 1 / sigma^2 of each ray per axis (px^-2). Residuals are observed minus computed, NaN of points that cannot
    be seen or whose rays are parallel; such points take no part.
    """
    start, view, _ = rays
    _, _, camera, _, basis, free = cameras
    matrix, side = np.zeros((size, size)), np.zeros(size)
    residuals = np.full((len(view), 2), np.nan)
    work = _work(start, basis)
    residual, jacobian, mixed, _, right, inverse = work
    gain, q = np.zeros((len(residual), 6, 3)), basis.shape[2]
    shared, shared_gain = np.zeros((len(free), q, 3)), np.zeros((q, 3))
    for p in range(len(start) - 1):
        first, last = start[p], start[p + 1]
        if not _point_system(p, rays, weight, points, cameras, work):
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
def follow(rays, weight, points, cameras, column, change):  # type: ignore[no-untyped-def]
    """Return the points (p, 3) that go with a ``change`` (size,) of the cameras; those that take no part stay."""
    start, view, _ = rays
    _, _, camera, _, basis, free = cameras
    moved = points.copy()
    work = _work(start, basis)
    _, _, mixed, _, right, inverse = work
    for p in range(len(start) - 1):
        first, last = start[p], start[p + 1]
        if not _point_system(p, rays, weight, points, cameras, work):
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
def influence(rays, weight, points, cameras, column, size, chosen):  # type: ignore[no-untyped-def]
    """Return how the points ``chosen`` (s,) follow the cameras (s, 3, size), and their covariance (s, 3, 3) with these held.

    The former is -Hpp^-1 Hpa: with the cameras' covariance Q a point's is ``held + follow Q follow^T``. NaN of points that take
    no part.
    """
    start, view, _ = rays
    _, _, camera, _, basis, free = cameras
    follows, held = np.zeros((len(chosen), 3, size)), np.full((len(chosen), 3, 3), np.nan)
    work = _work(start, basis)
    _, _, mixed, _, _, inverse = work
    for s in range(len(chosen)):
        p = chosen[s]
        first, last = start[p], start[p + 1]
        if not _point_system(p, rays, weight, points, cameras, work):
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
def covariances(rays, weight, points, cameras, column, cofactor):  # type: ignore[no-untyped-def]
    """Return the covariances (p, 3, 3) of points, ``Hpp^-1 + Hpp^-1 Hpa Q Hap Hpp^-1`` with the cameras' ``cofactor`` Q (u, u).

    NaN of points that take no part. A point touches the columns of its own views and their cameras only.
    """
    start, view, _ = rays
    _, _, camera, _, basis, free = cameras
    found = np.full((len(start) - 1, 3, 3), np.nan)
    work = _work(start, basis)
    _, _, mixed, _, _, inverse = work
    most = len(mixed) * 6 + len(free) * basis.shape[2]
    follows, to, place = np.zeros((most, 3)), np.zeros(most, np.int64), np.zeros(len(free), np.int64)
    for p in range(len(start) - 1):
        first, last = start[p], start[p + 1]
        if not _point_system(p, rays, weight, points, cameras, work):
            continue
        count = 0
        place[:] = -1
        for i in range(first, last):
            k, v = i - first, view[i]
            c = camera[v]
            for j in range(6):
                to[count] = 6 * v + j
                follows[count] = mixed[k, j]
                count += 1
            if place[c] < 0:
                place[c] = count
                for j in range(free[c]):
                    to[count] = column[c] + j
                    follows[count] = 0.0
                    count += 1
            for j in range(free[c]):
                follows[place[c] + j] += mixed[k, 6 + j]
        total = np.zeros((3, 3))
        for j in range(count):
            for b in range(count):
                q = cofactor[to[j], to[b]]
                for a in range(3):
                    for e in range(3):
                        total[a, e] += follows[j, a] * q * follows[b, e]
        found[p] = inverse + inverse @ total @ inverse
    return found


@njit(cache=True)
def intersect(rays, weight, points, cameras, rounds):  # type: ignore[no-untyped-def]
    """Return the points (p, 3) that fit their rays best with the cameras held, and residuals (m, 2).

    By ``rounds`` of Gauss-Newton from ``points``; residuals are observed minus computed, NaN where a point cannot be seen.
    """
    start, view, xy = rays
    rotation, centre, camera, brown, basis, free = cameras
    column = np.zeros(len(free), np.int64)
    held = rotation, centre, camera, brown, basis, np.zeros(len(free), np.int64)
    still = np.zeros(6 * len(centre) + 1)
    for _ in range(rounds):
        points = follow(rays, weight, points, held, column, still)
    residuals = np.full((len(view), 2), np.nan)
    at, by_point, by_pose, by_brown = np.empty(2), np.empty((2, 3)), np.empty((2, 6)), np.empty((2, 12))
    for p in range(len(start) - 1):
        for i in range(start[p], start[p + 1]):
            v = view[i]
            if project(points[p], rotation[v], centre[v], brown[camera[v]], at, by_point, by_pose, by_brown):
                residuals[i, 0], residuals[i, 1] = xy[i, 0] - at[0], xy[i, 1] - at[1]
    return points, residuals
