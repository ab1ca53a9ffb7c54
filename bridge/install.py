"""Make the engine's environment: a venv with the pinned packages, marked ready only when it is whole.

This file imports the standard library alone: QGIS uses it, and so does ``make setup`` as a script:

    python3 bridge/install.py FOLDER [REQUIREMENTS ...]
"""

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Callable, List, Optional, Sequence

REQUIREMENTS = Path(__file__).resolve().parent.parent / "requirements.txt"
_MARKER = "strandline-ready"  # written last; holds the fingerprint of the requirements

Call = Callable[[Sequence[str]], None]


def python_of(folder: Path) -> Path:
    """Return where the Python of the venv ``folder`` is."""
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def fingerprint(requirements: Path = REQUIREMENTS) -> str:
    """Return what stands for the pinned versions; comments do not count."""
    lines = requirements.read_text(encoding="utf-8").splitlines()
    pins = sorted(filter(None, (line.partition("#")[0].strip() for line in lines)))
    return hashlib.sha256("\n".join(pins).encode()).hexdigest()


def state(folder: Path) -> str:
    """Return "ready", "outdated" (made whole, for other requirements) or "missing"."""
    marker = folder / _MARKER
    if not marker.is_file() or not python_of(folder).exists():
        return "missing"
    return "ready" if marker.read_text(encoding="utf-8").strip() == fingerprint() else "outdated"


def make(
    folder: Path, python: str, call: Call, *, more: Sequence[Path] = (), wheels: Optional[Path] = None, fresh: bool = False
) -> None:
    """Make or complete the venv ``folder`` with ``python``.

    ``call`` runs a command and raises when it fails. ``more`` are further requirement files. ``wheels`` is a folder
    to install from instead of the network. ``fresh`` starts over even when a usable venv stands.
    """
    (folder / _MARKER).unlink(missing_ok=True)
    inner = str(python_of(folder))
    if fresh or not _works([inner, "-m", "pip", "--version"]):
        folder.parent.mkdir(parents=True, exist_ok=True)
        call([python, "-m", "venv", "--clear", str(folder)])
    source = ["--no-index", "--find-links", str(wheels)] if wheels else []
    files: List[str] = []
    for path in (REQUIREMENTS, *more):
        files += ["-r", str(path)]
    options = ["--disable-pip-version-check", "--no-input", "--progress-bar", "off"]
    call([inner, "-m", "pip", "install", *options, *source, *files])
    # The marker appears whole or not at all, and only now.
    part = folder / f"{_MARKER}.part"
    part.write_text(fingerprint() + "\n", encoding="utf-8")
    part.replace(folder / _MARKER)


def _works(command: Sequence[str]) -> bool:
    try:
        return subprocess.run(list(command), capture_output=True, check=False).returncode == 0
    except OSError:
        return False


if __name__ == "__main__":
    make(Path(sys.argv[1]), sys.executable, subprocess.check_call, more=[Path(p) for p in sys.argv[2:]])
