"""Oriented blocks without photographs: tie points and marks of a true flight, for tests and benchmarks of georeferencing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from strandline.core.block import Block, View
from strandline.core.camera import Camera
from strandline.core.frames import LocalFrame
from strandline.core.orientation import interior
from strandline.core.orientation.adjustedsolution import solve_adjustment
from strandline.core.orientation.adjustment import adjust
from strandline.core.orientation.assembly import Assembly
from strandline.core.orientation.cameras import Cameras, Rays
from strandline.core.orientation.control import GroundPoint
from strandline.core.orientation.gnss import Gnss
from strandline.core.orientation.marks import Mark
from strandline.core.orientation.network import Network, Positions
from strandline.core.orientation.observations import Seen, find_marks
from strandline.core.orientation.solution import Solution, solve
from strandline.core.simulation.flight import fly, lens, plan
from strandline.core.simulation.terrain import Beach

Array = NDArray[np.float64]

FRAME = LocalFrame.at("EPSG:32630", 560000.0, 4922000.0, 48.0)


@dataclass(frozen=True)
class Scene:
    """A flight over a beach; ``tilt`` in degrees, ``relief`` the standard deviation that heights are scaled to (m).

    ``points`` are tie points per photograph, ``pixel`` the sigma of their coordinates. The camera's distortion is not known to
    the adjustment.
    """

    seed: int = 1
    length: float = 50.0
    width: float = 58.0
    height: float = 48.0
    size: tuple[int, int] = (1800, 1350)
    focal: float = 1650.0
    tilt: float = 2.0
    relief: float | None = None
    points: int = 600
    pixel: float = 0.3
    gnss: tuple[float, float] = (0.03, 0.03)
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    declared: bool = True
    mark: float = 0.25
    gcp: tuple[float, float] = (0.007, 0.010)
    control: int = 5
    checks: int = 12
    wrong_mark: float = 0.0  # px, of the first control point's first mark
    wrong_gcp: float = 0.0  # m, of the second control point in plan
    wrong_height: float = 0.0  # m, of the second control point
    single: int = 0  # control points that are marked once, the last ones
    wrong_single: float = 0.0  # px, of these marks


@dataclass(frozen=True)
class Flown:
    """A simulated block: as oriented in a free frame, with ground points as surveyed, and the truth in ``FRAME``."""

    scene: Scene
    assembly: Assembly
    points: tuple[GroundPoint, ...]
    gnss: Gnss
    camera: Camera
    true_views: tuple[View, ...]
    true_points: Array  # ground points (n, 3)
    true_ties: Array  # tie points (p, 3)
    gsd: float

    def start(self) -> Solution:
        """Return the similarity."""
        seen: tuple[Seen, ...] = find_marks(self.assembly.block, self.points, self.scene.mark)
        return solve(self.assembly.block, seen, self.gnss, frame=FRAME, comparable=True)

    def adjusted(self, known: interior.Interior | None = None, *, compare: bool = False) -> Solution:
        """Return the adjustment; ``known`` is what is known of the camera, None for its focal length to 1.5 %."""
        wanted = known or interior.free(self.assembly.block.views[0].camera, interior.file_focal(1.003 * self.scene.focal))
        usable = np.ones(len(self.assembly.block.points), bool)
        return solve_adjustment(
            self.assembly, self.start(), self.gnss, {1: wanted}, sigma_mark=self.scene.mark, comparable=True, usable=usable,
            labels={1: "camera"}, compare=compare,
        )  # fmt: skip

    def truth_errors(self, solution: Solution, *, check: bool = True) -> Array:
        """Return computed minus true places (n, 3) of the check (or control) points."""
        chosen = np.array([p.check == check for p in self.points])
        given = np.array([p.coordinates for p in self.points])
        return solution.errors[chosen] + given[chosen] - FRAME.to_crs(self.true_points[chosen])


def flown(scene: Scene, *, calibration: Camera | None = None) -> Flown:
    """Fly, observe with noise, and orient freely; a ``calibration`` is held."""
    random = np.random.default_rng([scene.seed, 99])
    camera = lens(*scene.size, scene.focal)
    gsd = scene.height / scene.focal
    footprint = (scene.size[0] * gsd, scene.size[1] * gsd)
    flight = plan(scene.length, scene.width, footprint, 0.8, 0.7)
    names = [f"{i:04d}.jpg" for i in range(len(flight.places))]
    views = tuple(fly(flight, camera, scene.height + 3.0, np.radians(scene.tilt), names, random))
    beach = Beach(scene.length, scene.width, 0.012, scene.seed)
    ground = _ground(beach, scene, len(views), random)
    rays = _observe(views, ground, scene, random)
    laid = _targets(beach, scene, random)
    points = _surveyed(views, laid, scene, random)
    centres = np.array([v.centre for v in views])
    noisy = centres + random.standard_normal(centres.shape) * [scene.gnss[0], scene.gnss[0], scene.gnss[1]] + scene.bias
    sigmas = np.tile(scene.gnss if scene.declared else (1.0, 1.5), (len(views), 1))
    gnss = Gnss(np.arange(len(views)), FRAME.to_crs(noisy), sigmas, scene.declared, np.zeros(3))
    assembly = oriented(views, ground, rays, scene, random, calibration)
    return Flown(scene, assembly, points, gnss, camera, views, laid, ground, gsd)


def oriented(
    views: tuple[View, ...],
    ground: Array,
    rays: Rays,
    scene: Scene,
    random: np.random.Generator,
    calibration: Camera | None = None,
) -> Assembly:
    """Return the block as a free adjustment leaves it, in a frame of its own; a ``calibration`` is held."""
    about = 1.003 * scene.focal
    camera = calibration or Camera("OPENCV", *scene.size, (about, about, scene.size[0] / 2, scene.size[1] / 2, 0, 0, 0, 0))
    known = interior.held() if calibration else interior.free(camera, interior.file_focal(about))
    basis, free = interior.merged({1: known})
    cameras = Cameras(
        np.array([v.rotation for v in views]), np.array([v.centre for v in views]), np.zeros(len(views), np.int64),
        camera.brown()[None], basis, free,
    )  # fmt: skip
    loose = Positions(np.arange(len(views)), cameras.centre, np.full((len(views), 3), 5.0), np.zeros(3), np.zeros(3))
    done = adjust(Network(cameras, (known,), rays, ground), (), loose, sigma=scene.pixel)
    angle = random.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    scale, shift = 0.05, np.array([0.3, -0.2, 0.1])
    made = done.cameras
    values = dict(zip(("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"), made.brown[0], strict=False))
    final = replace(camera, params=tuple(values.values()))
    free_views = []
    for name, rotation, centre in zip([v.name for v in views], made.rotation, made.centre, strict=True):
        r, c = rotation @ turn.T, scale * turn @ centre + shift
        free_views.append(View(name, final, r, -r @ c))
    counts = np.diff(rays.start).astype(np.int32)
    block = Block(
        tuple(free_views), scale * done.network.points @ turn.T + shift, np.full(len(ground), scene.pixel), counts,
        rays.point.astype(np.int32), rays.view.astype(np.int32),
    )  # fmt: skip
    return Assembly(block, rays, (1,) * len(views))


def _height(beach: Beach, scene: Scene, places: Array) -> Array:
    z = beach.heights(places[:, 0], places[:, 1], False)
    if scene.relief is None:
        return z
    grid = np.stack(np.meshgrid(np.linspace(0, scene.length, 50), np.linspace(0, scene.width, 50)), -1).reshape(-1, 2)
    return (z - 2.0) * scene.relief / float(np.std(beach.heights(grid[:, 0], grid[:, 1], False))) + 2.0


def _ground(beach: Beach, scene: Scene, photographs: int, random: np.random.Generator) -> Array:
    margin = 20.0
    low, high = np.array([-margin, -margin]), np.array([scene.length + margin, scene.width + margin])
    count = max(300, scene.points * photographs // 5)  # a point has some five rays
    places = random.uniform(low, high, (count, 2))
    return np.column_stack([places, _height(beach, scene, np.clip(places, 0, [scene.length, scene.width]))])


def _observe(views: tuple[View, ...], ground: Array, scene: Scene, random: np.random.Generator) -> Rays:
    width, height = scene.size
    points, view_of, xy = [], [], []
    for i, view in enumerate(views):
        with np.errstate(invalid="ignore"):
            pixels = view.project(ground)
            inside = (pixels > 5).all(axis=1) & (pixels < [width - 5, height - 5]).all(axis=1)
        seen = np.flatnonzero(inside & (random.random(len(ground)) < 0.5))
        points.append(seen)
        view_of.append(np.full(len(seen), i))
        xy.append(pixels[seen] + random.standard_normal((len(seen), 2)) * scene.pixel)
    point, view, pixel = np.concatenate(points), np.concatenate(view_of), np.concatenate(xy)
    order = np.lexsort((view, point))
    counts = np.bincount(point, minlength=len(ground))
    kept = counts >= 2
    rays = Rays(np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), view[order].astype(np.int64), pixel[order])
    ground_kept = rays.only(kept)
    ground[: kept.sum()] = ground[kept]  # the array that the caller holds, without the points that nothing sees
    ground.resize((int(kept.sum()), 3), refcheck=False)
    return ground_kept


def _targets(beach: Beach, scene: Scene, random: np.random.Generator) -> Array:
    corners = np.array([[0.06, 0.06], [0.94, 0.94], [0.94, 0.06], [0.06, 0.94], [0.5, 0.5]])
    more = max(0, scene.control - 5)
    share = np.concatenate([corners[: scene.control], random.uniform(0.05, 0.95, (more + scene.checks, 2))])
    places = share * [scene.length, scene.width]
    return np.column_stack([places, _height(beach, scene, places)])


def _surveyed(views: tuple[View, ...], laid: Array, scene: Scene, random: np.random.Generator) -> tuple[GroundPoint, ...]:
    noise = random.standard_normal(laid.shape) * [scene.gcp[0], scene.gcp[0], scene.gcp[1]]
    given = FRAME.to_crs(laid + noise)
    if scene.control > 1:
        given[1] += [scene.wrong_gcp, 0.0, scene.wrong_height]
    made = []
    for k, place in enumerate(laid):
        marks = []
        for view in views:
            with np.errstate(invalid="ignore"):
                pixel = view.project(place[None])[0]
                if not (np.all(pixel > 20) and np.all(pixel < np.array(scene.size) - 20)):
                    continue
            x, y = pixel + random.standard_normal(2) * scene.mark
            marks.append(Mark(f"P{k}", view.name, float(x), float(y)))
        if scene.control - scene.single <= k < scene.control:
            middle = min(marks, key=lambda m: np.hypot(m.x - scene.size[0] / 2, m.y - scene.size[1] / 2))
            marks = [replace(middle, x=middle.x + scene.wrong_single)]
        if k == 0 and marks and scene.wrong_mark:
            marks[0] = replace(marks[0], x=marks[0].x + scene.wrong_mark)
        made.append(GroundPoint(f"P{k}", given[k], k >= scene.control, *scene.gcp, tuple(marks)))
    return tuple(made)
