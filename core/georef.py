"""What ``georeference`` leaves in the survey for the surface: the frame of georeferenced/ and its accuracy."""

from __future__ import annotations

import json
from dataclasses import dataclass, field

from .contract import decode
from .errors import InputError
from .files import write_json
from .frames import LocalFrame
from .survey import Survey

FOLDER = "georeferenced"
_FILE = "georef.json"


@dataclass(frozen=True)
class CalibratedCamera:
    """An adjusted interior orientation: its parameters by COLMAP's names, and their covariance row by row."""

    label: str
    names: tuple[str, ...]
    values: tuple[float, ...]
    covariance: tuple[float, ...]


@dataclass(frozen=True)
class Georef:
    """The local frame of the georeferenced block.

    ``similarity`` holds scale, the rotation's nine numbers row by row, and the shift: ``x_local = s R x_model + t``.
    ``covariance`` (10x10, row by row: shift E N U in m, rotations about E N U in rad, scale, and the height's terms in E^2, E N
    and N^2 in 1/m; about the block's ``pivot`` in the local frame) is the georeferencing's own uncertainty, common to all that is
    measured in the block; empty when not known. ``cameras`` are those of an adjustment, to calibrate another flight.
    ``accuracy`` repeats the step's numbers by name. ``heights`` says what the block's heights stand on: "ellipsoidal",
    "orthometric" or "unknown".
    """

    frame: LocalFrame
    method: str
    similarity: tuple[float, ...]
    pivot: tuple[float, ...] = ()
    covariance: tuple[float, ...] = ()
    accuracy: dict[str, float | None] = field(default_factory=dict)
    heights: str = "unknown"
    cameras: tuple[CalibratedCamera, ...] = ()

    @classmethod
    def read(cls, survey: Survey) -> Georef:
        """Read it from the survey folder.

        Raises
        ------
        InputError
            When it is missing or damaged.
        """
        path = survey.folder / _FILE
        try:
            return decode(cls, json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError) as error:
            raise InputError(f"{path} cannot be read ({error}): run strandline:georeference again.") from error

    def write(self, survey: Survey) -> None:
        """Write it into the survey folder."""
        write_json(survey.folder / _FILE, self)
