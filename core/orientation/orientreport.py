"""The report of ``orient``: the statistics, the cameras, the residuals, and what the pictures of the block show."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pycolmap
from numpy.typing import NDArray

from ..camera import PARAMETERS
from ..report.html import Report
from ..survey import Survey
from ..tiepoints.statistics import CELLS, Statistics, cell_counts, ray_histograms, rays_per_point
from . import orientpictures as pictures
from .focal import FocalPrior
from .selfcalibration import FILTER, Observations, indexed

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Orientation:
    """What the report tells beside the model.

    ``statistics`` and ``image_ids`` are in the order of the photographs' names; ``entering`` are the observations of the final
    adjustment, ``observations`` those its filter kept, with their residuals; ``limit`` (px) is the final filter's; ``missing``
    are the photographs that are not oriented, ``others`` the smaller models; ``doubts`` are sentences on the block's weakest
    link and on focal lengths; ``sigmas`` of camera parameters and ``priors`` of focal lengths are by camera id.
    """

    statistics: Statistics
    entering: Observations
    observations: Observations
    image_ids: Sequence[int]
    limit: float
    missing: Sequence[str]
    others: Sequence[Sequence[str]]
    doubts: Sequence[str]
    sigmas: Mapping[int, Array]
    fixed: Collection[int]
    priors: Mapping[int, FocalPrior]


def write_report(survey: Survey, model: pycolmap.Reconstruction, outcome: Orientation, copy: str | None) -> None:
    """Write the report."""
    s, count = outcome.statistics, len(outcome.image_ids)
    report = Report(
        "Orientation",
        f"{count} of {len(survey.photographs)} photographs are oriented in one block, with {s.mtp:.0f} tie points each on "
        f"average (MTP), of which {_percent(s.mtp_percent)} are kept; {s.mmtp:.0f} are seen in three or more photographs (MMTP). "
        f"The residual is {s.mse or 0.0:.2f} pixels (MSE).",
    )
    if outcome.missing:
        report.warning(f"Not oriented: {', '.join(outcome.missing)}. They share too few tie points with the block.")
    for names in outcome.others:
        report.warning(f"These photographs fit each other but not the block: {', '.join(names)}.")
    names = [model.images[i].name for i in outcome.image_ids]
    for doubt in outcome.doubts:
        report.warning(doubt)
    report.text(
        "The frame is free: its position, direction and scale mean nothing until the block is georeferenced. Residuals are in "
        f"pixels of the stored photographs; the final filter drops what is beyond {outcome.limit:.2f} pixels "
        f"({FILTER:.0f} robust sigmas)."
    )
    _cameras(report, model, outcome)
    seen = pictures.sightings(model, outcome.image_ids, outcome.entering, outcome.observations)
    cells = np.stack([cell_counts(one.xy[one.kept], one.width, one.height) for one in seen])
    photograph, track = indexed(outcome.observations, outcome.image_ids)
    per_point, rays = rays_per_point(photograph, track), ray_histograms(photograph, track, count)
    kept = np.bincount(photograph, minlength=count)
    mean_rays = np.bincount(photograph, weights=per_point[track], minlength=count) / np.maximum(kept, 1)
    report.heading("Residuals")
    pictures.draw_residuals(report, model, outcome.image_ids, outcome.observations, seen, outcome.limit)
    report.heading("Rays")
    pictures.draw_rays(report, per_point, rays)
    report.heading("The block")
    pictures.draw_block(report, model)
    pictures.draw_barest(report, survey, seen, cells)
    report.heading("Photographs")
    rows = []
    for name, p, of_photograph, mean in zip(names, s.photographs, cells, mean_rays.tolist(), strict=True):
        percent = 100.0 * p.kept / p.observations if p.observations else None
        multi = 100.0 * p.multi_kept / p.multi if p.multi else None
        covered = 100.0 * np.count_nonzero(of_photograph) / CELLS**2
        rows.append((name, p.observations, percent, p.multi, multi, p.rms, mean, covered))
    report.table(
        ["name", "tie points", "kept (%)", "of 3 or more rays", "kept (%)", "residual (px)", "mean rays", "coverage (%)"], rows
    )
    report.text(
        f"Rays and coverage are those of the points kept; coverage is the share of {CELLS} x {CELLS} cells with one or more."
    )
    report.save(survey.report_path("orient"), copy)


def _percent(value: float | None) -> str:
    return "none" if value is None else f"{value:.1f} %"


def _cameras(report: Report, model: pycolmap.Reconstruction, outcome: Orientation) -> None:
    report.heading("Interior orientation")
    used = sorted({model.images[i].camera_id for i in outcome.image_ids})
    for camera_id in used:
        camera = model.cameras[camera_id]
        count = sum(model.images[i].camera_id == camera_id for i in outcome.image_ids)
        state = "held at the given calibration" if camera_id in outcome.fixed else "adjusted"
        report.text(f"Camera {camera_id} ({camera.width} x {camera.height}, {count} photographs), {camera.model.name}, {state}.")
        if camera_id in outcome.priors and camera_id not in outcome.fixed:
            prior = outcome.priors[camera_id]
            report.text(f"Its focal length entered the adjustment as {prior.value:.1f} px with a sigma of {prior.sigma:.1f} px.")
        sigmas = outcome.sigmas.get(camera_id)
        names = PARAMETERS[camera.model.name]
        report.table(
            ["parameter", "value", "sigma"],
            [
                (name, f"{camera.params[i]:.6g}", None if sigmas is None or sigmas[i] == 0 else f"{sigmas[i]:.2g}")
                for i, name in enumerate(names)
            ],
        )
    report.text(
        "Focal lengths and principal point in pixels; a dash is a parameter that was held. The sigmas are formal, from the "
        "thinned tie points of the first adjustment: they do not know of what all photographs have in common, such as a dome "
        "that focal length and radial distortion make together."
    )
