"""Transects: lines across the beach, from the land to the sea."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..contract import VectorSource
from ..errors import InputError
from ..vector import in_crs, read_layer

Array = NDArray[np.float64]
_SHORT = 1e-6  # metres


@dataclass(frozen=True)
class Transect:
    """A named line in the grid's CRS; its start is the landward end."""

    name: str
    line: Any

    @property
    def length(self) -> float:
        """Its length (m)."""
        return float(shapely.length(self.line))

    def at(self, distance: Array) -> Array:
        """Return the places (n, 2) at distances (n,) from the landward end."""
        return np.asarray(shapely.get_coordinates(shapely.line_interpolate_point(self.line, distance)))

    def direction(self, distance: float) -> Array:
        """Return the unit vector (2,) seaward at a distance."""
        step = 1e-3 * self.length
        ends = np.clip([distance - step, distance + step], 0.0, self.length)
        first, second = self.at(ends)
        return np.asarray((second - first) / np.hypot(*(second - first)))

    def nodes(self, spacing: float) -> Array:
        """Return the distances 0, ``spacing``, ... and the line's length (n,)."""
        steps = np.arange(0.0, self.length, spacing)
        return np.append(steps[self.length - steps > 1e-6 * spacing], self.length)


def read_transects(source: VectorSource, field: str | None, crs: str, *, flip: bool) -> list[Transect]:
    """Return the lines of TRANSECTS in ``crs``, named by ``field`` (default ``name`` if there is one, else the feature's id).

    Raises
    ------
    InputError
        When the layer has no lines, or one that is no transect.
    """
    layer = read_layer(source)
    if field is None and any(name.casefold() == "name" for name in layer.fields):
        field = "name"
    names = layer.text(field) if field else [str(i) for i in layer.ids]
    found: dict[str, Transect] = {}
    for name, fid, geometry in zip(names, layer.ids, in_crs(layer, crs), strict=True):
        told = f"TRANSECTS: the feature {fid} of {layer.name}"
        if geometry is None or geometry.is_empty:
            raise InputError(f"{told} has no geometry: draw its line, or delete it.")
        if shapely.get_dimensions(geometry) != 1:
            raise InputError(f"{told} is not a line: give a layer of lines across the beach.")
        line = shapely.force_2d(geometry)
        if line.geom_type != "LineString":
            line = shapely.line_merge(line)
        if line.geom_type != "LineString":
            raise InputError(f"{told} has several parts that do not join: make it one line.")
        if not np.isfinite(shapely.get_coordinates(line)).all():
            raise InputError(f"{told} does not lie where the DSMs' CRS is defined: check the layer's CRS.")
        if shapely.length(line) < _SHORT:
            raise InputError(f"{told} has no length: draw it again, or delete it.")
        name = name or str(fid)
        if name in found:
            raise InputError(f"TRANSECTS: two lines are called {name}: name them apart, or choose another TRANSECT_FIELD.")
        found[name] = Transect(name, shapely.reverse(line) if flip else line)
    if not found:
        raise InputError(f"TRANSECTS: the layer {layer.name} has no lines.")
    return list(found.values())


def require_some_inside(transects: list[Transect], covered: Any) -> list[str]:
    """Return the names of the transects outside ``covered``, a polygon.

    Raises
    ------
    InputError
        When all are.
    """
    outside = [t.name for t in transects if not shapely.intersects(t.line, covered)]
    if len(outside) == len(transects):
        raise InputError("No line of TRANSECTS lies on the DSMs: draw them across the beach, and check the layer's CRS.")
    return outside
