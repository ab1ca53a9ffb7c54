"""What ``georeference`` leaves in the survey's folder: the georeferenced model, and georef.json."""

from __future__ import annotations

import cv2  # noqa: F401 - before pycolmap, whose PNG library otherwise crashes OpenCV's
import pycolmap

from ..files import whole
from ..georef import FOLDER, CalibratedCamera, Georef
from ..survey import Survey
from .assembly import write_back
from .solution import Solution

_STEP = "georeference"


def write_georeferenced(model: pycolmap.Reconstruction, solution: Solution, survey: Survey) -> None:
    """Write ``model``, brought to the solution, as the survey's georeferenced model; ids stay. ``model`` is changed in place."""
    similarity = solution.similarity
    turn = pycolmap.Rotation3d(similarity.rotation)
    model.transform(pycolmap.Sim3d(similarity.scale, turn, similarity.shift))
    write_back(model, solution.block, solution.kept)
    # A kill from there to finish() leaves a survey that is not georeferenced, never one whose two files disagree.
    with whole(survey.folder / FOLDER, before=lambda: survey.forget(_STEP)) as part:
        part.mkdir()
        model.write(part)


def georef_of(solution: Solution, heights: str, accuracy: dict[str, float | None]) -> Georef:
    """Return what the surface and other surveys need of a solution; ``heights`` says what they stand on."""
    similarity = solution.similarity
    return Georef(
        solution.frame,
        solution.method,
        (similarity.scale, *map(float, similarity.rotation.ravel()), *map(float, similarity.shift)),
        tuple(map(float, solution.common.pivot)),
        tuple(map(float, solution.common.covariance.ravel())),
        accuracy,
        heights,
        tuple(
            CalibratedCamera(c.label, c.names, tuple(map(float, c.values)), tuple(map(float, c.covariance.ravel())))
            for c in solution.cameras
            if c.names
        ),
    )


def complete(survey: Survey) -> bool:
    """Tell whether all that the step leaves is there."""
    folder = survey.folder
    return (folder / FOLDER).is_dir() and (folder / "georef.json").is_file() and survey.report_path(_STEP).is_file()
