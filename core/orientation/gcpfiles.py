"""Files that hold ground control and its marks together: ODM's gcp_list.txt and Metashape's marker XML.

Each returns marks in this project's image coordinates (corner of the top-left pixel at 0, 0). Files come from strangers: XML is
parsed without document types, hence without entities.
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from pyproj import CRS
from pyproj.exceptions import CRSError

from ..errors import InputError
from .control import Given
from .marks import Mark

_UTM = re.compile(r"WGS\s*84\s+UTM\s+(\d{1,2})\s*([NS])", re.IGNORECASE)
_ODM_HALF_PIXEL = 0.5  # ODM counts from the centre of the top-left pixel, we from its corner
_MOST_BYTES = 200_000_000


def read_gcp_file(path: str) -> Given:
    """Read control and marks from a file of ODM or Metashape.

    Raises
    ------
    InputError
        When it cannot be read, is of another format, or a line is not complete.
    """
    text = _text(Path(path))
    name = Path(path).name
    if text.lstrip().startswith("<"):
        return _xml(text, name)
    return _odm(text, name)


def _odm(text: str, name: str) -> Given:
    """Read ODM's list: a line with the CRS, then ``x y z column row image [name] [extras]`` per mark."""
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), start=1)]
    lines = [(n, line) for n, line in lines if line and not line.startswith("#")]
    if not lines:
        raise InputError(f"The GCP file {name} is empty: give ODM's gcp_list.txt or Metashape's marker XML.")
    crs = _odm_crs(lines[0][1], name)
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
        marks.append(Mark(gcp, image, column + _ODM_HALF_PIXEL, row + _ODM_HALF_PIXEL))
    if not points:
        raise InputError(f"The GCP file {name} has no points below its first line: add some.")
    return Given(name, crs, tuple(points), np.array(list(points.values()), float), marks=tuple(marks))


def _odm_crs(line: str, name: str) -> str:
    utm = _UTM.fullmatch(line)
    if utm:
        zone = int(utm[1])
        if 1 <= zone <= 60:
            return f"EPSG:{(32600 if utm[2].upper() == 'N' else 32700) + zone}"
    try:
        crs = CRS.from_user_input(line)
    except CRSError as error:
        raise InputError(
            f"The first line of {name} ({line[:60]!r}) names no CRS: write an EPSG code, a PROJ string or 'WGS84 UTM 11N'; "
            "of other programs' files only Metashape's marker XML is read, the rest goes in GCPS and MARKS."
        ) from error
    # A PROJ string has no name of its own; most mean a CRS that has one.
    code = crs.to_epsg() if len(crs.axis_info) == 2 else None
    return f"EPSG:{code}" if code else line


def _xml(text: str, name: str) -> Given:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(f"{name} declares a document type, which no GCP file needs: remove it.")
    try:
        root = ElementTree.fromstring(text)  # noqa: S314 - no document type, hence no entities
    except ElementTree.ParseError as error:
        raise InputError(f"{name} is not sound XML ({error}): export it again.") from error
    if root.find(".//OneAppuisDAF") is not None or root.find(".//MesureAppuiFlottant1Im") is not None:
        raise InputError(
            f"{name} is MicMac's, which keeps points and marks in two files without a CRS: give them as GCPS and MARKS instead."
        )
    chunk = root if root.tag == "chunk" else root.find(".//chunk")
    if root.tag not in ("document", "chunk") or chunk is None:
        raise InputError(f"{name} is not Metashape's marker XML: export the markers as XML from the Reference pane.")
    return _metashape(chunk, name)


def _metashape(chunk: ElementTree.Element, name: str) -> Given:
    """Read a chunk of Metashape's marker XML, whose pixels count from the corner as ours do (the manual's appendix)."""
    crs = chunk.findtext("reference")
    cameras = {c.get("id"): c.get("label", "") for c in chunk.iterfind("cameras//camera")}
    names: dict[str | None, str] = {}
    places, roles, sigmas = [], [], []
    for marker in chunk.iterfind("markers//marker"):
        reference = marker.find("reference")
        if reference is None or reference.get("x") is None:
            continue  # a marker without ground coordinates is a tie point
        label = marker.get("label") or f"marker {marker.get('id')}"
        names[marker.get("id")] = label
        places.append([_number(reference, a, name, label) for a in ("x", "y", "z")])
        sigmas.append([_number(reference, a, name, label) for a in ("sx", "sz")])
        # Metashape adjusts on the ticked markers and checks on the others.
        roles.append("control" if reference.get("enabled", "true").lower() in ("true", "1") else "check")
    if not names:
        raise InputError(f"{name} has no markers with coordinates: enter them in Metashape's Reference pane and export again.")
    marks = []
    for marker in chunk.iterfind("frames/frame/markers/marker"):
        gcp = names.get(marker.get("marker_id"))
        for location in marker.iterfind("location"):
            pinned = location.get("pinned", location.get("valid", "true")).lower() in ("true", "1")
            image = cameras.get(location.get("camera_id"))
            if gcp is not None and image and pinned:  # the rest are Metashape's own projections, not measurements
                marks.append(Mark(gcp, image, _number(location, "x", name, gcp), _number(location, "y", name, gcp)))
    return Given(name, crs, tuple(names.values()), np.array(places), tuple(roles), np.array(sigmas), tuple(marks))


def _number(element: ElementTree.Element, attribute: str, name: str, label: str) -> float:
    text = element.get(attribute)
    if text is None:
        return float("nan")
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"{attribute}={text!r} of {label} in {name} is not a number: export the file again.") from error


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(f"{path} is far too large for a GCP file: give ODM's gcp_list.txt or Metashape's marker XML.")
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"The GCP file {path} cannot be read ({error.strerror}): check its path.") from error
    for encoding in ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8-sig", "cp1252"):
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise InputError(f"The GCP file {path} is not text: give ODM's gcp_list.txt or Metashape's marker XML.")
