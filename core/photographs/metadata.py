"""What a photograph's EXIF and XMP tell of the camera and of the place."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from typing import Any

from PIL import ExifTags

from ..survey import Position
from .containers import Tags, read_tags
from .reading import BROKEN
from .xmp import DJI, PIX4D_CAMERA, parse_xmp, xmp_number

_DIAGONAL_35MM = math.hypot(36.0, 24.0)  # mm
_SENSORS = 2.0, 100.0  # mm, the longer side
_CUT = 0.05  # share by which nobody makes a photograph smaller
_PER_MM = {2: 1 / 25.4, 3: 0.1, 4: 1.0, 5: 1000.0}  # FocalPlaneResolutionUnit: inch, cm, mm, um


@dataclass(frozen=True)
class Metadata:
    """One photograph's metadata; what a file does not tell is None.

    ``body`` names maker, model, lens and serial number; ``focal_length`` and ``focal_length_35mm`` are in mm,
    ``focal_plane`` is pixels per mm of the sensor in a photograph whose longer side is ``exif_side``. ``xmp_height`` is
    DJI's absolute altitude. ``problems`` says what could not be read.
    """

    body: str = ""
    focal_length: float | None = None
    focal_length_35mm: float | None = None
    focal_plane: float | None = None
    exif_side: int | None = None
    time: str | None = None
    position: Position | None = None
    exif_height: float | None = None
    xmp_height: float | None = None
    relative_height: float | None = None
    yaw: float | None = None
    pitch: float | None = None
    roll: float | None = None
    problems: tuple[str, ...] = ()


def read_metadata(data: bytes) -> Metadata:
    """Read the EXIF and XMP of a photograph from its file's content.

    JPG, PNG, CR3, RAF and whatever is built like a TIFF (most RAW files are) are understood; other files tell nothing.

    A position and its height are EXIF's. Where the XMP gives the sigmas of an RTK receiver, position and absolute
    altitude are the XMP's, since it is they that have those sigmas; and so they are where EXIF has none. 0, 0 is what
    receivers write before they know, and is no position. EXIF's ``GPSHPositioningError`` does not say how probable it
    is; it is taken as one sigma.
    """
    problems: list[str] = []
    tags = Tags()
    with warnings.catch_warnings(record=True) as complaints:
        warnings.simplefilter("always")
        try:
            tags = read_tags(data)
        except BROKEN as error:
            problems.append(f"EXIF is broken ({error})")
    problems += [f"EXIF is broken ({str(c.message).strip()})" for c in complaints if issubclass(c.category, UserWarning)][:1]
    properties: dict[tuple[str, str], str] = {}
    if tags.xmp:
        try:
            properties = parse_xmp(tags.xmp)
        except ValueError as error:
            problems.append(str(error))
    base, detail, gps = tags.base, tags.exposure, tags.gps
    exif_height = _height(gps)
    focal_plane = _number(detail.get(ExifTags.Base.FocalPlaneXResolution))
    unit = _number(detail.get(ExifTags.Base.FocalPlaneResolutionUnit)) or 2
    sides = [_number(detail.get(t)) or 0.0 for t in (ExifTags.Base.ExifImageWidth, ExifTags.Base.ExifImageHeight)]
    return Metadata(
        body=_body(base, detail),
        focal_length=_positive(detail.get(ExifTags.Base.FocalLength)),
        focal_length_35mm=_positive(detail.get(ExifTags.Base.FocalLengthIn35mmFilm)),
        focal_plane=focal_plane * _PER_MM[int(unit)] if focal_plane and unit in _PER_MM else None,
        exif_side=int(max(sides)) or None,
        time=_time(detail),
        position=_position(gps, exif_height, properties),
        exif_height=exif_height,
        xmp_height=xmp_number(properties, DJI, "AbsoluteAltitude"),
        relative_height=xmp_number(properties, DJI, "RelativeAltitude"),
        yaw=xmp_number(properties, DJI, "GimbalYawDegree"),
        pitch=xmp_number(properties, DJI, "GimbalPitchDegree"),
        roll=xmp_number(properties, DJI, "GimbalRollDegree"),
        problems=tuple(problems),
    )


def focal_pixels(metadata: Metadata, width: int, height: int) -> float | None:
    """Return the focal length in pixels of a photograph of ``width`` x ``height``, None when the metadata do not tell.

    The sensor's pixel pitch (``FocalPlaneXResolution``) is exact where it is given. The "35 mm equivalent" is rounded to
    a millimetre and refers to the diagonal of the sensor (CIPA DCG-001), ``hypot(36, 24)`` mm. A picture wider than
    3:2 is cut from a higher sensor, taken to be 4:3 as in most drones; on a 3:2 sensor that is 4 % too long. Where both are given
    and differ by a quarter, or the sensor would be 2 mm or 100 mm wide, the pitch is of something else and is not used.
    """
    long, short = max(width, height), min(width, height)
    equivalent = None
    if metadata.focal_length_35mm:
        diagonal = math.hypot(long, 0.75 * long if long > 1.52 * short else short)
        equivalent = metadata.focal_length_35mm * diagonal / _DIAGONAL_35MM
    if metadata.focal_plane and metadata.focal_length:
        side = metadata.exif_side or long  # a photograph made smaller keeps the pitch of the original
        # A RAW may show a little more than the JPG that the pitch is told of.
        scale = long / side if abs(long / side - 1.0) > _CUT else 1.0
        pixels = metadata.focal_length * metadata.focal_plane * scale
        sensor = side / metadata.focal_plane
        if _SENSORS[0] < sensor < _SENSORS[1] and (equivalent is None or 0.8 < pixels / equivalent < 1.25):
            return pixels
    return equivalent


def camera_name(metadata: Metadata, width: int, height: int) -> str:
    """Return the name that photographs of one interior orientation share."""
    parts = [metadata.body or "unknown camera"]
    if metadata.focal_length:
        parts.append(f"{metadata.focal_length:.4g} mm")
    if width and height:
        parts.append(f"{width} x {height}")
    return ", ".join(parts)


def _position(gps: dict[int, Any], exif_height: float | None, xmp: dict[tuple[str, str], str]) -> Position | None:
    rtk_h = [xmp_number(xmp, DJI, name) for name in ("RtkStdLon", "RtkStdLat")]
    rtk_v = xmp_number(xmp, DJI, "RtkStdHgt")
    exif_place = _place(
        _degrees(gps, ExifTags.GPS.GPSLongitude, ExifTags.GPS.GPSLongitudeRef, "W"),
        _degrees(gps, ExifTags.GPS.GPSLatitude, ExifTags.GPS.GPSLatitudeRef, "S"),
    )
    # "Longtitude" is what DJI's firmware wrote for years.
    xmp_place = _place(
        xmp_number(xmp, DJI, "GpsLongitude", "GpsLongtitude", "Longitude"), xmp_number(xmp, DJI, "GpsLatitude", "Latitude")
    )
    xmp_height = xmp_number(xmp, DJI, "AbsoluteAltitude")
    sigma_h = math.sqrt((rtk_h[0] ** 2 + rtk_h[1] ** 2) / 2) if rtk_h[0] and rtk_h[1] else None
    of_rtk = sigma_h is not None
    place = (xmp_place or exif_place) if of_rtk else (exif_place or xmp_place)
    if place is None:
        return None
    first, second = (xmp_height, exif_height) if of_rtk else (exif_height, xmp_height)
    return Position(
        longitude=place[0],
        latitude=place[1],
        height=first if first is not None else second,
        sigma_h=sigma_h
        or _positive(gps.get(ExifTags.GPS.GPSHPositioningError))
        or _positive(xmp_number(xmp, PIX4D_CAMERA, "GPSXYAccuracy")),
        sigma_v=_positive(rtk_v) or _positive(xmp_number(xmp, PIX4D_CAMERA, "GPSZAccuracy")),
    )


def _place(longitude: float | None, latitude: float | None) -> tuple[float, float] | None:
    if longitude is None or latitude is None or (longitude == 0.0 and latitude == 0.0):
        return None
    return (longitude, latitude) if abs(longitude) <= 180.0 and abs(latitude) <= 90.0 else None


def _degrees(gps: dict[int, Any], tag: int, reference: int, negative: str) -> float | None:
    try:
        degrees, minutes, seconds = (float(v) for v in gps[tag])
    except (KeyError, TypeError, ValueError):
        return None
    value = degrees + minutes / 60.0 + seconds / 3600.0
    if not math.isfinite(value):
        return None
    return -value if _text(gps.get(reference)).upper().startswith(negative) else value


def _height(gps: dict[int, Any]) -> float | None:
    value = _number(gps.get(ExifTags.GPS.GPSAltitude))
    if value is None:
        return None
    reference = gps.get(ExifTags.GPS.GPSAltitudeRef, 0)
    if isinstance(reference, bytes):
        reference = reference[0] if reference else 0
    # 1 is below sea level; EXIF 3 adds 2 and 3, above and below the ellipsoid.
    return -abs(value) if str(reference).strip() in ("1", "3") else value


def _time(detail: dict[int, Any]) -> str | None:
    """Return the time of exposure as ISO 8601, with an offset from UTC only where the camera wrote one."""
    for taken, fraction, offset in (
        (ExifTags.Base.DateTimeOriginal, ExifTags.Base.SubsecTimeOriginal, ExifTags.Base.OffsetTimeOriginal),
        (ExifTags.Base.DateTimeDigitized, ExifTags.Base.SubsecTimeDigitized, ExifTags.Base.OffsetTimeDigitized),
    ):
        match = re.fullmatch(r"(\d{4})[:-](\d\d)[:-](\d\d)[ T](\d\d:\d\d:\d\d)", _text(detail.get(taken)))
        if match and match[1] != "0000":
            digits, zone = _text(detail.get(fraction)), _text(detail.get(offset))
            year, month, day, clock = match.groups()
            part = f".{digits}" if digits.isdigit() else ""
            return f"{year}-{month}-{day}T{clock}{part}" + (zone if re.fullmatch(r"[+-]\d\d:\d\d", zone) else "")
    return None


def _body(base: dict[int, Any], detail: dict[int, Any]) -> str:
    make, model = _text(base.get(ExifTags.Base.Make)), _text(base.get(ExifTags.Base.Model))
    if make and not model.casefold().startswith(make.casefold().split()[0]):
        model = f"{make} {model}".strip()
    lens, serial = _text(detail.get(ExifTags.Base.LensModel)), _text(detail.get(ExifTags.Base.BodySerialNumber))
    return ", ".join(p for p in (model, lens, f"no. {serial}" if serial else "") if p)


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        value = value.decode("ascii", "replace")
    return str(value).partition("\0")[0].strip() if value is not None else ""


def _number(value: Any) -> float | None:
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) else None


def _positive(value: Any) -> float | None:
    number = _number(value)
    return number if number is not None and number > 0.0 else None
