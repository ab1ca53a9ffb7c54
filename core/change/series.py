"""Dated surface models of one place, in the order of their dates, seen through one grid."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from ..contract import RasterSource, VectorSource
from ..errors import InputError
from ..progress import Progress
from ..raster import Grid
from ..vector import read_layer
from .alignment import Aligned, common_grid, footprint, link_accuracy, tiles
from .dates import Dated, date_in_name, date_models, place_of, table_of, written, years_between
from .georeferencing import GEOREFERENCING
from .heights import Heights, open_heights
from .units import true_area
from .zones import read_zones, touched

Array = NDArray[np.float64]
_LINK = 0.1  # metres between two datums that are worth a warning
_CELLS = 100_000_000  # of the common grid on one axis or another: beyond it the models are not of one place


@dataclass(frozen=True, kw_only=True)
class SeriesRequest:
    """What ``profiles``, ``shoreline`` and ``timeseries`` are told of the models; sigmas and ranges in metres, of one model.

    ``date_table`` has the fields file and date, and sigma where it is known.
    """

    dsms: tuple[RasterSource, ...]
    dates: str | None = None
    date_table: VectorSource | None = None
    nodata: float | None = None
    precisions: tuple[RasterSource, ...] | None = None
    sigma: float | None = None
    stable: VectorSource | None = None
    ignore: VectorSource | None = None
    coregister: Literal["auto", "none", "vertical", "plane"] = "auto"
    registration_sigma: float | None = None
    correlation_range: float | None = None
    confidence: float = 0.95


@dataclass(frozen=True)
class Epoch:
    """One model: when it was flown, what says so, its heights as they are and on the grid, a cell's sigma (None: not known)."""

    date: datetime
    told_by: str
    heights: Heights
    aligned: Aligned
    sigma: Aligned | float | None

    @property
    def name(self) -> str:
        """Its date as text."""
        return written(self.date)

    def sigma_on(self, window: Grid) -> Array:
        """Return the sigma (rows, columns) on a window; NaN where it is not known."""
        if isinstance(self.sigma, Aligned):
            values = self.sigma.read(window)
            values[~(values > 0)] = np.nan
            return values
        return np.full((window.height, window.width), np.nan if self.sigma is None else self.sigma)


@dataclass(frozen=True)
class Series:
    """Models in the order of their dates; ``ignore`` are polygons in the grid's CRS whose cells have no height."""

    epochs: tuple[Epoch, ...]
    grid: Grid
    ignore: list[Any]

    @property
    def years(self) -> Array:
        """The years since the first date (n,)."""
        return np.array([years_between(self.epochs[0].date, epoch.date) for epoch in self.epochs])

    def tiles(self) -> list[tuple[int, int, int, int]]:
        """Return the grid's tiles, sized so that all dates of one fit into some 64 MB."""
        return tiles(self.grid, max(e.aligned.points for e in self.epochs) * math.sqrt(2.0 * len(self.epochs)))

    def heights(self, window: Grid) -> Array:
        """Return the heights (dates, rows, columns) on a window."""
        values = np.stack([epoch.aligned.read(window) for epoch in self.epochs])
        if self.ignore:
            values[:, touched(self.ignore, window)] = np.nan
        return values

    def sigmas(self, window: Grid) -> Array:
        """Return the sigmas (dates, rows, columns) on a window."""
        return np.stack([epoch.sigma_on(window) for epoch in self.epochs])


def validate(request: SeriesRequest, outputs: Sequence[str | None], *, least: int) -> None:
    """Refuse, before any work, what cannot be meant.

    Raises
    ------
    InputError
        When too few models, a number out of its range, or an output that is also an input.
    """
    if len(request.dsms) < least:
        raise InputError(
            f"DSMS holds {len(request.dsms)} raster(s) and {least} are needed: choose surface models of several dates."
        )
    if not 0.0 < request.confidence < 1.0:
        raise InputError(f"CONFIDENCE is {request.confidence:g}: give a number between 0 and 1, such as 0.95.")
    for name in ("sigma", "registration_sigma", "correlation_range"):
        value = getattr(request, name)
        if value is not None and value < 0:
            raise InputError(f"{name.upper()} is {value:g}: give metres that are not negative.")
    if request.sigma is not None and request.precisions:
        raise InputError("PRECISIONS and SIGMA are both given: give one of them.")
    if request.precisions and len(request.precisions) != len(request.dsms):
        raise InputError(
            f"PRECISIONS holds {len(request.precisions)} rasters and DSMS {len(request.dsms)}: "
            "give one for each, in the same order, or none."
        )
    if request.coregister in ("vertical", "plane") and request.stable is None:
        raise InputError(f"COREGISTER={request.coregister} needs STABLE: draw polygons on ground that has not moved.")
    files = [Path(s.path).resolve() for s in request.dsms]
    twice = sorted({path.name for path in files if files.count(path) > 1})
    if twice:
        raise InputError(f"{twice[0]} is in DSMS twice: leave one out.")
    written_to = [Path(p).resolve() for p in outputs if p]
    if len(set(written_to)) < len(written_to):
        raise InputError("Two outputs have the same name: give each its own.")
    inputs = {*files, *(Path(s.path).resolve() for s in request.precisions or ())}
    for path in written_to:
        if path in inputs:
            raise InputError(f"The output {path} is also an input: choose another name.")


def open_series(request: SeriesRequest, files: ExitStack, progress: Progress, *, resolution: float = 0.0) -> Series:
    """Open and date the models and lay the grid over them: the coarsest model's own, or north-up cells of ``resolution`` (m).

    Raises
    ------
    InputError
        When a model cannot be read, placed or dated, or does not lie where another does.
    """
    count = len(request.dsms)
    models = []
    for i, source in enumerate(request.dsms):
        part = progress.part(0.8 * i / count, 0.8 * (i + 1) / count)
        models.append(files.enter_context(open_heights(source, Path(source.path).name, request.nodata, part)))
    table = read_layer(request.date_table) if request.date_table else None
    told = None if table is None else table_of(table, "date")
    dated = date_models(request.dsms, [m.file.tags for m in models], request.dates, told)
    sigmas = _given(request, table)
    _one_reference(models)
    grid = _grid(models, resolution)
    for model in models:
        if (accuracy := link_accuracy(models[0], model)) > _LINK:
            progress.warn(
                f"The datums of {models[0].label} and {model.label} are linked to {accuracy:g} m only: one may lie that far "
                "beside the other; put both in the CRS in which they were surveyed."
            )
    west, south, east, north = grid.bounds
    _, areas = true_area(grid.crs, (west + east) / 2, (south + north) / 2)
    if areas:
        progress.warn(areas)
    epochs = []
    for i in range(count):
        sigma: Aligned | float | None = sigmas[i]
        if request.precisions:
            source = request.precisions[i]
            _same_date(source, request.dsms[i], dated[i])
            part = progress.part(0.8 + 0.2 * i / count, 0.8 + 0.2 * (i + 1) / count)
            precision = files.enter_context(open_heights(source, f"the precision {Path(source.path).name}", None, part))
            sigma = Aligned(precision, grid)
        epochs.append(Epoch(dated[i].date, dated[i].told_by, models[i], Aligned(models[i], grid), sigma))
    epochs.sort(key=lambda epoch: epoch.date)
    ignore = [zone.shape for zone in read_zones(request.ignore, "IGNORE", None, grid.crs)] if request.ignore else []
    return Series(tuple(epochs), grid, ignore)


def covered_by(series: Series) -> Any:
    """Return the polygon in the grid's CRS that the models' rasters cover together."""
    return shapely.union_all([footprint(epoch.heights, series.grid.crs) for epoch in series.epochs])


def _given(request: SeriesRequest, table: Any) -> list[float | None]:
    """Return the sigma of each model that the user gave, those of the table before SIGMA."""
    sigmas: list[float | None] = [request.sigma] * len(request.dsms)
    if table is None or not any(name.casefold() == "sigma" for name in table.fields):
        return sigmas
    for name, value in zip(table.text("file"), table.numbers("sigma").tolist(), strict=True):
        if not name or math.isnan(value):
            continue
        if request.precisions:
            raise InputError("PRECISIONS and the sigmas of DATE_TABLE are both given: give one of them.")
        if value < 0:
            raise InputError(f"DATE_TABLE: the sigma of {name} is {value:g}: give metres that are not negative.")
        sigmas[place_of(request.dsms, name, "DATE_TABLE")] = value
    return sigmas


def _same_date(precision: RasterSource, source: RasterSource, dated: Dated) -> None:
    """Refuse precisions in another order than the models, as far as their names tell."""
    dates = date_in_name(Path(precision.path).stem)
    if len(dates) == 1 and next(iter(dates)).date() != dated.date.date():
        raise InputError(
            f"PRECISIONS: {Path(precision.path).name} stands where {Path(source.path).name} of {written(dated.date)} stands "
            "in DSMS: give both in the same order."
        )


def _one_reference(models: Sequence[Heights]) -> None:
    """Refuse heights above different references."""
    datums = {model.units.datum: model.label for model in models if model.units.datum}
    if len(datums) > 1:
        told = " and ".join(f"{label} above {datum}" for datum, label in list(datums.items())[:2])
        raise InputError(f"DSMS has heights of different vertical datums ({told}): convert them to one.")
    kinds: dict[str, str] = {}
    for model in models:
        try:
            tag = json.loads(model.file.tags.get(GEOREFERENCING, "{}"))
        except ValueError:
            continue  # a damaged tag is refused, by name, where its covariance is read
        if isinstance(tag, dict) and tag.get("heights") in ("ellipsoidal", "orthometric"):
            kinds[tag["heights"]] = model.label
    if len(kinds) > 1:
        raise InputError(
            f"{kinds['ellipsoidal']} has ellipsoidal heights and {kinds['orthometric']} orthometric ones: "
            "georeference one of the surveys again."
        )


def _grid(models: Sequence[Heights], resolution: float) -> Grid:
    coarsest = models[0]
    for model in models[1:]:
        if model.cell > coarsest.cell * (1 + 1e-6):
            coarsest = model
    own, shape = common_grid(coarsest, coarsest)
    shapes = [footprint(model, own.crs) for model in models]
    for i, model in enumerate(models):
        others = [s for k, s in enumerate(shapes) if k != i]
        if others and not any(shapely.area(shapely.intersection(shapes[i], s)) >= coarsest.cell**2 for s in others):
            raise InputError(f"{model.label} does not overlap the other DSMs: choose rasters of one place, and check their CRS.")
    if resolution:
        if resolution < 0.999 * coarsest.cell:
            raise InputError(
                f"RESOLUTION={resolution:g} m is finer than the cells of {coarsest.label} ({coarsest.cell:.3g} m): "
                "give that or more, or 0 for it."
            )
        west, north = (math.floor(v / resolution) * resolution for v in (own.west, own.north))
        own = replace(own, west=west, north=north, cell=resolution, cell_north=None)
    west, south, east, north = shapely.total_bounds(shapes) if len(shapes) > 1 else shapely.bounds(shape)
    left, right = math.floor((west - own.west) / own.cell + 1e-6), math.ceil((east - own.west) / own.cell - 1e-6)
    top, bottom = math.floor((own.north - north) / own.step_north + 1e-6), math.ceil((own.north - south) / own.step_north - 1e-6)
    if right - left > _CELLS or bottom - top > _CELLS:
        raise InputError("The DSMs lie too far apart: choose rasters of one place.")
    return own.window(left, top, right - left, bottom - top)
