"""XMP: what drones write beside EXIF, as attributes or as elements."""

from __future__ import annotations

import math
from xml.etree import ElementTree

DJI = "http://www.dji.com/drone-dji/1.0/"
PIX4D_CAMERA = "http://pix4d.com/camera/1.0"
_LARGEST = 1_000_000  # characters; drones write a few thousand


def parse_xmp(packet: bytes | str) -> dict[tuple[str, str], str]:
    """Return the simple properties of an XMP packet by (namespace without trailing slash, name).

    Raises
    ------
    ValueError
        When the packet is not well-formed, too large, or has a document type (XMP has none; entities could be hostile).
    """
    text = packet.decode("utf-8", "replace") if isinstance(packet, bytes) else packet
    start, end = text.find("<"), text.rfind(">")
    text = text[start : end + 1]
    if len(text) > _LARGEST or "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError("the XMP packet is too large or has a document type")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"the XMP packet is not well-formed: {error}") from error
    found: dict[tuple[str, str], str] = {}
    for element in root.iter():
        for tag, value in [*element.attrib.items(), (element.tag, (element.text or "").strip())]:
            namespace, _, name = tag.rpartition("}")
            if value:
                found.setdefault((namespace.lstrip("{").rstrip("/"), name), value)
    return found


def xmp_number(properties: dict[tuple[str, str], str], namespace: str, *names: str) -> float | None:
    """Return the first of ``names`` in ``namespace`` that is a finite number, else None."""
    for name in names:
        try:
            value = float(properties.get((namespace.rstrip("/"), name), ""))
        except ValueError:
            continue
        if math.isfinite(value):
            return value
    return None
