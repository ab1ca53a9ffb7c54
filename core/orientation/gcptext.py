"""Reading files of ground control safely: text of any usual encoding, XML without document types, numbers.

Files come from strangers: their size is limited, and XML is parsed without document types, hence without entities.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..errors import InputError
from .control import Given
from .marks import Mark

FORMATS = "ODM's gcp_list.txt, Metashape's or MicMac's XML, or tables of points and marks (CSV)"
_MOST_BYTES = 50_000_000


@dataclass(frozen=True)
class Part:
    """What one file holds: ``points``, ``marks`` or both; None for what it does not hold."""

    where: str
    points: Given | None = None
    marks: tuple[Mark, ...] | None = None


def read_text(path: Path) -> str:
    """Return a file's text; UTF-8 and UTF-16 with or without their mark, else Windows' Western code page.

    Raises
    ------
    InputError
        When it cannot be read, is too large, or no text.
    """
    try:
        if path.is_dir():
            raise InputError(f"GCP_FILE {path} is a folder: give a file: {FORMATS}.")
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(f"{path} is far too large for a GCP file: give {FORMATS}.")
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"The GCP file {path} cannot be read ({error.strerror}): check its path.") from error
    for encoding in ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8-sig", "cp1252"):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text
    raise InputError(f"The GCP file {path} is not text: give {FORMATS}.")


def parse_xml(text: str, name: str) -> ElementTree.Element:
    """Return the root of an XML text.

    Raises
    ------
    InputError
        When it is not sound, or declares a document type.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(f"{name} declares a document type, which no GCP file needs: remove it.")
    try:
        return ElementTree.fromstring(text)  # noqa: S314 - no document type, hence no entities
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{name} is not sound XML ({error}): export it again.") from error


def numbers_in(text: str | None, count: int, what: str, name: str) -> tuple[float, ...]:
    """Return the ``count`` finite numbers of a text, separated by blanks.

    Raises
    ------
    InputError
        When it holds anything else.
    """
    try:
        values = tuple(float(word) for word in (text or "").split())
    except ValueError:
        values = ()
    if len(values) != count or not np.isfinite(values).all():
        raise InputError(
            f"{what} in {name} is not {count} numbers ({(text or '').strip()[:60]!r}): correct it or export it again."
        )
    return values
