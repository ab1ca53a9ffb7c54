"""One step through the door: a request in, progress and messages on the way, a result out."""

import json
import os
import shutil
import signal
import tempfile
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Dict, List

from ..i18n import tr
from .child import Cancelled, Child
from .engine import ROOT
from .environment import cleaned

__all__ = ["Cancelled", "EngineError", "run_step"]

_TAIL = 15  # lines of the log shown after a crash


class EngineError(Exception):
    """The step did not succeed; the text is one sentence for the user."""


def run_step(python: str, step: str, request: Mapping[str, Any], feedback: Any) -> Dict[str, Any]:
    """Run ``step`` of the engine under ``python`` and return its result.

    ``feedback`` is a QgsProcessingFeedback, or anything that offers its isCanceled, setProgress, pushInfo, pushWarning
    and reportError.

    Raises
    ------
    EngineError
        When the step fails; a bug's traceback and a crash's last words have been reported to ``feedback``.
    Cancelled
        When ``feedback`` is cancelled.
    """
    folder = Path(tempfile.mkdtemp(prefix="strandline-"))
    log = folder / f"{step}.log"
    keep_log = False
    try:
        file = folder / "request.json"
        file.write_text(json.dumps(request, allow_nan=False), encoding="utf-8")
        command = [python, "-s", str(ROOT / "__main__.py"), step, str(file), "--door"]
        last: Dict[str, Any] = {}
        try:
            with Child(command, cleaned(os.environ), log) as child:
                for text in child.lines(feedback):
                    last = _pass_on(text, feedback)
                    if last:
                        break  # all is done and written: nothing the interpreter does on its way out may undo that
                else:
                    status = child.wait(feedback)
        except OSError as error:
            raise EngineError(tr("The engine's Python {} cannot be started: {}.").format(python, error)) from error
        if last.get("type") == "result":
            return dict(last["result"])
        keep_log = last.get("type") != "error" or last.get("kind") == "Bug"
        if last.get("type") == "error":
            raise EngineError(_told(last, step, log, feedback))
        for line in _tail(log):
            feedback.reportError(line)
        raise EngineError(_crash(step, status, log))
    finally:
        if keep_log:
            file.unlink()
        else:
            shutil.rmtree(folder, ignore_errors=True)


def _pass_on(text: str, feedback: Any) -> Dict[str, Any]:
    """Show a progress or message line; return a result or error line."""
    try:
        line = json.loads(text)
        kind = line["type"]
    except (ValueError, KeyError, TypeError):
        feedback.pushInfo(text)
        return {}
    if kind == "progress":
        feedback.setProgress(100.0 * line["fraction"])
    elif kind == "message":
        (feedback.pushWarning if line["level"] == "warning" else feedback.pushInfo)(line["text"])
    else:
        return dict(line)
    return {}


def _told(error: Mapping[str, Any], step: str, log: Path, feedback: Any) -> str:
    if error.get("kind") != "Bug":
        return str(error["text"])
    trace = error.get("traceback", "")
    with log.open("a", encoding="utf-8") as stream:
        stream.write(trace)
    feedback.reportError(trace)
    told = tr("This is a fault of Strandline in '{}': {}; please report it with the lines above (also in {}).")
    return told.format(step, error["text"], log)


def _tail(log: Path) -> List[str]:
    with log.open(encoding="utf-8", errors="replace") as stream:
        return [line.rstrip() for line in deque(stream, _TAIL)]


def _crash(step: str, status: int, log: Path) -> str:
    name = _status_name(status)
    if name == "SIGKILL":
        told = tr("The engine was killed ({}) during '{}', most often for want of memory: use fewer WORKERS; its log is {}.")
    else:
        told = tr("The engine crashed ({}) during '{}': its last lines stand above, its whole log is {}.")
    return told.format(name, step, log)


def _status_name(status: int) -> str:
    if os.name != "nt" and status < 0:
        try:
            return signal.Signals(-status).name
        except ValueError:
            return tr("signal {}").format(-status)
    return {0xC0000005: "ACCESS_VIOLATION", 0xC00000FD: "STACK_OVERFLOW", 0xC0000374: "HEAP_CORRUPTION"}.get(
        status & 0xFFFFFFFF, tr("exit status {}").format(status)
    )
