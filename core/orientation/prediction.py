"""Where ground points ought to appear in georeferenced photographs, and how well that is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..block import Block, View
from ..georef import Georef
from .common import TERMS, Common
from .control import GroundPoint

Array = NDArray[np.float64]

# What a pose errs against its neighbours, in pixels per axis, beside the residuals of its tie points: a block held by tie points
# is not stiff. The targets of a simulated survey that was georeferenced with its marks lie 0.33 px from their predictions, the
# centimetre (0.26 px) of the points' survey included; more is left for blocks with fewer tie points.
_POSE = 0.3
_STEP = 1e-5  # of the distance, for derivatives: exact to far below a pixel's hundredth
_MARGIN = 2.0  # sigmas outside the frame at which a point may still be inside
_NEIGHBOURS = 8  # tie points whose median is the surface at a place
_NEAR = 0.3  # of the flying height: tie points further off do not tell the surface
_OFF = 0.1  # of the flying height: heights that differ by more are of another kind


@dataclass(frozen=True)
class Prediction:
    """A ground point (``point`` indexes them) in a photograph (``view`` indexes the block's).

    ``pixel`` (2,) counts from the corner of the top-left pixel; ``covariance`` (2, 2; px2) is NaN where the georeferencing's own
    is not known. ``off_axis`` (px) is the distance from the middle of the frame.
    """

    point: int
    view: int
    pixel: Array
    covariance: Array
    off_axis: float
    inside: bool

    @property
    def sigma(self) -> float:
        """The standard deviation (px) of an axis: the root mean square of both; NaN when not known."""
        return float(np.sqrt(np.trace(self.covariance) / 2))

    @property
    def reach(self) -> float:
        """The standard deviation (px) along the direction that is known worst; NaN when not known."""
        if not np.isfinite(self.covariance).all():
            return float("nan")
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance)[-1]))


def ground_covariance(georef: Georef, points: Array) -> Array:
    """Return what the georeferencing's own error does to local ground points (n, 3): covariances (n, 3, 3) in m2.

    NaN when it is not known.
    """
    if len(georef.covariance) != TERMS**2 or len(georef.pivot) != 3:
        return np.full((len(points), 3, 3), np.nan)
    return Common(np.asarray(georef.pivot), np.reshape(georef.covariance, (TERMS, TERMS))).uncertainty(points)


def predict(block: Block, georef: Georef, points: Sequence[GroundPoint]) -> list[Prediction]:
    """Return where the points fall, by point, the photographs that see one nearest to their middle first.

    A photograph counts when the point lies in front of it, within the radius up to which its distortion grows, and in the
    frame or within two sigmas of it. The covariance joins that of the georeferencing (common to all photographs), of the point's
    survey, and of the pose: ``J (C_georeferencing + C_point) J' + s2 I``, with the derivatives ``J`` (2, 3) of the projection.
    """
    if not points:
        return []
    local = georef.frame.from_crs(np.array([p.coordinates for p in points]))
    surveyed = np.array([np.diag([p.sigma_h, p.sigma_h, p.sigma_v]) ** 2 for p in points])
    covariance = ground_covariance(georef, local) + surveyed
    pose = _POSE**2 + (float(np.median(block.errors)) ** 2 / 2 if len(block.errors) else 0.0)
    found = []
    for index, view in enumerate(block.views):
        pixels, slopes = _projected(view, local)
        spread = slopes @ covariance @ slopes.transpose(0, 2, 1) + pose * np.eye(2)
        size = np.array([view.camera.width, view.camera.height])
        for k in np.flatnonzero(np.isfinite(pixels).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2))):
            margin = np.nan_to_num(_MARGIN * np.sqrt(np.diag(spread[k])))
            if ((pixels[k] >= -margin) & (pixels[k] <= size + margin)).all():
                inside = bool(((pixels[k] >= 0) & (pixels[k] <= size)).all())
                off_axis = float(np.hypot(*(pixels[k] - size / 2)))
                found.append(Prediction(int(k), index, pixels[k], spread[k], off_axis, inside))
    return sorted(found, key=lambda p: (p.point, p.off_axis))


def above_surface(block: Block, georef: Georef, points: Sequence[GroundPoint]) -> float | None:
    """Return how far (m) the points lie above the tie points around them, the median; None where that is within reason.

    It is within reason up to a tenth of the flying height, or three sigmas of it, or where there are no tie points near.
    """
    if len(block.points) < _NEIGHBOURS or not points:
        return None
    local = georef.frame.from_crs(np.array([p.coordinates for p in points]))
    flying = float(np.median([v.centre[2] for v in block.views]) - np.median(block.points[:, 2]))
    distances, nearest = cKDTree(block.points[:, :2]).query(local[:, :2], k=_NEIGHBOURS)
    near = distances[:, -1] < _NEAR * flying
    if not near.any():
        return None
    heights = local[near, 2] - np.median(block.points[nearest[near], 2], axis=1)
    shared = np.nan_to_num(np.sqrt(ground_covariance(georef, local[near])[:, 2, 2]))
    sigma = float(np.median(np.hypot(shared, [p.sigma_v for p, n in zip(points, near, strict=True) if n])))
    off = float(np.median(heights))
    return off if abs(off) > max(_OFF * flying, 3.0 * sigma) else None


def distance_from_block(block: Block, georef: Georef, points: Sequence[GroundPoint]) -> float:
    """Return how far (m) in plan the points' middle is from the block's."""
    local = georef.frame.from_crs(np.array([p.coordinates for p in points]))
    middle = np.median(np.array([v.centre for v in block.views]), axis=0)
    return float(np.hypot(*(np.median(local, axis=0) - middle)[:2]))


def _projected(view: View, points: Array) -> tuple[Array, Array]:
    """Return pixels (n, 2) and their derivatives (n, 2, 3) by the points (n, 3)."""
    steps = _STEP * np.linalg.norm(points - view.centre, axis=1)
    slopes = []
    for axis in np.eye(3):
        moved = steps[:, None] * axis
        slopes.append((view.project(points + moved) - view.project(points - moved)) / (2 * steps[:, None]))
    return view.project(points), np.stack(slopes, axis=2)
