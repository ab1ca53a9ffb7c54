"""From what a raster declares to metres: the unit of its CRS, the unit of its heights, the truth of its areas."""

from __future__ import annotations

from dataclasses import dataclass

from pyproj import CRS, Proj, Transformer
from pyproj.exceptions import CRSError, ProjError

from ..errors import InputError

_FEET = {"us survey foot": 1200 / 3937, "us survey feet": 1200 / 3937, "us-ft": 1200 / 3937, "ftus": 1200 / 3937}
_FEET |= dict.fromkeys(("foot_us", "us foot", "us feet", "u.s. survey foot", "sftus"), 1200 / 3937)
_FEET |= dict.fromkeys(("foot", "feet", "ft", "international foot", "'"), 0.3048)
_METRES = dict.fromkeys(("metre", "meter", "metres", "meters", "m"), 1.0) | {"cm": 0.01, "mm": 0.001, "decimetre": 0.1}
_UNITS = _METRES | _FEET | {"centimetre": 0.01, "centimeter": 0.01, "millimetre": 0.001, "millimeter": 0.001}
_AREA_REFUSED, _AREA_WARNED = 0.02, 0.003  # UTM at a zone's edge and national grids stay below 0.2 %


@dataclass(frozen=True)
class Units:
    """How to read a raster in metres.

    ``crs`` is the horizontal CRS in metres (WKT2), ``horizontal`` the metres per unit of its coordinates, ``vertical`` the
    metres per unit of its heights, ``datum`` the name of the declared vertical datum or None.
    """

    crs: str
    horizontal: float
    vertical: float
    datum: str | None


def units_of(label: str, file_crs: str | None, layer_crs: str | None, band_unit: str) -> Units:
    """Return the units of a raster called ``label``; ``layer_crs``, what the user's layer says, overrides ``file_crs``.

    A layer's CRS may have lost the vertical part that the file has (QGIS 3.22 cannot hold it), so heights are looked up in both.

    Raises
    ------
    InputError
        When the CRS is missing, not projected, or in feet without a declared unit of the heights.
    """
    text = layer_crs or file_crs
    if not text:
        raise InputError(f"{label} has no CRS: set the layer's CRS, or give a raster that declares one.")
    crs = _understood(label, text)
    plane = CRS(crs.sub_crs_list[0]) if crs.is_compound else crs
    if plane.is_bound and plane.source_crs is not None:
        plane = plane.source_crs
    if plane.is_geographic or plane.is_geocentric:
        raise InputError(f"{label} is in {plane.name}, in degrees: reproject it to a CRS in metres (UTM, national grid).")
    if not plane.is_projected:
        raise InputError(f"{label} is in {plane.name}, which is not a projected CRS: set the CRS it is really in.")
    horizontal = float(plane.axis_info[0].unit_conversion_factor)
    factor, datum = _vertical(label, crs)
    if factor is None and layer_crs and file_crs:
        factor, datum = _vertical(label, _understood(label, file_crs))
    if factor is None and band_unit:
        factor = _UNITS.get(band_unit.strip().lower())
        if factor is None:
            raise InputError(f"{label} declares its heights in {band_unit!r}, which is not known: convert them to metres.")
    if factor is None and abs(horizontal - 1.0) > 1e-9:
        raise InputError(
            f"{label} is in {plane.name}, in {plane.axis_info[0].unit_name}, and does not say the unit of its heights: "
            "declare it (the band's unit, or a compound CRS) or convert the raster to metres."
        )
    return Units(_in_metres(plane).to_wkt(), horizontal, factor or 1.0, datum)


def true_area(crs: str, easting: float, northing: float) -> tuple[float, str | None]:
    """Return the CRS plane's area for one square metre of ground at a place, and a warning when it matters.

    Raises
    ------
    InputError
        When areas (and so volumes) are wrong by more than 2 %.
    """
    definition = CRS.from_wkt(crs)
    try:
        inverse = Transformer.from_crs(definition, definition.geodetic_crs, always_xy=True)
        scale = float(Proj(definition).get_factors(*inverse.transform(easting, northing)).areal_scale)
    except (ProjError, CRSError) as error:
        raise InputError(f"The rasters do not lie where {definition.name} is defined ({error}): set the right CRS.") from error
    excess = abs(scale - 1.0)
    if not excess <= _AREA_REFUSED:
        raise InputError(
            f"Areas in {definition.name} are {scale:.2f} times those on the ground here, and volumes with them: "
            "reproject the rasters to UTM or a national grid."
        )
    if excess > _AREA_WARNED:
        return scale, f"Areas in {definition.name} are {scale:.4f} times those on the ground here, and volumes with them."
    return scale, None


def _understood(label: str, text: str) -> CRS:
    try:
        return CRS.from_user_input(text)
    except CRSError as error:
        raise InputError(f"The CRS of {label} is not understood ({error}): set the layer's CRS.") from error


def _vertical(label: str, crs: CRS) -> tuple[float | None, str | None]:
    """Return the metres per unit of height and the vertical datum's name, as far as the CRS declares them."""
    parts = [CRS(part) for part in crs.sub_crs_list] if crs.is_compound else [crs]
    for part in parts:
        axes = part.axis_info if part.is_vertical else part.axis_info[2:]
        if axes:
            if axes[0].direction != "up":
                raise InputError(f"{label} holds depths ({crs.name}): give heights that are positive up.")
            name = part.datum.name if part.is_vertical and part.datum else f"the ellipsoid of {part.name}"
            return float(axes[0].unit_conversion_factor), name
    return None, None


def _in_metres(plane: CRS) -> CRS:
    """Return a projected CRS with its axes in metres, otherwise the same."""
    definition = plane.to_2d().to_json_dict()
    axes = definition["coordinate_system"]["axis"]
    if all(axis["unit"] == "metre" for axis in axes):
        return plane.to_2d()
    for axis in axes:
        axis["unit"] = "metre"
    definition.pop("id", None)
    definition["name"] += " in metres"
    return CRS.from_json_dict(definition)
