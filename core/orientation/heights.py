"""Kinds of heights: above the ellipsoid or above a geoid, and the way from one to the other.

The undulation N is the geoid's height above the ellipsoid: with h above the ellipsoid and H above the geoid, h = H + N.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError

from ..errors import InputError
from ..frames import horizontal, transformer
from ..raster import RasterFile
from ..vector import number_of

Array = NDArray[np.float64]
Kind = Literal["ellipsoidal", "orthometric", "unknown"]

_MOST = 120.0  # m; EGM2008 lies between -107 and +86 m
_METRES = ("", "m", "metre", "metres", "meter", "meters")
_OF_A_GEOID = ("height", "geoid", "level", "msl", "navd", "nap", "egm", "datum")


@dataclass(frozen=True)
class HeightPlan:
    """``kind`` of the block's heights; ``sign`` times the undulation is added to GNSS heights.

    ``comparable`` is False when GNSS and GCP heights are of different kinds and nothing leads from one to the other.
    """

    kind: Kind
    sign: int = 0
    comparable: bool = True


def plan_heights(gcp: Kind, gnss: Kind, *, geoid: bool, with_gcps: bool, with_gnss: bool) -> HeightPlan:
    """Decide which heights the block gets: the GCPs' kind; without GCPs orthometric when a GEOID leads there.

    Raises
    ------
    InputError
        When a GEOID is given but it is not said from which kind to which it leads.
    """
    if not with_gnss:
        return HeightPlan(gcp)
    if geoid and (gnss == "unknown" or (with_gcps and gcp == "unknown")):
        unsaid = "GNSS_HEIGHTS" if gnss == "unknown" else "GCP_HEIGHTS"
        raise InputError(f"A GEOID is given but {unsaid} is unknown: say whether these heights are ellipsoidal or orthometric.")
    kind: Kind = gcp if with_gcps else "orthometric" if geoid else gnss
    if kind == gnss or "unknown" in (kind, gnss):
        return HeightPlan(kind)
    if not geoid:
        return HeightPlan(kind, comparable=False)
    return HeightPlan(kind, -1 if kind == "orthometric" else 1)


def kind_of_crs(crs: str | None) -> Kind:
    """Return what a CRS says of its heights: unknown when it has none, or of no known kind."""
    if not crs:
        return "unknown"
    definition = CRS.from_user_input(crs)
    if definition.is_compound:
        name = definition.sub_crs_list[1].name.casefold()
        if "ellips" in name:
            return "ellipsoidal"
        return "orthometric" if any(word in name for word in _OF_A_GEOID) else "unknown"
    return "ellipsoidal" if len(definition.axis_info) > 2 and (definition.is_geographic or definition.is_projected) else "unknown"


def stated_kind(stated: Kind, crs: str | None, where: str) -> tuple[Kind, tuple[str, ...]]:
    """Return the kind of the GCPs' heights, from the parameter and from their CRS, and a note on what the CRS decided.

    Raises
    ------
    InputError
        When the two contradict each other.
    """
    told = kind_of_crs(crs)
    if told == "unknown" or told == stated or crs is None:
        return stated, ()
    name = CRS.from_user_input(crs).name
    if stated == "unknown":
        return told, (f"The heights of {where} are taken as {told}, as its CRS {name} says.",)
    raise InputError(f"GCP_HEIGHTS is {stated} but the CRS of {where}, {name}, has {told} heights: correct one of the two.")


def undulation(geoid: str, points: Array, crs: str) -> Array:
    """Return the geoid's height above the ellipsoid (n,) at points (n, 2 or 3) of ``crs``.

    ``geoid`` is a number in metres or a raster of metres, read bilinearly between the centres of its cells.

    Raises
    ------
    InputError
        When it is neither, the raster has no CRS or no value at a point, or no geoid is that far from the ellipsoid.
    """
    number = number_of(geoid.strip().removesuffix("m"))
    if np.isfinite(number):
        return _possible(np.full(len(points), number), f"GEOID {geoid}")
    if not Path(geoid).is_file():
        raise InputError(f"GEOID {geoid!r} is neither a number nor a file: give metres or a raster.")
    with RasterFile(geoid) as raster:
        if not raster.crs or not raster.placed:
            raise InputError(f"The geoid {geoid} has no CRS: give a georeferenced raster.")
        if raster.unit.strip().lower() not in _METRES:
            raise InputError(f"The geoid {geoid} declares its heights in {raster.unit!r}: convert them to metres.")
        plane = horizontal(raster.crs)
        x, y = transformer(crs, plane).transform(points[:, 0], points[:, 1])
        a, b, c, d, e, f = raster.transform
        if plane.is_geographic and c > 0 - 1e-9 and b == 0 and c + a * raster.width > 180:
            x = np.where(x < c, x + 360.0, x)  # grids of 0 to 360 degrees
        column, row = np.linalg.solve(np.array([[a, b], [d, e]]), np.stack([x - c, y - f])) - 0.5
        values = _bilinear(raster, np.asarray(column), np.asarray(row))
    missing = int((~np.isfinite(values)).sum())
    if missing:
        raise InputError(
            f"The geoid {geoid} has no value at {missing} of {len(values)} positions: give one that covers the survey."
        )
    return _possible(values, f"The geoid {geoid}")


def undulation_of_crs(crs: str, points: Array, points_crs: str) -> Array:
    """Return the geoid's height above the ellipsoid (n,) at points (n, 2 or 3), by PROJ's grid for a compound CRS.

    Raises
    ------
    InputError
        When the grid is not installed: PROJ would else pass heights unchanged and say nothing.
    """
    compound = CRS.from_user_input(crs)
    plane = horizontal(compound)
    base = plane.geodetic_crs
    if base is None:
        raise InputError(f"The CRS {compound.name} has no geographic base: give GEOID.")
    longitude, latitude = transformer(points_crs, base).transform(points[:, 0], points[:, 1])
    try:
        change = Transformer.from_crs(base.to_3d(), compound, always_xy=True, allow_ballpark=False, only_best=True)
        up = np.asarray(change.transform(longitude, latitude, np.zeros(len(points)))[2])
    except ProjError:
        up = np.full(len(points), np.nan)
    values = -up * compound.axis_info[2].unit_conversion_factor
    if not np.isfinite(values).all():
        raise InputError(f"PROJ has no grid installed for {compound.sub_crs_list[1].name} at the survey: give GEOID.")
    return _possible(values, f"PROJ's grid for {compound.sub_crs_list[1].name}")


def _possible(values: Array, what: str) -> Array:
    if len(values) and float(np.abs(values).max()) > _MOST:
        raise InputError(
            f"{what} is {values[np.argmax(np.abs(values))]:.5g} m, but no geoid is more than {_MOST:.0f} m from the ellipsoid: "
            "give the geoid's height above the ellipsoid in metres."
        )
    return values


def _bilinear(raster: RasterFile, column: Array, row: Array) -> Array:
    inside = (column >= 0) & (column <= raster.width - 1) & (row >= 0) & (row <= raster.height - 1)
    values = np.full(len(column), np.nan)
    if not inside.all() or raster.width < 2 or raster.height < 2:
        return values
    left = np.minimum(np.floor(column), raster.width - 2).astype(int)
    top = np.minimum(np.floor(row), raster.height - 2).astype(int)
    west, north = int(left.min()), int(top.min())
    cells = raster.read(west, north, int(left.max()) - west + 2, int(top.max()) - north + 2)
    if raster.nodata is not None:
        cells[cells == raster.nodata] = np.nan
    cells = cells * raster.scale + raster.offset
    u, v, i, j = column - left, row - top, top - north, left - west
    return np.asarray(
        (1 - v) * ((1 - u) * cells[i, j] + u * cells[i, j + 1]) + v * ((1 - u) * cells[i + 1, j] + u * cells[i + 1, j + 1])
    )
