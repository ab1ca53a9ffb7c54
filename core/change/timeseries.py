"""Step ``timeseries``: volumes of zones through many dates, and the rate of change of every cell."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..contract import VectorSource
from ..errors import InputError, NotEnoughData
from ..progress import SILENT, Progress
from ..raster import CogWriter, Grid, Patch
from ..raster import check_destination as check_raster
from ..vector import check_destination, write_layer
from .alignment import footprint
from .epocherror import EpochError, epoch_errors, stable_ground
from .heard import Heard
from .series import Series, SeriesRequest, covered_by, open_series, validate
from .seriesvolumes import ZoneSeries, ZoneTally, rate_columns, rows_of
from .significance import coverage_factor
from .timeseriesreport import SeriesFindings, write_report
from .trend import LEAST, fit_trend
from .volumes import Cells
from .zones import Zone, read_zones, union

Array = NDArray[np.float64]
_PREVIEW = 900  # cells of the report's map along its longer side
_POOR = 10.0  # points of coverage that leaving out one date must gain to be told


@dataclass(frozen=True, kw_only=True)
class Request(SeriesRequest):
    """Metres. ``output`` (table) and ``zone_rates`` are GeoPackages, ``rate`` and ``significant`` rasters (m/year) to write."""

    zones: VectorSource | None = None
    zone_field: str | None = None
    resolution: float = 0.0
    output: str
    zone_rates: str | None = None
    rate: str | None = None
    significant: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Over the union of the zones: net change from the first to the last date (m3) and rate (m3/year); None: not known."""

    output: str
    date_count: int
    zone_count: int
    net: float | None
    net_sigma: float | None
    net_rate: float | None
    net_rate_sigma: float | None
    area: float
    covered_percent: float
    zone_rates: str | None = None
    rate: str | None = None
    significant: str | None = None


@dataclass
class RateMap:
    """A thinned map of rates and of which are significant, and counts of cells: with a rate, rising and falling significantly."""

    rate: Array
    kept: Array
    thinning: int
    cells: int = 0
    rising: int = 0
    falling: int = 0


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Sum the zones date by date and fit the rates."""
    outputs = (request.output, request.zone_rates, request.rate, request.significant, request.output_html_file)
    validate(request, outputs, least=2)
    _validate(request)
    heard = Heard(progress)
    progress = Progress(heard)
    with ExitStack() as files:
        series = open_series(request, files, progress.part(0.0, 0.3), resolution=request.resolution)
        grid, dates = series.grid, len(series.epochs)
        if dates < LEAST:
            if request.rate or request.significant:
                raise InputError(f"RATE and SIGNIFICANT need {LEAST} dates and DSMS holds {dates}: add surface models.")
            progress.warn(f"Rates need {LEAST} dates; there are {dates}: they are not known.")
        covered = covered_by(series)
        if request.zones:
            zones = read_zones(request.zones, "ZONES", request.zone_field, grid.crs)
        else:
            zones = [Zone("all dates", _overlap(series))]
        if not any(shapely.intersects(zone.shape, covered) for zone in zones):
            raise InputError("No zone of ZONES lies on the DSMs: draw zones there, and check the layer's CRS.")
        ground = None
        if request.stable:
            shapes = [zone.shape for zone in read_zones(request.stable, "STABLE", None, grid.crs)]
            ground = stable_ground(series, shapes, progress.part(0.3, 0.45))
        middles = shapely.get_coordinates(shapely.centroid([zone.shape for zone in zones]))
        errors = epoch_errors(series, request, ground, middles, progress)
        whole = [Zone("all zones", union(zones))] if len(zones) > 1 else []
        tallies = [ZoneTally(zone, dates) for zone in (*zones, *whole)]
        map_ = _pass(request, series, errors, tallies, progress.part(0.45, 0.95))
    told = [tally.series(series.years, errors, request.confidence) for tally in tallies]
    total = told[-1]
    _tell(series, told[: len(zones)], total, progress)
    factor = coverage_factor(request.confidence)
    rows = [row for zone in told[: len(zones)] for row in rows_of(series, zone, factor)]
    write_layer(request.output, "timeseries", None, {name: [row[name] for row in rows] for name in rows[0]}, None)
    if request.zone_rates:
        columns = [rate_columns(zone) for zone in told[: len(zones)]]
        shapes = [shapely.multipolygons(shapely.get_parts(zone.shape)) for zone in zones]
        fields = {name: [row[name] for row in columns] for name in columns[0]}
        write_layer(request.zone_rates, "zone_rates", grid.crs, fields, shapes, "MultiPolygon")
    if request.output_html_file:
        write_report(
            request.output_html_file,
            SeriesFindings(request, series, errors, told[: len(zones)], total, map_, tuple(heard.warnings)),
        )
    progress.at(1.0)
    net, sigma = total.change(0, dates - 1)
    return Result(
        request.output,
        dates,
        len(zones),
        _or_none(net),
        _or_none(sigma),
        _or_none(float(total.trend.rate)),
        _or_none(float(total.trend.sigma)),
        total.area,
        total.covered_percent,
        request.zone_rates,
        request.rate,
        request.significant,
    )


def _validate(request: Request) -> None:
    if request.resolution < 0:
        raise InputError(f"RESOLUTION={request.resolution:g} is negative: give metres, 0 or more.")
    for path in (request.output, request.zone_rates):
        if path:
            check_destination(path)
    for path in (request.rate, request.significant):
        if path:
            check_raster(path)


def _overlap(series: Series) -> Any:
    """Return the ground that every model's raster covers."""
    shape = shapely.intersection_all([footprint(epoch.heights, series.grid.crs) for epoch in series.epochs])
    if shapely.area(shape) < series.grid.cell_area:
        raise InputError("There is no place that all DSMs cover: give ZONES, or leave a DSM out.")
    return shapely.multipolygons([p for p in shapely.get_parts(shape) if shapely.get_dimensions(p) == 2])


def _pass(request: Request, series: Series, errors: list[EpochError], tallies: list[ZoneTally], progress: Progress) -> RateMap:
    """Go over the grid once: tally the zones, write the rates."""
    grid, dates = series.grid, len(series.epochs)
    thinning = max(1, -(-max(grid.width, grid.height) // _PREVIEW))
    small = (-(-grid.height // thinning), -(-grid.width // thinning))
    map_ = RateMap(np.full(small, np.nan), np.full(small, np.nan), thinning)
    tree = shapely.STRtree([tally.zone.shape for tally in tallies])
    wanted = dates >= LEAST and bool(request.rate or request.significant or request.output_html_file)
    seen = np.zeros(dates, np.int64)
    with ExitStack() as files:
        rate_file, kept_file = (
            files.enter_context(_writer(path, grid, name, series)) if path else None
            for path, name in ((request.rate, "rate"), (request.significant, "significant rate"))
        )
        for column, row, width, height in progress.over(series.tiles()):
            window = grid.window(column, row, width, height)
            near = tree.query(shapely.box(*window.bounds))
            if not (wanted or len(near)):
                continue
            heights = series.heights(window)
            seen += np.isfinite(heights).sum(axis=(1, 2))
            if np.isnan(heights).all():
                continue
            x, y = window.centres(np.arange(height), np.arange(width))
            heights -= np.stack([error.shift.at(x[None, :], y[:, None]) for error in errors])
            sigmas = series.sigmas(window)
            for k, error in enumerate(errors):
                if error.common is not None:
                    sigmas[k] = error.common
            tile = Cells(window, row * grid.width + column, grid.width, heights[0], None, None, heights[0])
            for i in near:
                tallies[i].add(tile, heights, sigmas)
            if not wanted:
                continue
            points = np.stack(
                [
                    error.point_sigma(sigma, x[None, :], y[:, None], np.nan_to_num(level))
                    for error, sigma, level in zip(errors, sigmas, heights, strict=True)
                ]
            )
            trend = fit_trend(series.years, heights, points, request.confidence)
            kept = np.where(trend.significant, trend.rate, np.nan)
            if rate_file is not None:
                rate_file.write(Patch(column, row, trend.rate[None]))
            if kept_file is not None:
                kept_file.write(Patch(column, row, kept[None]))
            for small_map, values in ((map_.rate, trend.rate), (map_.kept, kept)):
                _thin(small_map, thinning, column, row, values)
            map_.cells += int(np.count_nonzero(np.isfinite(trend.rate)))
            map_.rising += int(np.count_nonzero(kept > 0))
            map_.falling += int(np.count_nonzero(kept < 0))
        if wanted and (request.rate or request.significant) and not map_.cells:
            raise NotEnoughData(f"No cell has heights at {LEAST} dates: choose DSMs whose data overlap.")
    return map_


def _writer(path: str, grid: Grid, name: str, series: Series) -> CogWriter:
    tags = {
        "STRANDLINE_RATE": "metres per year",
        "STRANDLINE_DATES": ", ".join(epoch.name for epoch in series.epochs),
    }
    return CogWriter(path, grid, names=(name,), tags=tags)


def _thin(map_: Array, step: int, column: int, row: int, values: Array) -> None:
    """Put every ``step``-th cell of a tile that begins at ``column``, ``row`` into the thinned map."""
    r, c = (-row) % step, (-column) % step
    part = values[r::step, c::step]
    map_[(row + r) // step :, (column + c) // step :][: part.shape[0], : part.shape[1]] = part


def _tell(series: Series, zones: list[ZoneSeries], total: ZoneSeries, progress: Progress) -> None:
    empty = [zone.zone.name for zone in zones if zone.covered_percent == 0]
    if len(empty) == len(zones):
        worst = series.epochs[int(np.argmax(total.without))]
        told = f"; without {worst.name} it would be {total.without.max():.0f} %" if total.without.max() > 0 else ""
        raise NotEnoughData(f"No cell of the zones has a height at every date{told}: leave dates out, or choose other zones.")
    if empty:
        progress.warn(f"No cell of {', '.join(empty)} has a height at every date: their volumes are not known.")
    costly = int(np.argmax(total.without))
    if total.without[costly] - total.covered_percent > _POOR:
        progress.warn(
            f"{total.covered_percent:.0f} % of the zones have a height at every date, which is the ground that is summed; "
            f"without {series.epochs[costly].name} it would be {total.without[costly]:.0f} %."
        )
    if not np.isfinite(total.sigmas).all():
        progress.warn(
            "The sigmas are not complete, so no change of volume can be called significant: give PRECISIONS or SIGMA with "
            "CORRELATION_RANGE and REGISTRATION_SIGMA, or STABLE."
        )


def _or_none(value: float) -> float | None:
    return value if np.isfinite(value) else None
