"""GCP_FILE: ground control and its marks from one file that holds both, or from two of which each holds one.

ODM's list and Metashape's XML hold both. MicMac's files and tables (CSV) hold one: the user names both, separated by a
semicolon, or one, and the other is found beside it by what it contains. All readers return marks in this project's image
coordinates (corner of the top-left pixel at 0, 0).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from . import micmac
from .control import Given
from .gcptables import read_table
from .gcptext import Part, parse_xml, read_text
from .marks import key_of
from .metashape import read_markers
from .odm import read_odm

_BESIDE = (".xml", ".txt", ".csv")
_MOST_BESIDE = 200  # files to look into
_MOST_BYTES_BESIDE = 5_000_000
_ESTIMATES = "-s3d"  # points that MicMac intersected itself end so


def read_gcp_file(path: str) -> Given:
    """Read control and marks from a file, or from two separated by a semicolon.

    Raises
    ------
    InputError
        When a file cannot be read, is of another format or not complete, or the second file is not found.
    """
    paths = [Path(path)] if Path(path).is_file() else [Path(p.strip()) for p in path.split(";") if p.strip()]
    if not 1 <= len(paths) <= 2:
        raise InputError(
            f"GCP_FILE names {len(paths)} files: give one, or one of points and one of marks, separated by a semicolon."
        )
    parts = [read_part(p) for p in paths]
    if len(parts) == 2:
        return _joined(*parts)
    part = parts[0]
    if part.points is not None and part.marks is not None:
        return replace(part.points, marks=part.marks)
    other = _beside(paths[0], part)
    given = _joined(part, other)
    note = f"{part.where} holds {_content(part)} only: the {_content(other)} are those of {other.where} in the same folder."
    return replace(given, notes=(*given.notes, note))


def read_part(path: Path) -> Part:
    """Read what one file holds.

    Raises
    ------
    InputError
        When it cannot be read, is of another format, or not complete.
    """
    text, name = read_text(path), path.name
    if text.lstrip().startswith("<"):
        root = parse_xml(text, name)
        if micmac.holds_points(root):
            return micmac.read_points(root, name)
        if micmac.holds_marks(root):
            return micmac.read_marks(root, name)
        return read_markers(root, name)
    if micmac.is_text(text):
        return micmac.read_text_points(text, name)
    return read_table(text, name) or read_odm(text, name)


def _joined(one: Part, other: Part) -> Given:
    whole = next((p for p in (one, other) if p.points is not None and p.marks is not None), None)
    if whole is not None:
        raise InputError(f"{whole.where} holds points and marks: give it alone as GCP_FILE.")
    points, marks = (one, other) if one.points is not None else (other, one)
    if points.points is None or marks.marks is None:
        raise InputError(f"{one.where} and {other.where} both hold {_content(one)}: give one file of points and one of marks.")
    return replace(points.points, marks=marks.marks)


def _beside(path: Path, part: Part) -> Part:
    """Return the part in the same folder that completes ``part``."""
    wanted = "marks" if part.points is not None else "points"
    ours = _names(part)
    found: list[Part] = []
    for candidate in _candidates(path):
        try:
            other = read_part(candidate)
        except InputError:
            continue  # of something else
        fits = (other.points is None) == (wanted == "marks") and (other.marks is None) == (wanted == "points")
        if fits and ours & _names(other) and not any(_same(other, known) for known in found):
            found.append(other)
    if not found:
        raise InputError(
            f"{part.where} holds {_content(part)} only, and its folder has no file of {wanted} with the same names: name both "
            "files as GCP_FILE, separated by a semicolon."
        )
    if len(found) > 1:
        raise InputError(
            f"The {wanted} for {part.where} could be those of {' or '.join(p.where for p in found[:4])}: name both files as "
            f"GCP_FILE, such as {part.where};{found[0].where}."
        )
    return found[0]


def _candidates(path: Path) -> list[Path]:
    try:
        files = sorted(p for p in path.absolute().parent.iterdir() if p.suffix.lower() in _BESIDE and p.is_file())
        small = [p for p in files if p.stat().st_size <= _MOST_BYTES_BESIDE and not p.stem.lower().endswith(_ESTIMATES)]
    except OSError:
        return []
    return [p for p in small if p.name != path.name][:_MOST_BESIDE]


def _names(part: Part) -> set[str]:
    names = part.points.names if part.points is not None else [m.gcp for m in part.marks or ()]
    return {key_of(name) for name in names}


def _same(one: Part, other: Part) -> bool:
    """Tell whether two parts say the same: MicMac's users have their points as text and as the XML made of it."""
    if one.points is None or other.points is None:
        return set(one.marks or ()) == set(other.marks or ())
    a, b = one.points, other.points
    return a.names == b.names and np.array_equal(np.round(a.coordinates, 4), np.round(b.coordinates, 4), equal_nan=True)


def _content(part: Part) -> str:
    return "points" if part.points is not None else "marks"
