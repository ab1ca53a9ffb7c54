"""The interior orientation of another survey, for cameras of this one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ..camera import Camera
from ..errors import InputError
from ..survey import Photograph, Survey
from .sparse import read_block

MODEL = "model"  # the folder of a survey's sparse model in its free frame


def read_calibration(folder: str, photographs: Sequence[Photograph]) -> Mapping[str, Camera]:
    """Return the cameras of the oriented survey in ``folder``, by the names of ``photographs`` they fit.

    A camera fits a photograph of the same camera group and size.

    Raises
    ------
    InputError
        When that survey is not oriented, or has no camera for a photograph.
    """
    other = Survey.open(folder)
    other.require("orient")
    group_of = {p.name: (p.camera, p.width, p.height) for p in other.photographs}
    known = {group_of[view.name]: view.camera for view in read_block(Path(folder) / MODEL).views if view.name in group_of}
    missing = sorted({p.camera for p in photographs if (p.camera, p.width, p.height) not in known})
    if missing:
        raise InputError(
            f"CALIBRATION: the survey {folder} has no photograph of the camera {missing[0]} of this survey's size: "
            "choose a survey flown with the same camera and focal length."
        )
    return {p.name: known[p.camera, p.width, p.height] for p in photographs}
