"""Step ``dsmdifference``: erosion and deposition between two surface models, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..contract import RasterSource, VectorSource
from ..progress import SILENT, Progress


@dataclass(frozen=True)
class Request:
    """Sigmas and ranges in metres; ``output``, ``significant`` are rasters and ``volumes`` a GeoPackage to write."""

    before: RasterSource
    after: RasterSource
    output: str
    nodata: float | None = None
    before_precision: RasterSource | None = None
    after_precision: RasterSource | None = None
    before_sigma: float | None = None
    after_sigma: float | None = None
    stable: VectorSource | None = None
    zones: VectorSource | None = None
    zone_field: str | None = None
    ignore: VectorSource | None = None
    coregister: Literal["auto", "none", "vertical", "plane", "horizontal"] = "auto"
    registration_sigma: float | None = None
    correlation_range: float | None = None
    lod: Literal["cell", "uniform", "coherent"] = "cell"
    confidence: float = 0.95
    significant: str | None = None
    volumes: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Volumes in m3 over the union of the zones, ``area`` in m2; None is "not known"."""

    output: str
    net: float | None
    net_sigma: float | None
    net_random: float | None
    net_correlated: float | None
    net_systematic: float | None
    erosion: float | None
    erosion_sigma: float | None
    deposition: float | None
    deposition_sigma: float | None
    erosion_significant: float | None
    deposition_significant: float | None
    net_significant: float | None
    area: float
    covered_percent: float
    significant: str | None = None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Compute the difference and the volumes."""
    raise NotImplementedError
