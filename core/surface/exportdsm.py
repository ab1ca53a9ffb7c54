"""Step ``exportdsm``: a surface model and an orthophoto from the original photographs."""

from __future__ import annotations

from dataclasses import dataclass

from ..contract import VectorSource
from ..progress import SILENT, Progress


@dataclass(frozen=True)
class Request:
    """``resolution`` in metres (0 = two ground pixels), ``window`` in cells (0 = adaptive), ``fill`` in m2.

    The outputs are files to write.
    """

    survey: str
    output: str
    resolution: float = 0.0
    area: VectorSource | None = None
    ignore: VectorSource | None = None
    window: int = 0
    regularity: float = 1.0
    fill: float = 0.0
    precision: str | None = None
    correlation: str | None = None
    views: str | None = None
    filled: str | None = None
    ortho: str | None = None
    points: str | None = None
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """``gsd`` is the mean ground pixel (m); ``coverage_percent`` the share of the area's cells with a height."""

    output: str
    gsd: float
    coverage_percent: float
    median_precision: float | None
    precision: str | None = None
    correlation: str | None = None
    views: str | None = None
    filled: str | None = None
    ortho: str | None = None
    points: str | None = None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Compute the surface."""
    raise NotImplementedError
