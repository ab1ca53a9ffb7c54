"""Step ``checkengine``: prove that the engine has all it needs by using it."""

from __future__ import annotations

import importlib
import platform
import re
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from .errors import MissingDependency
from .progress import SILENT, Progress

_REQUIREMENTS = Path(__file__).resolve().parent.parent / "requirements.txt"
# Distributions whose module has another name.
_MODULES = {"opencv-contrib-python-headless": "cv2", "pillow": "PIL"}


@dataclass(frozen=True)
class Request:
    """Nothing to ask for."""


@dataclass(frozen=True)
class Result:
    """``ready`` is True; ``packages`` maps each requirement to the version found."""

    ready: bool
    python: str
    packages: dict[str, str]


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Import every requirement in a safe order and compare its version with the pinned one.

    Raises
    ------
    MissingDependency
        When one is missing or cannot be imported; the message names all of them.
    """
    found: dict[str, str] = {}
    faults: list[str] = []
    pins = re.findall(r"^([A-Za-z0-9_.-]+)==([^\s#]+)", _REQUIREMENTS.read_text(encoding="utf-8"), re.MULTILINE)
    for name, pinned in progress.over(pins):
        try:
            found[name] = metadata.version(name)
            importlib.import_module(_MODULES.get(name, name))
        except metadata.PackageNotFoundError:
            faults.append(f"{name} {pinned} is not installed")
            continue
        except ImportError as error:
            faults.append(f"{name} cannot be imported ({error})")
            continue
        if found[name] != pinned:
            progress.warn(f"{name} is {found[name]}, tested with {pinned}.")
    if faults:
        raise MissingDependency(
            f"The engine is not complete: {'; '.join(faults)}. Run 'Check engine' with INSTALL, or `make setup` in a clone."
        )
    return Result(True, platform.python_version(), found)
