"""The same ground control for all cases: marks of the JPG brought to the RAW, and all that can be refused before the work."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..block import Block, View
from ..contract import VectorSource
from ..errors import InputError, NotEnoughData
from ..orientation import georeference
from ..orientation.control import Given
from ..orientation.inputs import Inputs, gather, read_given
from ..orientation.marks import Mark, marks_of_table, match_photograph
from ..survey import Survey
from ..tiepoints.database import provisional_camera
from ..vector import read_layer, write_layer
from .exposures import Exposures
from .frames import raw_offsets

_FAR = 1000.0  # m in plan between ground points and photographs; a wrong CRS


def raw_request(
    request: georeference.Request,
    marks_raw: VectorSource | None,
    exposures: Exposures,
    folder: Path,
    crs: str | None = None,
) -> georeference.Request:
    """Return the request for the RAW cases, with the JPG's marks moved to the RAW's frame unless ``marks_raw`` are given.

    Layers that it needs are written into ``folder``. ``crs`` is the survey's, which ground points have whose format names none.

    Raises
    ------
    InputError
        When what was given cannot be read, or it is not known where the JPG's frame lies in the RAW's.
    """
    if marks_raw is not None and request.gcps is not None:
        return replace(request, marks=marks_raw)
    given = read_given(request)
    if given is None:
        return request
    borrowed = request.crs or crs
    if borrowed:
        given = given.in_crs_of(borrowed)
    marks = list(marks_of_table(read_layer(marks_raw))) if marks_raw else _moved(given.marks, exposures)
    points, table = folder / "points.gpkg", folder / "marks.gpkg"
    _write(given, marks, points, table)
    return replace(
        request,
        gcps=VectorSource(str(points), points.stem, given.crs),
        marks=VectorSource(str(table), table.stem),
        gcp_file=None,
        name_field="name",
        height_field=None,
        role_field="role" if given.roles else None,
        sigma_h_field="sigma_h",
        sigma_v_field="sigma_v",
    )


def check(request: georeference.Request, survey: Survey) -> None:
    """Refuse control that would fail only after the photographs have been oriented.

    Raises
    ------
    InputError
        When something cannot be read or does not fit together.
    NotEnoughData
        When points and marks cannot place the block, however well it is oriented.
    """
    georeference.check_parameters(request)
    # All photographs as if they were oriented: what is read and matched does not ask where they are.
    views = [View(p.name, provisional_camera(p), np.eye(3), np.zeros(3)) for p in survey.photographs]
    nothing = np.zeros(0, np.int32)
    block = Block(tuple(views), np.zeros((0, 3)), np.zeros(0), nothing, nothing, nothing)
    inputs = gather(request, None, survey, read_given(request), block)
    _enough(inputs)
    _near(inputs)


def _enough(inputs: Inputs) -> None:
    control = [p for p in inputs.control.points if not p.check]
    seen = [p for p in control if len({m.image for m in p.marks}) >= 2]
    if control and not seen:
        raise NotEnoughData(
            f"None of the {len(control)} control points of {inputs.control.where} is marked in two of the photographs that are "
            "compared: mark them in more photographs."
        )
    if len(seen) + len(inputs.gnss) < 3:
        raise NotEnoughData(
            f"{len(seen)} control points marked in two photographs and {len(inputs.gnss)} GNSS positions do not place the block: "
            "three are needed."
        )


def _near(inputs: Inputs) -> None:
    places = np.array([p.coordinates for p in inputs.control.points if p.marks], float).reshape(-1, 3)
    if not len(places) or not len(inputs.gnss):
        return
    apart = places[:, None, :2] - inputs.gnss.coordinates[None, :, :2]
    nearest = float(np.hypot(apart[..., 0], apart[..., 1]).min())
    if nearest > _FAR:
        raise InputError(
            f"The ground points of {inputs.control.where} lie {nearest / 1000:.0f} km from the photographs: set their right CRS, "
            "or USE_GNSS to false if it is the photographs' positions that are wrong."
        )


def _moved(marks: Sequence[Mark], exposures: Exposures) -> list[Mark]:
    """Return the marks in the RAW of each exposure; those in photographs that are not compared are left out."""
    if exposures.raw is None:
        return list(marks)
    offsets = raw_offsets(exposures)
    raw_of = {a.name: b.name for a, b in zip(exposures.jpg.photographs, exposures.raw.photographs, strict=True)}
    moved = []
    for mark in marks:
        name = match_photograph(mark.image, exposures.jpg.photographs)
        if name is not None:
            x, y = offsets[name]
            moved.append(Mark(mark.gcp, raw_of[name], mark.x + x, mark.y + y))
    return moved


def _write(given: Given, marks: Sequence[Mark], points: Path, table: Path) -> None:
    sigmas = np.full((len(given.names), 2), np.nan) if given.sigmas is None else given.sigmas
    fields: dict[str, Any] = {"name": list(given.names), "sigma_h": sigmas[:, 0], "sigma_v": sigmas[:, 1]}
    if given.roles:
        fields["role"] = list(given.roles)
    write_layer(str(points), points.stem, given.crs, fields, list(shapely.points(given.coordinates)), "Point Z")
    columns = {key: [getattr(m, key) for m in marks] for key in ("gcp", "image", "x", "y")}
    write_layer(str(table), table.stem, None, columns, None)
