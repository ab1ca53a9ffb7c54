"""The survey folder: one flight, its photographs, and which steps stand.

``survey.json`` is written last, so after a kill at any moment the folder holds the last finished state. A step's
record carries a fingerprint of its parameters and of the steps it was built on; a step is stale when one of those
has changed since, or is itself stale.
"""

from __future__ import annotations

import datetime
import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath
from typing import Any

from .contract import decode, encode
from .errors import InputError
from .files import remove_parts, require_room, write_json

VERSION = 1
_FILE = "survey.json"
_LOCK = "survey.lock"


@dataclass(frozen=True)
class Position:
    """Where a photograph was taken, from GNSS: WGS 84 degrees, metres; the height's datum is not known here."""

    longitude: float
    latitude: float
    height: float | None = None
    sigma_h: float | None = None
    sigma_v: float | None = None


@dataclass(frozen=True)
class Photograph:
    """One exposure. ``name`` is its path relative to the images folder, with forward slashes.

    ``camera`` groups photographs that share one interior orientation (maker, model, lens, size, focal length).
    ``focal`` is in pixels, None when the file does not tell. Angles (degrees) are the gimbal's from XMP: yaw
    clockwise from north, pitch -90 for nadir. ``relative_height`` is metres above take-off.
    """

    name: str
    bytes: int
    digest: str
    width: int
    height: int
    camera: str
    focal: float | None = None
    time: str | None = None
    position: Position | None = None
    relative_height: float | None = None
    yaw: float | None = None
    pitch: float | None = None
    roll: float | None = None


@dataclass(frozen=True)
class StepRecord:
    """What is remembered of a finished step; ``built_on`` maps earlier steps to their fingerprints then."""

    fingerprint: str
    built_on: dict[str, str]
    parameters: dict[str, Any]
    result: dict[str, Any]
    finished: str


@dataclass(frozen=True)
class _Content:
    version: int
    images: str  # relative to the survey folder where that is possible
    crs: str | None
    photographs: tuple[Photograph, ...]
    steps: dict[str, StepRecord] = field(default_factory=dict)


class Survey:
    """An open survey folder. Attributes are read-only; ``finish`` alone changes what is on disk."""

    def __init__(self, folder: Path, content: _Content) -> None:
        self.folder, self._content = folder, content

    @classmethod
    def open(cls, folder: Path | str) -> Survey:
        """Read the survey in ``folder``.

        Raises
        ------
        InputError
            When the folder holds no survey, or one of a newer version.
        """
        path = Path(folder) / _FILE
        if not path.is_file():
            raise _no_survey(folder)
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            version = data["version"]
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path} is damaged ({error}): run 'Create survey' again.") from error
        if version != VERSION:
            raise InputError(f"{path} is of version {version}, this engine reads {VERSION}: update Strandline.")
        content = decode(_Content, _of_today(data))
        for photograph in content.photographs:
            # A survey may come from a stranger; names become paths of files that steps write.
            if not _is_inside(photograph.name):
                raise InputError(f"{path} names a photograph outside its folder, {photograph.name!r}: do not use this survey.")
        return cls(Path(folder), content)

    @classmethod
    def create(cls, folder: Path | str, images: Path | str, crs: str | None, photographs: list[Photograph]) -> Survey:
        """Write a survey into ``folder``; steps of a survey that stood there are kept and may become stale.

        When the photographs or the CRS are others than before, they are stale from here on until ``createsurvey`` is finished.
        """
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        ordered = tuple(sorted(photographs, key=lambda p: p.name))
        steps: dict[str, StepRecord] = {}
        if (target / _FILE).is_file():
            former = cls.open(target)._content
            same = (former.photographs, former.crs) == (ordered, crs)
            steps = {k: v for k, v in former.steps.items() if same or k != "createsurvey"}
        survey = cls(target, _Content(VERSION, _portable(Path(images), target), crs, ordered, steps))
        survey._write()
        return survey

    @property
    def photographs(self) -> tuple[Photograph, ...]:
        """The photographs, sorted by name."""
        return self._content.photographs

    @property
    def images(self) -> Path:
        """The folder with the photographs."""
        # Resolved, because the relative path was made so: a link to the survey folder may lie anywhere.
        return Path(os.path.normpath(self.folder.resolve() / self._content.images))

    @property
    def crs(self) -> str | None:
        """The survey's projected CRS as WKT2, None when nothing tells."""
        return self._content.crs

    def path(self, photograph: Photograph) -> Path:
        """Return where a photograph lies.

        Raises
        ------
        InputError
            When it is gone or its content has changed.
        """
        path = self.images / photograph.name
        if not path.is_file():
            raise InputError(
                f"The photograph {path} is gone: put it back, or run 'Create survey' again with the folder's new place."
            )
        if path.stat().st_size != photograph.bytes:
            raise InputError(f"The photograph {path} has changed since the survey was made: run 'Create survey' again.")
        return path

    def record(self, step: str) -> StepRecord | None:
        """Return the record of a finished step, stale or not, or None."""
        return self._content.steps.get(step)

    def is_stale(self, step: str) -> bool:
        """Tell whether what ``step`` was built on has changed since."""
        record = self.record(step)
        if record is None:
            return False
        for earlier, fingerprint in record.built_on.items():
            standing = self.record(earlier)
            if standing is None or standing.fingerprint != fingerprint or self.is_stale(earlier):
                return True
        return False

    def require(self, step: str) -> StepRecord:
        """Return the record of ``step``.

        Raises
        ------
        InputError
            When the step has not been run, or is stale.
        """
        record = self.record(step)
        if record is None:
            raise InputError(f"The survey {self.folder} has no '{step}' yet: run strandline:{step} first.")
        if self.is_stale(step):
            raise InputError(
                f"'{step}' in the survey {self.folder} is stale (an earlier step was run again since): "
                f"run strandline:{step} again."
            )
        return record

    def finish(
        self,
        step: str,
        fingerprint: str,
        *,
        built_on: tuple[str, ...],
        parameters: dict[str, Any],
        result: dict[str, Any],
    ) -> None:
        """Record that ``step`` is done. Call it last, when all its files are in place."""
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        inputs = {earlier: record.fingerprint for earlier in built_on if (record := self.record(earlier))}
        # As JSON, as it will be read again.
        record = StepRecord(fingerprint, inputs, encode(parameters), encode(result), now)
        # The folder may have been opened before it was held; what another step finished in between is kept.
        standing = Survey.open(self.folder)._content
        self._content = replace(standing, steps={**standing.steps, step: record})
        self._write()

    def forget(self, step: str) -> None:
        """Drop the record of ``step``, before its files are about to change."""
        if step in self._content.steps:
            steps = {k: v for k, v in self._content.steps.items() if k != step}
            self._content = replace(self._content, steps=steps)
            self._write()

    def report_path(self, step: str) -> Path:
        """Return where the report of ``step`` belongs."""
        return self.folder / "report" / f"{step}.html"

    def _write(self) -> None:
        write_json(self.folder / _FILE, self._content)


@contextmanager
def held(folder: Path | str, step: str, *, make: bool = False) -> Iterator[None]:
    """Hold the survey folder as its only writer; the system lets go of it when this process ends, however it ends.

    ``make`` makes the folder where there is none.

    Raises
    ------
    InputError
        When there is no such folder, its disk is full, or another process holds the survey; the message names it.
    """
    target = Path(folder)
    if make:
        target.mkdir(parents=True, exist_ok=True)
    elif not target.is_dir():
        raise _no_survey(target)
    with (target / _LOCK).open("a+", encoding="utf-8") as stream:
        try:
            _lock(stream)
        except OSError as error:
            stream.seek(0)
            raise InputError(
                f"The survey {target} is in use by {stream.read().strip() or 'another process'}: wait for it or stop it."
            ) from error
        for place in (target, *(p for p in target.iterdir() if p.is_dir())):
            remove_parts(place)
        require_room(target)
        stream.truncate(0)
        stream.write(f"{step} (process {os.getpid()} on {socket.gethostname()})\n")
        stream.flush()
        try:
            yield
        finally:
            stream.truncate(0)


def _lock(stream: Any) -> None:
    if os.name == "nt":
        import msvcrt

        # Byte 2**30 is far beyond the content, so that others can still read who holds the survey.
        stream.seek(2**30)
        msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        stream.seek(0)
    else:
        import fcntl

        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _no_survey(folder: Path | str) -> InputError:
    return InputError(
        f"{str(folder) or 'SURVEY, which is empty,'} is not a survey folder (no {_FILE} in it): make one with 'Create survey'."
    )


def _of_today(data: dict[str, Any]) -> dict[str, Any]:
    """Return a survey file's data without what earlier engines noted: which photographs they could not decode (RAW).

    With such photographs in it the survey counts as not finished, so that it is made again.
    """
    try:
        photographs = [dict(p) for p in data["photographs"]]
        decoded = [p.pop("decodable", True) for p in photographs]
        steps = data["steps"] if all(decoded) else {k: v for k, v in data["steps"].items() if k != "createsurvey"}
    except (KeyError, TypeError, ValueError, AttributeError):
        return data  # what is wrong with it is told when it is decoded
    return {**data, "photographs": photographs, "steps": steps}


def _is_inside(name: str) -> bool:
    """Tell whether a name is a relative path that does not lead out of its folder."""
    path = PurePath(name)
    return bool(path.parts) and not path.drive and not path.root and ".." not in path.parts


def _portable(path: Path, base: Path) -> str:
    try:
        return Path(os.path.relpath(path.resolve(), base.resolve())).as_posix()
    except ValueError:  # another drive
        return path.resolve().as_posix()
