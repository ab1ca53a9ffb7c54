"""Polygons on the ground as outlines in photographs, and outlines as masks.

An outline is made in the plane at unit distance before the camera, where straight edges stay straight, so that it can be cut
to the frame there; only then it is bent by the lens.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from ..block import View
from ..camera import Camera

Array = NDArray[np.float64]
Heights = Callable[[Array], Array]

_STEPS = 50  # edges on the ground follow its relief in steps of the height above it over this
_FARTHEST = 30.0  # heights above the ground at which polygons end, towards a horizon
_AROUND = 0.05  # of the frame's extent: what is kept outside it before the lens bends it
_BORDER = 64  # points on each side of the frame, and of what is kept
_DIGITS = 1  # of pixels, to which outlines are rounded, so that the same pose gives the same mask anywhere
_SHIFT = 4  # binary digits of pixels in OpenCV's drawing


def outline_in(view: View, polygons: Any, heights: Heights, margin: float = 0.0) -> Any:
    """Return the part of ``polygons`` that a photograph shows, in its pixels; empty when there is none.

    Parameters
    ----------
    view
        The photograph's pose in a frame whose z is up (m).
    polygons
        A valid (multi)polygon in that frame's x and y.
    heights
        Gives the ground's z of points (n, 2).
    margin
        By how much the outline is widened, as tangent of an angle from the camera.
    """
    centre = view.centre
    frame = _frame(view.camera)
    above = max(float(centre[2] - heights(centre[None, :2])[0]), 0.1)
    reach = above * (_reach(view, frame) + margin)
    near = shapely.intersection(polygons, shapely.box(*(centre[:2] - reach), *(centre[:2] + reach)))
    pieces = [
        piece
        for part in _polygons(shapely.segmentize(near, above / _STEPS))
        if (piece := _before_camera(view, part, heights)) is not None
    ]
    extent = float(np.ptp(frame, axis=0).max())
    kept = shapely.box(*(frame.min(axis=0) - _AROUND * extent), *(frame.max(axis=0) + _AROUND * extent))
    plane = shapely.intersection(shapely.buffer(shapely.union_all(pieces), margin), kept)
    bent = shapely.transform(shapely.segmentize(plane, extent / _BORDER), lambda uv: _pixels(view.camera, uv))
    shown = shapely.intersection(shapely.make_valid(bent), shapely.box(0, 0, view.camera.width, view.camera.height))
    areas = [p for p in _polygons(shapely.transform(shown, lambda xy: np.round(xy, _DIGITS))) if shapely.area(p) > 0]
    return shapely.multipolygons(areas) if areas else shapely.MultiPolygon()


def unmasked(outline: Any, width: int, height: int) -> NDArray[np.bool_]:
    """Return which pixels (rows, columns) lie outside ``outline``; those its edge runs through do not."""
    inside = np.zeros((height, width), np.uint8)
    for polygon in shapely.get_parts(outline):
        rings = [shapely.get_exterior_ring(polygon), *shapely.get_rings(polygon)[1:]]
        # OpenCV counts from the centre of the first pixel.
        drawn = [np.rint((shapely.get_coordinates(r) - 0.5) * 2**_SHIFT).astype(np.int32) for r in rings]
        cv2.fillPoly(inside, drawn, 1, shift=_SHIFT)
    return np.asarray(inside == 0)


def _polygons(geometry: Any) -> list[Any]:
    """Return the polygons among the parts of a geometry, which may be collections themselves."""
    parts = shapely.get_parts(shapely.get_parts(geometry))
    return [part for part in parts if shapely.get_type_id(part) == 3 and not shapely.is_empty(part)]


def _before_camera(view: View, polygon: Any, heights: Heights) -> Any | None:
    """Return what of a polygon on the ground lies before the camera, in the plane at unit distance; None when nothing does."""
    rings = []
    for ring in shapely.get_rings(polygon):
        xy = shapely.get_coordinates(ring)[:-1]
        points = np.column_stack([xy, heights(xy)]) @ view.rotation.T + view.translation
        cut = _cut(points, 1e-3 * float(np.abs(points).max()))
        rings.append(shapely.make_valid(shapely.Polygon(cut[:, :2] / cut[:, 2:])) if len(cut) > 2 else shapely.Polygon())
    if rings[0].is_empty:
        return None
    return shapely.difference(rings[0], shapely.union_all(rings[1:]))


def _cut(ring: Array, near: float) -> Array:
    """Return the part of a ring (n, 3), not closed, at z >= ``near`` (Sutherland & Hodgman 1974, for one plane)."""
    following = np.roll(ring, -1, axis=0)
    inside, next_inside = ring[:, 2] >= near, following[:, 2] >= near
    crossing = inside != next_inside
    share = np.divide(near - ring[:, 2], following[:, 2] - ring[:, 2], out=np.zeros(len(ring)), where=crossing)
    points = np.stack([ring, ring + share[:, None] * (following - ring)], axis=1).reshape(-1, 3)
    return np.asarray(points[np.stack([inside, crossing], axis=1).ravel()])


def _frame(camera: Camera) -> Array:
    """Return the photograph's border (n, 2) in the plane at unit distance, where the lens model reaches it."""
    along, zero = np.linspace(0.0, 1.0, _BORDER), np.zeros(_BORDER)
    sides = [np.column_stack(pair) for pair in ((along, zero), (along, zero + 1), (zero, along), (zero + 1, along))]
    pixels = np.concatenate(sides) * (camera.width, camera.height)
    rays = camera.unproject(pixels)
    return np.asarray(rays[np.abs(camera.project(rays) - pixels).max(axis=1) < 0.5, :2])


def _reach(view: View, frame: Array) -> float:
    """Return how far, in heights above the ground, the photograph looks from the point below it."""
    rays = np.column_stack([frame, np.ones(len(frame))]) @ view.rotation
    across, down = np.hypot(rays[:, 0], rays[:, 1]), -rays[:, 2]
    limit = math.cos(math.atan(_FARTHEST))
    seen = down > limit * np.linalg.norm(rays, axis=1)
    return 1.2 * float((across[seen] / down[seen]).max()) if seen.all() else _FARTHEST


def _pixels(camera: Camera, uv: Array) -> Array:
    """Return pixels (n, 2) of points in the plane at unit distance; what the lens model cannot reach is put at its edge."""
    radius = np.hypot(uv[:, 0], uv[:, 1])
    within = uv * np.minimum(1.0, 0.999 * camera.fold_radius() / np.maximum(radius, 1e-12))[:, None]
    return camera.project(np.column_stack([within, np.ones(len(uv))]))
