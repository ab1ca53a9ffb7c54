"""What is known beforehand of focal lengths, as an observation in the adjustment.

A camera that looks straight down at flat ground hardly tells its focal length from its height, and a gimballed drone over a
beach does just that. What the residuals of thousands of tie points then seem to determine is mostly what they have in common:
left alone, eight photographs of a park gave 26 % too much. So the maker's number enters with its sigma, and tie points count
for no more than the independent statements they are.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import cv2  # noqa: F401 - before pycolmap, whose PNG library otherwise crashes OpenCV's
import numpy as np
import pyceres
import pycolmap

FILE_SIGMA = 0.015  # relative; makers round to two digits, and one lens differs from the next
CALIBRATION_SIGMA = 0.002  # relative; what temperature and a new flight do to a lens
_INDEPENDENT = 100  # per photograph: one for each of 10x10 cells, within which errors of lens model and matching are alike


@dataclass(frozen=True)
class FocalPrior:
    """A focal length and its sigma, in pixels."""

    value: float
    sigma: float


def add_priors(
    adjuster: pycolmap.CeresBundleAdjuster,
    model: pycolmap.Reconstruction,
    priors: Mapping[int, FocalPrior],
    fixed: Collection[int],
    *,
    sigma: float,
) -> list[object]:
    """Add ``priors`` (by camera id) to the adjuster's problem; return what must live until it is solved.

    ``sigma`` (px) is that of an observation per axis. COLMAP counts each observation in pixels and as independent; the prior's
    weight is raised by as much as that overstates them.
    """
    problem, alive = adjuster.problem, []
    for camera_id, prior in sorted(priors.items()):
        images = [image for i in model.reg_image_ids() if (image := model.images[i]).camera_id == camera_id]
        if camera_id in fixed or not images:
            continue
        camera = model.cameras[camera_id]
        overstated = max(1.0, sum(image.num_points3D for image in images) / len(images) / _INDEPENDENT)
        parameters = camera.params
        mean = np.array(parameters)
        covariance = np.eye(len(mean)) * 1e12  # nothing is known beforehand of the other parameters
        for i in camera.focal_length_idxs():
            mean[i] = prior.value
            covariance[i, i] = prior.sigma**2 / (sigma**2 * overstated)
        cost = pyceres.factors.NormalPrior(mean, covariance)
        problem.add_residual_block(cost, None, [parameters])
        alive += [cost, parameters]
    return [problem, *alive]


def far_off(model: pycolmap.Reconstruction, priors: Mapping[int, FocalPrior], fixed: Collection[int]) -> list[str]:
    """Return a sentence on each adjusted focal length that is more than three sigmas from what was known."""
    sentences = []
    used = {model.images[i].camera_id for i in model.reg_image_ids()}
    for camera_id, prior in sorted(priors.items()):
        if camera_id not in used or camera_id in fixed:
            continue
        value = float(np.mean([model.cameras[camera_id].params[i] for i in model.cameras[camera_id].focal_length_idxs()]))
        off = 100 * (value / prior.value - 1)
        if abs(value - prior.value) > 3 * prior.sigma:
            sentences.append(
                f"The focal length of camera {camera_id} came out at {value:.0f} px, {off:+.1f} % off "
                f"the {prior.value:.0f} px known beforehand: check that the photographs are not cropped or resized, or give "
                "CALIBRATION."
            )
    return sentences
