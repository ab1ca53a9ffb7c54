"""The flight: strips along the shore from overlaps, poses with jitter, and the precision to expect of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..block import View
from ..camera import Camera

Array = NDArray[np.float64]

# What a small drone's lens is like: a principal point some pixels off the centre and a mild Brown distortion.
_OFF_CENTRE = (6.3, -4.1)
_DISTORTION = (-0.06, 0.035, 4e-4, -3e-4)  # k1, k2, p1, p2

VIEWS_PER_STRIP = 3  # photographs of a strip that see the end of the area
STRIPS = 2  # strips that see its side
_WANDER = 0.01  # sigma of a position against the plan, relative to the height
_YAW = math.radians(1.5)


@dataclass(frozen=True)
class Plan:
    """Where photographs are to be taken: beach coordinates a, c of each (n, 2), the strip's heading (+1 along, -1 back; n)."""

    places: Array
    headings: Array
    base: float
    spacing: float


def lens(width: int, height: int, focal: float) -> Camera:
    """Return the true interior orientation of the simulated camera (pixels)."""
    return Camera(
        "OPENCV",
        width,
        height,
        (focal, focal, width / 2 + _OFF_CENTRE[0], height / 2 + _OFF_CENTRE[1], *_DISTORTION),
    )


def plan(length: float, width: float, footprint: tuple[float, float], forward: float, side: float) -> Plan:
    """Plan strips along the shore over an area (m) with a footprint (across, along the strip; m) and overlaps (0..1).

    There are as many photographs as put the ends of the area in sight of three in a strip, and its sides in sight of two strips.
    """
    spacing, base = footprint[0] * (1 - side), footprint[1] * (1 - forward)
    across = _stations(width, footprint[0], spacing, STRIPS)
    along = _stations(length, footprint[1], base, VIEWS_PER_STRIP)
    places, headings = [], []
    for k, c in enumerate(across):
        heading = 1.0 if k % 2 == 0 else -1.0
        places += [(a, c) for a in along[:: int(heading)]]
        headings += [heading] * len(along)
    return Plan(np.array(places), np.array(headings), base, spacing)


def fly(flight: Plan, camera: Camera, height: float, tilt: float, names: list[str], random: np.random.Generator) -> list[View]:
    """Return the true views in beach coordinates: nadir with the image's top forward, but for jitter.

    ``height`` is above z = 0 (m); ``tilt`` is the sigma (rad) of the gimbal's error about each of the image's axes. A
    position strays from the plan by 1 % of the height, as wind and the autopilot have it.
    """
    views = []
    for name, (a, c), heading in zip(names, flight.places, flight.headings, strict=True):
        errors, strays = random.standard_normal(3), random.standard_normal(3)
        turn = _rotation(np.array([tilt, tilt, _YAW]) * errors)
        nadir = np.array([[0.0, -heading, 0.0], [-heading, 0.0, 0.0], [0.0, 0.0, -1.0]])
        rotation = turn @ nadir
        centre = np.array([a, c, height]) + strays * _WANDER * height
        views.append(View(name, camera, rotation, -rotation @ centre))
    return views


def footprint_bounds(views: list[View], lowest: float) -> tuple[float, float, float, float]:
    """Return the smallest and largest a, then c, that the views see of the plane z = ``lowest``."""
    camera = views[0].camera
    x, y = np.linspace(0, camera.width, 9), np.linspace(0, camera.height, 9)
    border = np.array([(u, v) for u in x for v in (0, camera.height)] + [(u, v) for v in y for u in (0, camera.width)])
    rays = camera.unproject(border)
    seen = []
    for view in views:
        directions = rays @ view.rotation
        reach = (lowest - view.centre[2]) / directions[:, 2:]
        seen.append((view.centre + reach * directions)[:, :2])
    places = np.concatenate(seen)
    (a0, c0), (a1, c1) = places.min(axis=0), places.max(axis=0)
    return float(a0), float(a1), float(c0), float(c1)


def expected_precision(views: list[View], points: Array, sigma: float) -> tuple[Array, NDArray[np.int64]]:
    """Return sigma_Z (n,; m, NaN where fewer than two views see a point) and the number of views (n,) of points (n, 3).

    Normal case: ``sigma_Z = sigma GSD H / sqrt(sum |b_i - mean b|^2)`` with image coordinates good to ``sigma`` pixels and
    b_i the places of the views that see the point, in both directions of the plane, since x and y both tell of the height.
    """
    camera = views[0].camera
    focal = camera.brown()[:2].mean()
    seen = np.zeros((len(views), len(points)), bool)
    for i, view in enumerate(views):
        pixels = view.project(points)
        with np.errstate(invalid="ignore"):
            seen[i] = ((pixels >= 0) & (pixels <= (camera.width, camera.height))).all(axis=1)
    centres = np.array([view.centre for view in views])
    count = seen.sum(axis=0)
    share = seen / np.maximum(count, 1)
    mean = share.T @ centres
    spread = seen.T @ (centres[:, :2] ** 2).sum(axis=1) - count * (mean[:, :2] ** 2).sum(axis=1)
    distance = mean[:, 2] - points[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        precision = sigma * distance**2 / focal / np.sqrt(spread)
    return np.where(count >= 2, precision, np.nan), count


def _stations(extent: float, footprint: float, step: float, seen: int) -> Array:
    """Return evenly spaced places, centred on 0..``extent``, whose ``seen`` outermost still see its end."""
    reach = (extent - footprint) / 2 + (seen - 1) * step
    count = max(seen, math.ceil(2 * reach / step - 1e-9) + 1)
    return np.asarray(extent / 2 + (np.arange(count) - (count - 1) / 2) * step, float)


def _rotation(vector: Array) -> Array:
    """Return the rotation (3, 3) by the angle |vector| about it (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)
