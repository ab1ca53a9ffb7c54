"""The collinearity equation with Brown's distortion, and its derivatives."""

from __future__ import annotations

from numba import njit


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
