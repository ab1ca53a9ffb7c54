"""The report of ``orient``: the statistics, the cameras, the residuals and the block from above."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pycolmap
from numpy.typing import NDArray

from ..camera import PARAMETERS
from ..report.html import Report, new_figure
from ..survey import Survey
from ..tiepoints.statistics import Statistics, coverage_percent
from .focal import FocalPrior
from .selfcalibration import FILTER, Observations
from .sparse import block_from_model

Array = NDArray[np.float64]
_GRID = 16  # cells of the residual field along the longer side
_DRAWN = 20000  # points of the cloud that are drawn


@dataclass(frozen=True)
class Orientation:
    """What the report tells beside the model.

    ``statistics`` and ``image_ids`` are in the order of the photographs' names; ``limit`` (px) is the final filter's; ``missing``
    are the photographs that are not oriented, ``others`` the smaller models; ``doubts`` are sentences on the block's weakest
    link and on focal lengths; ``sigmas`` of camera parameters and ``priors`` of focal lengths are by camera id.
    """

    statistics: Statistics
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
    _residuals(report, model, outcome)
    _from_above(report, model)
    report.heading("Photographs")
    rows = []
    for image_id, name, p in zip(outcome.image_ids, names, s.photographs, strict=True):
        image = model.images[image_id]
        xy = np.array([image.points2D[i].xy for i in image.get_observation_point2D_idxs()]).reshape(-1, 2)
        percent = 100.0 * p.kept / p.observations if p.observations else None
        multi = 100.0 * p.multi_kept / p.multi if p.multi else None
        covered = coverage_percent(xy, image.camera.width, image.camera.height)
        rows.append((name, p.observations, percent, p.multi, multi, p.rms, covered))
    report.table(["name", "tie points", "kept (%)", "of 3 or more rays", "kept (%)", "residual (px)", "coverage (%)"], rows)
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


def _residuals(report: Report, model: pycolmap.Reconstruction, outcome: Orientation) -> None:
    report.heading("Residuals")
    found = outcome.observations
    figure = new_figure(9.0, 3.2)
    axes = figure.add_subplot()
    axes.hist(found.length, bins=np.linspace(0, outcome.limit, 61).tolist(), color="#c9a45c")
    axes.set_xlabel("length of the residual (px)")
    axes.set_ylabel("observations")
    axes.set_xlim(0, outcome.limit)
    report.figure(figure, "Residuals of all observations kept.")
    largest = max((model.images[i].camera_id for i in outcome.image_ids), key=lambda c: (_photographs(model, c), -c))
    mine = np.isin(found.image, [i for i in outcome.image_ids if model.images[i].camera_id == largest])
    camera = model.cameras[largest]
    xy = np.array(
        [model.images[i].points2D[k].xy for i, k in zip(found.image[mine].tolist(), found.keypoint[mine].tolist(), strict=True)]
    ).reshape(-1, 2)
    field = residual_field(xy, found.residual[mine], camera.width, camera.height)
    if not len(field):
        return
    longest = float(np.hypot(field[:, 2], field[:, 3]).max())
    figure = new_figure(8.0, 8.0 * camera.height / camera.width + 0.6)
    axes = figure.add_subplot()
    arrows = axes.quiver(*field.T, angles="xy", color="#a03020", width=0.002)
    axes.quiverkey(arrows, 0.85, 1.04, max(longest, 1e-3), f"{longest:.2g} px", labelpos="W")
    axes.set_xlim(0, camera.width)
    axes.set_ylim(camera.height, 0)
    axes.set_aspect("equal")
    report.figure(
        figure,
        "Mean residual over the photograph, all photographs of the camera together: arrows without order are noise; a pattern is "
        "distortion that the camera model does not describe.",
    )


def residual_field(xy: Array, residual: Array, width: int, height: int) -> Array:
    """Return x, y and the mean residual's x and y (m, 4) of the cells of a photograph that hold 10 or more observations."""
    cell = max(width, height) / _GRID
    column, row = (xy // cell).astype(np.int64).T
    index = row * _GRID + column
    count = np.bincount(index)
    mean = [np.bincount(index, weights=residual[:, k]) / np.maximum(count, 1) for k in (0, 1)]
    full = np.flatnonzero(count >= 10)
    return np.column_stack([(full % _GRID + 0.5) * cell, (full // _GRID + 0.5) * cell, mean[0][full], mean[1][full]])


def _photographs(model: pycolmap.Reconstruction, camera_id: int) -> int:
    return sum(model.images[i].camera_id == camera_id for i in model.reg_image_ids())


def _from_above(report: Report, model: pycolmap.Reconstruction) -> None:
    """Draw points and photographs as seen against the mean viewing direction."""
    report.heading("The block from above")
    block = block_from_model(model)
    centres = np.array([view.centre for view in block.views])
    down = np.mean([view.rotation[2] for view in block.views], axis=0)
    down /= np.linalg.norm(down)
    across = centres - centres.mean(axis=0)
    across -= np.outer(across @ down, down)
    right = np.linalg.svd(across, full_matrices=False)[2][0]
    axes_of = np.stack([right, np.cross(-down, right), -down])
    points = block.points[:: max(1, len(block.points) // _DRAWN)] @ axes_of.T
    rays = block.rays[:: max(1, len(block.points) // _DRAWN)]
    places = centres @ axes_of.T
    low, high = np.quantile(points[:, 2], [0.02, 0.98])
    left, right_edge = np.quantile(points[:, :2], 0.002, axis=0), np.quantile(points[:, :2], 0.998, axis=0)
    extent = np.maximum(right_edge - left, 1e-6)
    figure = new_figure(9.0, float(np.clip(8.0 * extent[1] / extent[0], 2.0, 9.0)) + 0.8)
    axes = figure.add_subplot()
    shown = axes.scatter(
        points[:, 0], points[:, 1], c=points[:, 2], s=np.where(rays > 2, 2.0, 0.7), cmap="terrain", vmin=low, vmax=high
    )
    figure.colorbar(shown, ax=axes, label="height in the free frame")
    axes.plot(places[:, 0], places[:, 1], "k^", markersize=4)
    axes.set_aspect("equal")
    margin = 0.05 * float(extent.max())
    axes.set_xlim(min(left[0], places[:, 0].min()) - margin, max(right_edge[0], places[:, 0].max()) + margin)
    axes.set_ylim(min(left[1], places[:, 1].min()) - margin, max(right_edge[1], places[:, 1].max()) + margin)
    report.figure(figure, f"{len(block.points)} tie points and the photographs (triangles). Large dots: three or more rays.")
