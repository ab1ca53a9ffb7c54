"""Step ``surveylayers``: what stands in a survey as layers of a map; nothing is computed anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..block import Block, View
from ..errors import InputError, NotEnoughData
from ..frames import transformer
from ..georef import FOLDER, Georef
from ..photographs.thumbnails import thumbnail
from ..progress import SILENT, Progress
from ..survey import Photograph, Survey, held
from ..vector import check_destination, write_layer
from .sparse import read_block

Array = NDArray[np.float64]

STEP = "surveylayers"
_SIDE = 8  # points on each side of a footprint: distortion bends it


@dataclass(frozen=True)
class Request:
    """``photos``, ``footprints`` and ``tie_points`` are GeoPackages to write; ``max_points`` 0 writes all tie points."""

    survey: str
    photos: str | None = None
    footprints: str | None = None
    tie_points: str | None = None
    max_points: int = 50000


@dataclass(frozen=True)
class Result:
    """How many photographs and tie points were written, and how many tie points there are."""

    photo_count: int
    point_count: int
    tie_point_count: int


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Write the layers: adjusted places when the survey is georeferenced, the positions in the photographs before.

    Raises
    ------
    InputError
        When the survey or a file cannot be used.
    NotEnoughData
        When nothing tells where the photographs were taken.
    """
    for path in filter(None, (request.photos, request.footprints, request.tie_points)):
        check_destination(path)
    if request.max_points < 0:
        raise InputError("MAX_POINTS must be 0 (all) or more.")
    with held(request.survey, STEP):
        survey = Survey.open(request.survey)
        known = {p.name: p for p in survey.photographs}
        georeferenced = survey.record("georeference") is not None and not survey.is_stale("georeference")
        if not georeferenced:
            if request.photos:
                _write_positions(request.photos, survey, progress)
            progress.info("The survey is not georeferenced: the photographs are at their GNSS positions, without footprints.")
            return Result(sum(p.position is not None for p in survey.photographs), 0, 0)
        georef = Georef.read(survey)
        block = read_block(survey.folder / FOLDER)
        unknown = [v.name for v in block.views if v.name not in known]
        if unknown:
            raise InputError(f"{unknown[0]} is oriented but not in the survey {survey.folder}: run strandline:orient again.")
        photographs = [known[v.name] for v in block.views]
        crs = georef.frame.crs
        if request.photos:
            centres = georef.frame.to_crs(np.array([v.centre for v in block.views]))
            _write_photographs(request.photos, crs, survey, photographs, centres, "adjusted", progress.part(0.1, 0.7))
        if request.footprints:
            shapes = [_shape(georef, footprint(view, ground)) for view, ground in zip(block.views, _ground(block), strict=True)]
            seen = [i for i, shape in enumerate(shapes) if shape is not None]
            fields = {"name": [photographs[i].name for i in seen]}
            write_layer(request.footprints, "footprints", crs, fields, [shapes[i] for i in seen], "Polygon")
        progress.at(0.8)
        written = 0
        if request.tie_points:
            written = _write_points(request.tie_points, crs, georef, block, request.max_points)
    progress.at(1.0)
    return Result(len(photographs), written, len(block.points))


def footprint(view: View, ground: float) -> Array | None:
    """Return the outline (n, 3) of what a photograph shows of a level at height ``ground``; None where it sees the horizon."""
    width, height = view.camera.width, view.camera.height
    along = np.linspace(0.0, 1.0, _SIDE, endpoint=False)
    zero, one = np.zeros(_SIDE), np.ones(_SIDE)
    x = np.concatenate([along, one, 1.0 - along, zero]) * width
    y = np.concatenate([zero, along, one, 1.0 - along]) * height
    directions = view.camera.unproject(np.stack([x, y], axis=1)) @ view.rotation
    if not (directions[:, 2] < -0.1 * np.linalg.norm(directions, axis=1)).all():
        return None
    reach = (ground - view.centre[2]) / directions[:, 2]
    return np.asarray(view.centre + reach[:, None] * directions) if (reach > 0).all() else None


def _ground(block: Block) -> list[float]:
    """Return for each photograph the median height of the tie points it shows, the block's where it shows none."""
    middle = float(np.median(block.points[:, 2])) if len(block.points) else 0.0
    found = []
    for index in range(len(block.views)):
        heights = block.points[block.observed_point[block.observed_view == index], 2]
        found.append(float(np.median(heights)) if len(heights) else middle)
    return found


def _shape(georef: Georef, outline: Array | None) -> Any:
    return None if outline is None else shapely.Polygon(georef.frame.to_crs(outline)[:, :2])


def _write_points(path: str, crs: str, georef: Georef, block: Block, most: int) -> int:
    """Write tie points, every so manieth of them when they are more than ``most``; return how many."""
    count = len(block.points)
    chosen = np.arange(count) if not most or count <= most else np.linspace(0, count - 1, most).round().astype(int)
    places = georef.frame.to_crs(block.points[chosen])
    fields = {"height": places[:, 2], "photographs": block.rays[chosen], "residual": block.errors[chosen]}
    write_layer(path, "tie_points", crs, fields, list(shapely.points(places)), "Point Z")
    return len(chosen)


def _write_positions(path: str, survey: Survey, progress: Progress) -> None:
    located = [(p, p.position) for p in survey.photographs if p.position is not None]
    if not located:
        raise NotEnoughData(
            f"Nothing tells where the photographs of {survey.folder} were taken: run strandline:georeference with ground points."
        )
    crs = survey.crs or "EPSG:4326"
    x, y = transformer("EPSG:4326", crs).transform([q.longitude for _, q in located], [q.latitude for _, q in located])
    heights = [np.nan if q.height is None else q.height for _, q in located]
    _write_photographs(path, crs, survey, [p for p, _ in located], np.column_stack([x, y, heights]), "gnss", progress)


def _write_photographs(
    path: str, crs: str, survey: Survey, photographs: Sequence[Photograph], places: Array, origin: str, progress: Progress
) -> None:
    """Write the photographs at ``places`` (n, 3); a height that is not known is left out of the geometry as zero."""
    small = []
    for i, photograph in enumerate(photographs):
        small.append(thumbnail(survey, photograph))
        progress.at((i + 1) / len(photographs))
    fields: dict[str, Any] = {
        "name": [p.name for p in photographs],
        "time": [p.time for p in photographs],
        "height": places[:, 2],
        "origin": [origin] * len(photographs),
        "path": [str(survey.images / p.name) for p in photographs],
        "thumbnail": [None if t is None else str(t.resolve()) for t in small],
    }
    write_layer(path, "photographs", crs, fields, list(shapely.points(np.nan_to_num(places))), "Point Z")
