"""OpenDroneMap's ``gcp_list.txt``: ground control and its marks together."""

from __future__ import annotations

import re

import numpy as np
from pyproj import CRS
from pyproj.exceptions import CRSError

from ..errors import InputError
from .control import Given
from .gcptext import FORMATS, Part
from .marks import Mark

_UTM = re.compile(r"WGS\s*84\s+UTM\s+(\d{1,2})\s*([NS])", re.IGNORECASE)
_HALF_PIXEL = 0.5  # ODM counts from the centre of the top-left pixel, we from its corner


def read_odm(text: str, name: str) -> Part:
    """Read ODM's list: a line with the CRS, then ``x y z column row image [name] [extras]`` per mark.

    Raises
    ------
    InputError
        When its first line names no CRS, or a line is not complete or contradicts another.
    """
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), start=1)]
    lines = [(n, line) for n, line in lines if line and not line.startswith("#")]
    if not lines:
        raise InputError(f"The GCP file {name} is empty: give {FORMATS}.")
    crs = _crs(lines[0][1], name)
    points: dict[str, tuple[float, float, float]] = {}
    nameless: dict[tuple[float, float, float], str] = {}
    marks = []
    for number, line in lines[1:]:
        words = [w.strip() for w in line.split("\t") if w.strip()] if line.count("\t") >= 5 else line.split()
        try:
            x, y, z, column, row = map(float, words[:5])
            image = words[5]
        except (ValueError, IndexError) as error:
            raise InputError(f"The line {number} of {name} is not 'x y z column row image name': correct it.") from error
        if not np.isfinite([column, row]).all():
            raise InputError(f"The line {number} of {name} has no finite pixel coordinates: correct it.")
        place = (x, y, z)
        gcp = words[6] if len(words) > 6 else nameless.setdefault(place, f"gcp{len(nameless) + 1}")
        if not np.array_equal(points.setdefault(gcp, place), place, equal_nan=True):
            raise InputError(f"The line {number} of {name} gives {gcp} other coordinates than before: correct one.")
        marks.append(Mark(gcp, image, column + _HALF_PIXEL, row + _HALF_PIXEL))
    if not points:
        raise InputError(f"The GCP file {name} has no points below its first line: add some.")
    return Part(name, Given(name, crs, tuple(points), np.array(list(points.values()), float)), tuple(marks))


def _crs(line: str, name: str) -> str:
    utm = _UTM.fullmatch(line)
    if utm:
        zone = int(utm[1])
        if 1 <= zone <= 60:
            return f"EPSG:{(32600 if utm[2].upper() == 'N' else 32700) + zone}"
    try:
        crs = CRS.from_user_input(line)
    except CRSError as error:
        raise InputError(
            f"The first line of {name} ({line[:60]!r}) names no CRS, as ODM's list must (an EPSG code, a PROJ string or 'WGS84 "
            f"UTM 11N'), and the file is nothing else that is known: give {FORMATS}."
        ) from error
    # A PROJ string has no name of its own; most mean a CRS that has one.
    code = crs.to_epsg() if len(crs.axis_info) == 2 else None
    return f"EPSG:{code}" if code else line
