"""Where the engine's Python is."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Optional

from qgis.core import QgsApplication

from ..i18n import tr
from . import settings
from .environment import cleaned
from .install import forget, python_of, state

ROOT = Path(__file__).resolve().parent.parent
_PROBE = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))"


class MissingEngine(Exception):
    """There is no engine; the text is one sentence that says what to run."""


def find_python() -> str:
    """Return the engine's Python: the one that is named, else the clone's, else the QGIS profile's.

    Raises
    ------
    MissingEngine
        When there is none, or it was made for another version of Strandline.
    """
    for origin, named in (
        ("STRANDLINE_PYTHON", settings.overridden(settings.PYTHON)),
        (tr("The option 'Python of the engine'"), settings.read(settings.PYTHON)),
    ):
        if named:
            if not Path(named).is_file():
                raise MissingEngine(tr("{} names {}, which is not there: correct or remove it.").format(origin, named))
            return named
    outdated = None
    for folder in (clone_folder(), profile_folder()):
        found = state(folder)
        if found == "ready":
            return str(python_of(folder))
        outdated = outdated or (folder if found == "outdated" else None)
    if outdated:
        told = tr("The engine in {} was made for another version of Strandline: {}.")
        raise MissingEngine(told.format(outdated, _remedy()))
    raise MissingEngine(tr("The engine of Strandline is not installed: {}.").format(_remedy()))


def clone_folder() -> Path:
    """Return where ``make setup`` puts the engine of a clone."""
    return ROOT / ".engine"


def profile_folder() -> Path:
    """Return where ``checkengine`` puts the engine of a QGIS profile."""
    return Path(QgsApplication.qgisSettingsDirPath()) / "strandline" / "engine"


def install_folder() -> Path:
    """Return where an engine is to be installed: the clone's place if there is an engine already, else the profile's."""
    return clone_folder() if clone_folder().is_dir() else profile_folder()


def remove() -> None:
    """Remove the engine of the QGIS profile; that of a clone is the developer's.

    Raises
    ------
    OSError
        When files of it cannot be removed; what is left does not count as an engine.
    """
    folder = profile_folder()
    forget(folder)
    if folder.is_dir():
        shutil.rmtree(folder)


def base_python(named: Optional[str] = None) -> str:
    """Return a Python of at least 3.11 that can make a venv: ``named``, else one found on this machine.

    Raises
    ------
    MissingEngine
        When there is none.
    """
    if named:
        if _can_make_venv(named):
            return named
        told = tr("{} cannot make the engine: PYTHON must be a Python of at least 3.11 with the modules venv and ensurepip.")
        raise MissingEngine(told.format(named))
    for candidate in _candidates():
        if _can_make_venv(candidate):
            return candidate
    raise MissingEngine(
        tr(
            "No Python of at least 3.11 with the module venv was found: install one "
            "(on Debian: apt install python3-venv), or name it in PYTHON."
        )
    )


def _remedy() -> str:
    if (ROOT / "Makefile").is_file():
        return tr("run `make setup` in {}, or strandline:checkengine with INSTALL=true").format(ROOT)
    return tr("run strandline:checkengine ('Check engine') with INSTALL=true")


def _candidates() -> Iterator[str]:
    path = cleaned(os.environ).get("PATH")
    for name in ("python3", "python3.13", "python3.12", "python3.11", "python3.14", "python"):
        found = shutil.which(name, path=path)
        if found:
            yield found
    # Last, the one QGIS brings; sys.executable is QGIS itself.
    own = Path(sys.base_prefix) / ("python.exe" if os.name == "nt" else "bin/python3")
    if own.is_file():
        yield str(own)


def _can_make_venv(python: str) -> bool:
    hidden = {"creationflags": subprocess.CREATE_NO_WINDOW} if os.name == "nt" else {}
    try:
        return not subprocess.run(
            [python, "-c", _PROBE], env=cleaned(os.environ), capture_output=True, timeout=60, check=False, **hidden
        ).returncode
    except (OSError, subprocess.TimeoutExpired):
        return False
