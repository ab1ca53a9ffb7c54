"""The local topocentric frame (east, north, up) and its exact way to and from a projected CRS.

A projected CRS is bent and scaled against the world the cameras saw: 2 cm at 500 m from the centre by curvature alone. So
poses live in a tangent frame at an origin, and only results are put in the CRS. The frame is built on the CRS's
own ellipsoid; no change of datum happens here. A height passes as it is: whether it is ellipsoidal or
orthometric, it is the height in the CRS's vertical reference, whatever that is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError

from .errors import InputError

Array = NDArray[np.float64]


def projected_crs(text: str) -> CRS:
    """Return the CRS that ``text`` (WKT2, EPSG code, PROJ string) names, if volumes can be measured in it.

    Raises
    ------
    InputError
        When it is not known, not projected, or not in metres.
    """
    try:
        crs = CRS.from_user_input(text)
    except CRSError as error:
        raise InputError(f"The CRS {text!r} is not understood: choose a projected CRS in metres.") from error
    crs = horizontal(crs)
    if not crs.is_projected:
        raise InputError(f"The CRS {crs.name} is not projected: choose a projected CRS in metres (UTM or a national grid).")
    if {axis.direction for axis in crs.axis_info} & {"west", "south"}:
        raise InputError(f"The axes of the CRS {crs.name} do not point east and north: choose a projected CRS whose axes do.")
    factor = crs.axis_info[0].unit_conversion_factor
    if abs(factor - 1.0) > 1e-9:
        raise InputError(
            f"The CRS {crs.name} is in {crs.axis_info[0].unit_name}: choose a projected CRS in metres for this survey."
        )
    return crs


def horizontal(crs: CRS | str) -> CRS:
    """Return a CRS without its heights."""
    crs = CRS.from_user_input(crs)
    return CRS(crs.sub_crs_list[0]).to_2d() if crs.is_compound else crs.to_2d()


def transformer(source: CRS | str, target: CRS | str) -> Transformer:
    """Return the horizontal transformation between two CRS, x before y.

    What a CRS says of heights is left out: a height that PROJ would pass unchanged, for want of a grid, cannot even be asked for.

    Raises
    ------
    InputError
        When PROJ knows only a guess ("ballpark") between the two datums.
    """
    try:
        return Transformer.from_crs(horizontal(source), horizontal(target), always_xy=True, allow_ballpark=False)
    except Exception as error:
        names = " to ".join(CRS.from_user_input(c).name for c in (source, target))
        raise InputError(
            f"No reliable transformation from {names} is installed: give the data in one datum, or install PROJ's grids."
        ) from error


@dataclass(frozen=True)
class LocalFrame:
    """East, north, up at an origin (degrees on the CRS's datum, metres) of a projected CRS (WKT2)."""

    crs: str
    longitude: float
    latitude: float
    height: float

    @classmethod
    def at(cls, crs: str, easting: float, northing: float, height: float) -> LocalFrame:
        """Return the frame whose origin is at the given coordinates of ``crs``.

        Raises
        ------
        InputError
            When the CRS does not suit, or the coordinates lie outside its area.
        """
        definition = projected_crs(crs)
        to_geographic = Transformer.from_crs(definition, definition.geodetic_crs, always_xy=True)
        longitude, latitude = np.array(to_geographic.transform(easting, northing)) * _degrees_per_unit(definition)
        if not np.isfinite([longitude, latitude, height]).all():
            raise InputError(f"The point {easting:g}, {northing:g} lies outside the area of {definition.name}: check the CRS.")
        return cls(definition.to_wkt(), float(longitude), float(latitude), float(height))

    def from_crs(self, points: Array) -> Array:
        """Return local (n, 3) of easting, northing, height (n, 3)."""
        points = np.asarray(points, float)
        longitude, latitude = self._projection.transform(points[:, 0], points[:, 1], direction="INVERSE")
        unit = _degrees_per_unit(self._definition)
        return self._local(np.stack([longitude * unit, latitude * unit, points[:, 2]], axis=1))

    def to_crs(self, points: Array) -> Array:
        """Return easting, northing, height (n, 3) of local (n, 3)."""
        centre, axes = self._base
        x, y, z = (np.asarray(points, float) @ axes + centre).T
        longitude, latitude, height = self._geocentric.transform(x, y, z, direction="INVERSE")
        unit = _degrees_per_unit(self._definition)
        easting, northing = self._projection.transform(longitude / unit, latitude / unit)
        return np.stack([easting, northing, height], axis=1)

    def from_wgs84(self, points: Array) -> Array:
        """Return local (n, 3) of WGS 84 longitude, latitude (degrees) and height (n, 3); heights pass unchanged."""
        points = np.asarray(points, float)
        # By way of the projection, which alone knows of a shift of datum in a PROJ string.
        easting, northing = self._from_wgs84.transform(points[:, 0], points[:, 1])
        return self.from_crs(np.stack([easting, northing, points[:, 2]], axis=1))

    def affine(self, centre: Array, reach: float) -> tuple[Array, Array]:
        """Return (matrix, offset) with ``local = matrix @ (crs - centre) + offset`` near ``centre`` (easting, northing, height).

        Fitted over +-``reach`` metres; the error grows with ``reach**2 / 12.7e6`` (8 um at 10 m, 0.8 mm at 100 m).
        """
        centre = np.asarray(centre, float)
        steps = np.concatenate([np.eye(3), -np.eye(3)]) * reach
        local = self.from_crs(np.concatenate([centre + steps, centre[None]]))
        return ((local[:3] - local[3:6]) / (2 * reach)).T, local[6]

    def _local(self, geographic: Array) -> Array:
        centre, axes = self._base
        xyz = np.stack(self._geocentric.transform(*geographic.T), axis=1)
        return np.asarray((xyz - centre) @ axes.T)

    @cached_property
    def _definition(self) -> CRS:
        return CRS.from_user_input(self.crs)

    @cached_property
    def _projection(self) -> Transformer:
        return Transformer.from_crs(self._definition.geodetic_crs, self._definition, always_xy=True)

    @cached_property
    def _from_wgs84(self) -> Transformer:
        return transformer("EPSG:4326", self._definition)

    @cached_property
    def _geocentric(self) -> Transformer:
        ellipsoid = self._definition.ellipsoid
        if ellipsoid is None:
            raise InputError(f"The CRS {self._definition.name} has no ellipsoid: choose another.")
        return Transformer.from_pipeline(
            f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart "
            f"+a={ellipsoid.semi_major_metre!r} +b={ellipsoid.semi_minor_metre!r}"
        )

    @cached_property
    def _base(self) -> tuple[Array, Array]:
        """Geocentric origin (3,) and rows east, north, up (3, 3)."""
        centre = np.array(self._geocentric.transform(self.longitude, self.latitude, self.height))
        lam, phi = np.radians([self.longitude, self.latitude])
        east = [-np.sin(lam), np.cos(lam), 0.0]
        north = [-np.sin(phi) * np.cos(lam), -np.sin(phi) * np.sin(lam), np.cos(phi)]
        up = [np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)]
        return centre, np.array([east, north, up])


def _degrees_per_unit(crs: CRS) -> float:
    """Return the degrees in a unit of the CRS's geographic base: 0.9 for the grads of old French maps."""
    base = crs.geodetic_crs
    return 1.0 if base is None else float(np.degrees(base.axis_info[0].unit_conversion_factor))
