"""What the report of ``orient`` draws: residuals, rays, the block, and the tie points on the barest photograph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2  # noqa: F401 - before pycolmap, whose PNG library otherwise crashes OpenCV's
import numpy as np
import pycolmap
from numpy.typing import NDArray

from ..errors import InputError
from ..report.cloud import Cloud, cloud_from_above, cloud_in_perspective, levelled
from ..report.drawing import draw_tie_points
from ..report.html import Report, new_figure
from ..survey import Survey
from ..tiepoints.statistics import MOST_RAYS
from ..tiepoints.tiereport import COVERAGES, draw_coverages, tones
from .selfcalibration import Observations, among

Array = NDArray[np.float64]
_GRID = 16  # cells of the residual field along the longer side
_UNIT = "unit of the free frame"
_COLOURS = ("#d7301f", "#fdae61", "#74add1", "#313695")  # 2, 3, 4, 5 and more rays, as in the cloud


@dataclass(frozen=True)
class Sightings:
    """The observations of one photograph that entered the final adjustment: ``xy`` (n, 2) in pixels, and ``kept`` (n,)."""

    name: str
    width: int
    height: int
    camera: int
    xy: Array
    kept: NDArray[np.bool_]


def sightings(
    model: pycolmap.Reconstruction, image_ids: Sequence[int], entering: Observations, kept: Observations
) -> list[Sightings]:
    """Return the sightings of each photograph, in the order of ``image_ids``."""
    left, result = among(entering, kept), []
    for image_id in image_ids:
        image, mine = model.images[image_id], _part(entering, image_id)
        points = image.points2D
        xy = np.array([points[k].xy for k in entering.keypoint[mine].tolist()], float).reshape(-1, 2)
        result.append(Sightings(image.name, image.camera.width, image.camera.height, image.camera_id, xy, left[mine]))
    return result


def _part(found: Observations, image_id: int) -> slice:
    """Return where the observations of one photograph stand, which are in the order of the ids."""
    return slice(*np.searchsorted(found.image, [image_id, image_id + 1]).tolist())


def draw_residuals(
    report: Report,
    model: pycolmap.Reconstruction,
    image_ids: Sequence[int],
    found: Observations,
    seen: Sequence[Sightings],
    limit: float,
) -> None:
    """Draw the lengths of all residuals and, for the camera of most photographs, their mean over the image plane."""
    figure = new_figure(9.0, 3.2)
    axes = figure.add_subplot()
    axes.hist(found.length, bins=np.linspace(0, limit, 61).tolist(), color="#c9a45c")
    axes.set_xlabel("length of the residual (px)")
    axes.set_ylabel("observations")
    axes.set_xlim(0, limit)
    report.figure(figure, "Residuals of all observations kept.")
    cameras = [s.camera for s in seen]
    largest = max(sorted(set(cameras)), key=cameras.count)
    camera = model.cameras[largest]
    mine = [(image_id, s) for image_id, s in zip(image_ids, seen, strict=True) if s.camera == largest]
    xy = np.concatenate([s.xy[s.kept] for _, s in mine])
    residual = np.concatenate([found.residual[_part(found, image_id)] for image_id, _ in mine])
    field = residual_field(xy, residual, camera.width, camera.height)
    if not len(field):
        return
    lengths, chance = np.hypot(field[:, 2], field[:, 3]), field[:, 4]
    longest = float(lengths.max())
    figure = new_figure(8.0, 8.0 * camera.height / camera.width + 0.6)
    axes = figure.add_subplot()
    reach = max(longest, 1e-6) / (1.4 * max(camera.width, camera.height) / _GRID)  # the longest arrow crosses a cell and a half
    axes.quiver(*field.T[:4], angles="xy", scale_units="xy", scale=reach, color="#a03020", width=0.002)
    axes.set_title(f"the longest arrow is {longest:.2g} px", fontsize=9)
    axes.set_xlim(0, camera.width)
    axes.set_ylim(camera.height, 0)
    axes.set_aspect("equal")
    report.figure(
        figure,
        "Mean residual over the photograph, all photographs of the camera together: arrows without order are noise; a pattern is "
        f"distortion that the camera model does not describe. The arrows are {_rms(lengths):.2g} px long (root mean square); "
        f"noise alone would make them {_rms(chance):.2g} px.",
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def residual_field(xy: Array, residual: Array, width: int, height: int) -> Array:
    """Return the mean residual in the cells of a photograph that hold 10 or more observations.

    The columns (m, 5) are the cell's x and y, the mean residual's x and y, and the length that a mean without any pattern is
    expected to have: the root of the sum of both variances over the number of observations.
    """
    cell = max(width, height) / _GRID
    column, row = np.minimum(xy // cell, _GRID - 1).astype(np.int64).T
    index = row * _GRID + column
    count = np.bincount(index)
    full = np.flatnonzero(count >= 10)
    n = count[full]
    mean = np.stack([np.bincount(index, weights=r)[full] / n for r in residual.T], axis=1)
    square = np.bincount(index, weights=(residual**2).sum(axis=1))[full] / n
    chance = np.sqrt(np.maximum(square - (mean**2).sum(axis=1), 0.0) / (n - 1))
    return np.column_stack([(full % _GRID + 0.5) * cell, (full // _GRID + 0.5) * cell, mean, chance])


def draw_rays(report: Report, per_point: NDArray[np.int64], rays: NDArray[np.int64]) -> None:
    """Draw how many points have how many rays, in the block and in each photograph.

    See ``rays_per_point`` and ``ray_histograms`` of the statistics.
    """
    points = np.bincount(np.minimum(per_point, MOST_RAYS), minlength=MOST_RAYS + 1)[2:]
    figure = new_figure(9.4, 3.4)
    left, right = figure.subplots(1, 2)
    numbers = np.arange(2, MOST_RAYS + 1)
    bars = left.bar(numbers, points, color=[_COLOURS[min(n, 5) - 2] for n in numbers.tolist()])
    left.bar_label(bars, [f"{100 * n / max(1, points.sum()):.0f} %" for n in points.tolist()], fontsize=8)
    left.set_xticks(numbers.tolist(), [*map(str, numbers[:-1].tolist()), f"{MOST_RAYS}+"])
    left.set(xlabel="rays of a point", ylabel="points", ylim=(0, 1.12 * max(1, int(points.max()))))
    kinds = np.column_stack([rays[:, 2], rays[:, 3], rays[:, 4], rays[:, 5:].sum(axis=1)])
    # Twice the last photograph, so that its step is drawn to its end.
    upper = np.cumsum(np.vstack([kinds, kinds[-1:]]), axis=1)
    places = np.arange(len(upper)) + 0.5
    names = ("2 rays", "3", "4", "5 and more")
    for k in range(4):
        lower = upper[:, k - 1] if k else np.zeros(len(upper))
        right.fill_between(places, lower, upper[:, k], step="post", color=_COLOURS[k], label=names[k], linewidth=0)
    right.set(xlabel="photograph, in the order of the table below", ylabel="points", xlim=(0.5, len(rays) + 0.5))
    right.set_ylim(0, 1.25 * max(1, int(upper.max())))
    right.legend(fontsize=7, ncols=4, loc="upper center")
    figure.tight_layout()
    report.figure(
        figure,
        "Rays of the points kept, in the block and in each photograph. "
        "Two rays cannot show a match that is wrong along the epipolar line.",
    )


def draw_block(report: Report, model: pycolmap.Reconstruction) -> None:
    """Draw the cloud of tie points and the photographs from above and in perspective."""
    points = list(model.points3D.values())
    xyz = np.array([p.xyz for p in points], float).reshape(-1, 3)
    images = [model.images[i] for i in sorted(model.reg_image_ids())]
    poses = [image.cam_from_world() for image in images]
    turns = np.array([pose.rotation.matrix() for pose in poses])
    shifts = np.array([pose.translation for pose in poses], float)
    centres = -np.einsum("nji,nj->ni", turns, shifts)
    xyz, centres = levelled(xyz, centres, turns[:, 2])
    cloud = {"": Cloud(xyz, np.array([p.track.length() for p in points], np.int64), centres)}
    told = "Triangles: the photographs."
    report.figure(cloud_in_perspective(cloud, unit=_UNIT), f"The tie points in perspective. {told}", dense=True)
    report.figure(cloud_from_above(cloud, unit=_UNIT), f"From above, against the mean viewing direction. {told}", dense=True)
    report.figure(cloud_from_above(cloud, unit=_UNIT, colour="rays"), f"From above, by rays. {told}", dense=True)


def draw_barest(report: Report, survey: Survey, seen: Sequence[Sightings], cells: NDArray[np.int64]) -> None:
    """Draw the tie points on the photograph that keeps the fewest, and the coverage of the least covered ones."""
    by_name = {p.name: p for p in survey.photographs}
    barest = min(seen, key=lambda s: (int(s.kept.sum()), s.name))
    kept = int(barest.kept.sum())
    order = np.lexsort((cells.sum(axis=(1, 2)), np.count_nonzero(cells, axis=(1, 2))))[:COVERAGES].tolist()
    report.heading(f"The barest photograph: {barest.name}")
    try:
        picture = draw_tie_points(tones(survey, by_name[barest.name]), barest.xy, barest.kept)
        report.picture(
            picture, f"Tie points kept (blue, {kept}) and dropped by the final filter (orange, {len(barest.xy) - kept})."
        )
        draw_coverages(report, survey, [by_name[seen[i].name] for i in order], cells[order], "Tie points kept")
    except InputError as error:  # orientation itself does without the photographs
        report.text(f"No picture: {error}")
