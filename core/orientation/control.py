"""Ground control: points and their marks in photographs, from layers and tables, checked and put in the survey's CRS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj import CRS
from pyproj.exceptions import CRSError

from ..contract import VectorSource
from ..errors import InputError
from ..frames import transformer
from ..survey import Photograph
from ..vector import Layer, read_layer
from .marks import Mark, key_of, listed, marks_of_table, match_marks

Array = NDArray[np.float64]

_ROLES = {"": "control", "control": "control", "gcp": "control", "check": "check", "checkpoint": "check", "check point": "check"}


@dataclass(frozen=True)
class Given:
    """Control as a user gave it.

    ``where`` names its source in messages; ``coordinates`` (n, 3) are easting (or longitude), northing (or latitude) and
    height in ``crs``; ``sigmas`` (n, 2) in plan and height are NaN where nothing was said.
    """

    where: str
    crs: str | None
    names: tuple[str, ...]
    coordinates: Array
    roles: tuple[str, ...] = ()
    sigmas: Array | None = None
    marks: tuple[Mark, ...] = ()


@dataclass(frozen=True)
class GroundPoint:
    """A surveyed point: easting, northing, height (3,) in the survey's CRS; sigmas in metres."""

    name: str
    coordinates: Array
    check: bool
    sigma_h: float
    sigma_v: float
    marks: tuple[Mark, ...] = ()


@dataclass(frozen=True)
class Control:
    """Ground points with the marks that match photographs of the survey; ``notes`` says what was set aside."""

    points: tuple[GroundPoint, ...] = ()
    notes: tuple[str, ...] = ()
    where: str = ""


def given_from_layers(
    points: VectorSource,
    marks: VectorSource | None,
    *,
    name_field: str | None,
    height_field: str | None,
    role_field: str | None = None,
    sigma_h_field: str | None = None,
    sigma_v_field: str | None = None,
) -> Given:
    """Read a point layer and a table of marks (columns gcp, image, x, y).

    Raises
    ------
    InputError
        When a field is missing, a feature is no point, or a name, height or number is missing.
    """
    layer = read_layer(points)
    if not len(layer):
        raise InputError(f"The layer {layer.name} of GCPs is empty: add points to it.")
    if not name_field:
        raise InputError(f"NAME_FIELD is needed to match the points of {layer.name} with their marks: choose the field of names.")
    names = layer.text(name_field)
    if "" in names:
        raise InputError(f"The feature {layer.ids[names.index('')]} of {layer.name} has no name in {name_field}: give it one.")
    coordinates = _coordinates(layer, names, height_field)
    columns = [layer.numbers(f) if f else np.full(len(layer), np.nan) for f in (sigma_h_field, sigma_v_field)]
    roles = tuple(layer.text(role_field)) if role_field else ()
    seen = tuple(marks_of_table(read_layer(marks))) if marks else ()
    return Given(layer.name, layer.crs, tuple(names), coordinates, roles, np.stack(columns, axis=1), seen)


def control_from(
    given: Given,
    crs: str,
    photographs: Sequence[Photograph],
    *,
    sigma_h: float,
    sigma_v: float,
    check: str | None = None,
) -> Control:
    """Check what was given, transform it to ``crs`` and match its marks with points and photographs.

    Raises
    ------
    InputError
        When names repeat, a role or CHECK name is unknown, a sigma is not positive, marks lie outside their photograph or
        repeat, or nothing matches.
    """
    keys = [key_of(name) for name in given.names]
    repeated = sorted({n for n, k in zip(given.names, keys, strict=True) if keys.count(k) > 1})
    if repeated:
        raise InputError(f"Points of {given.where} share a name ({', '.join(repeated)}): give each its own.")
    coordinates = in_metres(given, crs)
    notes = _zero_heights(given)
    roles = [_role(given.where, role) for role in given.roles] or [False] * len(keys)
    for name in filter(None, (n.strip() for n in (check or "").split(","))):
        if key_of(name) not in keys:
            raise InputError(f"The check point {name!r} of CHECK is not in {given.where}; it has {', '.join(given.names)}.")
        roles[keys.index(key_of(name))] = True
    sigmas = np.full((len(keys), 2), np.nan) if given.sigmas is None else given.sigmas
    sigmas = np.where(np.isnan(sigmas), [sigma_h, sigma_v], sigmas)
    for name, pair in zip(given.names, sigmas, strict=True):
        if pair.min() <= 0:
            raise InputError(f"The sigma of {name} in {given.where} is not positive: give a number of metres above 0.")
    matched, unmatched = match_marks(given.where, given.marks, given.names, photographs)
    points = [
        GroundPoint(n, c, r, float(s[0]), float(s[1]), matched[n])
        for n, c, r, s in zip(given.names, coordinates, roles, sigmas, strict=True)
    ]
    return Control(tuple(points), tuple(notes + unmatched), given.where)


def in_metres(given: Given, crs: str) -> Array:
    """Return the points (n, 3) in ``crs``; declared feet become metres, in plan and height.

    Raises
    ------
    InputError
        When there is no CRS, heights are missing or their unit is not declared, or the coordinates do not fit the CRS.
    """
    if not given.crs:
        raise InputError(f"{given.where} has no CRS: set it.")
    try:
        source = CRS.from_user_input(given.crs)
    except CRSError as error:
        raise InputError(f"The CRS {given.crs!r} of {given.where} is not understood: use an EPSG code.") from error
    missing = [n for n, c in zip(given.names, given.coordinates, strict=True) if not np.isfinite(c).all()]
    if missing:
        raise InputError(
            f"{listed(missing)} of {given.where} {_have(missing)} no complete coordinates (with height): fill them in."
        )
    x, y, height = given.coordinates.T
    if source.is_projected and np.abs(x).max() <= 180 and np.abs(y).max() <= 90 and max(np.ptp(x), np.ptp(y)) < 1:
        raise InputError(f"The coordinates of {given.where} look like degrees, but its CRS is {source.name}: set the right CRS.")
    if source.is_geographic and (np.abs(x).max() > 360 or np.abs(y).max() > 90):
        raise InputError(f"The coordinates of {given.where} are no degrees, but its CRS is {source.name}: set the right CRS.")
    axes = source.axis_info
    vertical = axes[2].unit_conversion_factor if len(axes) > 2 else None
    if vertical is None and source.is_projected and abs(axes[0].unit_conversion_factor - 1.0) > 1e-9:
        raise InputError(
            f"{given.where} is in {axes[0].unit_name} ({source.name}) and does not declare the unit of its heights: give it in a "
            "CRS in metres, or in a compound CRS that names the heights' unit."
        )
    plane = CRS(source.sub_crs_list[0]) if source.is_compound else source.to_2d()
    easting, northing = transformer(plane, CRS.from_user_input(crs)).transform(x, y)
    moved = np.stack([easting, northing, height * (vertical or 1.0)], axis=1)
    if not np.isfinite(moved).all():
        raise InputError(f"Points of {given.where} lie outside the area of {CRS.from_user_input(crs).name}: set the right CRS.")
    return moved


def _coordinates(layer: Layer, names: Sequence[str], height_field: str | None) -> Array:
    if layer.geometry is None:
        raise InputError(f"{layer.name} is a table without geometry: give GCPS as a layer of points.")
    coordinates = np.full((len(layer), 3), np.nan)
    for i, shape in enumerate(layer.geometry):
        parts = [] if shape is None else [p for p in shapely.get_parts(shape) if not p.is_empty]
        if len(parts) != 1 or parts[0].geom_type != "Point":
            raise InputError(f"{names[i]} of {layer.name} is not one point: give GCPS as a layer of points.")
        coordinates[i] = parts[0].x, parts[0].y, parts[0].z if parts[0].has_z else np.nan
    if height_field:
        coordinates[:, 2] = layer.numbers(height_field)
    elif np.isnan(coordinates[:, 2]).all():
        raise InputError(f"The points of {layer.name} have no heights: choose HEIGHT_FIELD, or give points with Z.")
    return coordinates


def _zero_heights(given: Given) -> list[str]:
    zero = given.coordinates[:, 2] == 0.0
    if zero.all():
        return [f"All heights of {given.where} are 0: the ground is forced level through them, and heights mean nothing else."]
    names = [n for n, z in zip(given.names, zero, strict=True) if z]
    return [f"{listed(names)} of {given.where} {_have(names)} height 0 unlike the others: is it missing?"] if names else []


def _role(where: str, role: str) -> bool:
    known = _ROLES.get(role.strip().casefold())
    if known is None:
        raise InputError(f"The role {role!r} in {where} is not known: use control or check.")
    return known == "check"


def _have(names: Sequence[str]) -> str:
    return "has" if len(names) == 1 else "have"
