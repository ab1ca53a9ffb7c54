"""Kinds of heights: above the ellipsoid or above a geoid, and the way from one to the other."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS

from ..errors import InputError
from ..frames import transformer
from ..raster import RasterFile

Array = NDArray[np.float64]
Kind = Literal["ellipsoidal", "orthometric", "unknown"]


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


def undulation(geoid: str, points: Array, crs: str) -> Array:
    """Return the geoid's height above the ellipsoid (n,) at points (n, 2 or 3) of ``crs``.

    ``geoid`` is a number in metres or a raster, read bilinearly between the centres of its cells.

    Raises
    ------
    InputError
        When the raster has no CRS or no value at a point.
    """
    try:
        return np.full(len(points), float(geoid))
    except ValueError:
        pass  # not a number: a file
    if not Path(geoid).is_file():
        raise InputError(f"GEOID {geoid!r} is neither a number nor a file: give metres or a raster.")
    with RasterFile(geoid) as raster:
        if not raster.crs or not raster.placed:
            raise InputError(f"The geoid {geoid} has no CRS: give a georeferenced raster.")
        crs_of_raster = CRS.from_user_input(raster.crs)
        plane = CRS(crs_of_raster.sub_crs_list[0]) if crs_of_raster.is_compound else crs_of_raster.to_2d()
        x, y = transformer(CRS.from_user_input(crs), plane).transform(points[:, 0], points[:, 1])
        a, b, c, d, e, f = raster.transform
        if plane.is_geographic and c > 0 - 1e-9 and b == 0 and c + a * raster.width > 180:
            x = np.where(x < c, x + 360.0, x)  # grids of 0 to 360 degrees
        column, row = np.linalg.solve(np.array([[a, b], [d, e]]), np.stack([x - c, y - f])) - 0.5
        values = _bilinear(raster, np.asarray(column), np.asarray(row))
    if not np.isfinite(values).all():
        raise InputError(f"The geoid {geoid} has no value at some of the positions: give one that covers the survey.")
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
