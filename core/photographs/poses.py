"""Where photographs look: from the georeferenced block, else from what the drone noted, with a margin for its errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..block import Block, View
from ..camera import Camera
from ..contract import VectorSource
from ..errors import InputError
from ..frames import LocalFrame, transformer
from ..georef import FOLDER, Georef
from ..orientation.sparse import read_block
from ..survey import Photograph, Position, Survey
from ..vector import polygons
from .listing import some
from .masking import outline_in

Array = NDArray[np.float64]

# Largest errors to expect of what a drone notes (about two sigmas).
_HEADING = math.radians(5.0)  # a compass
_TILT = math.radians(2.0)
_POSITION = 4.0  # m, where the file tells no sigma
_RELATIVE = 0.10  # of the height above take-off: the ground is not level with it, the barometer drifts, the lens bends
_ELSEWHERE = 30.0  # m between a pose and the photograph's GNSS from which on the pose is of something else
_NEIGHBOURS = 9  # tie points whose median height is the ground's


@dataclass(frozen=True)
class Outlines:
    """What IGNORE covers, by the photograph's name: a multipolygon in its pixels, empty when it covers nothing there.

    ``unknown`` names the photographs of which it is not known where they look; ``note`` says in sentences what the others' poses
    come from and how far they may be off.
    """

    by_name: dict[str, shapely.MultiPolygon]
    unknown: tuple[str, ...]
    note: str


@dataclass(frozen=True)
class Noted:
    """What a drone noted of an exposure: ``above`` take-off (m), ``focal`` in pixels, the gimbal's ``angles`` (rad)."""

    name: str
    position: Position
    above: float
    angles: tuple[float, float, float]
    focal: float
    size: tuple[int, int]

    @classmethod
    def of(cls, photograph: Photograph) -> Noted | None:
        """Return what a photograph's metadata tell, None when that is not enough; a gimbal without pitch looks down."""
        p = photograph
        if p.position is None or p.yaw is None or p.focal is None or p.relative_height is None or p.relative_height <= 1.0:
            return None
        yaw, pitch, roll = np.radians([p.yaw, -90.0 if p.pitch is None else p.pitch, p.roll or 0.0])
        return cls(p.name, p.position, p.relative_height, (yaw, pitch, roll), p.focal, (p.width, p.height))

    def view(self, frame: LocalFrame) -> View:
        """Return the pose in ``frame``, but with z counted from take-off."""
        rotation = camera_from_east_north_up(*self.angles)
        place = frame.from_wgs84(np.array([[self.position.longitude, self.position.latitude, frame.height]]))[0]
        camera = Camera("SIMPLE_PINHOLE", *self.size, (self.focal, self.size[0] / 2, self.size[1] / 2))
        return View(self.name, camera, rotation, -rotation @ np.array([place[0], place[1], self.above]))

    def margin(self) -> float:
        """Return by how much an outline must be widened, as tangent from the camera, at the photograph's corners."""
        corner = math.hypot(*self.size) / 2 / self.focal
        place = 2.0 * self.position.sigma_h if self.position.sigma_h else _POSITION
        return math.hypot(corner * _HEADING, (1 + corner**2) * _TILT, place / self.above, corner * _RELATIVE)


def find_outlines(survey: Survey, photographs: Sequence[Photograph], ignore: VectorSource) -> Outlines:
    """Project the polygons of ``ignore`` into the photographs.

    The poses are those of georeferenced/, even of a stale one, at the heights of the tie points nearest to the polygons' edges;
    for photographs that are not in it, GNSS, heading, and height above take-off, over level ground and with a margin.

    Raises
    ------
    InputError
        When it is not known where any photograph looks, or the polygons do not suit.
    """
    notes, by_name = [], {}
    if (survey.folder / FOLDER).is_dir():
        georef, block = Georef.read(survey), read_block(survey.folder / FOLDER)
        views = _belonging(block, photographs, georef.frame)
        areas = _areas(ignore, georef.frame, np.array([v.centre for v in views.values()]))
        heights = _heights(block)
        by_name = {name: outline_in(view, areas, heights) for name, view in views.items()}
        notes.append(_georeferenced_note(survey, georef, views, photographs))
    noted = [n for p in photographs if p.name not in by_name and (n := Noted.of(p)) is not None]
    if noted and survey.crs:
        frame = _frame_of(noted, survey.crs)
        poses = {n.name: n.view(frame) for n in noted}
        areas = _areas(ignore, frame, np.array([v.centre for v in poses.values()]))
        by_name |= {n.name: outline_in(poses[n.name], areas, _level, n.margin()) for n in noted}
        metres = float(np.median([n.margin() * n.above for n in noted]))
        notes.append(
            f"{len(noted)} photographs are placed by GNSS, heading and height above take-off, over level ground: the areas are "
            f"widened by {metres:.1f} m for a heading off by {math.degrees(_HEADING):.0f} degrees, a tilt by "
            f"{math.degrees(_TILT):.0f}, a position by {_POSITION:g} m or twice its sigma and a height by {_RELATIVE:.0%}."
        )
    if not by_name:
        raise InputError(
            f"IGNORE needs to know where the photographs of {survey.folder} look, but they are not georeferenced and tell no "
            "heading and height above take-off: leave IGNORE empty, run the steps up to 'georeference', and then 'enhance' with "
            "IGNORE again."
        )
    unknown = tuple(p.name for p in photographs if p.name not in by_name)
    if unknown:
        notes.append(f"It is not known where {some(unknown)} look: nothing is masked there.")
    return Outlines(by_name, unknown, " ".join(notes))


def _belonging(block: Block, photographs: Sequence[Photograph], frame: LocalFrame) -> dict[str, View]:
    """Return the block's views by name, without those that a photograph of another frame or place now has the name of."""
    listed = {p.name: p for p in photographs}
    kept = {}
    for view in block.views:
        photograph = listed.get(view.name)
        if photograph is None or (view.camera.width, view.camera.height) != (photograph.width, photograph.height):
            continue
        offset = _offset(view, photograph, frame)
        if offset is None or offset < _ELSEWHERE:
            kept[view.name] = view
    return kept


def _offset(view: View, photograph: Photograph, frame: LocalFrame) -> float | None:
    """Return the horizontal distance (m) of a pose from the photograph's GNSS position, None without one."""
    position = photograph.position
    if position is None:
        return None
    place = frame.from_wgs84(np.array([[position.longitude, position.latitude, frame.height]]))[0]
    return float(np.hypot(*(view.centre - place)[:2]))


def _areas(ignore: VectorSource, frame: LocalFrame, centres: Array) -> shapely.Geometry:
    """Return the polygons as one geometry in the local frame's x and y, of the surroundings of the projection centres (n, 3)."""
    shapes = shapely.union_all(polygons(ignore, frame.crs))
    if len(centres) == 0:
        return shapely.MultiPolygon()
    around = 35.0 * max(100.0, float(np.abs(centres[:, 2]).max()))
    places = frame.to_crs(centres)[:, :2]
    near = shapely.intersection(shapes, shapely.box(*(places.min(axis=0) - around), *(places.max(axis=0) + around)))

    def local(xy: Array) -> Array:
        return frame.from_crs(np.column_stack([xy, np.full(len(xy), frame.height)]))[:, :2]

    return shapely.make_valid(shapely.transform(near, local))


def _heights(block: Block) -> Callable[[Array], Array]:
    """Return a function of points (n, 2) that gives the median height of the nearest tie points (n,)."""
    count = min(_NEIGHBOURS, len(block.points))
    tree = cKDTree(block.points[:, :2])

    def heights(xy: Array) -> Array:
        _, nearest = tree.query(xy, count)
        return np.asarray(np.median(block.points[np.reshape(nearest, (len(xy), count)), 2], axis=1))

    return heights


def _level(xy: Array) -> Array:
    return np.zeros(len(xy))


def _frame_of(noted: Sequence[Noted], crs: str) -> LocalFrame:
    """Return a local frame amid the photographs; its origin's height is of no account."""
    longitude, latitude = np.median([(n.position.longitude, n.position.latitude) for n in noted], axis=0)
    return LocalFrame.at(crs, *transformer("EPSG:4326", crs).transform(longitude, latitude), 0.0)


def camera_from_east_north_up(yaw: float, pitch: float, roll: float) -> Array:
    """Return the rotation (3, 3) of a gimbal's angles (rad): yaw clockwise from north, pitch up from the horizon, roll clockwise.

    Rows are the camera's axes: right in the image, down in it, and forward.
    """
    sin, cos = math.sin, math.cos
    forward = np.array([sin(yaw) * cos(pitch), cos(yaw) * cos(pitch), sin(pitch)])
    level = np.array([cos(yaw), -sin(yaw), 0.0])
    down = np.cross(forward, level)
    return np.stack([cos(roll) * level + sin(roll) * down, cos(roll) * down - sin(roll) * level, forward])


def _georeferenced_note(survey: Survey, georef: Georef, views: dict[str, View], photographs: Sequence[Photograph]) -> str:
    stale = survey.record("georeference") is None or survey.is_stale("georeference")
    text = f"{len(views)} photographs are placed by the {'stale ' if stale else ''}georeferencing, without a margin"
    if not views:
        return text + "."
    check = next((v for k in ("plani_check", "plani_loo", "plani_control") if (v := georef.accuracy.get(k)) is not None), None)
    if check is not None:
        text += f"; ground points were {check:.3f} m off in it"
    offsets = [o for p in photographs if p.name in views and (o := _offset(views[p.name], p, georef.frame)) is not None]
    if stale and offsets:
        text += f"; its poses lie {np.median(offsets):.2f} m from the GNSS positions, in the median"
    return text + "."
