"""Files that are whole or absent: a temporary name, then a rename."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .contract import encode
from .errors import InputError

PART = ".part-"  # marks what is not finished; whoever holds the survey may remove it
_OLD = f"{PART}old-"  # marks a folder that is being replaced
_SPARE = 1 << 16  # bytes; what libraries wrote without a word on a full disk may be short, so that some must be left
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_SIDECAR = re.compile(r"(\.[\w.]+\.tmp|-journal|-wal|-shm)?")  # what libraries put beside the file they are writing

# Waits until whoever holds the other end of its input is gone; workers may write for a moment longer.
_REMOVER = """
import os, shutil, sys, time
sys.stdin.read()
for _ in range(100):
    shutil.rmtree(sys.argv[1], ignore_errors=True)
    if not os.path.exists(sys.argv[1]):
        break
    time.sleep(0.1)
"""


@contextmanager
def whole(path: Path | str, *, room: int = 0, before: Callable[[], None] | None = None) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` (same suffix); it replaces ``path`` on success and is removed on failure.

    The body may make a file or a folder there. A folder replaces the folder that stood at ``path``. ``room`` bytes are made sure
    of first, for libraries that end the process when a disk is full. ``before`` is called when all is written, before anything
    that stands is touched: to drop a record that will not be true any more.

    Raises
    ------
    InputError
        When the disk is full, or the user's share of it.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f"{PART}{_writer()}-{target.name}")
    remove(part)
    try:
        try:
            _claim(part, room)
            yield part
        except Exception as error:
            if isinstance(error, OSError) and error.errno in _FULL:
                raise
            _claim(_beside(part), _SPARE)  # a full disk is what most libraries' errors in writing come from
            raise
        _claim(_beside(part), _SPARE)
        if before is not None:
            before()
        if part.is_dir() and target.is_dir():
            old = target.with_name(f"{_OLD}{_writer()}-{target.name}")
            target.rename(old)
            part.rename(target)
            remove(old)
        else:
            _sync(part)
            part.replace(target)
    except OSError as error:
        _discard(part)
        if error.errno in _FULL:
            raise InputError(
                f"{target} cannot be written, for the disk is full: free some space and run the step again."
            ) from error
        raise
    except BaseException:
        _discard(part)
        raise


@contextmanager
def scratch(path: Path | str) -> Iterator[Path]:
    """Yield a new folder beside ``path`` for what is not to be kept, and remove it at the end, whatever the end is.

    A process of its own waits for the end of this one, so that the folder goes too when this process is killed. What one that
    was killed with it has left is removed at the start.
    """
    target = Path(path)
    remove_abandoned(target)
    part = target.with_name(f"{PART}{_writer()}-{target.name}")
    part.mkdir(parents=True)
    nothing = subprocess.DEVNULL
    command = [sys.executable, "-c", _REMOVER, str(part)]
    try:
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=nothing, stderr=nothing, start_new_session=True):
            yield part
    finally:
        _discard(part)


def require_writable(path: Path | str, what: str) -> None:
    """Refuse, before any work, a file that could not be written; ``what`` names it, such as "raster".

    Raises
    ------
    InputError
        When it is a folder, or nothing can be made in its own, or in the nearest that there is.
    """
    target = Path(path)
    folder = next((f for f in target.absolute().parents if f.exists()), target)
    try:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, "it is a folder")
        # Tried, because what the rights say is not all there is to it.
        _claim(folder / f"{PART}{_writer()}-{target.name}", 1)
    except OSError as error:
        if error.errno in _FULL:
            raise _full(target) from error
        why = error.strerror or str(error)
        raise InputError(f"The {what} {path} cannot be written ({why}): choose a folder you may write to.") from error


def require_room(folder: Path) -> None:
    """Refuse to start where nothing can be written.

    Raises
    ------
    InputError
        When the disk of ``folder`` is full, or the user's share of it.
    """
    try:
        _claim(folder / f"{PART}{_writer()}-room.tmp", _SPARE)
    except OSError as error:
        if error.errno in _FULL:
            raise _full(folder) from error
        raise


def write_json(path: Path | str, data: Any) -> None:
    """Write ``data`` (JSON data or dataclasses) to ``path``, whole or not at all."""
    with whole(path) as part:
        part.write_text(json.dumps(encode(data), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def copy_file(source: Path | str, target: Path | str) -> None:
    """Copy a file, whole or not at all."""
    with whole(target) as part:
        shutil.copyfile(source, part)


def remove(path: Path) -> None:
    """Remove a file or folder if it exists."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def remove_parts(folder: Path) -> None:
    """Remove what killed runs left unfinished directly in ``folder``; put back a folder caught between two renames."""
    for path in folder.glob(f"{PART}*"):
        _, old, rest = path.name.partition(_OLD)
        name = rest.partition("-")[2]
        if old and name and not (folder / name).exists():
            path.rename(folder / name)
        else:
            remove(path)


def remove_abandoned(path: Path | str) -> None:
    """Remove what killed runs left of ``path`` beside it, where it lies among files that are not ours.

    Only parts of this very target go, and only those whose process was one of this machine and lives no more.
    """
    target = Path(path)
    for writer, part in _parts_of(target):
        if _is_gone(writer):
            remove(part)


def digest(*values: Any) -> str:
    """Return a fingerprint (32 hex digits) of JSON data."""
    text = json.dumps(encode(values), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def file_digest(path: Path | str) -> str:
    """Return a fingerprint (32 hex digits) of a file's content."""
    with Path(path).open("rb") as stream:
        return hashlib.file_digest(stream, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def bytes_digest(data: bytes) -> str:
    """Return the fingerprint that ``file_digest`` has of a file with this content."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def _parts_of(target: Path) -> list[tuple[str, Path]]:
    """Return what stands unfinished of ``target``, with who wrote it."""
    found = []
    for entry in os.scandir(target.parent) if target.parent.is_dir() else ():
        writer, _, name = entry.name.removeprefix(PART).partition("-")
        if entry.name.startswith(PART) and name.startswith(target.name) and _SIDECAR.fullmatch(name[len(target.name) :]):
            found.append((writer, Path(entry.path)))
    return found


def _discard(part: Path) -> None:
    """Remove a part of ours and what a library left beside it."""
    remove(part)
    for ending in ("-journal", "-wal", "-shm"):
        remove(part.with_name(part.name + ending))


def _full(path: Path) -> InputError:
    return InputError(f"{path} cannot be written, for the disk is full: free some space and run the step again.")


def _beside(part: Path) -> Path:
    return part.with_name(f"{part.name}.room.tmp")


def _claim(path: Path, size: int) -> None:
    """Make sure that a file of ``size`` bytes finds room at ``path``, and remove it again.

    Raises
    ------
    OSError
        When it does not.
    """
    if size == 0:
        return
    try:
        with path.open("wb") as stream:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(stream.fileno(), 0, size)
            else:
                stream.truncate(size)
    finally:
        path.unlink(missing_ok=True)


def _machine() -> str:
    """Return six hex digits for what process ids mean something in: this machine, and in it this container."""
    namespace = Path("/proc/self/ns/pid")
    return digest(socket.gethostname(), str(namespace.readlink()) if namespace.is_symlink() else "")[:6]


def _writer() -> str:
    return f"{os.getpid()}@{_machine()}"


def _is_gone(writer: str) -> bool:
    """Tell whether the process that wrote a part is known to have ended."""
    number, _, machine = writer.partition("@")
    if machine != _machine() or not number.isdigit() or os.name == "nt":  # to ask there is to end the process
        return False
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return True
    except PermissionError:
        pass  # it is another user's
    return False


def _sync(path: Path) -> None:
    if path.is_file():
        with path.open("rb+") as stream:
            os.fsync(stream.fileno())
