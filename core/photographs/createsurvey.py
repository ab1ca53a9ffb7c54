"""Step ``createsurvey``: list the photographs of a flight with what their metadata tell."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pyproj import CRS
from shapely import Point

from ..contract import VectorSource
from ..errors import InputError
from ..files import PART, digest
from ..frames import projected_crs
from ..parallel import run_calls
from ..progress import SILENT, Progress
from ..survey import Photograph, Survey, held
from ..vector import write_layer
from .inspection import Inspection, inspect
from .listing import list_photographs, some
from .positions import Table, distance_from_exif, median_place, read_positions, utm_zone, within_area
from .surveyreport import write_report

_MANY = 60  # photographs from which starting worker processes pays
_FAR_FROM_EXIF = 1000.0  # m
_HEIGHTS_DIFFER = 1.0  # m between EXIF and XMP


@dataclass(frozen=True)
class Request:
    """``photos`` is a GeoPackage to write (layer "photos": name, height, time, sigma_h, sigma_v, camera; points in EPSG:4326)."""

    images: str
    output: str
    filter: str | None = None
    positions: VectorSource | None = None
    positions_crs: str | None = None
    crs: str | None = None
    photos: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """The survey folder and what was found."""

    output: str
    image_count: int
    position_count: int


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Make the survey folder, or bring one up to date with its photographs.

    Steps that were done in it before stay valid when nothing that they use has changed: the photographs' content,
    names and metadata, the positions, the CRS. Where the photographs lie does not count.

    Raises
    ------
    InputError
        When something cannot be used; the survey folder is then as it was.
    """
    images, output = Path(request.images), Path(request.output)
    _check_output(output)
    crs = projected_crs(request.crs) if request.crs else None
    names = list_photographs(images, (request.filter or "").strip() or None, output)
    table = read_positions(request.positions, request.positions_crs, names) if request.positions else None
    inspections = inspect_all(images, names, progress.part(0.0, 0.9))
    photographs = [i.photograph for i in inspections]
    notes = notes_on_inspections(inspections)
    if table:
        notes += _notes_on_table(table, photographs)
        photographs = [replace(p, position=table.positions.get(p.name)) for p in photographs]
    positions = [p.position for p in photographs if p.position]
    if positions:
        notes += _notes_on_positions(photographs, crs)
        crs = crs or utm_zone(*median_place(positions))
    else:
        notes.append("No photograph has a position: georeferencing will need ground control points.")
    for note in notes:
        progress.warn(note)
    for camera, count in Counter(p.camera for p in photographs).most_common():
        progress.info(f"{count} photographs: {camera}.")

    definition = crs.to_wkt() if crs else None
    with held(output, "createsurvey", make=True):
        if positions and request.photos:
            _write_photos(request.photos, photographs)
        survey = Survey.create(output, images, definition, photographs)
        write_report(survey, notes, request.output_html_file)
        result = Result(str(output), len(photographs), len(positions))
        survey.finish(
            "createsurvey",
            digest(survey.photographs, definition),
            built_on=(),
            parameters={"filter": request.filter, "positions": request.positions, "positions_crs": request.positions_crs},
            result={"image_count": result.image_count, "position_count": result.position_count},
        )
    progress.at(1.0)
    return result


def _check_output(output: Path) -> None:
    """Make sure that ``output`` is a survey that nobody else is using, or is free to become one.

    Raises
    ------
    InputError
        When it is not.
    """
    if output.exists() and not output.is_dir():
        raise InputError(f"OUTPUT is a file: {output}; give a folder.")
    if not output.is_dir():
        return
    if (output / "survey.json").is_file():
        with held(output, "createsurvey"):
            Survey.open(output)
        return
    # What a run that was killed before its end leaves behind does not make the folder another's.
    others = [p.name for p in output.iterdir() if p.name not in ("survey.lock", "report") and not p.name.startswith(PART)]
    if others:
        raise InputError(f"OUTPUT is not empty and no survey: {output} holds {some(sorted(others))}; give a new folder.")


def inspect_all(images: Path, names: list[str], progress: Progress) -> list[Inspection]:
    """Return what each photograph tells, in the order of ``names``; all that are broken are named in one sentence."""
    calls = ((str(images / name), name) for name in names)
    workers = 0 if len(names) >= _MANY else 1
    found = dict(run_calls(inspect, calls, workers=workers, progress=progress, total=len(names)))
    inspections, broken = [], []
    for i, name in enumerate(names):
        inspection = found[i]
        if isinstance(inspection, str):
            broken.append(f"{name} ({inspection})")
        else:
            inspections.append(inspection)
    if broken:
        raise InputError(
            f"{len(broken)} of {len(names)} photographs cannot be read: {some(broken)}; copy them again from the camera, "
            "or take them out of the folder."
        )
    return inspections


def notes_on_inspections(inspections: list[Inspection]) -> list[str]:
    """Return what the user should know about the photographs, a sentence each."""
    photographs = [i.photograph for i in inspections]
    notes = []
    twins = defaultdict(list)
    for p in photographs:
        twins[p.digest].append(p.name)
    same = [" = ".join(n[:3]) + (" ..." if len(n) > 3 else "") for n in twins.values() if len(n) > 1]
    if same:
        notes.append(f"The same photograph is there more than once: {some(same)}.")
    if len(photographs) == 1:
        notes.append("There is one photograph: a surface needs at least two that overlap.")
    unread = [f"{i.photograph.name}: {'; '.join(i.problems)}" for i in inspections if i.problems]
    if unread:
        notes.append(f"The metadata of {len(unread)} photographs could not be read in full: {some(unread)}.")
    differ = [i.photograph.name for i in inspections if i.heights_differ and i.heights_differ > _HEIGHTS_DIFFER]
    if differ:
        notes.append(
            f"EXIF and XMP tell heights more than {_HEIGHTS_DIFFER:g} m apart in {len(differ)} photographs ({some(differ)}): "
            "XMP's is used where it has RTK sigmas, else EXIF's."
        )
    return notes


def _notes_on_table(table: Table, photographs: list[Photograph]) -> list[str]:
    """Return what the user should know about the POSITIONS table; ``photographs`` have the positions of EXIF."""
    notes = []
    distance = distance_from_exif(table, [p.position for p in photographs if p.position])
    if distance is not None and distance > _FAR_FROM_EXIF:
        notes.append(f"POSITIONS lie {distance / 1000:.0f} km from the positions in EXIF: check POSITIONS_CRS.")
    if table.unmatched:
        notes.append(f"POSITIONS has {len(table.unmatched)} rows without a photograph: {some(table.unmatched)}.")
    return notes


def _notes_on_positions(photographs: list[Photograph], crs: CRS | None) -> list[str]:
    notes = []
    missing = [p.name for p in photographs if p.position is None]
    if missing:
        notes.append(f"{len(missing)} of {len(photographs)} photographs have no position: {some(missing)}.")
    longitude, latitude = median_place([p.position for p in photographs if p.position])
    if crs and not within_area(crs, np.array([longitude]), np.array([latitude])).all():
        notes.append(f"The photographs lie outside the area of {crs.name}: choose another CRS, unless that is meant.")
    return notes


def _write_photos(path: str, photographs: list[Photograph]) -> None:
    placed = [(p, p.position) for p in photographs if p.position is not None]
    fields: dict[str, list[Any]] = {
        "name": [p.name for p, _ in placed],
        "height": [q.height for _, q in placed],
        "time": [p.time for p, _ in placed],
        "sigma_h": [q.sigma_h for _, q in placed],
        "sigma_v": [q.sigma_v for _, q in placed],
        "camera": [p.camera for p, _ in placed],
    }
    write_layer(path, "photos", "EPSG:4326", fields, [Point(q.longitude, q.latitude) for _, q in placed])
