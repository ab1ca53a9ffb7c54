"""A child process with all that it starts: read line by line, stopped as one."""

import contextlib
import os
import queue
import signal
import subprocess
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Optional

POLL = 0.1  # seconds between two looks at the cancel button


class Cancelled(Exception):
    """The user asked to stop; the child and its children are gone."""


class Child:
    """A process in its own group; a context manager that leaves nothing running.

    Its standard input stays open until the end: an engine takes its closing for our death. Standard error goes
    to ``log``, or to standard output when there is none.
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str], log: Optional[Path] = None) -> None:
        if os.name == "nt":
            options: Any = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_NO_WINDOW}
        else:
            options = {"start_new_session": True}
        with contextlib.ExitStack() as stack:
            errors = stack.enter_context(log.open("wb")) if log else subprocess.STDOUT
            self._process = subprocess.Popen(
                list(command),
                env=dict(environment),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                **options,
            )
        self._stopped = False
        self._lines: "queue.Queue[Optional[str]]" = queue.Queue()
        self._reader = threading.Thread(target=self._read, name="strandline reader", daemon=True)
        self._reader.start()

    def lines(self, feedback: Any) -> Iterator[str]:
        """Yield the lines of standard output until it closes.

        Raises
        ------
        Cancelled
            When ``feedback`` is cancelled.
        """
        while True:
            self._obey(feedback)
            try:
                line = self._lines.get(timeout=POLL)
            except queue.Empty:
                if self._process.poll() is not None:
                    self.stop()  # children that it left behind may hold its standard output open
                continue
            if line is None:
                return
            yield line

    def wait(self, feedback: Any) -> int:
        """Return the exit status; negative is the number of the signal that ended the child.

        Raises
        ------
        Cancelled
            When ``feedback`` is cancelled.
        """
        while True:
            self._obey(feedback)
            with contextlib.suppress(subprocess.TimeoutExpired):
                status = self._process.wait(timeout=POLL)
                self.stop()
                return status

    def stop(self) -> None:
        """End the child with all that it started, at once."""
        if self._stopped:
            return
        self._stopped = True
        if os.name == "nt":
            if self._process.poll() is None:
                kill = ["taskkill", "/T", "/F", "/PID", str(self._process.pid)]
                subprocess.run(kill, capture_output=True, check=False, creationflags=subprocess.CREATE_NO_WINDOW)
        else:
            # Also when the child itself has ended: what it started may not have.
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def _obey(self, feedback: Any) -> None:
        if feedback.isCanceled():
            self.stop()
            raise Cancelled

    def __enter__(self) -> "Child":
        """Return the child."""
        return self

    def __exit__(self, *_: Any) -> None:
        """Stop what still runs and close the pipes."""
        self.stop()
        self._reader.join(timeout=5.0)
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe:
                pipe.close()

    def _read(self) -> None:
        stream = self._process.stdout
        if stream:
            for line in stream:
                self._lines.put(line.decode("utf-8", "replace").rstrip("\r\n"))
        self._lines.put(None)
