"""The engine's command line: one request in, JSON lines out.

    python -m strandline STEP REQUEST.json [--door]

Each line of standard output is an object: ``{"type": "progress", "fraction": 0.4}``, ``{"type": "message",
"level": "info" | "warning", "text": ...}`` and, last, ``{"type": "result", "result": {...}}`` or ``{"type": "error",
"kind": "InputError", "text": ...}`` (with ``traceback`` when it is a bug). Everything else that anything prints
goes to standard error. With ``--door`` the engine ends, with all that it started, when standard input closes.
The exit status is 0 for a result, 1 for an error of the user's input, 2 for a bug.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
import traceback
from pathlib import Path
from typing import Any

from .contract import decode, encode
from .errors import Cancelled, InputError, StrandlineError
from .files import require_writable
from .progress import Progress
from .steps import STEP_IDS, load

_REPORT_EVERY = 0.1  # seconds; more progress lines than that cost the reader more than they tell


class JsonLines:
    """A listener that writes JSON lines to a stream."""

    def __init__(self, stream: Any) -> None:
        self._stream, self._last = stream, 0.0

    def send(self, **line: Any) -> None:
        """Write one object."""
        self._stream.write(json.dumps(encode(line), ensure_ascii=True, allow_nan=False) + "\n")
        self._stream.flush()

    def fraction(self, value: float) -> None:
        """Write a progress line, not more often than every tenth of a second."""
        now = time.monotonic()
        if now - self._last >= _REPORT_EVERY or value >= 1.0:
            self._last = now
            self.send(type="progress", fraction=round(value, 4))

    def message(self, text: str, *, warning: bool) -> None:
        """Write a message line."""
        self.send(type="message", level="warning" if warning else "info", text=text)

    def cancelled(self) -> bool:
        """Never: whoever cancels ends the process."""
        return False


def main(arguments: list[str] | None = None) -> int:
    """Run one step; return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    door = "--door" in words
    words = [w for w in words if w != "--door"]
    if len(words) != 2:
        print(f"usage: strandline STEP REQUEST.json\nsteps: {', '.join(STEP_IDS)}", file=sys.stderr)
        return 1
    lines = JsonLines(_claim_stdout())
    if door:
        _end_with_stdin()
    try:
        step = load(words[0])
        # Some native libraries install handlers that print a stack on SIGTERM.
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
        request = decode(step.Request, _read(Path(words[1])))
        if report := getattr(request, "output_html_file", None):
            require_writable(report, "report")
        result = step.run(request, Progress(lines))
    except StrandlineError as error:
        lines.send(type="error", kind=type(error).__name__, text=str(error))
        return 1
    except Cancelled:
        lines.send(type="error", kind="Cancelled", text="Cancelled.")
        return 1
    except ModuleNotFoundError as error:
        # One of our own modules that is missing is a bug; one of a library's is an engine that is not whole.
        if (error.name or "").startswith("strandline"):
            return _bug(lines, error)
        told = f"The engine lacks the package {error.name}: run 'Check engine' with INSTALL, or `make setup` in a clone."
        lines.send(type="error", kind="MissingDependency", text=told, traceback=traceback.format_exc())
        return 1
    except OSError as error:
        # A full disk, a read-only folder or a vanished drive is the user's to mend, and says which file.
        what = "" if error.filename else " (is the disk full, or the user's share of it?)"
        lines.send(type="error", kind="InputError", text=f"{error}{what}.", traceback=traceback.format_exc())
        return 1
    except Exception as error:
        return _bug(lines, error)
    lines.send(type="result", result=result)
    return 0


def _bug(lines: JsonLines, error: Exception) -> int:
    lines.send(type="error", kind="Bug", text=f"{type(error).__name__}: {error}", traceback=traceback.format_exc())
    return 2


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"The request {path} cannot be read: {error}.") from error


def _claim_stdout() -> Any:
    """Keep standard output for the JSON lines alone; prints, of native code too, go to standard error."""
    sys.stdout.flush()
    private = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return private


def _end_with_stdin() -> None:
    """End this process, and its group when it leads one, as soon as standard input closes."""
    leads = hasattr(os, "killpg") and os.getpgid(0) == os.getpid()
    if leads:
        _ask_kernel_to_kill()

    def watch() -> None:
        while os.read(0, 4096):
            pass
        if leads:
            os.killpg(0, signal.SIGKILL)
        os._exit(1)  # workers watch their parent, so they end too

    threading.Thread(target=watch, name="door", daemon=True).start()


def _ask_kernel_to_kill() -> None:
    """Have Linux itself end the group: native code may hold the interpreter, and with it the watching thread, for long."""
    import fcntl

    if sys.platform == "linux":
        fcntl.fcntl(0, fcntl.F_SETOWN, -os.getpid())
        fcntl.fcntl(0, fcntl.F_SETSIG, signal.SIGKILL)
        fcntl.fcntl(0, fcntl.F_SETFL, fcntl.fcntl(0, fcntl.F_GETFL) | os.O_ASYNC)
