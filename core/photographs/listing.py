"""Finding the photographs of a flight in a folder: which files, under which names, one per exposure."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

from ..errors import InputError
from .reading import DECODABLE, RAW, is_raw

_SHOWN = 8


def list_photographs(images: Path, pattern: str | None, outside: Path, kinds: frozenset[str] = DECODABLE | RAW) -> list[str]:
    """Return the names (paths relative to ``images``, with forward slashes) of the photographs in it, sorted.

    Parameters
    ----------
    images
        The folder; its sub-folders are searched too. Hidden files and folders, and survey folders, are passed over.
    pattern
        A glob that the file's name or its relative path must match, upper and lower case alike; None for all.
    outside
        A folder to pass over: the survey's own.
    kinds
        The files' endings, in lower case.

    Raises
    ------
    InputError
        When there is no photograph, or there is more than one file of an exposure.
    """
    if not images.is_dir():
        raise InputError(f"IMAGES is not a folder: {images}.")
    if (images / "survey.json").is_file():
        raise InputError(f"IMAGES is a survey folder, not a folder of photographs: {images}.")
    found = sorted(_walk(images, outside.resolve(), kinds))
    if not found:
        endings = ", ".join(sorted(s[1:] for s in kinds))
        raise InputError(f"There is no photograph in {images} (files ending in {endings}): choose another folder.")
    names = [n for n in found if pattern is None or _matches(n, pattern)]
    if not names:
        raise InputError(f"None of the {len(found)} photographs in {images} matches FILTER={pattern!r}: try '*.jpg'.")
    _refuse_twins(names)
    return names


def some(names: Iterable[str]) -> str:
    """Return names as one phrase, the first few of many."""
    every = list(names)
    rest = len(every) - _SHOWN
    return ", ".join(every[:_SHOWN]) + (f" and {rest} more" if rest > 0 else "")


def _walk(images: Path, outside: Path, kinds: frozenset[str]) -> Iterator[str]:
    seen: set[str] = set()  # a link to a folder above would lead round for ever
    for folder, folders, files in os.walk(images, followlinks=True):
        place = Path(folder)
        real = os.path.realpath(place)
        if real in seen or Path(real) == outside or (place / "survey.json").is_file():
            folders.clear()
            continue
        seen.add(real)
        folders[:] = [f for f in folders if not f.startswith((".", "$"))]
        for file in files:
            # macOS leaves hidden companions ("._DJI_0001.JPG") on memory cards.
            if not file.startswith(".") and Path(file).suffix.casefold() in kinds:
                yield (place / file).relative_to(images).as_posix()


def _matches(name: str, pattern: str) -> bool:
    wanted = pattern.strip().casefold().replace("\\", "/")
    return any(fnmatchcase(n, wanted) for n in (name.casefold(), PurePosixPath(name).name.casefold()))


def _refuse_twins(names: list[str]) -> None:
    """Refuse files of one name but for the ending, in one folder, or in any when one is a RAW and another is not.

    Counters of cameras start anew in each folder, so that one name in two folders is two exposures as long as both are of
    one kind; but cameras and people put the RAW of an exposure beside its JPG or in a folder of its own.
    """
    places, stems = defaultdict(list), defaultdict(list)
    for name in names:
        path = PurePosixPath(name)
        places[path.with_suffix("").as_posix().casefold()].append(name)
        stems[path.stem.casefold()].append(name)
    groups = [g for g in stems.values() if len({is_raw(name) for name in g}) > 1]
    parted = {name for group in groups for name in group}
    groups += [g for g in places.values() if len(g) > 1 and not parted.issuperset(g)]
    twins = [" and ".join(group) for group in sorted(groups)]
    if twins:
        raise InputError(
            f"There is more than one file of {len(twins)} exposures ({some(twins)}): pick one kind with FILTER, such as '*.jpg'."
        )
