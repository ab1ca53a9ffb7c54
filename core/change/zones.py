"""Polygons on the common grid: which share of each cell lies inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from exactextract import exact_extract
from exactextract.raster import NumPyRasterSource
from numpy.typing import NDArray

from ..contract import VectorSource
from ..errors import InputError
from ..raster import Grid
from ..vector import in_crs, read_layer

Array = NDArray[np.float64]
_TOUCH = 1e-6  # share of a cell below which a polygon that only touches it counts as outside


@dataclass(frozen=True)
class Zone:
    """A named multipolygon in the grid's CRS."""

    name: str
    shape: Any


def read_zones(source: VectorSource, label: str, field: str | None, crs: str) -> list[Zone]:
    """Return the polygons of a layer, named by ``field`` (default ``name`` if there is one, else the feature's id).

    Raises
    ------
    InputError
        When the layer has no polygons, or not the field.
    """
    layer = read_layer(source)
    if field is None and any(name.casefold() == "name" for name in layer.fields):
        field = "name"
    ids = [str(i) for i in layer.ids]
    names = layer.text(field) if field else ids
    zones = []
    for name, fallback, geometry in zip(names, ids, in_crs(layer, crs), strict=True):
        if geometry is None or geometry.is_empty:
            continue
        shape = _polygons(geometry)
        if shape.is_empty:
            raise InputError(f"{label}: feature {fallback} of {layer.name} is not a polygon: give a layer of polygons.")
        if not np.isfinite(shapely.bounds(shape)).all():
            raise InputError(f"{label}: feature {fallback} of {layer.name} does not lie where the rasters' CRS is defined.")
        zones.append(Zone(name or fallback, shape))
    if not zones:
        raise InputError(f"{label}: the layer {layer.name} has no polygons.")
    return zones


def union(zones: list[Zone]) -> Any:
    """Return the ground that at least one zone covers."""
    return _polygons(shapely.union_all([zone.shape for zone in zones]))


def cell_shares(shape: Any, window: Grid) -> tuple[int, int, Array] | None:
    """Return first row, first column and shares (rows, columns; 0..1) of the cells of ``window`` inside ``shape``, or None."""
    west, south, east, north = window.bounds
    part = _polygons(shapely.intersection(shape, shapely.box(west, south, east, north)))
    if part.is_empty:
        return None
    left, low, right, high = shapely.bounds(part)
    c0 = max(0, int(np.floor((left - west) / window.cell - _TOUCH)))
    c1 = min(window.width, int(np.ceil((right - west) / window.cell + _TOUCH)))
    r0 = max(0, int(np.floor((north - high) / window.step_north - _TOUCH)))
    r1 = min(window.height, int(np.ceil((north - low) / window.step_north + _TOUCH)))
    cells = window.window(c0, r0, c1 - c0, r1 - r0)
    if shapely.area(part) >= (1 - 1e-12) * cells.width * cells.height * window.cell_area:
        return r0, c0, np.ones((cells.height, cells.width))
    shares = _shares(part, cells)
    return (r0, c0, shares) if shares.any() else None


def touched(shapes: list[Any], window: Grid, least: float = _TOUCH) -> NDArray[np.bool_]:
    """Return which cells (rows, columns) have at least the share ``least`` inside one of ``shapes``."""
    mask = np.zeros((window.height, window.width), bool)
    for shape in shapes:
        found = cell_shares(shape, window)
        if found is not None:
            r, c, shares = found
            mask[r : r + shares.shape[0], c : c + shares.shape[1]] |= shares >= least
    return mask


def _shares(part: Any, cells: Grid) -> Array:
    west, south, east, north = cells.bounds
    # Coordinates from the corner keep exactextract's own grid arithmetic exact.
    local = shapely.transform(part, lambda xy: (xy - (west, south)) / (cells.cell, cells.step_north))
    raster = NumPyRasterSource(np.zeros((cells.height, cells.width)), xmin=0, ymin=0, xmax=cells.width, ymax=cells.height)
    feature = {"type": "Feature", "properties": {}, "geometry": shapely.geometry.mapping(local)}
    (found,) = exact_extract(raster, [feature], ["cell_id", "coverage"])
    shares = np.zeros(cells.height * cells.width)
    shares[found["properties"]["cell_id"]] = found["properties"]["coverage"]
    shares[shares < _TOUCH] = 0.0
    return shares.reshape(cells.height, cells.width)


def _polygons(geometry: Any) -> Any:
    """Return the polygons of a geometry as one valid multipolygon; lines and points that make_valid leaves are dropped."""
    parts = shapely.get_parts(shapely.make_valid(shapely.force_2d(geometry)), return_index=False)
    flat = [p for part in parts for p in shapely.get_parts(part) if shapely.get_dimensions(p) == 2 and shapely.area(p) > 0]
    if len(flat) == 1:
        return shapely.multipolygons(flat)
    whole = shapely.union_all(flat) if flat else shapely.MultiPolygon()
    return shapely.multipolygons(shapely.get_parts(whole)) if not whole.is_empty else shapely.MultiPolygon()
