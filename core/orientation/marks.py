"""Marks of ground points in photographs: read, matched with points and photographs by name, and checked."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from ..errors import InputError
from ..survey import Photograph
from ..vector import Layer

_SAME_PLACE = 3.0  # pixels


@dataclass(frozen=True)
class Mark:
    """Where a ground point was seen: pixels from the corner of the top-left pixel, x right, y down."""

    gcp: str
    image: str
    x: float
    y: float


def marks_of_table(table: Layer) -> Iterable[Mark]:
    """Yield the marks of a table with the columns gcp, image, x, y.

    Raises
    ------
    InputError
        When it is empty, or a row is not complete.
    """
    if not len(table):
        raise InputError(f"The table {table.name} of marks is empty: add marks (gcp, image, x, y).")
    gcps, images = table.text("gcp"), table.text("image")
    x, y = table.numbers("x"), table.numbers("y")
    for i, (gcp, image) in enumerate(zip(gcps, images, strict=True)):
        if not gcp or not image or not np.isfinite([x[i], y[i]]).all():
            raise InputError(f"The row {i + 1} of {table.name} is not complete (gcp, image, x, y): fill it in or remove it.")
        yield Mark(gcp, image, float(x[i]), float(y[i]))


def predictions_among(table: Layer) -> list[str]:
    """Return a note when marks are predictions of ``predictmarks`` that nothing measured: those repeat what they came from."""
    if "score" not in {name.casefold() for name in table.fields}:
        return []
    count = int(np.isnan(table.numbers("score")).sum())
    if not count:
        return []
    return [
        f"{count} of {len(table)} marks of {table.name} have no score: if nobody corrected these predictions they only confirm "
        "the georeferencing that they came from; correct them, or predict with REFINE."
    ]


def match_photograph(image: str, photographs: Sequence[Photograph]) -> str | None:
    """Return the name of the photograph that ``image`` means, None for none.

    Case, blanks, missing or other extensions and missing or additional folders are forgiven.

    Raises
    ------
    InputError
        When several photographs match equally well.
    """
    wanted = _path(image)
    paths = {photo.name: _path(photo.name) for photo in photographs}
    for found in (
        [name for name, path in paths.items() if path.name == wanted.name],
        [name for name, path in paths.items() if path.stem == wanted.name],
        [name for name, path in paths.items() if path.stem == wanted.stem],
    ):
        if len(found) > 1:
            common = [_common_tail(paths[name].parent, wanted.parent) for name in found]
            if common.count(max(common)) > 1:
                raise InputError(f"The marked image {image!r} could be {' or '.join(found)}: name it with its folder.")
            return found[common.index(max(common))]
        if found:
            return found[0]
    return None


def match_marks(
    where: str, marks: Sequence[Mark], points: Sequence[str], photographs: Sequence[Photograph]
) -> tuple[dict[str, tuple[Mark, ...]], list[str]]:
    """Return the marks of each point (by the names in ``points``) in photographs of the survey, and notes on the rest.

    Raises
    ------
    InputError
        When a mark lies outside its photograph, a point is marked twice in one, or no mark matches.
    """
    names = list(dict.fromkeys(m.gcp for m in marks))
    point_of = match_names(names, points)
    photo_of = {image: match_photograph(image, photographs) for image in dict.fromkeys(m.image for m in marks)}
    by_name = {p.name: p for p in photographs}
    matched: dict[str, dict[str, Mark]] = {name: {} for name in points}
    for mark in marks:
        point, image = point_of.get(mark.gcp), photo_of[mark.image]
        if point is None or image is None:
            continue
        photo = by_name[image]
        if not (0 <= mark.x <= photo.width and 0 <= mark.y <= photo.height):
            raise InputError(
                f"The mark of {point} in {image} at ({mark.x:g}, {mark.y:g}) lies outside the photograph of "
                f"{photo.width} x {photo.height} pixels: correct or remove it."
            )
        twin = matched[point].setdefault(image, Mark(point, image, mark.x, mark.y))
        if max(abs(twin.x - mark.x), abs(twin.y - mark.y)) > 0.01:
            raise InputError(
                f"{point} is marked twice in {image}, at ({twin.x:g}, {twin.y:g}) and ({mark.x:g}, {mark.y:g}): remove one."
            )
    if marks and not any(matched.values()):
        raise InputError(
            f"No mark of {where} matches a point and a photograph of the survey: the marks name the points {listed(names)} in "
            f"{listed(sorted(photo_of))}, the points are {listed(points)}, the photographs {listed(sorted(by_name), 3)}: "
            "correct the names."
        )
    notes = []
    loosely = [f"{name} for {point}" for name, point in point_of.items() if key_of(name) != key_of(point)]
    if loosely:
        notes.append(f"Marks were matched by similar names: {listed(loosely)}.")
    strangers = [image for image, name in photo_of.items() if name is None]
    if strangers:
        notes.append(f"Marks in images that are not in the survey were left out: {listed(strangers)}.")
    unknown = [name for name in names if name not in point_of]
    if unknown:
        notes.append(f"Marks of points that are not among the GCPs were left out: {listed(unknown)}.")
    found = {name: tuple(by_image.values()) for name, by_image in matched.items()}
    return found, notes + _same_place(found)


def match_names(wanted: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Return which of ``names`` each of ``wanted`` means; those that mean none are left out.

    Case and blanks are always forgiven; hyphens, underscores, points and leading zeros where one name alone comes near, and
    nobody means that name more exactly.
    """
    exact = {key_of(name): name for name in names}
    found = {w: exact[key_of(w)] for w in wanted if key_of(w) in exact}
    free = [name for name in names if name not in found.values()]
    left = [w for w in wanted if w not in found]
    near, asked = defaultdict(list), defaultdict(list)
    for name in free:
        near[_loose(name)].append(name)
    for w in left:
        asked[_loose(w)].append(key_of(w))
    for w in left:
        if len(near[_loose(w)]) == 1 and len(set(asked[_loose(w)])) == 1 and _loose(w):
            found[w] = near[_loose(w)][0]
    return found


def _same_place(matched: Mapping[str, Sequence[Mark]]) -> list[str]:
    """Return notes on marks of different points at one place of a photograph: one of them must be wrong."""
    told, known = [], defaultdict[str, list[Mark]](list)
    for mark in (m for marks in matched.values() for m in marks):
        for twin in known[mark.image]:
            if np.hypot(twin.x - mark.x, twin.y - mark.y) < _SAME_PLACE:
                told.append(f"{twin.gcp} and {mark.gcp} are marked at the same place in {mark.image}: one of the two is wrong.")
        known[mark.image].append(mark)
    return told


def key_of(name: str) -> str:
    """Return a name without the differences that people do not mean: case and blanks."""
    return " ".join(name.casefold().split())


def _loose(name: str) -> str:
    """Return a name without what is often written differently; the digits of separate numbers stay apart."""
    words = re.findall(r"\d+|[^\W\d_]+", key_of(name))
    joined = ""
    for word in words:
        word = word.lstrip("0") or "0" if word.isdigit() else word
        joined += f".{word}" if word.isdigit() and joined and joined[-1].isdigit() else word
    return joined


def _path(name: str) -> PurePosixPath:
    return PurePosixPath(key_of(name).replace("\\", "/"))


def _common_tail(a: PurePosixPath, b: PurePosixPath) -> int:
    count = 0
    for left, right in zip(reversed(a.parts), reversed(b.parts), strict=False):
        if left != right:
            break
        count += 1
    return count


def listed(names: Sequence[str], most: int = 8) -> str:
    """Return names as a list for a sentence."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
