"""Ground control: points and their marks in photographs, from layers and tables, checked and put in the survey's CRS."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj import CRS
from pyproj.exceptions import CRSError

from ..contract import VectorSource
from ..errors import InputError
from ..frames import horizontal, transformer
from ..survey import Photograph
from ..vector import Layer, read_layer
from .marks import Mark, key_of, listed, marks_of_table, match_marks, match_names, predictions_among

Array = NDArray[np.float64]

# Without case, accents, blanks and signs.
_CONTROL = ("", "control", "controlpoint", "gcp", "groundcontrolpoint", "appui", "pointdappui", "passpunkt", "apoyo", "apoio")
_CHECK = ("check", "checkpoint", "icp", "checkpoints", "verification", "pointdeverification", "validation", "kontrollpunkt")


@dataclass(frozen=True)
class Given:
    """Control as a user gave it.

    ``where`` names its source in messages; ``coordinates`` (n, 3) are easting (or longitude), northing (or latitude) and
    height in ``crs``; ``sigmas`` (n, 2) in plan and height are NaN where nothing was said. ``borrows_crs`` tells that the format
    names no CRS, so that the survey's is meant; ``notes`` what its reader has to say.
    """

    where: str
    crs: str | None
    names: tuple[str, ...]
    coordinates: Array
    roles: tuple[str, ...] = ()
    sigmas: Array | None = None
    marks: tuple[Mark, ...] = ()
    notes: tuple[str, ...] = ()
    borrows_crs: bool = False

    def in_crs_of(self, crs: str) -> Given:
        """Return the same in ``crs`` where the format names none."""
        if self.crs is not None or not self.borrows_crs:
            return self
        note = f"{self.where} names no CRS: its coordinates are taken as those of {CRS.from_user_input(crs).name}."
        return replace(self, crs=crs, notes=(*self.notes, note))


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
    table = read_layer(marks) if marks else None
    seen = tuple(marks_of_table(table)) if table is not None else ()
    notes = tuple(predictions_among(table)) if table is not None else ()
    return Given(layer.name, layer.crs, tuple(names), coordinates, roles, np.stack(columns, axis=1), seen, notes=notes)


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
    notes = [*given.notes, *_zero_heights(given)]
    roles = [_role(given.where, role) for role in given.roles] or [False] * len(keys)
    checks = [n.strip() for n in (check or "").replace(";", ",").split(",") if n.strip()]
    meant = match_names(checks, given.names)
    unknown = [repr(n) for n in checks if n not in meant]
    if unknown:
        raise InputError(
            f"The check point{'s' * (len(unknown) > 1)} {listed(unknown)} of CHECK {'is' if len(unknown) == 1 else 'are'} not in "
            f"{given.where}: correct CHECK; the points are {listed(given.names, 20)}."
        )
    for name in meant.values():
        roles[given.names.index(name)] = True
    sigmas = np.full((len(keys), 2), np.nan) if given.sigmas is None else given.sigmas
    sigmas = np.where(np.isnan(sigmas), [sigma_h, sigma_v], sigmas)
    for name, pair in zip(given.names, sigmas, strict=True):
        if not (pair.min() > 0 and np.isfinite(pair).all()):
            raise InputError(
                f"The sigma of {name} in {given.where} is not above 0: give metres, or leave it empty to use SIGMA_H and SIGMA_V."
            )
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
    if source.is_geocentric:
        raise InputError(f"{given.where} is in {source.name}, which is geocentric: give longitude, latitude and height.")
    if not (source.is_projected or source.is_geographic):
        raise InputError(
            f"{given.where} is in the local system {source.name}, which nothing ties to a map: give a projected CRS."
        )
    axes = source.axis_info
    if len(axes) > 2 and axes[2].direction == "down":
        raise InputError(f"{given.where} has depths ({source.name}): give heights, which count upwards.")
    vertical = axes[2].unit_conversion_factor if len(axes) > 2 else None
    if vertical is None and source.is_projected and abs(axes[0].unit_conversion_factor - 1.0) > 1e-9:
        raise InputError(
            f"{given.where} is in {axes[0].unit_name} ({source.name}) and does not declare the unit of its heights: give it in a "
            "CRS in metres, or in a compound CRS that names the heights' unit."
        )
    if source.is_projected:
        _refuse_other_units(given, horizontal(source))
    easting, northing = transformer(source, crs).transform(x, y)
    moved = np.stack([easting, northing, height * (vertical or 1.0)], axis=1)
    if not np.isfinite(moved).all():
        raise InputError(f"Points of {given.where} lie outside the area of {CRS.from_user_input(crs).name}: set the right CRS.")
    return moved


def _refuse_other_units(given: Given, plane: CRS) -> None:
    """Refuse plan coordinates beyond any grid: those of zones that carry their number in front reach 60,000 km."""
    furthest = float(np.abs(given.coordinates[:, :2]).max()) * plane.axis_info[0].unit_conversion_factor
    if furthest > 1e8:
        raise InputError(
            f"The coordinates of {given.where} are too large for metres of {plane.name}, as if in millimetres: give metres."
        )


def _coordinates(layer: Layer, names: Sequence[str], height_field: str | None) -> Array:
    if layer.geometry is None:
        raise InputError(f"{layer.name} is a table without geometry: give GCPS as a layer of points.")
    coordinates = np.full((len(layer), 3), np.nan)
    for i, shape in enumerate(layer.geometry):
        parts = [] if shape is None else [p for p in shapely.get_parts(shape) if not p.is_empty]
        if not parts:
            raise InputError(f"{names[i]} of {layer.name} has no geometry: place it, or remove it.")
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
    word = _bare(role)
    if word in _CHECK:
        return True
    if word in _CONTROL:
        return False
    if word in map(_bare, ("contrôle", "point de contrôle", "CP")):  # a French one checks, a Portuguese one controls
        raise InputError(f"The role {role!r} in {where} can mean control as well as check: write control or check.")
    raise InputError(f"The role {role!r} in {where} is not known: write control or check.")


def _bare(role: str) -> str:
    return "".join(c for c in unicodedata.normalize("NFKD", role.casefold()) if c.isalnum())


def _have(names: Sequence[str]) -> str:
    return "has" if len(names) == 1 else "have"
