"""What the block itself says of given heights: of another kind than GNSS', or in another unit than metres.

A free block knows the shape of the ground but no unit and no level. The plan of the ground points gives it the unit: heights in
feet then stretch its relief 3.28 times. GNSS gives it a level, too, from which heights of another kind lie off by the geoid's
height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..errors import InputError, NotEnoughData
from ..survey import Photograph
from .control import Control
from .gnss import Gnss
from .similarity import Similarity, umeyama
from .triangulation import triangulate

Array = NDArray[np.float64]

LEVELS_DIFFER = 5.0  # m; geoids lie tens of metres from the ellipsoid
_NO_GEOID = 200.0  # m; geoids lie within 110 m of the ellipsoid, and barometers err by tens of metres
_TAKE_OFF = 30.0  # m; the ground points may lie as far below or above the place of take-off
_LINE = 0.05  # the positions' width over their length; on a narrower strip the tilt about it is not known
_UNITS = {"feet": 0.3048, "centimetres": 0.01, "millimetres": 0.001}
_MARK = 5.0  # px; coarse, for nothing here asks for more


@dataclass(frozen=True)
class Level:
    """How far GNSS heights lie above those of the ground points (m), and how far apart they must be to mean something."""

    above: float
    limit: float
    unit: str | None = None  # of the ground points' heights that would make them agree

    @property
    def differs(self) -> bool:
        """Whether the two are apart."""
        return abs(self.above) > self.limit


def check_unit(block: Block, control: Control) -> None:
    """Refuse heights whose relief is plainly that of another unit than metres.

    Raises
    ------
    InputError
        When the ground points fit the block far better with their heights in another unit.
    """
    found, model = _intersected(block, control)
    if len(found) < 5:  # four points hardly tell a wrong unit from a wrong point
        return
    ground = np.array([control.points[i].coordinates for i in found])
    ground = ground - ground.mean(axis=0)
    as_given = _misfit(model, ground, 1.0)
    for unit, metres in _UNITS.items():
        misfit = _misfit(model, ground, metres)
        # What is scaled down fits better by that alone: the relief itself must be explained.
        if misfit < as_given / 5 and misfit < _relief(ground) * metres / 5:
            raise InputError(
                f"The heights of {control.where} fit the photographs as {unit} ({misfit:.2g} m instead of {as_given:.2g} m): "
                "give them in metres, as the coordinates are."
            )


def level_of(block: Block, control: Control, gnss: Gnss, photographs: Sequence[Photograph]) -> Level | None:
    """Return how far GNSS heights lie above the ground points', None when that cannot be told.

    The block is laid on the GNSS positions alone; where these do not hold it, the height above take-off in the photographs'
    XMP tells roughly how high they flew.
    """
    if not control.points or not len(gnss):
        return None
    laid = _laid(block, gnss)
    found, model = _intersected(block, control) if laid else ([], np.zeros((0, 3)))
    if laid is not None and found:
        similarity, scatter = laid
        heights = np.array([control.points[i].coordinates[2] for i in found])
        return _level(similarity.apply(model)[:, 2], heights, max(LEVELS_DIFFER, 5 * scatter))
    flown = {p.name: p.relative_height for p in photographs}
    above = [flown.get(block.views[i].name) for i in gnss.view]
    ground = [z - up for z, up in zip(gnss.coordinates[:, 2], above, strict=True) if up is not None]
    if not ground:
        return None
    heights = np.array([p.coordinates[2] for p in control.points if p.marks])
    return _level(np.array([float(np.median(ground))]), heights, _TAKE_OFF) if len(heights) else None


def refuse_absurd(level: Level, where: str) -> None:
    """Refuse heights that no kind of height explains.

    Raises
    ------
    InputError
        When they lie too far from GNSS heights.
    """
    if abs(level.above) <= _NO_GEOID:
        return
    unit = f"; in {level.unit} they would agree" if level.unit else ""
    raise InputError(
        f"The heights of {where} lie {abs(level.above):.0f} m {'below' if level.above > 0 else 'above'} the ground as GNSS "
        f"positions show it{unit}: give them in metres, or set USE_GNSS to false if it is the positions that are wrong."
    )


def _level(by_gnss: Array, given: Array, limit: float) -> Level:
    above = float(np.median(by_gnss - given)) if len(by_gnss) == len(given) else float(np.median(by_gnss) - np.median(given))
    if abs(above) <= limit:
        return Level(above, limit)
    rest = {unit: abs(above + (1.0 - metres) * float(np.median(given))) for unit, metres in _UNITS.items()}
    best = min(rest, key=lambda unit: rest[unit])
    return Level(above, limit, best if rest[best] <= min(limit, abs(above) / 4) else None)


def _laid(block: Block, gnss: Gnss) -> tuple[Similarity, float] | None:
    """Return the similarity on GNSS positions alone and the scatter of their heights (m), None when they do not hold it."""
    centres = np.array([block.views[i].centre for i in gnss.view]).reshape(-1, 3)
    kept = np.ones(len(centres), bool)
    for _ in range(2):  # the second time without the positions that the first shows wrong
        if kept.sum() < 4 or _narrow(gnss.coordinates[kept, :2]):
            return None
        try:
            similarity = umeyama(centres[kept], gnss.coordinates[kept])
        except NotEnoughData:
            return None
        errors = similarity.apply(centres) - gnss.coordinates
        sizes = np.linalg.norm(errors - np.median(errors, axis=0), axis=1)
        kept = sizes <= 5 * max(float(np.median(sizes)), 0.01)
    return similarity, 1.4826 * float(np.median(np.abs(errors[kept, 2] - np.median(errors[kept, 2]))))


def _narrow(places: Array) -> bool:
    lengths = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return not lengths[1] > _LINE * lengths[0]


def _intersected(block: Block, control: Control) -> tuple[list[int], Array]:
    """Return which ground points are seen twice and agree, and where they lie in the block (m, 3)."""
    views = {v.name: v for v in block.views}
    found, places = [], []
    for index, point in enumerate(control.points):
        marks = [m for m in point.marks if m.image in views]
        centres = np.array([views[m.image].centre for m in marks]).reshape(-1, 3)
        if len(marks) < 2 or not np.ptp(centres, axis=0).max() > 0:
            continue
        place = triangulate([views[m.image] for m in marks], np.array([[m.x, m.y] for m in marks]), _MARK)
        if place is not None and place.agree:
            found.append(index)
            places.append(place.point)
    return found, np.array(places, float).reshape(-1, 3)


def _misfit(model: Array, ground: Array, metres: float) -> float:
    scaled = ground * [1.0, 1.0, metres]
    try:
        errors = umeyama(model, scaled).apply(model) - scaled
    except NotEnoughData:
        return float("inf")
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def _relief(ground: Array) -> float:
    """Return how far the points lie from their plane in height (RMS); a plane looks the same in any unit."""
    design = np.column_stack([ground[:, :2], np.ones(len(ground))])
    rest = ground[:, 2] - design @ np.linalg.lstsq(design, ground[:, 2], rcond=None)[0]
    return float(np.sqrt(np.mean(rest**2)))
