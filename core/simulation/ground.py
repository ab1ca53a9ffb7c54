"""Ground control of a simulated survey: painted targets, their measured coordinates and their marks in the photographs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..block import View
from ..errors import InputError
from .placement import Placement
from .rendering import Scene
from .terrain import Beach

Array = NDArray[np.float64]

TARGET_PIXELS = 36  # side of a target in the photographs
_STEEPEST = 0.25  # slope of ground a surveyor lays a target on
_CANDIDATES = 3000


@dataclass(frozen=True)
class Targets:
    """Targets on the ground in beach coordinates: ``points`` (n, 3) of the centres, ``turns`` (n,; rad), names and roles."""

    names: list[str]
    roles: list[str]
    points: Array
    turns: Array

    @property
    def placed(self) -> Array:
        """What the renderer needs: a, c, cosine, sine (n, 4)."""
        return np.column_stack([self.points[:, :2], np.cos(self.turns), np.sin(self.turns)])


def lay_targets(beach: Beach, after: bool, control: int, check: int, side: float, random: np.random.Generator) -> Targets:
    """Lay targets of ``side`` metres: the first in the corners, each further one where the widest gap is; control first.

    Raises
    ------
    InputError
        When the area is too small for so many.
    """
    count, margin = control + check, side
    if not count:
        return Targets([], [], np.empty((0, 3)), np.empty(0))
    if min(beach.length, beach.width) <= 2 * margin:
        raise InputError(f"The area is too small for targets of {side:.1f} m: enlarge LENGTH and WIDTH or fly lower.")
    places = random.uniform((margin, margin), (beach.length - margin, beach.width - margin), (_CANDIDATES, 2))
    around = np.stack([places + step for step in side * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])])
    z = beach.heights(around[..., 0], around[..., 1], after)
    slope = np.hypot(z[1] - z[2], z[3] - z[4]) / (2 * side)
    places = places[(slope < _STEEPEST) & (z.min(axis=0) > 0.05)]
    corners = np.array([[0, 0], [1, 1], [1, 0], [0, 1]]) * (beach.length, beach.width)
    nearest, chosen = np.full(len(places), np.inf), []
    for k in range(count):
        wanted = -np.hypot(*(places - corners[k]).T) if k < len(corners) else nearest
        best = int(np.argmax(wanted)) if len(places) else -1
        if best < 0 or nearest[best] < 2 * side:
            raise InputError(f"The area has no room for {count} targets of {side:.1f} m: ask for fewer, or enlarge the area.")
        chosen.append(best)
        nearest = np.minimum(nearest, np.hypot(*(places - places[best]).T))
    spots = places[chosen]
    points = np.column_stack([spots, beach.heights(spots[:, 0], spots[:, 1], after)])
    names = [f"G{k + 1}" for k in range(control)] + [f"C{k + 1}" for k in range(check)]
    roles = ["control"] * control + ["check"] * check
    return Targets(names, roles, points, random.uniform(0, np.pi / 2, count))


def measure(targets: Targets, placement: Placement, sigma_h: float, sigma_v: float, random: np.random.Generator) -> Array:
    """Return the coordinates (n, 3) in the CRS as a surveyor finds them, with errors of ``sigma_h`` and ``sigma_v`` (m)."""
    if not targets.names:
        return np.empty((0, 3))
    local = placement.to_local(targets.points)
    return placement.frame.to_crs(local + np.array([sigma_h, sigma_h, sigma_v]) * random.standard_normal(local.shape))


@dataclass(frozen=True)
class Mark:
    """A target seen in a photograph, at x, y in pixels (the top-left corner is 0, 0)."""

    gcp: str
    image: str
    x: float
    y: float


def mark(targets: Targets, views: list[View], scene: Scene, sigma: float, random: np.random.Generator) -> list[Mark]:
    """Return the marks of every target wholly in a photograph and not hidden, measured to ``sigma`` (px)."""
    marks = []
    for view in views:
        if not len(targets.points):
            break
        pixels = view.project(targets.points)
        camera = view.camera
        edge = TARGET_PIXELS * 0.8
        with np.errstate(invalid="ignore"):
            inside = ((pixels > edge) & (pixels < (camera.width - edge, camera.height - edge))).all(axis=1)
        errors = random.standard_normal(pixels.shape) * sigma
        found = np.full_like(targets.points, np.inf)
        found[inside] = scene.hit(view, pixels[inside])
        hidden = np.linalg.norm(found - targets.points, axis=1) > 0.05
        for k in np.flatnonzero(inside & ~hidden):
            x, y = pixels[k] + errors[k]
            marks.append(Mark(targets.names[k], view.name, float(x), float(y)))
    return marks
