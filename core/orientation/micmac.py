"""MicMac's files of ground control: points (XML or text) and image measures (XML), each in a file of its own.

Image measures count from the corner of the top-left pixel, as ours do: the windows in which MicMac's users measure
(SaisieAppuisInitQT, SaisieAppuisPredicQT) draw the image from 0 to its width and height, and write where the click fell. What
finds targets by itself and counts from the centre of that pixel must be moved by half a pixel before. No file names a CRS.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .control import Given
from .gcptext import Part, numbers_in
from .marks import Mark

_FORMAT = re.compile(r"#\s*F\s*=\s*(.+)")
_COLUMNS = ("N", "X", "Y", "Z", "Ix", "Iy", "Iz")


def holds_points(root: ElementTree.Element) -> bool:
    """Tell whether an XML document is MicMac's file of ground points."""
    return _named(root, "DicoAppuisFlottant") or root.find(".//OneAppuisDAF") is not None


def holds_marks(root: ElementTree.Element) -> bool:
    """Tell whether an XML document is MicMac's file of image measures."""
    return _named(root, "SetOfMesureAppuisFlottants") or root.find(".//MesureAppuiFlottant1Im") is not None


def read_points(root: ElementTree.Element, name: str) -> Part:
    """Read ``OneAppuisDAF``: ``Pt`` (x y z), ``NamePt`` and ``Incertitude`` (sigmas of x, y, z).

    Raises
    ------
    InputError
        When there are none, or one is not complete.
    """
    names: list[str] = []
    places, sigmas = [], []
    for point in root.iter("OneAppuisDAF"):
        label = (point.findtext("NamePt") or "").strip()
        if not label:
            raise InputError(f"The point {len(names) + 1} of {name} has no NamePt: give it a name.")
        names.append(label)
        places.append(numbers_in(point.findtext("Pt"), 3, f"Pt of {label}", name))
        told = point.findtext("Incertitude")
        sigmas.append(numbers_in(told, 3, f"Incertitude of {label}", name) if told else (np.nan,) * 3)
    return _points(name, names, places, sigmas)


def read_marks(root: ElementTree.Element, name: str) -> Part:
    """Read ``MesureAppuiFlottant1Im``: ``NameIm`` and any number of ``OneMesureAF1I`` with ``NamePt`` and ``PtIm`` (x y).

    Raises
    ------
    InputError
        When there are none, or one is not complete.
    """
    marks: list[Mark] = []
    for image in root.iter("MesureAppuiFlottant1Im"):
        label = (image.findtext("NameIm") or "").strip()
        for measure in image.iter("OneMesureAF1I"):
            gcp = (measure.findtext("NamePt") or "").strip()
            if not label or not gcp:
                raise InputError(f"The mark {len(marks) + 1} of {name} has no NameIm or no NamePt: export it again.")
            x, y = numbers_in(measure.findtext("PtIm"), 2, f"PtIm of {gcp} in {label}", name)
            marks.append(Mark(gcp, label, x, y))
    if not marks:
        raise InputError(f"{name} has no image measures: measure the points in the photographs and save again.")
    return Part(name, marks=tuple(marks))


def is_text(text: str) -> bool:
    """Tell whether a text is MicMac's list of points, whose first line says what its columns are: ``#F=N X Y Z``."""
    return _FORMAT.match(text.lstrip()) is not None


def read_text_points(text: str, name: str) -> Part:
    """Read the list that MicMac's GCPConvert takes: ``#F=N X Y Z`` or with Ix Iy Iz, S for a column to pass over.

    Raises
    ------
    InputError
        When the first line is not of that kind, or a line has not as many columns.
    """
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), start=1) if line.strip()]
    found = _FORMAT.match(lines[0][1])
    columns = found[1].replace("_", " ").split() if found else []
    at = {key: columns.index(key) for key in _COLUMNS if key in columns}
    if not {"N", "X", "Y", "Z"} <= set(at):
        raise InputError(f"The first line of {name} ({lines[0][1][:60]!r}) does not place N, X, Y and Z: write '#F=N X Y Z'.")
    names, places, sigmas = [], [], []
    for number, line in lines[1:]:
        if line.startswith("#"):
            continue
        words = line.split()
        if len(words) < len(columns):
            raise InputError(f"The line {number} of {name} has not the columns {' '.join(columns)}: correct it.")
        names.append(words[at["N"]])
        what = f"The line {number}"
        places.append(numbers_in(" ".join(words[at[k]] for k in "XYZ"), 3, what, name))
        told = [words[at[k]] for k in ("Ix", "Iy", "Iz") if k in at]
        sigmas.append(numbers_in(" ".join(told), 3, what, name) if len(told) == 3 else (np.nan,) * 3)
    return _points(name, names, places, sigmas)


def _points(name: str, names: list[str], places: Sequence[Sequence[float]], sigmas: Sequence[Sequence[float]]) -> Part:
    if not names:
        raise InputError(f"{name} has no ground points: add some.")
    told, notes = _sigmas(np.array(sigmas, float), name)
    return Part(name, Given(name, None, tuple(names), np.array(places, float), (), told, notes=notes, borrows_crs=True))


def _sigmas(told: NDArray[np.float64], name: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return sigmas (n, 2) in plan and height, NaN where nothing was said.

    MicMac writes 1 1 1 where its user said nothing, and does not mean a metre by it.
    """
    if (told == 1.0).all():
        note = (
            f"Incertitude is 1 1 1 for all points of {name}, which MicMac writes when nothing was said: SIGMA_H and SIGMA_V hold."
        )
        return np.full((len(told), 2), np.nan), (note,)
    told = np.where(told > 0, told, np.nan)
    return np.column_stack([np.sqrt((told[:, 0] ** 2 + told[:, 1] ** 2) / 2), told[:, 2]]), ()


def _named(root: ElementTree.Element, tag: str) -> bool:
    return root.tag == tag or root.find(tag) is not None
