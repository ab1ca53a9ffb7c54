"""The POSITIONS table: where photographs were taken, from a better source than their EXIF (PPK, a flight log)."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj import CRS, Geod
from pyproj.exceptions import CRSError

from ..contract import VectorSource
from ..errors import InputError
from ..frames import transformer
from ..survey import Position
from ..vector import Layer, read_layer
from .listing import some

Array = NDArray[np.float64]
_WGS84 = CRS("EPSG:4326")
_FAR_FROM_EXIF = 10_000.0  # m between what is not the same place
_FAR = 1.0  # degrees that a position may lie outside its CRS's area of use; grids are used a little beyond their zone


@dataclass(frozen=True)
class Table:
    """Positions by the name of their photograph; ``unmatched`` are the table's other names."""

    positions: dict[str, Position]
    unmatched: tuple[str, ...]


def read_positions(source: VectorSource, crs: str | None, names: list[str]) -> Table:
    """Read the positions of the photographs ``names``.

    Parameters
    ----------
    source
        A table or point layer with the columns image, x, y and perhaps z, sigma_h and sigma_v (metres), in any order and
        case; a point layer may leave out x, y and z. Longitude is x.
    crs
        The coordinates' CRS; else the layer's own; else WGS 84.
    names
        The survey's photographs. A row's image matches in upper and lower case alike, with or without its folders, with or
        without its extension, the closest form first.

    Raises
    ------
    InputError
        When columns are missing, no row matches, a row matches several photographs or a photograph several rows, or
        coordinates cannot be what the CRS says.
    """
    layer = read_layer(source)
    images = layer.text("image")
    x, y, z = _coordinates(layer)
    sigma_h, sigma_v = (_optional(layer, name) for name in ("sigma_h", "sigma_v"))
    for name, sigma in (("sigma_h", sigma_h), ("sigma_v", sigma_v)):
        if np.any(sigma <= 0):
            raise InputError(
                f"POSITIONS: {name} of {images[int(np.argmax(sigma <= 0))]} is not above zero: correct it or leave it empty."
            )
    rows, unmatched = _match(images, names)
    kept = [i for i in rows.values() if not (math.isnan(x[i]) and math.isnan(y[i]))]
    half = [images[i] for i in kept if math.isnan(x[i]) or math.isnan(y[i])]
    if half:
        raise InputError(f"POSITIONS has only one of x and y for {some(half)}: give both or neither.")
    definition = _definition(crs or layer.crs)
    if np.any(np.isfinite(z[kept])):
        z = z * _height_unit(definition)
    longitude, latitude = _to_wgs84(definition, x[kept], y[kept], [images[i] for i in kept])
    high = [images[i] for i in kept if not -1000.0 < np.nan_to_num(z[i]) < 20000.0]
    if high:
        raise InputError(f"POSITIONS has heights that no drone flies at for {some(high)}: z is in metres, upwards.")
    places = {
        i: Position(float(longitude[k]), float(latitude[k]), _none(z[i]), _none(sigma_h[i]), _none(sigma_v[i]))
        for k, i in enumerate(kept)
    }
    return Table({name: places[i] for name, i in rows.items() if i in places}, tuple(unmatched))


def utm_zone(longitude: float, latitude: float) -> CRS:
    """Return the WGS 84 / UTM zone of a place (degrees), by the regular six-degree rule.

    Raises
    ------
    InputError
        When UTM is not defined there.
    """
    if not -80.0 <= latitude <= 84.0:
        raise InputError(f"There is no UTM zone at latitude {latitude:.1f}: choose a CRS.")
    zone = min(int((longitude + 180.0) // 6.0) + 1, 60)
    return CRS.from_epsg((32600 if latitude >= 0 else 32700) + zone)


def _coordinates(layer: Layer) -> tuple[Array, Array, Array]:
    fields = {f.casefold() for f in layer.fields}
    if not {"x", "y"} <= fields and layer.geometry is not None:
        if any(g is not None and g.geom_type != "Point" for g in layer.geometry):
            raise InputError(f"POSITIONS: {layer.name} has features that are not points: give points, or the columns x and y.")
        points = np.array([shapely.Point() if g is None else g for g in layer.geometry])
        z = _optional(layer, "z") if "z" in fields else shapely.get_z(points)
        return shapely.get_x(points), shapely.get_y(points), z
    return layer.numbers("x"), layer.numbers("y"), _optional(layer, "z")


def _optional(layer: Layer, name: str) -> Array:
    if name in {f.casefold() for f in layer.fields}:
        return layer.numbers(name)
    return np.full(len(layer), np.nan)


def _forms(name: str) -> list[str]:
    """Return what a photograph may be called: whole, without its extension, without its folders, without both."""
    path = PurePosixPath(name.replace("\\", "/").strip().casefold())
    return [path.as_posix(), path.with_suffix("").as_posix(), path.name, path.stem] if path.name else []


def _match(images: list[str], names: list[str]) -> tuple[dict[str, int], list[str]]:
    """Return the row of each photograph that has one, and the images that match none."""
    by_form: list[defaultdict[str, list[str]]] = [defaultdict(list) for _ in range(4)]
    for name in names:
        for table, form in zip(by_form, _forms(name), strict=True):
            table[form].append(name)
    rows: dict[str, int] = {}
    unmatched = []
    for i, image in enumerate(images):
        found: list[str] = []
        forms = _forms(image)
        for table, form in zip(by_form, forms, strict=False):
            found = found or table.get(form, [])
        if not found and forms:  # "flight.2" for flight.2.jpg has no extension to be left out
            found = by_form[1].get(forms[0]) or by_form[3].get(forms[2]) or []
        if len(found) > 1:
            raise InputError(f"POSITIONS: {image} could be {' or '.join(found[:3])}: write its folder too.")
        if not found:
            unmatched.append(image or "(no name)")
        elif found[0] in rows:
            raise InputError(f"POSITIONS has two rows for {found[0]}: keep one.")
        else:
            rows[found[0]] = i
    if not rows:
        raise InputError(
            f"POSITIONS names none of the photographs: it has {some(images[:3])}; the photographs are {some(names[:3])} ...: "
            "correct its column 'image'."
        )
    return rows, unmatched


def _definition(crs: str | None) -> CRS:
    try:
        return CRS.from_user_input(crs) if crs else _WGS84
    except CRSError as error:
        raise InputError(f"POSITIONS_CRS {crs!r} is not understood: choose it from the list.") from error


def _height_unit(crs: CRS) -> float:
    """Return metres per unit of the heights of ``crs``."""
    horizontal = crs.sub_crs_list[0] if crs.is_compound else crs
    if len(crs.axis_info) > 2:
        return float(crs.axis_info[2].unit_conversion_factor)
    factor = horizontal.axis_info[0].unit_conversion_factor
    if horizontal.is_projected and abs(factor - 1.0) > 1e-9:
        raise InputError(
            f"POSITIONS_CRS {crs.name} is in {horizontal.axis_info[0].unit_name} and does not say what z is in: "
            "give the positions in a CRS in metres, or in one with a vertical axis."
        )
    return 1.0


def _to_wgs84(crs: CRS, x: Array, y: Array, images: list[str]) -> tuple[Array, Array]:
    horizontal = crs.sub_crs_list[0] if crs.is_compound else crs
    horizontal = horizontal.to_2d()
    if not (horizontal.is_projected or horizontal.is_geographic):
        raise InputError(f"POSITIONS_CRS {crs.name} is neither projected nor geographic: choose another.")
    longitude, latitude = _change(horizontal, x, y)
    wrong = ~within_area(horizontal, longitude, latitude)
    if np.any(wrong):
        swapped = within_area(horizontal, *_change(horizontal, y, x))
        i = int(np.argmax(wrong))
        advice = "x and y look swapped (x is longitude or easting)" if np.all(swapped) else "correct them or POSITIONS_CRS"
        raise InputError(
            f"POSITIONS: {int(wrong.sum())} of {len(x)} positions are not in the area of {crs.name}, such as {images[i]} at "
            f"x={x[i]:.10g} y={y[i]:.10g}: {advice}."
        )
    return longitude, latitude


def _change(crs: CRS, x: Array, y: Array) -> tuple[Array, Array]:
    if crs.is_geographic:
        # PROJ wraps longitudes and would accept 4500000 degrees.
        valid = (np.abs(x) <= 180.0) & (np.abs(y) <= 90.0)
        x, y = np.where(valid, x, np.inf), np.where(valid, y, np.inf)
    if crs == _WGS84 or crs.equals(_WGS84, ignore_axis_order=True):
        return x, y
    longitude, latitude = transformer(crs, _WGS84).transform(x, y)
    return np.asarray(longitude), np.asarray(latitude)


def within_area(crs: CRS, longitude: Array, latitude: Array) -> NDArray[np.bool_]:
    """Tell which places (degrees, WGS 84) a CRS is meant for; one that does not say is meant for all."""
    finite = np.isfinite(longitude) & np.isfinite(latitude)
    area = _area_of_use(crs)
    if area is None:
        return finite
    width = (area.east - area.west) % 360.0 or 360.0
    offset = (np.where(finite, longitude, 0.0) - area.west + _FAR) % 360.0
    within = (latitude >= area.south - _FAR) & (latitude <= area.north + _FAR) & (offset <= width + 2 * _FAR)
    return np.asarray(finite & within)


def _area_of_use(crs: CRS) -> Any:
    """Return a CRS's area of use (degrees), looked up where its WKT has lost it, or None."""
    if crs.area_of_use is not None:
        return crs.area_of_use
    code = crs.to_epsg(min_confidence=70)
    return CRS.from_epsg(code).area_of_use if code else None


def distance_from_exif(table: Table, exif: list[Position]) -> float | None:
    """Return the distance (m) between the medians of the table's and of EXIF's positions, None without EXIF.

    Raises
    ------
    InputError
        When longitude and latitude of the table are swapped, which only EXIF can tell where both are below 90 degrees.
    """
    if not table.positions or not exif:
        return None
    ours, theirs = median_place(list(table.positions.values())), median_place(exif)
    geod = Geod(ellps="WGS84")
    distance = geod.inv(*ours, *theirs)[2]
    if distance > _FAR_FROM_EXIF and abs(ours[0]) <= 90.0 and geod.inv(ours[1], ours[0], *theirs)[2] < _FAR_FROM_EXIF:
        raise InputError("POSITIONS: x and y are swapped, says the photographs' EXIF: x is longitude or easting.")
    return float(distance)


def median_place(positions: list[Position]) -> tuple[float, float]:
    """Return the median longitude and latitude (degrees)."""
    return float(np.median([p.longitude for p in positions])), float(np.median([p.latitude for p in positions]))


def _none(value: float) -> float | None:
    return None if math.isnan(value) else float(value)
