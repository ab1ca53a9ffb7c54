"""What is true of the simulated beach: its surfaces on a grid of the CRS, their difference, and the volumes of each zone."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from exactextract import exact_extract
from exactextract.feature import JSONFeatureSource
from exactextract.raster import NumPyRasterSource
from numpy.typing import NDArray

from ..raster import Grid, Patch, write_cog
from .placement import Placement
from .terrain import STABLE_UNTIL, ZONES, Beach

Array = NDArray[np.float64]

_CELL = 0.05  # m
_MOST_CELLS = 60e6
_MARGIN = 3.0  # m of truth around the area
_ROWS = 256


@dataclass(frozen=True)
class Volumes:
    """True volumes of a zone (m3, positive) over its area (m2) in the CRS."""

    zone: str
    erosion: float
    deposition: float
    net: float
    area: float


def zone_polygons(placement: Placement, beach: Beach) -> dict[str, shapely.Polygon]:
    """Return the zones in the CRS: bands along the shore."""
    return {
        name: shapely.Polygon(placement.polygon((0.0, beach.length), (start * beach.across, end * beach.across)))
        for name, (start, end) in ZONES.items()
    }


def stable_polygon(placement: Placement, beach: Beach) -> shapely.Polygon:
    """Return the ground in the CRS that does not change."""
    return shapely.Polygon(placement.polygon((0.0, beach.length), (0.0, STABLE_UNTIL * beach.across)))


def truth_grid(placement: Placement, beach: Beach) -> Grid:
    """Return the grid of the truth: the area's bounds in the CRS and some margin."""
    corners = placement.polygon((-_MARGIN, beach.length + _MARGIN), (-_MARGIN, beach.width + _MARGIN))
    (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
    cell = max(_CELL, _CELL * math.ceil(math.sqrt((east - west) * (north - south) / _MOST_CELLS) / _CELL))
    west, north = math.floor(west / cell) * cell, math.ceil(north / cell) * cell
    return Grid(west, north, cell, math.ceil((east - west) / cell), math.ceil((north - south) / cell), placement.frame.crs)


def surface_rows(placement: Placement, beach: Beach, grid: Grid, after: bool, start: int, end: int) -> Array:
    """Return the true heights (m; rows, columns) in the CRS at the centres of the cells in the rows ``start`` to ``end``."""
    eastings = np.asarray(grid.west + (np.arange(grid.width) + 0.5) * grid.cell, float)
    northings = np.asarray(grid.north - (np.arange(start, end) + 0.5) * grid.cell, float)
    a, c, lift = placement.on_grid(eastings, northings)
    return np.asarray(beach.heights(a, c, after) + lift)


def write_truth(folder: Path, placement: Placement, beach: Beach, dates: int) -> list[Volumes]:
    """Write the true surfaces (before_dsm.tif, after_dsm.tif, difference.tif); return the volumes, last of the zones together."""
    grid = truth_grid(placement, beach)
    write_cog(str(folder / "before_dsm.tif"), grid, _patches(placement, beach, grid, (False,)))
    if dates == 1:
        return []
    write_cog(str(folder / "after_dsm.tif"), grid, _patches(placement, beach, grid, (True,)))
    write_cog(str(folder / "difference.tif"), grid, _patches(placement, beach, grid, (True, False)))
    zones = zone_polygons(placement, beach)
    zones["all"] = shapely.union_all(list(zones.values()))
    totals = {name: Volumes(name, 0.0, 0.0, 0.0, 0.0) for name in zones}
    for start in range(0, grid.height, _ROWS):
        end = min(start + _ROWS, grid.height)
        change = surface_rows(placement, beach, grid, True, start, end) - surface_rows(placement, beach, grid, False, start, end)
        part = grid.window(0, start, grid.width, end - start)
        for row in _integrals(change, part, zones):
            old = totals[row.zone]
            totals[row.zone] = Volumes(
                row.zone, old.erosion + row.erosion, old.deposition + row.deposition, old.net + row.net, old.area + row.area
            )
    return list(totals.values())


def _patches(placement: Placement, beach: Beach, grid: Grid, dates: tuple[bool, ...]) -> Iterator[Patch]:
    """Yield the surface of one date, or that of the first minus that of the second."""
    for start in range(0, grid.height, _ROWS):
        end = min(start + _ROWS, grid.height)
        surfaces = [surface_rows(placement, beach, grid, after, start, end) for after in dates]
        values = surfaces[0] - surfaces[1] if len(surfaces) == 2 else surfaces[0]
        yield Patch(0, start, values[None].astype(np.float32))


def _integrals(change: Array, grid: Grid, zones: dict[str, shapely.Polygon]) -> list[Volumes]:
    """Return what one part of the difference adds to each zone; border cells count by the share inside."""
    west, south, east, north = grid.bounds
    features = [
        {"type": "Feature", "properties": {"zone": name}, "geometry": shapely.geometry.mapping(polygon)}
        for name, polygon in zones.items()
    ]
    source = NumPyRasterSource(np.ascontiguousarray(change), west, south, east, north)
    found = exact_extract(source, JSONFeatureSource(features), ["values", "coverage"], include_cols=["zone"])
    rows, area = [], grid.cell**2
    for feature in found:
        properties = feature["properties"]
        values = np.asarray(properties["values"], float)
        share = np.asarray(properties["coverage"], float) * area
        deposition, erosion = float(share @ np.maximum(values, 0)), float(share @ np.maximum(-values, 0))
        rows.append(Volumes(properties["zone"], erosion, deposition, deposition - erosion, float(share.sum())))
    return rows
