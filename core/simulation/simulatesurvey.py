"""Step ``simulatesurvey``: photographs of a beach that never was, with all that is true of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..progress import SILENT, Progress


@dataclass(frozen=True)
class Request:
    """Terrain, flight, camera, contrast and noise; lengths in metres, angles in degrees, overlaps in percent.

    ``crs`` is a projected CRS in metres. ``contrast`` is the standard deviation of the sand's reflectance relative to its mean.
    ``noise`` scales shot and read noise (1 = a small drone camera at base ISO, 0 = none).
    """

    output: str
    dates: Literal["one", "two"] = "two"
    length: float = 60.0
    width: float = 40.0
    crs: str | None = None
    height: float = 30.0
    forward_overlap: float = 80.0
    side_overlap: float = 70.0
    tilt: float = 3.0
    camera_width: int = 1600
    camera_height: int = 1200
    focal: float = 1300.0
    contrast: float = 0.04
    noise: float = 1.0
    gnss_sigma_h: float = 0.03
    gnss_sigma_v: float = 0.05
    gcp_count: int = 6
    check_count: int = 4
    seed: int = 1
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """The folder, photographs per date, the ground pixel (m), and the true volumes (m3) when there are two dates."""

    output: str
    image_count: int
    gsd: float
    erosion: float | None
    deposition: float | None
    net: float | None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Render the survey."""
    raise NotImplementedError
