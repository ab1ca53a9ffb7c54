"""Metashape's marker XML: ground control and its marks together."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from ..errors import InputError
from .control import Given
from .gcptext import FORMATS, Part
from .marks import Mark


def read_markers(root: ElementTree.Element, name: str) -> Part:
    """Read Metashape's marker XML, whose pixels count from the corner as ours do (the manual's appendix).

    Raises
    ------
    InputError
        When it is none, has no markers with coordinates or several chunks with them, or something in it is not a number.
    """
    chunks = [root] if root.tag == "chunk" else list(root.iter("chunk"))
    if root.tag not in ("document", "chunk") or not chunks:
        raise InputError(f"{name} is neither Metashape's marker XML nor MicMac's points or image measures: give {FORMATS}.")
    surveyed = [c for c in chunks if c.find("markers//marker/reference[@x]") is not None]
    if len(surveyed) > 1:
        labels = ", ".join(repr(c.get("label", "")) for c in surveyed[:4])
        raise InputError(f"{name} has {len(surveyed)} chunks with ground points ({labels}): export the markers of one chunk.")
    chunk = surveyed[0] if surveyed else chunks[0]
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
        sx, sy, sz = (_number(reference, a, name, label) for a in ("sx", "sy", "sz"))
        sigmas.append([np.sqrt((sx**2 + sy**2) / 2), sz])
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
    given = Given(name, crs, tuple(names.values()), np.array(places), tuple(roles), np.array(sigmas))
    return Part(name, given, tuple(marks))


def _number(element: ElementTree.Element, attribute: str, name: str, label: str) -> float:
    text = element.get(attribute)
    if text is None:
        return float("nan")
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"{attribute}={text!r} of {label} in {name} is not a number: export the file again.") from error
