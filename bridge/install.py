"""Make the engine's environment: a venv with the pinned packages, marked ready only when it is whole.

QGIS asks it where a ready engine is. To make one, it runs as a script under the Python that the venv is to have, and so
it imports the standard library alone:

    python3 bridge/install.py FOLDER [--requirements FILE ...] [--wheels FOLDER] [--fresh] [--door]
"""

import argparse
import hashlib
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import List, Optional, Sequence

REQUIREMENTS = Path(__file__).resolve().parent.parent / "requirements.txt"
_MARKER = "strandline-ready"  # written last; holds the fingerprint of the requirements


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


def forget(folder: Path) -> None:
    """Have the venv ``folder`` count as missing from now on."""
    (folder / _MARKER).unlink(missing_ok=True)


def command(python: str, folder: Path, *, wheels: Optional[Path] = None, fresh: bool = False) -> List[str]:
    """Return the command with which the door makes the venv ``folder`` with ``python``."""
    options = [*(["--wheels", str(wheels)] if wheels else []), *(["--fresh"] if fresh else [])]
    return [python, "-s", str(Path(__file__).resolve()), str(folder), *options, "--door"]


def make(folder: Path, *, more: Sequence[Path] = (), wheels: Optional[Path] = None, fresh: bool = False) -> None:
    """Make or complete the venv ``folder`` with the running Python.

    ``more`` are further requirement files, ``wheels`` is a folder to install from instead of the network; ``fresh``
    starts over even when a usable venv stands.

    Raises
    ------
    subprocess.CalledProcessError
        When venv or pip fails; they have said why.
    """
    forget(folder)
    inner = str(python_of(folder))
    if fresh or not _works([inner, "-m", "pip", "--version"]):
        folder.parent.mkdir(parents=True, exist_ok=True)
        _call([sys.executable, "-m", "venv", "--clear", str(folder)])
    source = ["--no-index", "--find-links", str(wheels)] if wheels else []
    files = [word for path in (REQUIREMENTS, *more) for word in ("-r", str(path))]
    _call([inner, "-m", "pip", "install", "--disable-pip-version-check", "--no-input", "--progress-bar", "off", *source, *files])
    # The marker appears whole or not at all, and only now.
    part = folder / f"{_MARKER}.part"
    part.write_text(fingerprint() + "\n", encoding="utf-8")
    part.replace(folder / _MARKER)


def main() -> int:
    """Run as a script."""
    parser = argparse.ArgumentParser(description="Make the engine's environment.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--requirements", type=Path, action="append", default=[], help="a further file of requirements")
    parser.add_argument("--wheels", type=Path, help="install from this folder, not from the network")
    parser.add_argument("--fresh", action="store_true", help="start over even when a usable environment stands")
    parser.add_argument("--door", action="store_true", help="end when standard input closes")
    given = parser.parse_args()
    if given.door:
        threading.Thread(target=_end_with_stdin, daemon=True).start()
    try:
        make(given.folder, more=given.requirements, wheels=given.wheels, fresh=given.fresh)
    except subprocess.CalledProcessError as error:
        return int(error.returncode) or 1
    return 0


def _end_with_stdin() -> None:
    while os.read(0, 4096):
        pass
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


def _call(words: Sequence[str]) -> None:
    subprocess.run(list(words), stdin=subprocess.DEVNULL, check=True)


def _works(words: Sequence[str]) -> bool:
    try:
        return subprocess.run(list(words), stdin=subprocess.DEVNULL, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


if __name__ == "__main__":
    sys.exit(main())
