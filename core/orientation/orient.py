"""Step ``orient``: poses and interior orientation from tie points alone, in a free frame.

The block grows on thinned matches with a camera of one radial term; then the asked camera model is adjusted; then the tie
points of all matches are triangulated and everything is adjusted together. The result depends on nothing but its input: a
run that was interrupted is run again and gives the same to the bit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pycolmap

from ..camera import Camera
from ..errors import NotEnoughData
from ..files import copy_file, digest, whole
from ..photographs.listing import some
from ..progress import SILENT, Progress
from ..survey import Photograph, Survey, held
from ..tiepoints.database import NAME
from ..tiepoints.statistics import micmac_statistics, weakest_link
from . import selfcalibration as calibrating
from .calibration import MODEL, read_calibration
from .focal import CALIBRATION_SIGMA, FILE_SIGMA, FocalPrior, far_off
from .mapping import Network, camera_from_colmap, map_photographs, read_network, triangulate
from .orientreport import Orientation, write_report
from .pointcloud import check_cloud, write_points
from .sparse import block_from_model

VERSION = 4  # raise it when the same input would give another result
_WEAK_LINK = 100  # points of three or more rays below which a link between two parts of the block is told of
_MULTI = 10  # observations of points with three or more rays below which a photograph's pose is not believed


@dataclass(frozen=True)
class Request:
    """``calibration`` is another survey's folder; ``tie_points`` is a LAZ to write.

    ``calibration_use`` "fixed" holds its cameras; "prior" starts from them, holds them while the block grows and adjusts them
    at the end with ``camera_model``. ``mapper`` "auto" is "incremental".
    """

    survey: str
    camera_model: Literal["brown", "radial", "simple_radial", "full"] = "brown"
    calibration: str | None = None
    calibration_use: Literal["prior", "fixed"] = "prior"
    mapper: Literal["auto", "incremental", "global"] = "auto"
    tie_points: str | None = None
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """MicMac's statistics (see ``core.tiepoints.statistics``); percentages 0..100, mse in pixels."""

    output: str
    oriented_count: int
    mtp: float
    mtp_percent: float | None
    mmtp: float
    mmtp_percent: float | None
    mse: float | None
    tie_points: str | None = None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Orient the photographs.

    Raises
    ------
    InputError
        When the request cannot be met.
    NotEnoughData
        When no two photographs can be oriented to each other.
    """
    if request.tie_points is not None:
        check_cloud("TIE_POINTS", request.tie_points)
    Survey.open(request.survey)  # before a lock is put into a folder that is none
    with held(request.survey, "orient"):
        survey = Survey.open(request.survey)
        standing = survey.require("tiepoints")
        found = read_calibration(request.calibration, survey.photographs) if request.calibration else {}
        known = {name: calibration.camera for name, calibration in found.items()}
        parameters = {
            "camera_model": request.camera_model,
            "calibration": request.calibration,
            "calibration_use": request.calibration_use if request.calibration else None,
            "mapper": "incremental" if request.mapper == "auto" else request.mapper,
        }
        fingerprint = digest(VERSION, standing.fingerprint, {**parameters, "calibration": known})
        record = survey.record("orient")
        stands = record is not None and record.fingerprint == fingerprint and not survey.is_stale("orient")
        if record is not None and stands and (survey.folder / MODEL).is_dir() and survey.report_path("orient").is_file():
            progress.info("The photographs are oriented already under these parameters.")
            if request.output_html_file:
                copy_file(survey.report_path("orient"), request.output_html_file)
            numbers = record.result
        else:
            numbers = _orient(request, survey, known, progress)
            survey.finish("orient", fingerprint, built_on=("tiepoints",), parameters=parameters, result=numbers)
        if request.tie_points:
            block = block_from_model(pycolmap.Reconstruction(survey.folder / MODEL))
            write_points(request.tie_points, block.points, rays=block.rays, errors=block.errors)
    progress.at(1.0)
    return Result(output=request.survey, tie_points=request.tie_points, **numbers)


def _orient(request: Request, survey: Survey, known: Mapping[str, Camera], progress: Progress) -> dict[str, Any]:
    """Orient, write model/ and the report, and return the numbers."""
    database = survey.folder / NAME
    network = read_network(database)
    given = {network.camera_of[i]: known[name] for i, name in network.names.items() if name in known}
    fixed = set(given) if request.calibration_use == "fixed" else set()
    priors = _focal_priors(survey.photographs, network, given)
    mapper: Literal["incremental", "global"] = "global" if request.mapper == "global" else "incremental"
    models = map_photographs(database, network, mapper=mapper, given=given, progress=progress.part(0.0, 0.5))
    model = models[0]
    for camera_id, camera in model.cameras.items():
        if camera_id not in fixed:
            wanted = calibrating.MODELS[request.camera_model]
            calibrating.set_camera(model, camera_id, calibrating.convert_camera(camera_from_colmap(camera), wanted))
    calibrating.self_calibrate(model, request.camera_model, fixed, rounds=2, iterations=50, priors=priors)
    progress.at(0.55)
    sigmas = calibrating.camera_sigmas(model, request.camera_model, fixed, priors)
    progress.at(0.6)
    model = triangulate(database, model)
    progress.at(0.7)
    calibrating.self_calibrate(model, request.camera_model, fixed, rounds=1, iterations=20, priors=priors)
    progress.at(0.85)
    _drop_weak(model)
    entering = calibrating.observations(model)
    if not len(entering.image):
        raise NotEnoughData(
            f"No tie point of {survey.folder} survives the adjustment: look at the report of strandline:tiepoints."
        )
    sigma = calibrating.robust_sigma(entering.length)
    calibrating.adjust(model, request.camera_model, fixed, robust=max(2 * sigma, 0.1), iterations=30, priors=priors)
    entering = calibrating.observations(model)
    limit = calibrating.FILTER * calibrating.robust_sigma(entering.length)
    calibrating.drop_observations(model, entering, limit)
    model.update_point_3d_errors()
    progress.at(0.95)
    kept = calibrating.observations(model)
    ids = sorted(model.reg_image_ids(), key=lambda i: model.images[i].name)
    photograph, track = calibrating.indexed(entering, ids)
    statistics = micmac_statistics(photograph, track, entering.length, calibrating.among(entering, kept), len(ids))
    names = [network.names[i] for i in ids]
    missing = sorted({p.name for p in survey.photographs} - set(names))
    if missing:
        progress.warn(f"{len(missing)} of {len(survey.photographs)} photographs could not be oriented: {some(missing)}.")
    with whole(survey.folder / MODEL, before=lambda: survey.forget("orient")) as part:
        part.mkdir()
        model.write(part)
    for text in (doubt := far_off(model, priors, fixed)):
        progress.warn(text)
    link = _weak_link(kept, ids, names)
    if link:
        progress.warn(link)
    outcome = Orientation(
        statistics=statistics,
        entering=entering,
        observations=kept,
        image_ids=ids,
        limit=limit,
        missing=missing,
        others=_apart([{m.images[i].name for i in m.reg_image_ids()} for m in models[1:]], set(missing)),
        doubts=[*doubt, *([link] if link else [])],
        priors=priors,
        sigmas=sigmas,
        fixed=fixed,
    )
    write_report(survey, model, outcome, request.output_html_file)
    return {
        "oriented_count": len(names),
        "mtp": statistics.mtp,
        "mtp_percent": statistics.mtp_percent,
        "mmtp": statistics.mmtp,
        "mmtp_percent": statistics.mmtp_percent,
        "mse": statistics.mse,
    }


def _apart(others: list[set[str]], missing: set[str]) -> list[list[str]]:
    """Return the photographs of each smaller model that the block lacks, each named once."""
    result = []
    for names in others:
        left = names & missing
        missing = missing - left
        if len(left) > 1:
            result.append(sorted(left))
    return result


def _focal_priors(photographs: Sequence[Photograph], network: Network, given: Mapping[int, Camera]) -> dict[int, FocalPrior]:
    """Return what is known of focal lengths, by camera id: from another survey, else from the files."""
    told = {p.name: p.focal for p in photographs if p.focal}
    priors = {network.camera_of[i]: told[name] for i, name in network.names.items() if name in told}
    known = {camera_id: FocalPrior(focal, FILE_SIGMA * focal) for camera_id, focal in priors.items()}
    for camera_id, camera in given.items():
        focal = float(camera.brown()[:2].mean())
        known[camera_id] = FocalPrior(focal, CALIBRATION_SIGMA * focal)
    return known


def _drop_weak(model: pycolmap.Reconstruction) -> None:
    """Take out, weakest first, photographs that hardly any point of three rays ties to the block.

    Two-ray points hold a pair together but not its distance from the rest. A block of two photographs has no others.
    """
    while model.num_reg_images() > 2:
        found = calibrating.observations(model)
        point, rays = np.unique(found.point, return_counts=True)
        multi = rays[np.searchsorted(point, found.point)] >= 3
        counts = {image: int((multi & (found.image == image)).sum()) for image in sorted(model.reg_image_ids())}
        weakest = min(counts, key=lambda image: (counts[image], image))
        if counts[weakest] >= _MULTI:
            return
        pycolmap.ObservationManager(model).deregister_frame(model.images[weakest].frame_id)


def _weak_link(found: calibrating.Observations, ids: list[int], names: list[str]) -> str:
    """Return a sentence on the weakest link of the block when it is weak, else nothing."""
    link = weakest_link(*calibrating.indexed(found, ids), len(ids))
    if link is None or link[0] >= _WEAK_LINK:
        return ""
    apart = some(names[i] for i in link[1])
    return (
        f"Only {link[0]} points of three or more rays tie {apart} to the rest of the block: their scale and tilt against it are "
        "uncertain, so give control points on both sides."
    )
