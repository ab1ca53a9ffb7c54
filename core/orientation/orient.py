"""Step ``orient``: poses and interior orientation from tie points alone, in a free frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..progress import SILENT, Progress


@dataclass(frozen=True)
class Request:
    """``calibration`` is another survey's folder; ``tie_points`` is a LAZ to write."""

    survey: str
    camera_model: Literal["brown", "radial", "simple_radial", "full"] = "brown"
    calibration: str | None = None
    calibration_use: Literal["prior", "fixed"] = "prior"
    mapper: Literal["auto", "incremental", "global"] = "auto"
    tie_points: str | None = None
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """MicMac's statistics (see ``core.tiepoints.statistics``); percentages 0..100, mse in pixels."""

    output: str
    oriented_count: int
    mtp: float
    mtp_percent: float
    mmtp: float
    mmtp_percent: float
    mse: float
    tie_points: str | None = None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Orient the photographs."""
    raise NotImplementedError
