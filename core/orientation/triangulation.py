"""Marks of a ground point in several photographs, to its place in the block with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..block import View

Array = NDArray[np.float64]

_AGREE = 5.0  # sigmas of a mark beyond which it is taken for another point


@dataclass(frozen=True)
class Triangulated:
    """A point (3,) in the block's frame with its covariance (3, 3).

    ``residuals`` (m, 2) are marks minus projections in pixels. ``used`` (m,) is False for a mark that the others contradict;
    ``angle`` is the largest angle (radians) between two used rays. ``agree`` is False when marks contradict each other
    and nothing tells which is wrong.
    """

    point: Array
    covariance: Array
    residuals: Array
    used: NDArray[np.bool_]
    angle: float
    agree: bool


def triangulate(views: Sequence[View], marks: Array, sigma: float) -> Triangulated | None:
    """Intersect the rays of marks (m, 2), one per view, m >= 2; None when they do not meet in front of the cameras.

    With three marks or more, marks that the rest contradicts are left out one by one, as long as two remain and what remains
    agrees within 5 ``sigma`` (pixels). ``sigma`` ought to hold the block's own reprojection error besides the marking.
    """
    marks = np.asarray(marks, float)
    used = np.ones(len(views), bool)
    limit = _AGREE * sigma
    first = solved = _intersect(views, marks, used)
    while used.sum() > 2 and _worst(solved, used) > limit:
        trials = []
        for i in np.flatnonzero(used):
            rest = used.copy()
            rest[i] = False
            trial = _intersect(views, marks, rest)
            if trial is not None:
                trials.append((_worst(trial, rest), i, trial))
        # Two rays nearly always meet somewhere: when several pairs do, nothing tells which mark is wrong.
        if not trials or (used.sum() == 3 and sum(worst <= limit for worst, *_ in trials) > 1):
            break
        _, i, solved = min(trials, key=lambda t: t[0])
        used[i] = False
    if _worst(solved, used) > limit:
        used[:], solved = True, first
    if solved is None:
        return None
    point, residuals, normal = solved
    agree = _worst(solved, used) <= limit
    # What does not agree is worth what its residuals say.
    factor = 1.0 if agree else float(np.sum(residuals[used] ** 2)) / sigma**2 / (2 * int(used.sum()) - 3)
    directions = np.array([v.centre - point for v, u in zip(views, used, strict=True) if u])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    angle = float(np.arccos(np.clip(np.min(directions @ directions.T), -1.0, 1.0)))
    covariance: Array = np.asarray(np.linalg.inv(normal) * sigma**2 * max(factor, 1.0), float)
    return Triangulated(point, covariance, residuals, used, angle, agree)


def _worst(solved: tuple[Array, Array, Array] | None, used: NDArray[np.bool_]) -> float:
    """Return the largest residual of the used marks, infinite when their rays do not meet."""
    return np.inf if solved is None else float(np.max(np.linalg.norm(solved[1][used], axis=1)))


def _intersect(views: Sequence[View], marks: Array, used: NDArray[np.bool_]) -> tuple[Array, Array, Array] | None:
    """Return point, residuals of all marks, and normal matrix (3, 3) per unit pixel variance, from the used marks."""
    chosen = [i for i in range(len(views)) if used[i]]
    directions = np.array([views[i].rotation.T @ views[i].camera.unproject(marks[i : i + 1])[0] for i in chosen])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    centres = np.array([views[i].centre for i in chosen])
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    system = across.sum(axis=0)
    if np.linalg.cond(system) > 1e12:  # parallel rays
        return None
    point = np.linalg.solve(system, np.einsum("nij,nj->i", across, centres))
    normal = np.eye(3)
    for _ in range(10):
        residuals = marks - _projected(views, point)
        # Derivatives by central differences over a millionth of the distance: exact to far below a pixel's thousandth.
        step = 1e-6 * float(np.mean(np.linalg.norm(centres - point, axis=1)))
        design = np.stack(
            [(_projected(views, point + step * e) - _projected(views, point - step * e)) / (2 * step) for e in np.eye(3)], axis=2
        )
        part, left = design[used].reshape(-1, 3), residuals[used].ravel()
        if not (np.isfinite(part).all() and np.isfinite(left).all()):
            return None
        normal = part.T @ part
        change = np.linalg.lstsq(part, left, rcond=None)[0]
        point = point + change
        if np.linalg.norm(change) < step * 1e-3:
            break
    residuals = marks - _projected(views, point)
    if not np.isfinite(residuals[used]).all():
        return None
    return point, residuals, normal


def _projected(views: Sequence[View], point: Array) -> Array:
    return np.concatenate([view.project(point[None]) for view in views])
