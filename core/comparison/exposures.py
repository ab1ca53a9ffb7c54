"""The same exposures as JPG and as RAW: which files belong together, and what they have in common."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path, PurePosixPath

import numpy as np

from ..errors import InputError, NotEnoughData
from ..files import digest
from ..frames import projected_crs
from ..photographs.createsurvey import inspect_all, notes_on_inspections
from ..photographs.listing import list_photographs, some
from ..photographs.positions import median_place, utm_zone
from ..photographs.reading import DECODABLE, RAW
from ..photographs.surveyreport import write_report
from ..progress import Progress
from ..survey import Photograph, Survey, held

_SAME_MOMENT = 5.0  # s; cameras write the time of day to the second, and a RAW a little after its JPG


@dataclass(frozen=True)
class Source:
    """Photographs of one kind in one folder."""

    images: Path
    photographs: tuple[Photograph, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Exposures:
    """The flight as JPG and, where there is one, as RAW; the n-th photograph of both is the same exposure."""

    jpg: Source
    raw: Source | None
    notes: tuple[str, ...] = ()


def find_exposures(jpg: Path, raw: Path | None, surveys: Path, progress: Progress) -> Exposures:
    """Read the photographs that both folders have; positions that one kind lacks are taken from the other.

    ``surveys`` is a folder to pass over.

    Raises
    ------
    InputError
        When a folder is none or holds nothing of its kind, a photograph is broken, or JPG and RAW are not of one flight.
    NotEnoughData
        When fewer than two exposures are left.
    """
    names = _list("JPG", jpg, surveys, DECODABLE)
    notes: list[str] = []
    if raw is None:
        _enough(len(names), jpg)
        return Exposures(_inspect(jpg, names, progress), None)
    pairs, notes = pair_names(names, _list("RAW", raw, surveys, RAW))
    _enough(len(pairs), jpg)
    first = _inspect(jpg, [pair[0] for pair in pairs], progress.part(0.0, 0.5))
    second = _inspect(raw, [pair[1] for pair in pairs], progress.part(0.5, 1.0))
    _same_moments(first.photographs, second.photographs)
    first, second, told = _share_positions(first, second)
    return Exposures(first, second, (*notes, *told))


def pair_names(jpg: Sequence[str], raw: Sequence[str]) -> tuple[list[tuple[str, str]], list[str]]:
    """Return the names of files that belong together, by the JPG's names, and notes on those without a partner.

    Files belong together when their names without the extension are the same in upper and lower case alike, with their
    folders or, where that is unique, without.

    Raises
    ------
    InputError
        When there is no pair.
    """
    pairs: dict[str, str] = {}
    for with_folders in (True, False):
        first = _by_stem(set(jpg) - set(pairs), with_folders)
        second = _by_stem(set(raw) - set(pairs.values()), with_folders)
        pairs |= {a[0]: b[0] for stem, a in first.items() if len(a) == 1 and len(b := second.get(stem, [])) == 1}
    if not pairs:
        raise InputError(
            f"No photograph in JPG has a RAW of the same name: JPG has {some(jpg[:3])}, RAW has {some(raw[:3])}; give the "
            "folder with the RAW files of the same flight."
        )
    lonely = (("JPG", "RAW", sorted(set(jpg) - set(pairs))), ("RAW", "JPG", sorted(set(raw) - set(pairs.values()))))
    notes = [
        f"{len(names)} photographs have a {kind} but no {other} and take no part in any case: {some(names)}."
        for kind, other, names in lonely
        if names
    ]
    return sorted(pairs.items()), notes


def write_survey(folder: Path, source: Source, crs: str | None) -> Survey:
    """Write the photographs as a survey; steps that were done in it stay valid when the photographs are the same."""
    with held(folder, "compareinputs", make=True):
        survey = Survey.create(folder, source.images, crs, list(source.photographs))
        write_report(survey, list(source.notes), None)
        placed = sum(p.position is not None for p in source.photographs)
        survey.finish(
            "createsurvey",
            digest(survey.photographs, crs),
            built_on=(),
            parameters={},
            result={"image_count": len(source.photographs), "position_count": placed},
        )
    return survey


def survey_crs(asked: str | None, photographs: Sequence[Photograph]) -> str | None:
    """Return the CRS (WKT2) of all cases: the one that is asked for, else the UTM zone of the positions, if there are any."""
    if asked:
        return projected_crs(asked).to_wkt()
    positions = [p.position for p in photographs if p.position]
    return utm_zone(*median_place(positions)).to_wkt() if positions else None


def _by_stem(names: Iterable[str], with_folders: bool) -> dict[str, list[str]]:
    table = defaultdict(list)
    for name in names:
        path = PurePosixPath(name.casefold())
        table[path.with_suffix("").as_posix() if with_folders else path.stem].append(name)
    return table


def _list(key: str, folder: Path, surveys: Path, kinds: frozenset[str]) -> list[str]:
    if not folder.is_dir():
        raise InputError(f"{key} is not a folder: {folder}.")
    return list_photographs(folder, None, surveys, kinds)


def _enough(count: int, folder: Path) -> None:
    if count < 2:
        raise NotEnoughData(f"There is one photograph to compare in {folder}: a comparison needs two or more that overlap.")


def _inspect(images: Path, names: list[str], progress: Progress) -> Source:
    found = inspect_all(images, names, progress)
    return Source(images, tuple(i.photograph for i in found), tuple(notes_on_inspections(found)))


def _same_moments(jpg: Sequence[Photograph], raw: Sequence[Photograph]) -> None:
    apart = np.array([abs(s) for a, b in zip(jpg, raw, strict=True) if (s := _seconds(a, b)) is not None])
    if len(apart) and np.median(apart) > _SAME_MOMENT:
        worst = int(np.argmax(apart))
        raise InputError(
            f"JPG and RAW of the same name were taken at different times, such as {jpg[worst].name} and {raw[worst].name}: give "
            "the RAW files of the same flight."
        )


def _seconds(a: Photograph, b: Photograph) -> float | None:
    """Return the time between two photographs, None where one does not tell it; zones of time are not compared."""
    if not a.time or not b.time:
        return None
    times = [datetime.fromisoformat(p.time).replace(tzinfo=None) for p in (a, b) if p.time]
    return (times[1] - times[0]).total_seconds()


def _share_positions(jpg: Source, raw: Source) -> tuple[Source, Source, list[str]]:
    """Give both kinds the same positions, the JPG's where it has one."""
    taken = [a.position or b.position for a, b in zip(jpg.photographs, raw.photographs, strict=True)]
    notes = []
    for kind, other, source in (("JPG", "RAW", jpg), ("RAW", "JPG", raw)):
        lacking = sum(p.position is None and q is not None for p, q in zip(source.photographs, taken, strict=True))
        if lacking:
            notes.append(f"{lacking} {kind} photographs have no position: they get that of their {other}.")
    placed = [
        replace(s, photographs=tuple(replace(p, position=q) for p, q in zip(s.photographs, taken, strict=True)))
        for s in (jpg, raw)
    ]
    return placed[0], placed[1], notes
