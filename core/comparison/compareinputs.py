"""Step ``compareinputs``: JPG, RAW and both enhanced, of the same flight and under the same settings, side by side."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

from ..contract import VectorSource
from ..errors import InputError
from ..files import remove, scratch
from ..orientation import georeference
from ..orientation.inputs import GroundRequest
from ..photographs.enhance import check_window
from ..progress import SILENT, Progress
from ..tiepoints.tiepoints import CACHE, check_limits
from ..vector import check_destination, write_layer
from .cases import Outcome, Settings, run_case
from .comparisonreport import write_report
from .control import check, raw_request
from .exposures import Exposures, find_exposures, survey_crs, write_survey
from .verdict import verdict

_BYTES_PER_PIXEL = 3  # that a survey takes of the disk beside the photographs: an enhanced image, features and matches

# Case, whether it is of the RAW, whether it is enhanced; in the order of Rosu et al. (2015), table 1.
CASES = (("JPG", False, False), ("RAW", True, False), ("CeJPG", False, True), ("CeRAW", True, True))


@dataclass(frozen=True)
class Request(GroundRequest):
    """``marks_raw`` are marks in the RAW. ``method`` is that of ``enhance``.

    ``surveys`` is a folder to keep the surveys of the cases in, and to go on from; ``table`` is a GeoPackage to write.
    """

    jpg: str
    raw: str | None = None
    marks_raw: VectorSource | None = None
    method: Literal["arctan", "micmac", "equalize", "bandpass"] = "bandpass"
    window: int = 101
    max_size: int = 0
    threshold: Literal["noise", "fixed"] = "noise"
    camera_model: Literal["brown", "radial", "simple_radial", "full"] = "brown"
    surveys: str | None = None
    table: str | None = None
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Exposures compared, tie points per photograph of each case, and the largest of them over that of the JPG.

    None where a case was not made or not oriented.
    """

    image_count: int
    mtp_jpg: float | None
    mtp_raw: float | None
    mtp_cejpg: float | None
    mtp_ceraw: float | None
    mtp_ratio: float | None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Compare the cases.

    A case that cannot be oriented is told so and the others go on.

    Raises
    ------
    InputError
        When something cannot be used as given; it is looked at before the work begins.
    NotEnoughData
        When the photographs or the ground control are too few in any case.
    """
    check_limits(0, request.max_size)
    control = _control(request)
    if request.table:
        check_destination(request.table)
    settings = Settings(**{f.name: getattr(request, f.name) for f in fields(Settings)})
    with _place(request) as folder:
        exposures = find_exposures(
            Path(request.jpg), Path(request.raw) if request.raw else None, folder, progress.part(0.0, 0.05)
        )
        notes = [*exposures.notes, *exposures.jpg.notes, *(exposures.raw.notes if exposures.raw else ())]
        for note in notes:
            progress.warn(note)
        outcomes = _run_cases(request, exposures, settings, control, folder, progress.part(0.05, 0.97))
        if request.table:
            write_table(request.table, outcomes)
        write_report(folder / "report" / "compareinputs.html", request.output_html_file, outcomes, settings, notes)
        progress.info(verdict(outcomes))
        result = _result(outcomes)
    progress.at(1.0)
    return result


def write_table(path: str, outcomes: Sequence[Outcome]) -> None:
    """Write a row for each case, in the paper's order."""
    rows = [_row(outcome) for outcome in outcomes]
    write_layer(path, "comparison", None, {key: [row[key] for row in rows] for key in rows[0]}, None)


def _row(outcome: Outcome) -> dict[str, Any]:
    oriented, ground, tied = outcome.oriented, outcome.ground, outcome.tied
    return {
        "case": outcome.case,
        "images": outcome.images,
        "oriented": oriented.oriented_count if oriented else 0,
        "mtp": oriented.mtp if oriented else None,
        "mtp_percent": oriented.mtp_percent if oriented else None,
        "mmtp": oriented.mmtp if oriented else None,
        "mmtp_percent": oriented.mmtp_percent if oriented else None,
        "mse": oriented.mse if oriented else None,
        "plani": ground.plani_control if ground else None,
        "alti": ground.alti_control if ground else None,
        "coverage_percent": outcome.mean_coverage,
        "plani_check": ground.plani_check if ground else None,
        "alti_check": ground.alti_check if ground else None,
        "features": tied.mean_features if tied else None,
        "note": outcome.note or None,
    }


def _control(request: Request) -> georeference.Request | None:
    """Return what georeferencing is to be asked in each case, None without ground control."""
    given = {f.name: getattr(request, f.name) for f in fields(GroundRequest)}
    control = georeference.Request("", method="similarity", **given)  # as in the paper: it changes no shape
    georeference.check_parameters(control)
    if request.gcps is None and request.gcp_file is None:
        if request.marks_raw is not None:
            raise InputError("MARKS_RAW are marks of ground points, but there are none: give GCPS and MARKS, or GCP_FILE.")
        return None
    if request.marks_raw is not None and request.raw is None:
        raise InputError("MARKS_RAW are marks in RAW photographs, but there are none: give RAW, or leave MARKS_RAW empty.")
    return control


@contextmanager
def _place(request: Request) -> Iterator[Path]:
    """Yield the folder for the surveys: the user's, or one that goes at the end."""
    if request.surveys:
        yield Path(request.surveys).absolute()
    else:
        with scratch(Path(tempfile.gettempdir()) / "strandline-comparison") as folder:
            yield folder


def _run_cases(
    request: Request,
    exposures: Exposures,
    settings: Settings,
    control: georeference.Request | None,
    folder: Path,
    progress: Progress,
) -> list[Outcome]:
    cases = [case for case in CASES if exposures.raw or not case[1]]
    _require_room(folder, exposures, len(cases))
    check_window(settings.method, settings.window, exposures.jpg.photographs)
    crs = survey_crs(request.crs, exposures.jpg.photographs)
    sources = {name: exposures.raw if is_raw and exposures.raw else exposures.jpg for name, is_raw, _ in cases}
    surveys = {name: write_survey(folder / f"survey-{name}", source, crs) for name, source in sources.items()}
    controls = {False: control, True: control}
    if control is not None:
        check(control, surveys["JPG"])
        if exposures.raw is not None:
            controls[True] = moved = raw_request(control, request.marks_raw, exposures, folder, crs)
            check(moved, surveys["RAW"])
    outcomes = []
    for i, (name, is_raw, enhanced) in enumerate(cases):
        names = [p.name for p in sources[name].photographs]
        part = progress.part(i / len(cases), (i + 1) / len(cases))
        outcomes.append(run_case(name, surveys[name], names, enhanced, settings, controls[is_raw], part))
        if not request.surveys:
            remove(surveys[name].folder / CACHE)
    return outcomes


def _require_room(folder: Path, exposures: Exposures, count: int) -> None:
    """Refuse to start where the surveys will not fit."""
    pixels = sum(p.width * p.height for p in exposures.jpg.photographs)
    needed = pixels * count * _BYTES_PER_PIXEL
    place = next(f for f in (folder, *folder.parents) if f.exists())
    free = shutil.disk_usage(place).free
    if free < needed:
        raise InputError(
            f"The comparison needs about {needed / 1e9:.0f} GB and {place} has {free / 1e9:.0f} GB left: give SURVEYS, a folder "
            "on a larger disk."
        )


def _result(outcomes: Sequence[Outcome]) -> Result:
    mtp = {o.case: o.oriented.mtp if o.oriented else None for o in outcomes}
    found = [m for m in mtp.values() if m is not None]
    base = mtp["JPG"]
    return Result(
        outcomes[0].images,
        mtp["JPG"],
        mtp.get("RAW"),
        mtp.get("CeJPG"),
        mtp.get("CeRAW"),
        max(found) / base if base else None,
    )
