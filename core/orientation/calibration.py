"""The interior orientation of another survey, for cameras of this one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..block import View
from ..camera import Camera
from ..errors import InputError
from ..georef import FOLDER, Georef
from ..survey import Photograph, Survey
from .interior import Interior, calibrated, file_focal, free, held
from .sparse import read_block

MODEL = "model"  # the folder of a survey's sparse model in its free frame


@dataclass(frozen=True)
class Calibration:
    """A camera of another survey, and the covariance (q, q) of its model's parameters where an adjustment gave one."""

    camera: Camera
    covariance: NDArray[np.float64] | None = None


def read_calibration(folder: str, photographs: Sequence[Photograph]) -> Mapping[str, Calibration]:
    """Return the cameras of the survey in ``folder``, by the names of ``photographs`` they fit.

    A camera fits a photograph of the same camera group and size. A survey that was georeferenced by adjustment has calibrated its
    cameras on the ground; else those of its orientation are taken.

    Raises
    ------
    InputError
        When that survey is not oriented, or has no camera for a photograph.
    """
    other = Survey.open(folder)
    other.require("orient")
    group_of = {p.name: (p.camera, p.width, p.height) for p in other.photographs}
    record = other.record("georeference")
    covariances: dict[str, NDArray[np.float64]] = {}
    source = MODEL
    if record is not None and not other.is_stale("georeference"):
        georef = Georef.read(other)
        if georef.method == "adjustment":
            source = FOLDER
            covariances = {c.label: np.reshape(c.covariance, (len(c.names),) * 2) for c in georef.cameras}
    views = read_block(Path(folder) / source).views
    known = {
        group: Calibration(view.camera, covariances.get(f"camera {group[0]}"))
        for view in views
        if (group := group_of.get(view.name))
    }
    missing = sorted({p.camera for p in photographs if (p.camera, p.width, p.height) not in known})
    if missing:
        raise InputError(
            f"CALIBRATION: the survey {folder} has no photograph of the camera {missing[0]} of this survey's size: "
            "choose a survey flown with the same camera and focal length."
        )
    return {p.name: known[p.camera, p.width, p.height] for p in photographs}


def interiors_of(
    survey: Survey, cameras: Mapping[int, Camera], views: Mapping[int, View]
) -> tuple[dict[int, Interior], dict[int, str]]:
    """Return what is known of each camera (by id) before the adjustment, as the orientation knew it, and the cameras' labels."""
    photographs = {p.name: p for p in survey.photographs}
    standing = survey.require("orient").parameters
    use, other = standing.get("calibration_use"), standing.get("calibration")
    # Held cameras stand in the model as they are; only a prior needs the other survey again.
    known = read_calibration(other, survey.photographs) if other and use == "prior" else {}
    interiors, labels = {}, {}
    for key, camera in cameras.items():
        photo = photographs[views[key].name]
        labels[key] = f"camera {photo.camera}" if photo.camera else f"camera {key}"
        if use == "fixed":
            interiors[key] = held()
        elif photo.name in known:
            interiors[key] = calibrated(camera, known[photo.name].camera, known[photo.name].covariance)
        else:
            interiors[key] = free(camera, file_focal(photo.focal))
    return interiors, labels
