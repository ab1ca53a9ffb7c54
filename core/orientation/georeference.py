"""Step ``georeference``: from the free frame to a local metric frame of a projected CRS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..contract import VectorSource
from ..progress import SILENT, Progress


@dataclass(frozen=True)
class Request:
    """Sigmas in metres (``sigma_mark`` in pixels); ``residuals`` and ``photos`` are GeoPackages to write.

    ``check`` is names separated by commas; ``lever_arm`` three numbers (right, forward, up; m); ``geoid`` the path of a raster
    or a number (m).
    """

    survey: str
    gcps: VectorSource | None = None
    name_field: str | None = None
    height_field: str | None = None
    role_field: str | None = None
    sigma_h: float = 0.01
    sigma_v: float = 0.02
    sigma_h_field: str | None = None
    sigma_v_field: str | None = None
    marks: VectorSource | None = None
    gcp_file: str | None = None
    check: str | None = None
    sigma_mark: float = 0.5
    method: Literal["adjustment", "similarity"] = "similarity"
    use_gnss: bool = True
    lever_arm: str | None = None
    gcp_heights: Literal["ellipsoidal", "orthometric", "unknown"] = "unknown"
    gnss_heights: Literal["ellipsoidal", "orthometric", "unknown"] = "unknown"
    geoid: str | None = None
    ignore: VectorSource | None = None
    crs: str | None = None
    residuals: str | None = None
    photos: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Counts, and root mean square errors (m) in plan and height; None where nothing determines them."""

    output: str
    control_count: int
    check_count: int
    plani_control: float | None
    alti_control: float | None
    plani_check: float | None
    alti_check: float | None
    plani_loo: float | None
    alti_loo: float | None
    plani_gnss: float | None
    alti_gnss: float | None
    doming: float | None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Georeference the survey."""
    raise NotImplementedError
