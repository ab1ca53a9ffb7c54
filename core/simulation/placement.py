"""Where on Earth the beach lies: between the beach's own axes, the local frame and the CRS."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer

from ..errors import InputError
from ..frames import LocalFrame, projected_crs
from .terrain import Beach

Array = NDArray[np.float64]

DEFAULT_CRS = "EPSG:32630"
_DEFAULT_PLACE = (-1.2548, 44.4521)  # a sandy coast that faces west
_SEA = 48.9  # m, ellipsoidal height of the sea
_AZIMUTH = math.radians(8.0)
_LATTICE = 64  # cells between exact transformations; the curvature neglected between is below 2 um


@dataclass(frozen=True)
class Placement:
    """The beach's axes (along, across, up; from the area's corner) in a local frame at the area's centre, on the sea."""

    frame: LocalFrame
    length: float
    width: float

    @classmethod
    def of(cls, beach: Beach, crs: str | None) -> Placement:
        """Return the placement of ``beach`` in ``crs``: at a default place, or in the middle of the area the CRS is made for.

        Raises
        ------
        InputError
            When the CRS is unsuitable or does not say where it applies.
        """
        definition = projected_crs(crs or DEFAULT_CRS)
        place = _DEFAULT_PLACE
        if crs:
            code = definition.to_epsg()  # WKT may have lost the area, its code tells
            area = definition.area_of_use or (CRS.from_epsg(code).area_of_use if code else None)
            if area is None:
                raise InputError(f"The CRS {definition.name} does not say where it applies: choose one with an EPSG code.")
            if not (area.west <= place[0] <= area.east and area.south <= place[1] <= area.north):
                place = ((area.west + area.east) / 2, (area.south + area.north) / 2)
        easting, northing = Transformer.from_crs(definition.geodetic_crs, definition, always_xy=True).transform(*place)
        return cls(LocalFrame.at(definition.to_wkt(), round(easting), round(northing), _SEA), beach.length, beach.width)

    @property
    def azimuth(self) -> float:
        """The direction of the shore (rad, clockwise from true north); the sea lies to the left."""
        return _AZIMUTH

    @cached_property
    def axes(self) -> Array:
        """The rows along, across, up (3, 3) in the local frame: ``x_beach = axes @ x_local + offset``."""
        s, k = math.sin(_AZIMUTH), math.cos(_AZIMUTH)
        return np.array([[s, k, 0.0], [-k, s, 0.0], [0.0, 0.0, 1.0]])

    @property
    def offset(self) -> Array:
        """See ``axes``."""
        return np.array([self.length / 2, self.width / 2, 0.0])

    def to_local(self, beach: Array) -> Array:
        """Return local (n, 3) of a, c, z (n, 3)."""
        return np.asarray((np.asarray(beach, float) - self.offset) @ self.axes)

    def from_local(self, local: Array) -> Array:
        """Return a, c, z (n, 3) of local (n, 3)."""
        return np.asarray(np.asarray(local, float) @ self.axes.T + self.offset)

    def to_crs(self, beach: Array) -> Array:
        """Return easting, northing, height (n, 3) of a, c, z (n, 3)."""
        return self.frame.to_crs(self.to_local(beach))

    def polygon(self, a: tuple[float, float], c: tuple[float, float]) -> Array:
        """Return the ring (5, 2) in the CRS of a rectangle along the beach's axes."""
        corners = [(a[i], c[j], 2.0) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))]
        return self.to_crs(np.array(corners))[:, :2]

    def on_grid(self, eastings: Array, northings: Array) -> tuple[Array, Array, Array]:
        """Return a, c and height-minus-z (rows, columns each) at the crossings of evenly spaced eastings and northings.

        The way of a height through the frame is that at 2 m above the sea; 6 m higher a place is off by less than
        its distance from the centre times 1e-6.
        """
        rows, columns = _knots(len(northings)), _knots(len(eastings))
        mesh = np.stack(np.meshgrid(eastings[columns], northings[rows]), axis=-1).reshape(-1, 2)
        level = _SEA + 2.0
        local = self.frame.from_crs(np.column_stack([mesh, np.full(len(mesh), level)]))
        beach = self.from_local(local)
        nodes = np.column_stack([beach[:, :2], level - local[:, 2]]).reshape(len(rows), len(columns), 3)
        a, c, lift = (_spread(nodes[..., k], rows, columns) for k in range(3))
        return a, c, lift


def _knots(count: int) -> NDArray[np.int64]:
    return np.unique(np.append(np.arange(0, count, _LATTICE), count - 1))


def _spread(nodes: Array, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Array:
    """Return ``nodes`` interpolated linearly to every row and column in between."""
    wide = np.stack([np.interp(np.arange(columns[-1] + 1), columns, line) for line in nodes])
    below = np.clip(np.searchsorted(rows, np.arange(rows[-1] + 1), side="right") - 1, 0, max(len(rows) - 2, 0))
    if len(rows) == 1:
        return wide
    share = ((np.arange(rows[-1] + 1) - rows[below]) / (rows[below + 1] - rows[below]))[:, None]
    return np.asarray((1 - share) * wide[below] + share * wide[below + 1])
