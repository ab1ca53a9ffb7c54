"""Step ``georeference``: from the free frame to a local metric frame of a projected CRS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2  # noqa: F401 - before pycolmap, whose PNG library otherwise crashes OpenCV's
import numpy as np
import pycolmap
from numpy.typing import NDArray

from ..block import Block
from ..contract import VectorSource, encode
from ..errors import InputError, NotEnoughData
from ..files import digest
from ..frames import LocalFrame
from ..progress import SILENT, Progress
from ..survey import Survey, held
from ..vector import check_destination
from . import georeport
from .accuracy import Doming, alti, plani
from .adjustedsolution import solve_adjustment
from .assembly import assemble
from .calibration import interiors_of
from .domes import dome_of
from .findings import findings, verdict
from .ignoring import outside
from .inputs import GroundRequest, Inputs, gather, read_given
from .leaving import complete, georef_of, write_georeferenced
from .observations import Seen, find_marks
from .pointcloud import check_cloud
from .solution import Solution, place, solve
from .sparse import block_from_model, read_model
from .tieprecision import write_tie_points

Array = NDArray[np.float64]

STEP = "georeference"
VERSION = 2  # raise it when the same input would give another result


@dataclass(frozen=True)
class Request(GroundRequest):
    """``residuals`` and ``photos`` are GeoPackages, ``tie_points`` a LAZ to write."""

    survey: str
    method: Literal["adjustment", "similarity"] = "adjustment"
    ignore: VectorSource | None = None
    residuals: str | None = None
    photos: str | None = None
    tie_points: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Counts, and root mean square errors (m) in plan and height; None where nothing determines them.

    ``doming`` (m) is how much a radially quadratic height error rises from the points' middle to the outermost of them, from the
    height errors of eight control and check points or more, else from those of GNSS; it is a dome only where the report says so.
    """

    output: str
    control_count: int
    check_count: int
    plani_control: float | None
    alti_control: float | None
    plani_check: float | None
    alti_check: float | None
    plani_loo: float | None
    alti_loo: float | None
    plani_gnss: float | None
    alti_gnss: float | None
    doming: float | None
    tie_points: str | None = None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Georeference the survey.

    Raises
    ------
    InputError
        When a parameter, layer, table or file cannot be used as given.
    NotEnoughData
        When control points and positions do not place the block.
    """
    check_parameters(request)
    survey = Survey.open(request.survey)
    with held(survey.folder, STEP):
        survey = Survey.open(request.survey)
        oriented = survey.require("orient")
        given = read_given(request)
        model = read_model(survey.folder / "model")
        block = block_from_model(model)
        progress.at(0.3)
        inputs = gather(request, request.ignore, survey, given, block)
        fingerprint = _fingerprint(request, inputs, oriented.fingerprint)
        solution = _solve(block, inputs, request)
        usable = np.ones(len(block.points), bool)
        if inputs.ignore is not None:
            usable = outside(solution, inputs.ignore)
        if request.method == "adjustment":
            solution = _adjusted(request, survey, model, block, inputs, solution, usable, progress.part(0.4, 0.75))
        else:
            solution = replace(solution, block=solution.block.only(usable), kept=usable)
        result, dome = _result(request, solution, inputs)
        numbers = {k: v for k, v in encode(result).items() if k not in ("output", "tie_points")}
        georef = georef_of(solution, inputs.heights.kind, numbers)
        told = findings(solution, inputs, dome)
        for text in told:
            progress.warn(text)
        standing = survey.record(STEP)
        if standing is None or standing.fingerprint != fingerprint or survey.is_stale(STEP) or not complete(survey):
            write_georeferenced(model, solution, survey)
            georef.write(survey)
        progress.at(0.8)
        georeport.write_layers(request.residuals, request.photos, solution, inputs)
        if request.tie_points:
            write_tie_points(request.tie_points, solution)
        report = georeport.report(solution, inputs, result, dome, told)
        report.save(survey.report_path(STEP), request.output_html_file)
        survey.finish(
            STEP,
            fingerprint,
            built_on=("createsurvey", "orient"),
            parameters=encode(request),
            result=encode(result),
        )
        progress.info(verdict(solution, result))
        progress.at(1.0)
    return result


def check_parameters(request: Request) -> None:
    """Refuse, before anything is read, parameters that cannot be met.

    Raises
    ------
    InputError
        When there are any.
    """
    if request.gcp_file and (request.gcps or request.marks):
        raise InputError("GCP_FILE takes the place of GCPS and MARKS: give either the file or the two layers.")
    if (request.gcps is None) != (request.marks is None):
        raise InputError("GCPS and MARKS belong together: give both, or GCP_FILE, or neither.")
    if request.check and not (request.gcps or request.gcp_file):
        raise InputError("CHECK names check points but there are no GCPs: give GCPS and MARKS, or GCP_FILE.")
    for name in ("sigma_h", "sigma_v", "sigma_mark"):
        if not getattr(request, name) > 0:
            raise InputError(f"{name.upper()} must be above 0.")
    for path in (request.residuals, request.photos):
        if path:
            check_destination(path)
    if request.tie_points:
        check_cloud("TIE_POINTS", request.tie_points)


def _fingerprint(request: Request, inputs: Inputs, oriented: str) -> str:
    points = [
        (p.name, p.coordinates.tolist(), p.check, p.sigma_h, p.sigma_v, [(m.image, m.x, m.y) for m in p.marks])
        for p in inputs.control.points
    ]
    positions = [a.tolist() for a in (inputs.gnss.view, inputs.gnss.coordinates, inputs.gnss.sigmas, inputs.gnss.lever)]
    ignored = None if inputs.ignore is None else inputs.ignore.wkb_hex
    return digest(VERSION, oriented, request.method, request.sigma_mark, inputs.crs, points, positions, inputs.heights, ignored)


def _solve(block: Block, inputs: Inputs, request: Request) -> Solution:
    seen = find_marks(block, inputs.control.points, request.sigma_mark)
    _enough(seen, inputs, request.method)
    places = [s.point.coordinates for s in seen if s.found is not None] or list(inputs.gnss.coordinates)
    if not places:
        raise NotEnoughData("There is neither a GCP nor a GNSS position with a height: give GCPS and MARKS, or GCP_FILE.")
    first = LocalFrame.at(inputs.crs, *map(float, np.mean(places, axis=0)))
    rough = place(block, seen, inputs.gnss, first)
    # The origin belongs in the middle of the block, wherever the control lies; to whole metres, so that it stays put.
    middle = first.to_crs(np.median(rough.apply(block.points), axis=0)[None])[0]
    frame = LocalFrame.at(inputs.crs, *map(float, np.round(middle)))
    return solve(block, seen, inputs.gnss, frame=frame, comparable=inputs.heights.comparable, focal_change=inputs.focal_change)


def _adjusted(
    request: Request,
    survey: Survey,
    model: pycolmap.Reconstruction,
    block: Block,
    inputs: Inputs,
    start: Solution,
    usable: NDArray[np.bool_],
    progress: Progress,
) -> Solution:
    """Return the adjustment from the similarity ``start``; points that it puts into IGNORE leave it, and it is done again."""
    assembly = assemble(model, block)
    interiors, labels = interiors_of(survey, assembly.cameras_by_id(), dict(zip(assembly.camera_ids, block.views, strict=True)))
    rounds = 0

    def step() -> None:
        nonlocal rounds
        rounds += 1
        progress.at(1.0 - 0.9**rounds)

    def solved(points: NDArray[np.bool_], compare: bool) -> Solution:
        return solve_adjustment(
            assembly,
            start,
            inputs.gnss,
            interiors,
            sigma_mark=request.sigma_mark,
            comparable=inputs.heights.comparable,
            usable=points,
            labels=labels,
            compare=compare,
            step=step,
        )

    if inputs.ignore is None:
        return solved(usable, True)
    first = solved(usable, False)
    again = usable.copy()
    again[first.kept] &= outside(first, inputs.ignore)
    return solved(again, True)


def _enough(seen: Sequence[Seen], inputs: Inputs, method: str) -> None:
    control = [s for s in seen if not s.point.check]
    if method == "adjustment" and len(inputs.gnss) and any(s.single for s in control):
        return  # positions place the block, and a single mark tells where its point lies in it
    if control and all(s.found is None for s in control):
        raise NotEnoughData(
            f"None of the {len(control)} control points of {inputs.control.where} has marks in two oriented photographs: "
            "mark them in more photographs, or leave the GCPs out to use GNSS alone."
        )


def _result(request: Request, solution: Solution, inputs: Inputs) -> tuple[Result, Doming | None]:
    found = np.array([s.found is not None for s in solution.seen], bool)
    check = np.array([s.point.check for s in solution.seen], bool)
    control, checks = solution.errors[found & ~check], solution.errors[found & check]
    loo = solution.loo[np.isfinite(solution.loo[:, 0])]
    gnss_alti = alti(solution.gnss_errors) if inputs.heights.comparable else None
    dome = dome_of(solution, inputs.gnss)
    result = Result(
        request.survey,
        len(control) + len(solution.single),
        len(checks),
        plani(control),
        alti(control),
        plani(checks),
        alti(checks),
        plani(loo),
        alti(loo),
        plani(solution.gnss_errors),
        gnss_alti,
        dome.amplitude if dome else None,
        request.tie_points,
    )
    return result, dome
