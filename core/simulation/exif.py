"""EXIF and XMP of a simulated photograph, written as a drone writes them."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational

MAKER, MODEL = "Strandline", "Simulated"
_PIXEL = 0.004  # mm on the sensor
_FULL_FRAME = 43.2666  # mm, the diagonal of 24 x 36
_JPEG_QUALITY = 90


@dataclass(frozen=True)
class Metadata:
    """What the drone knows of an exposure: WGS 84 degrees, metres, degrees, pixels."""

    time: str  # ISO 8601, no zone
    longitude: float
    latitude: float
    height: float
    relative_height: float
    sigma_h: float
    sigma_v: float
    yaw: float
    focal: float


class Tags(NamedTuple):
    """EXIF by its three directories: a number, fraction, text or bytes by tag."""

    base: dict[int, Any]
    photo: dict[int, Any]
    gps: dict[int, Any]


def save_jpeg(path: Path, pixels: NDArray[np.uint8], metadata: Metadata) -> None:
    """Write ``pixels`` (rows, columns, 3) with its metadata."""
    rows, columns = pixels.shape[:2]
    shared, exif = tags(metadata, columns, rows), Image.Exif()
    exif.update(shared.base)
    exif.get_ifd(ExifTags.IFD.Exif).update(shared.photo)
    exif.get_ifd(ExifTags.IFD.GPSInfo).update(shared.gps)
    Image.fromarray(pixels).save(
        path,
        "JPEG",
        quality=_JPEG_QUALITY,
        exif=exif.tobytes(),
        xmp=xmp(metadata).encode(),
    )


def tags(m: Metadata, columns: int, rows: int) -> Tags:
    """Return the EXIF of a photograph of ``columns`` x ``rows`` pixels."""
    taken = datetime.datetime.fromisoformat(m.time)
    stamp = taken.strftime("%Y:%m:%d %H:%M:%S")
    base, tag = ExifTags.Base, ExifTags.GPS
    millimetres = m.focal * _PIXEL
    equivalent = m.focal / float(np.hypot(columns, rows)) * _FULL_FRAME
    return Tags(
        {base.Make: MAKER, base.Model: MODEL, base.Orientation: 1, base.DateTime: stamp},
        {
            base.ExposureTime: IFDRational(1, 1000),
            base.FNumber: IFDRational(28, 10),
            base.ISOSpeedRatings: 100,
            base.DateTimeOriginal: stamp,
            base.DateTimeDigitized: stamp,
            base.OffsetTimeOriginal: "+00:00",
            base.FocalLength: IFDRational(round(millimetres * 1e6), 10**6),
            base.FocalLengthIn35mmFilm: round(equivalent),
            base.ExifImageWidth: columns,
            base.ExifImageHeight: rows,
            # Pixels per centimetre: with the focal length they give it in pixels, better than the rounded equivalent.
            base.FocalPlaneXResolution: IFDRational(round(10 / _PIXEL), 1),
            base.FocalPlaneYResolution: IFDRational(round(10 / _PIXEL), 1),
            base.FocalPlaneResolutionUnit: 3,
        },
        {
            tag.GPSVersionID: b"\x02\x03\x00\x00",
            tag.GPSLatitudeRef: "N" if m.latitude >= 0 else "S",
            tag.GPSLatitude: _sexagesimal(m.latitude),
            tag.GPSLongitudeRef: "E" if m.longitude >= 0 else "W",
            tag.GPSLongitude: _sexagesimal(m.longitude),
            tag.GPSAltitudeRef: b"\x00" if m.height >= 0 else b"\x01",
            tag.GPSAltitude: IFDRational(round(abs(m.height) * 1000), 1000),
            tag.GPSMapDatum: "WGS-84",
        },
    )


def _sexagesimal(degrees: float) -> tuple[IFDRational, IFDRational, IFDRational]:
    units = round(abs(degrees) * 3600 * 10**6)  # of a millionth of a second, 0.03 mm
    minutes, seconds = divmod(units, 60 * 10**6)
    return IFDRational(minutes // 60, 1), IFDRational(minutes % 60, 1), IFDRational(seconds, 10**6)


def xmp(m: Metadata) -> str:
    """Return the XMP packet, with the names of DJI's drones."""
    values = {
        "GpsStatus": "RTK",
        "AltitudeType": "RtkAlt",
        "GpsLatitude": f"{m.latitude:+.9f}",
        "GpsLongitude": f"{m.longitude:+.9f}",
        "AbsoluteAltitude": f"{m.height:+.3f}",
        "RelativeAltitude": f"{m.relative_height:+.3f}",
        "GimbalRollDegree": "+0.00",
        "GimbalYawDegree": f"{m.yaw:+.2f}",
        "GimbalPitchDegree": "-90.00",  # what it is set to; its errors it does not know
        "RtkFlag": "50",
        "RtkStdLon": f"{m.sigma_h:.5f}",
        "RtkStdLat": f"{m.sigma_h:.5f}",
        "RtkStdHgt": f"{m.sigma_v:.5f}",
    }
    attributes = " ".join(f'drone-dji:{key}="{value}"' for key, value in values.items())
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" '
        f'xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/" {attributes}/></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    )
