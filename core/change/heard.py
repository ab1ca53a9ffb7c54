"""A listener that remembers the warnings of a run, for its report."""

from __future__ import annotations

from ..progress import Progress


class Heard:
    """A listener that passes everything on and remembers the warnings, for the report."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._done, self.warnings = progress, 0.0, list[str]()

    def fraction(self, value: float) -> None:
        """Pass the share done on; it never falls."""
        self._done = max(self._done, value)  # a raster with an undeclared no-data value is read again
        self._progress.at(self._done)

    def message(self, text: str, *, warning: bool) -> None:
        """Pass a message on, and keep it when it is a warning."""
        if warning:
            self.warnings.append(text)
            self._progress.warn(text)
        else:
            self._progress.info(text)

    def cancelled(self) -> bool:
        """Tell that nothing is cancelled here: the outer progress raises."""
        return False
