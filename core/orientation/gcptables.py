"""Tables (CSV) of ground points and of marks, as Metashape, Pix4D and spreadsheets write them.

Points: Metashape's reference (``#Label,X/East,Y/North,Z/Altitude,Accuracy_(m),...`` below ``# CoordinateSystem: ...``), or any
table whose header names name, x, y and z. Marks: a header that names gcp, image, x and y in any order, or Pix4D's marks without a
header (``image,gcp,x,y`` and perhaps a zoom). Commas, semicolons or tabs separate; with the latter two a decimal comma will do.
Pixels count from the corner of the top-left pixel, as ours do.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from ..errors import InputError
from ..vector import number_of
from .control import Given
from .gcptext import Part
from .marks import Mark

_HEADER_WITHIN = 10  # lines
_CRS = re.compile(r"#\s*Coordinate\s?System\s*:\s*(.+)", re.IGNORECASE)
_IMAGES = {
    ".jpg",
    ".jpeg",
    ".tif",
    ".tiff",
    ".png",
    ".dng",
    ".cr2",
    ".cr3",
    ".nef",
    ".arw",
    ".raf",
    ".orf",
    ".rw2",
    ".pef",
    ".kdc",
}
# What a header's words mean, without case, blanks and signs.
_NAME = ("label", "name", "gcp", "gcpname", "gcplabel", "marker", "markerlabel", "markername", "point", "pointname", "id", "nom")
_IMAGE = ("image", "imagename", "imagefilename", "img", "imgname", "photo", "camera", "cameralabel", "filename", "imagelabel")
_X = ("x", "xeast", "xeasting", "xlongitude", "easting", "east", "e", "longitude", "lon")
_Y = ("y", "ynorth", "ynorthing", "ylatitude", "northing", "north", "n", "latitude", "lat")
_Z = ("z", "zaltitude", "altitude", "height", "elevation", "elev", "h")
_COLUMN = ("x", "u", "imageu", "imagex", "imx", "imgx", "px", "pxx", "xpx", "column", "col", "imcol")
_ROW = ("y", "v", "imagev", "imagey", "imy", "imgy", "py", "pxy", "ypx", "row", "line", "imrow")
_SIGMA_H = (
    "sigmah",
    "accuracyxym",
    "accuracyxy",
    "accuracyxeastm",
    "accuracyxeastingm",
    "accuracyxlongitudem",
    "accuracym",
    "accuracy",
)
_SIGMA_V = ("sigmav", "accuracyzm", "accuracyz", "accuracyzaltitudem", "accuracym", "accuracy")
_ROLE = ("role", "type")
_ENABLED = ("enable", "enabled")


@dataclass(frozen=True)
class _Table:
    name: str
    crs: str | None
    header: tuple[str, ...]  # empty when there is none
    rows: tuple[tuple[int, tuple[str, ...]], ...]  # the line's number and its cells

    def column(self, words: tuple[str, ...]) -> int | None:
        """Return where the first of the words stands in the header."""
        return next((self.header.index(w) for w in words if w in self.header), None)

    @property
    def holds_marks(self) -> bool:
        return all(self.column(w) is not None for w in (_IMAGE, _COLUMN, _ROW)) and self._gcp is not None

    @property
    def holds_points(self) -> bool:
        return all(self.column(w) is not None for w in (_NAME, _X, _Y, _Z))

    @property
    def _gcp(self) -> int | None:
        return self.column(_NAME)


def read_table(text: str, name: str) -> Part | None:
    """Read a table of points or of marks, None when the text is no such table.

    Raises
    ------
    InputError
        When a row is not complete, or something in it is not a number.
    """
    for separator in "\t;,":
        table = _table(text, name, separator)
        if table is not None:
            return _marks(table) if table.holds_marks else _points(table)
    return None


def _table(text: str, name: str, separator: str) -> _Table | None:
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), start=1) if line.strip()]
    crs = next((found[1] for _, line in lines[:_HEADER_WITHIN] if (found := _CRS.match(line))), None)
    for at, (_, line) in enumerate(lines[:_HEADER_WITHIN]):
        if separator not in line or _CRS.match(line):
            continue
        table = _Table(name, crs, tuple(_word(cell) for cell in _cells(line.lstrip("# "), separator, name)), ())
        if table.holds_marks or table.holds_points:
            return _Table(name, crs, table.header, _rows(lines[at + 1 :], separator, name))
    if lines and separator in lines[0][1]:
        header = _headerless(_cells(lines[0][1], separator, name))
        if header:
            return _Table(name, crs, header, _rows(lines, separator, name))
    return None


def _headerless(first: tuple[str, ...]) -> tuple[str, ...]:
    """Return the header that Pix4D's marks would have, empty when a row is of another kind."""
    if len(first) not in (4, 5) or not all(np.isfinite(number_of(cell)) for cell in first[2:4]):
        return ()
    images = [PurePosixPath(cell.lower().replace("\\", "/")).suffix in _IMAGES for cell in first[:2]]
    return {(True, False): ("image", "gcp", "x", "y"), (False, True): ("gcp", "image", "x", "y")}.get((images[0], images[1]), ())


def _rows(lines: list[tuple[int, str]], separator: str, name: str) -> tuple[tuple[int, tuple[str, ...]], ...]:
    # Metashape ends its reference with lines on total errors.
    return tuple((n, _cells(line, separator, name)) for n, line in lines if not line.startswith("#"))


def _cells(line: str, separator: str, name: str) -> tuple[str, ...]:
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True)))
    except (csv.Error, StopIteration) as error:
        raise InputError(f"{name} is not a sound table ({error}): export it again.") from error


def _word(cell: str) -> str:
    return re.sub(r"[^a-z]", "", cell.casefold()).replace("pixel", "px")


def _points(table: _Table) -> Part:
    columns = [table.column(words) for words in (_NAME, _X, _Y, _Z, _SIGMA_H, _SIGMA_V)]
    role_at, enabled_at = table.column(_ROLE), table.column(_ENABLED)
    names, places, sigmas, roles = [], [], [], []
    for line, row in table.rows:
        label, x, y, z, sigma_h, sigma_v = (_cell(row, at) for at in columns)
        if not label:
            raise InputError(f"The line {line} of {table.name} names no point: fill it in or remove it.")
        if not any((x, y, z)):
            continue  # a marker without ground coordinates is a tie point
        names.append(label)
        places.append([_number(cell, line, table.name) for cell in (x, y, z)])
        sigmas.append([_number(cell, line, table.name) for cell in (sigma_h, sigma_v)])
        # Metashape adjusts on the ticked markers and checks on the others.
        unticked = _cell(row, enabled_at).casefold() in ("0", "false")
        roles.append("check" if unticked else _cell(row, role_at))
    if not names:
        raise InputError(f"{table.name} has no points with coordinates below its header: add some.")
    told = tuple(roles) if any(roles) else ()
    sigma = np.array(sigmas, float)
    given = Given(table.name, table.crs, tuple(names), np.array(places, float), told, sigma, borrows_crs=table.crs is None)
    return Part(table.name, given)


def _marks(table: _Table) -> Part:
    columns = [table.column(words) for words in (_NAME, _IMAGE, _COLUMN, _ROW)]
    marks = []
    for line, row in table.rows:
        gcp, image, x, y = (_cell(row, at) for at in columns)
        mark = Mark(gcp, image, _number(x, line, table.name), _number(y, line, table.name))
        if not gcp or not image or not np.isfinite([mark.x, mark.y]).all():
            raise InputError(f"The line {line} of {table.name} is not complete (gcp, image, x, y): fill it in or remove it.")
        marks.append(mark)
    if not marks:
        raise InputError(f"{table.name} has no marks below its header: add some.")
    return Part(table.name, marks=tuple(marks))


def _cell(row: tuple[str, ...], at: int | None) -> str:
    return row[at] if at is not None and at < len(row) else ""


def _number(cell: str, line: int, name: str) -> float:
    if not cell:
        return float("nan")
    value = number_of(cell)
    if not np.isfinite(value):
        raise InputError(f"{cell[:40]!r} in the line {line} of {name} is not a number: correct it.")
    return value
