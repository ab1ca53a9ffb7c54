"""Step ``createsurvey``: list the photographs of a flight with what their metadata tell."""

from __future__ import annotations

from dataclasses import dataclass

from ..contract import VectorSource
from ..progress import SILENT, Progress


@dataclass(frozen=True)
class Request:
    """``photos`` is a GeoPackage to write (layer "photos": name, height, time, sigma_h, sigma_v, camera; points in EPSG:4326)."""

    images: str
    output: str
    filter: str | None = None
    positions: VectorSource | None = None
    positions_crs: str | None = None
    crs: str | None = None
    photos: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """The survey folder and what was found."""

    output: str
    image_count: int
    position_count: int


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Make the survey folder."""
    raise NotImplementedError
