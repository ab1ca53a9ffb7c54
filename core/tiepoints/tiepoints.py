"""Step ``tiepoints``: features, pairs and verified matches in a COLMAP database."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..progress import SILENT, Progress


@dataclass(frozen=True)
class Request:
    """``max_features`` 0 is no limit; ``max_size`` is the longer side in pixels features are looked for at, 0 is full."""

    survey: str
    source: Literal["auto", "enhanced", "original"] = "auto"
    max_features: int = 20000
    max_size: int = 0
    pairs: Literal["auto", "exhaustive", "sequential"] = "auto"
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Mean features per photograph, verified pairs, verified matches over all pairs."""

    output: str
    mean_features: float
    pair_count: int
    match_count: int


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Find tie points."""
    raise NotImplementedError
