"""Step ``predictmarks``: where each ground point appears in which photograph, and its target measured there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from ..block import Block
from ..contract import VectorSource, encode
from ..errors import InputError, NotEnoughData
from ..files import digest
from ..georef import FOLDER, Georef
from ..parallel import run_calls
from ..progress import SILENT, Progress
from ..survey import Photograph, Survey, held
from ..vector import check_destination, write_layer
from .codes import code_of
from .control import GroundPoint, control_from, given_from_layers
from .markreport import Marking, verdict, write_report
from .marks import listed
from .prediction import Prediction, above_surface, distance_from_block, predict
from .refining import Search, Sight, agreeing, circle, look
from .sparse import read_block

STEP = "predictmarks"
_PICTURES = 6  # per ground point


@dataclass(frozen=True)
class Request:
    """``output`` is the GeoPackage of the table to write; ``sigma_h`` and ``sigma_v`` are the points' own sigmas (m)."""

    survey: str
    output: str
    gcps: VectorSource
    name_field: str
    height_field: str | None = None
    sigma_h: float = 0.01
    sigma_v: float = 0.02
    sigma_h_field: str | None = None
    sigma_v_field: str | None = None
    refine: Literal["none", "target", "code"] = "none"
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Ground points with a row in the table, the photographs these lie in, rows, and predicted marks that were not found."""

    gcp_count: int
    image_count: int
    mark_count: int
    missed_count: int


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Write the table: gcp, image, x, y (px from the corner of the top-left pixel), sigma (px, an axis), score.

    Without refinement the rows are predictions, with their sigma and no score. With it, they are the marks that were found, and
    what was not found is named in the report, for as a row it would be taken for a measurement.

    Raises
    ------
    InputError
        When a parameter, the layer, the survey or a photograph cannot be used.
    NotEnoughData
        When no ground point lies in a photograph.
    """
    check_destination(request.output)
    for name in ("sigma_h", "sigma_v"):
        if not getattr(request, name) > 0:
            raise InputError(f"{name.upper()} must be above 0.")
    with held(request.survey, STEP):
        survey = Survey.open(request.survey)
        georeferenced = survey.require("georeference")
        georef = Georef.read(survey)
        points, told = _points(request, survey, georef)
        block = read_block(survey.folder / FOLDER)
        photographs = _photographs(survey, block)
        predictions = predict(block, georef, points)
        told += _reasonable(block, georef, points, predictions)
        progress.at(0.1)
        searches = _searches(request, block, points, predictions, photographs)
        told += _wide(request, predictions, searches, photographs)
        sights = _look(request, survey, block, photographs, predictions, searches, told, progress.part(0.1, 0.9))
        found = {s.key: s.found for s in sights.values() if s.found is not None}
        taken, contradicted = agreeing(block, predictions, found)
        marking = Marking(
            request.refine,
            tuple(points),
            tuple(v.name for v in block.views),
            tuple(predictions),
            found,
            taken,
            frozenset(contradicted),
            {s.key: (searches[s.key], s) for s in sights.values() if s.picture is not None},
            tuple(told),
        )
        rows = marking.rows()
        write_layer(request.output, "marks", None, {k: [row[k] for row in rows] for k in COLUMNS}, None)
        result = Result(
            len({row["gcp"] for row in rows}),
            len({row["image"] for row in rows}),
            len(rows),
            0 if request.refine == "none" else len(marking.sought()) - len(taken),
        )
        write_report(survey.report_path(STEP), request.output_html_file, marking)
        places = [(p.name, p.coordinates.tolist(), p.sigma_h, p.sigma_v) for p in points]
        survey.finish(
            STEP,
            digest(georeferenced.fingerprint, request.refine, places),
            built_on=("georeference",),
            parameters=encode(request),
            result=encode(result),
        )
    for text in marking.told:
        progress.warn(text)
    progress.info(verdict(marking))
    progress.at(1.0)
    return result


COLUMNS = ("gcp", "image", "x", "y", "sigma", "score")


def _points(request: Request, survey: Survey, georef: Georef) -> tuple[list[GroundPoint], list[str]]:
    given = given_from_layers(
        request.gcps,
        None,
        name_field=request.name_field,
        height_field=request.height_field,
        sigma_h_field=request.sigma_h_field,
        sigma_v_field=request.sigma_v_field,
    )
    control = control_from(given, georef.frame.crs, survey.photographs, sigma_h=request.sigma_h, sigma_v=request.sigma_v)
    told = list(control.notes)
    if request.refine == "code":
        without = [p.name for p in control.points if code_of(p.name) is None]
        if len(without) == len(control.points):
            raise InputError(
                f"No name of {given.where} ends with a number, which REFINE=code needs to tell the codes apart: rename the "
                "points (the code with the number 7 belongs to 7, T7 or GCP_07), or use REFINE=target."
            )
        if without:
            told.append(f"No code is sought for {listed(without)}: REFINE=code needs names that end with the code's number.")
    return list(control.points), told


def _photographs(survey: Survey, block: Block) -> list[Photograph]:
    known = {p.name: p for p in survey.photographs}
    missing = [v.name for v in block.views if v.name not in known]
    if missing:
        raise InputError(f"{missing[0]} is oriented but not in the survey {survey.folder}: run strandline:orient again.")
    return [known[v.name] for v in block.views]


def _reasonable(block: Block, georef: Georef, points: Sequence[GroundPoint], predictions: Sequence[Prediction]) -> list[str]:
    """Return what is odd about where the points lie; refuse when none lies in a photograph."""
    off = above_surface(block, georef, points)
    heights = ""
    if off is not None:
        heights = (
            f"the ground points lie {abs(off):.3g} m {'above' if off > 0 else 'below'} the surveyed ground: are their heights of "
            "another kind (ellipsoidal, orthometric) than those the survey was georeferenced with?"
        )
    if not any(p.inside for p in predictions):
        apart = distance_from_block(block, georef, points)
        why = heights or f"their middle is {apart:.0f} m from that of the block; check the CRS, or whether it is the right survey"
        raise NotEnoughData(f"None of the {len(points)} ground points falls in a photograph: {why}")
    return [heights[0].upper() + heights[1:]] if heights else []


def _searches(
    request: Request,
    block: Block,
    points: Sequence[GroundPoint],
    predictions: Sequence[Prediction],
    photographs: Sequence[Photograph],
) -> dict[int, Search]:
    """Return where to look: wherever something is to be refined, else once per point, for a picture."""
    shown: dict[int, int] = {}
    searches = {}
    for key, p in enumerate(predictions):
        code = code_of(points[p.point].name) if request.refine == "code" else None
        rank = shown.get(p.point, 0)
        if request.refine == "none" and (rank > 0 or not p.inside):
            continue
        if request.refine == "code" and code is None:
            continue
        photo = photographs[p.view]
        radius, _ = circle(p, photo.width, photo.height)
        searches[key] = Search(key, float(p.pixel[0]), float(p.pixel[1]), radius, code, p.inside and rank < _PICTURES)
        shown[p.point] = rank + int(p.inside)
    return searches


def _wide(
    request: Request, predictions: Sequence[Prediction], searches: Mapping[int, Search], photographs: Sequence[Photograph]
) -> list[str]:
    """Return a sentence when circles had to be cut short."""
    if request.refine == "none":
        return []
    photos = {k: photographs[predictions[k].view] for k in searches}
    cut = [k for k, photo in photos.items() if circle(predictions[k], photo.width, photo.height)[1]]
    if not cut:
        return []
    return [
        f"{len(cut)} of {len(searches)} predictions are too uncertain to search all of where the point may be: georeference with "
        "the marks that were found, or with a few made by eye, and predict again."
    ]


def _look(
    request: Request,
    survey: Survey,
    block: Block,
    photographs: Sequence[Photograph],
    predictions: Sequence[Prediction],
    searches: Mapping[int, Search],
    told: list[str],
    progress: Progress,
) -> dict[int, Sight]:
    """Look at each photograph once; without refinement one that cannot be read costs its pictures only."""
    by_view: dict[int, list[Search]] = {}
    for key, search in searches.items():
        by_view.setdefault(predictions[key].view, []).append(search)
    calls = []
    for view in sorted(by_view):
        try:
            calls.append((str(survey.path(photographs[view])), photographs[view], request.refine, by_view[view]))
        except InputError as error:
            if request.refine != "none":
                raise
            told.append(f"No picture: {error}")
    sights: dict[int, Sight] = {}
    try:
        for _, seen in run_calls(
            look, calls, workers=request.workers, scheduler=request.scheduler, progress=progress, total=len(calls)
        ):
            sights.update({s.key: s for s in seen})
    except InputError as error:
        if request.refine != "none":
            raise
        told.append(f"No picture: {error}")
    return sights
