"""Step ``enhance``: 8-bit images with enhanced local contrast, for tie points only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..contract import VectorSource
from ..progress import SILENT, Progress


@dataclass(frozen=True)
class Request:
    """``window`` is the side of the square window in pixels, odd."""

    survey: str
    method: Literal["arctan", "micmac", "equalize", "none"] = "arctan"
    window: int = 101
    ignore: VectorSource | None = None
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """The survey folder."""

    output: str


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Enhance every photograph of the survey."""
    raise NotImplementedError
