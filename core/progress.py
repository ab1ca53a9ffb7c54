"""Progress, messages and cancellation, without knowing who listens."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sized
from typing import Protocol, TypeVar

from .errors import Cancelled

T = TypeVar("T")


class Listener(Protocol):
    """Whoever shows progress: the door, a notebook, a test."""

    def fraction(self, value: float) -> None:
        """Show how much is done, from 0 to 1."""

    def message(self, text: str, *, warning: bool) -> None:
        """Show one sentence."""

    def cancelled(self) -> bool:
        """Tell whether the user wants to stop."""


class Silent:
    """The listener that shows nothing and never cancels."""

    def fraction(self, value: float) -> None:
        """Ignore."""

    def message(self, text: str, *, warning: bool) -> None:
        """Ignore."""

    def cancelled(self) -> bool:
        """Never."""
        return False


class _Prefixed:
    """A listener that tells its own listener what each sentence is about."""

    def __init__(self, listener: Listener, subject: str) -> None:
        self._listener, self._subject = listener, subject

    def fraction(self, value: float) -> None:
        """Pass it on."""
        self._listener.fraction(value)

    def message(self, text: str, *, warning: bool) -> None:
        """Pass the sentence on behind its subject."""
        self._listener.message(f"{self._subject}: {text}", warning=warning)

    def cancelled(self) -> bool:
        """Pass it on."""
        return self._listener.cancelled()


class Progress:
    """A stretch of a step's progress, mapped to a part of its listener's 0..1."""

    def __init__(self, listener: Listener, start: float = 0.0, end: float = 1.0) -> None:
        self._listener, self._start, self._end = listener, start, end

    def at(self, fraction: float) -> None:
        """Report that ``fraction`` (0..1) of this part is done.

        Raises
        ------
        Cancelled
            When the user asked to stop.
        """
        if self._listener.cancelled():
            raise Cancelled
        self._listener.fraction(self._start + (self._end - self._start) * min(max(fraction, 0.0), 1.0))

    def part(self, start: float, end: float) -> Progress:
        """Return the progress of the part from ``start`` to ``end`` of this one."""
        span = self._end - self._start
        return Progress(self._listener, self._start + span * start, self._start + span * end)

    def about(self, subject: str) -> Progress:
        """Return this progress with ``subject`` before each of its sentences."""
        return Progress(_Prefixed(self._listener, subject), self._start, self._end)

    def over(self, items: Iterable[T], total: int | None = None) -> Iterator[T]:
        """Yield ``items``, reporting after each; ``total`` is needed when they have no length."""
        count = total if total is not None else (len(items) if isinstance(items, Sized) else 0)
        self.at(0.0)
        for done, item in enumerate(items, start=1):
            yield item
            self.at(done / count if count else 0.0)

    def info(self, text: str) -> None:
        """Tell the user one sentence."""
        self._listener.message(text, warning=False)

    def warn(self, text: str) -> None:
        """Warn the user in one sentence."""
        self._listener.message(text, warning=True)


SILENT = Progress(Silent())
