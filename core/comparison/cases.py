"""One case of the comparison: a survey of its own, taken through the steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..contract import VectorSource
from ..errors import NotEnoughData
from ..orientation import georeference, orient
from ..orientation.sparse import read_block
from ..photographs import enhance
from ..progress import Progress
from ..survey import Photograph, Survey
from ..tiepoints import tiepoints
from ..tiepoints.statistics import coverage_percent
from ..vector import read_layer

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """What all cases share; the keys are those of the steps."""

    method: Literal["arctan", "micmac", "equalize", "bandpass"]
    window: int
    max_size: int
    threshold: Literal["noise", "fixed"]
    camera_model: Literal["brown", "radial", "simple_radial", "full"]
    workers: int
    scheduler: str | None


@dataclass(frozen=True)
class Outcome:
    """What became of a case; what it did not reach is None, and ``note`` says why.

    ``names`` are those of the photographs, in the order of the exposures, which is the same in all cases.
    ``coverage`` is the share (0..100) of 10 x 10 cells with a tie point that the adjustment kept, for every photograph by name,
    0 where it is not oriented. ``checks`` (dE, dN, dU; m) are the errors of the check points by name.
    """

    case: str
    survey: Path
    names: Sequence[str]
    tied: tiepoints.Result | None = None
    oriented: orient.Result | None = None
    ground: georeference.Result | None = None
    coverage: Mapping[str, float] = field(default_factory=dict)
    checks: Mapping[str, Array] = field(default_factory=dict)
    note: str = ""

    @property
    def images(self) -> int:
        """The number of photographs."""
        return len(self.names)

    @property
    def mean_coverage(self) -> float | None:
        """The mean coverage of all photographs, None when nothing is oriented."""
        return float(np.mean(list(self.coverage.values()))) if self.oriented else None


def run_case(
    case: str,
    survey: Survey,
    names: Sequence[str],
    enhanced: bool,
    settings: Settings,
    control: georeference.Request | None,
    progress: Progress,
) -> Outcome:
    """Take a survey from its photographs to the ground.

    A case whose photographs do not suffice for a step ends there, with that step's sentence as its note.

    Raises
    ------
    InputError
        When something cannot be used, which is no fault of the case.
    """
    told = progress.about(case)
    by_name = {p.name: p for p in survey.photographs}
    where = str(survey.folder)
    outcome = Outcome(case, survey.folder, names)
    workers, scheduler = settings.workers, settings.scheduler
    method = settings.method if enhanced else "none"
    enhance.run(
        enhance.Request(where, method=method, window=settings.window, workers=workers, scheduler=scheduler), told.part(0.0, 0.2)
    )
    search = tiepoints.Request(
        where,
        source="enhanced",
        max_features=0,
        max_size=settings.max_size,
        threshold=settings.threshold,
        workers=workers,
        scheduler=scheduler,
    )
    mapping = orient.Request(where, camera_model=settings.camera_model, workers=workers, scheduler=scheduler)
    try:
        tied = tiepoints.run(search, told.part(0.2, 0.7))
        outcome = replace(outcome, tied=tied)
        oriented = orient.run(mapping, told.part(0.7, 0.95))
        block = read_block(survey.folder / "model")
        outcome = replace(outcome, oriented=oriented, coverage=_coverage([by_name[n] for n in names], block))
        if control is not None:
            residuals = survey.folder / "residuals.gpkg"
            request = replace(control, survey=where, residuals=str(residuals))
            ground = georeference.run(request, told.part(0.95, 1.0))
            outcome = replace(outcome, ground=ground, checks=_checks(residuals))
    except NotEnoughData as error:
        told.warn(str(error))
        outcome = replace(outcome, note=str(error))
    progress.at(1.0)
    return outcome


def places(block: Block) -> dict[str, Array]:
    """Return where each oriented photograph sees its tie points (n, 2): their projections, a residual from the key points."""
    order = np.argsort(block.observed_view, kind="stable")
    ends = np.searchsorted(block.observed_view[order], np.arange(len(block.views) + 1))
    return {
        view.name: view.project(block.points[block.observed_point[order[ends[i] : ends[i + 1]]]])
        for i, view in enumerate(block.views)
    }


def _coverage(photographs: Sequence[Photograph], block: Block) -> dict[str, float]:
    seen = places(block)
    return {p.name: coverage_percent(seen[p.name], p.width, p.height) if p.name in seen else 0.0 for p in photographs}


def _checks(residuals: Path) -> dict[str, Array]:
    layer = read_layer(VectorSource(str(residuals), "residuals"))
    errors = np.stack([layer.numbers(key) for key in ("dE", "dN", "dU")], axis=1)
    rows = zip(layer.text("name"), layer.text("role"), errors, strict=True)
    return {name: error for name, role, error in rows if role == "check" and np.isfinite(error).all()}
