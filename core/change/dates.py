"""When each surface model was flown: what the user says, else the layer's time, the file's tags, the date in its name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from ..contract import RasterSource
from ..errors import InputError
from ..vector import Layer

_SECONDS = 365.25 * 86400.0  # of a year
_DATE = r"((?:19|20)\d\d)([-_.]?)(0[1-9]|1[0-2])\2(0[1-9]|[12]\d|3[01])"
_TIME = r"(?:[01]\d|2[0-3])(?::?[0-5]\d)?(?::?[0-5]\d)?"
_IN_NAME = re.compile(rf"(?<!\d){_DATE}(?:T({_TIME}))?(?!\d)")
_ALONE = re.compile(rf"{_DATE}(?:[T ]({_TIME})(?:\.\d+)?(?:Z|[+-]\d\d:?\d\d)?)?")
_TAGS = ("STRANDLINE_DATE", "ACQUISITIONDATETIME", "ACQUISITION_DATE", "DATE_ACQUIRED")
# Not TIFFTAG_DATETIME: programs write into it when the file was made.


@dataclass(frozen=True)
class Dated:
    """A date and where it was read."""

    date: datetime
    told_by: str


def years_between(first: datetime, second: datetime) -> float:
    """Return the years of 365.25 days from ``first`` to ``second``.

    >>> years_between(datetime(2018, 1, 1), datetime(2022, 1, 1))
    4.0
    """
    return (second - first).total_seconds() / _SECONDS


def written(date: datetime) -> str:
    """Return a date as text, with its time only where it has one.

    >>> written(datetime(2018, 6, 6)), written(datetime(2018, 6, 6, 9, 30))
    ('2018-06-06', '2018-06-06T09:30')
    """
    return date.strftime("%Y-%m-%d") if (date.hour, date.minute, date.second) == (0, 0, 0) else date.isoformat()[:16]


def parse_date(text: str) -> datetime | None:
    """Return the date that a text is, None when it is not one; a zone is left out: a day is what matters.

    >>> parse_date("2018-06-06"), parse_date("20180606T0930"), parse_date("6 June")
    (datetime.datetime(2018, 6, 6, 0, 0), datetime.datetime(2018, 6, 6, 9, 30), None)
    """
    found = _ALONE.fullmatch(text.strip())
    return None if found is None else _made(found)


def date_in_name(name: str) -> set[datetime]:
    """Return the dates that a name holds: year, month and day as 20180606, 2018-06-06, 2018_06_06 or 2018.06.06.

    A time counts behind a T only, for other digits may number files.

    >>> date_in_name("leo_20180606_dsm_resampled_1m"), date_in_name("beach_12")
    ({datetime.datetime(2018, 6, 6, 0, 0)}, set())
    """
    return {date for found in _IN_NAME.finditer(name) if (date := _made(found)) is not None}


def date_models(
    sources: Sequence[RasterSource], tags: Sequence[Mapping[str, str]], dates: str | None, table: Mapping[str, str] | None
) -> list[Dated]:
    """Return the date of each model, in their order.

    ``dates`` holds one date for each in their order, or some as name=date; ``table`` maps names to dates. Both win over layers,
    tags and names of files.

    Raises
    ------
    InputError
        When a date is not understood, not known, or two models have the same.
    """
    told = _told(sources, dates, table)
    found = [told.get(i) or _own(source, tag) for i, (source, tag) in enumerate(zip(sources, tags, strict=True))]
    unknown = [Path(source.path).name for source, date in zip(sources, found, strict=True) if date is None]
    if unknown:
        raise InputError(
            f"The date of {', '.join(unknown)} is not known: put it into the file's name (2018-06-06 or 20180606), "
            "or give DATES or DATE_TABLE."
        )
    known = [date for date in found if date is not None]
    seen: dict[datetime, str] = {}
    for source, one in zip(sources, known, strict=True):
        name = Path(source.path).name
        if one.date in seen:
            raise InputError(
                f"{seen[one.date]} and {name} have the same date, {written(one.date)}: leave one out, or tell them apart in "
                "DATES by a time (2018-06-06T09:30)."
            )
        seen[one.date] = name
    return known


def table_of(layer: Layer, column: str) -> dict[str, str]:
    """Return a table's ``column`` by what its field ``file`` holds; rows without a value are left out."""
    return {name: value for name, value in zip(layer.text("file"), layer.text(column), strict=True) if name and value}


def place_of(sources: Sequence[RasterSource], name: str, told_by: str) -> int:
    """Return which model is called ``name``: its file with or without ending, or its layer.

    Raises
    ------
    InputError
        When there is none, or more than one.
    """
    wanted = Path(name).name.casefold()
    names = [{Path(s.path).name.casefold(), Path(s.path).stem.casefold(), (s.name or "").casefold()} for s in sources]
    places = [i for i, own in enumerate(names) if wanted in own]
    if len(places) == 1:
        return places[0]
    many = "more than one raster" if places else "no raster"
    raise InputError(
        f"{told_by} names {name}, which is {many} of DSMS; they are {', '.join(Path(s.path).name for s in sources)}."
    )


def _told(sources: Sequence[RasterSource], dates: str | None, table: Mapping[str, str] | None) -> dict[int, Dated]:
    told: dict[int, Dated] = {}
    for name, text in (table or {}).items():
        told[place_of(sources, name, "DATE_TABLE")] = _understood(text, "DATE_TABLE")
    entries = [entry.strip() for entry in re.split(r"[,;\n]", dates or "") if entry.strip()]
    named = [entry.partition("=") for entry in entries if "=" in entry]
    if named and len(named) < len(entries):
        raise InputError(
            "DATES mixes dates with and without names: give all as name=date, or one date for each DSM in their order."
        )
    if entries and not named and len(entries) != len(sources):
        raise InputError(
            f"DATES holds {len(entries)} dates and DSMS {len(sources)} rasters: give one date for each, in their order."
        )
    for name, _, text in named:
        told[place_of(sources, name.strip(), "DATES")] = _understood(text, "DATES")
    for i, text in enumerate(() if named else entries):
        told[i] = _understood(text, "DATES")
    return told


def _understood(text: str, where: str) -> Dated:
    date = parse_date(text)
    if date is None:
        raise InputError(f"{where}: {text.strip()!r} is not a date: write it as 2018-06-06, with a time as 2018-06-06T09:30.")
    return Dated(date, where)


def _own(source: RasterSource, tags: Mapping[str, str]) -> Dated | None:
    if source.date and (date := parse_date(source.date)):
        return Dated(date, "the layer's temporal range")
    for tag in _TAGS:
        if date := parse_date(tags.get(tag, "")):
            return Dated(date, f"the tag {tag}")
    for name, told_by in ((Path(source.path).stem, "the file's name"), (source.name or "", "the layer's name")):
        dates = date_in_name(name)
        if len(dates) > 1:
            both = " and ".join(sorted(map(written, dates)))
            raise InputError(f"{name} holds more than one date ({both}): say in DATES which it is.")
        if dates:
            return Dated(dates.pop(), told_by)
    return None


def _made(found: re.Match[str]) -> datetime | None:
    year, _, month, day, time = found.groups()
    digits = (time or "").replace(":", "").ljust(6, "0")
    try:
        return datetime(int(year), int(month), int(day), int(digits[:2]), int(digits[2:4]), int(digits[4:6]))
    except ValueError:  # such as 31 February
        return None
