"""Step ``shoreline``: where each date's surface passes through a datum, how sure that is, and how it moved along transects."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from ..contract import VectorSource
from ..errors import InputError, NotEnoughData
from ..progress import SILENT, Progress
from ..raster import Grid
from ..vector import check_destination, write_layer
from .contours import joined, segments, slope_at
from .epocherror import EpochError, epoch_errors, stable_ground
from .heard import Heard
from .series import Epoch, Series, SeriesRequest, covered_by, open_series, validate
from .shorelinemoves import Moves, moves_of
from .shorelinereport import ShorelineFindings, write_report
from .significance import coverage_factor
from .transects import Transect, read_transects, require_some_inside
from .zones import read_zones

Array = NDArray[np.float64]
_SLOPE_CELLS, _SLOPE = 5.0, 5.0  # the default scale of slopes: 5 cells, 5 m at least
_ALONG = 150  # places along a date's line where the slope is taken


@dataclass(frozen=True, kw_only=True)
class Request(SeriesRequest):
    """Metres. ``output`` (lines), ``positions`` (points) and ``rates`` (transects) are GeoPackages to write."""

    transects: VectorSource | None = None
    transect_field: str | None = None
    flip: bool = False
    datum: float = 0.0
    resolution: float = 0.0
    min_length: float = 20.0
    keep: Literal["all", "longest", "seaward"] = "all"
    slope_scale: float = 0.0
    output: str
    positions: str | None = None
    rates: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Means over the transects, seaward positive: net movement (m) from the first to the last date, and rate (m/year)."""

    output: str
    date_count: int
    transect_count: int
    mean_nsm: float | None
    mean_rate: float | None
    median_sigma: float | None
    positions: str | None = None
    rates: str | None = None


@dataclass(frozen=True)
class Shoreline:
    """A date's lines in the grid's CRS, their length (m), what was removed, and along them: slope, sigmas (NaN: not known)."""

    lines: list[Any]
    removed: int
    slope: Array
    height_sigma: Array
    sigma: Array

    @property
    def length(self) -> float:
        """Of all lines together (m)."""
        return float(sum(shapely.length(line) for line in self.lines))


@dataclass(frozen=True)
class Position:
    """Where a transect meets a date's shoreline most seaward: distance (m), place, slope seaward, sigmas, number of meetings."""

    distance: float
    place: tuple[float, float]
    slope: float | None
    height_sigma: float | None
    sigma: float | None
    flat: bool
    crossings: int


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Trace the shorelines and measure them along the transects."""
    validate(request, (request.output, request.positions, request.rates, request.output_html_file), least=1)
    _validate(request)
    heard = Heard(progress)
    progress = Progress(heard)
    with ExitStack() as files:
        series = open_series(request, files, progress.part(0.0, 0.3), resolution=request.resolution)
        grid = series.grid
        transects: list[Transect] = []
        if request.transects:
            transects = read_transects(request.transects, request.transect_field, grid.crs, flip=request.flip)
            if outside := require_some_inside(transects, covered_by(series)):
                progress.warn(
                    f"{len(outside)} transect(s) lie outside the DSMs ({', '.join(outside[:8])} ...): they have no shoreline."
                )
        ground = None
        if request.stable:
            shapes = [zone.shape for zone in read_zones(request.stable, "STABLE", None, grid.crs)]
            ground = stable_ground(series, shapes, progress.part(0.3, 0.4))
        raw, low, high = _trace(series, request.datum, progress.part(0.4, 0.6))
        if not any(len(pieces) for pieces in raw):
            raise NotEnoughData(
                f"No DSM passes through DATUM={request.datum:g} m: their heights range from {low:.2f} to {high:.2f} m; "
                "give a datum between, in metres above the DSMs' own zero."
            )
        places = np.concatenate([np.column_stack(grid.centres(p[:, 0, 1], p[:, 0, 0])) for p in raw if len(p)])
        errors = epoch_errors(series, request, ground, places[:: max(1, len(places) // 1000)], progress)
        # Again where stable ground lifted a date: then its contour is another.
        if any(error.shift.method != "none" for error in errors):
            raw, low, high = _trace(series, request.datum, progress.part(0.6, 0.7), errors)
        cells = max(grid.cell, grid.step_north)
        scale = request.slope_scale or max(_SLOPE, _SLOPE_CELLS * cells)
        shores = []
        for epoch, error, pieces in progress.part(0.7, 0.8).over(list(zip(series.epochs, errors, raw, strict=True))):
            lines, removed = _cleaned(request, joined(pieces, grid), transects)
            if not lines:
                progress.warn(f"{epoch.name} has no shoreline at DATUM={request.datum:g} m of at least {request.min_length:g} m.")
            shores.append(_measured(series, epoch, error, lines, removed, scale))
        if not any(shore.lines for shore in shores):
            raise NotEnoughData(
                f"No shoreline at DATUM={request.datum:g} m is as long as MIN_LENGTH={request.min_length:g} m: give a "
                "smaller one."
            )
        factor = coverage_factor(request.confidence)
        positions = [
            [
                _position(series, e, error, shore, transect, scale, factor)
                for e, error, shore in zip(series.epochs, errors, shores, strict=True)
            ]
            for transect in progress.part(0.8, 0.95).over(transects)
        ]
    _tell(series, shores, positions, transects, factor, scale, progress)
    moves = [moves_of(series, row, request.confidence) for row in positions]
    _write(request, series, shores, transects, positions, moves, factor)
    if request.output_html_file:
        findings = ShorelineFindings(request, series, errors, shores, transects, positions, moves, scale, tuple(heard.warnings))
        write_report(request.output_html_file, findings)
    progress.at(1.0)
    sigmas = np.concatenate([shore.sigma for shore in shores])
    sigmas = sigmas[np.isfinite(sigmas)]
    nsm = [m.nsm for m in moves if m.nsm is not None]
    rates = [m.wlr for m in moves if m.wlr is not None]
    return Result(
        request.output,
        len(series.epochs),
        len(transects),
        float(np.mean(nsm)) if nsm else None,
        float(np.mean(rates)) if rates else None,
        float(np.median(sigmas)) if len(sigmas) else None,
        request.positions,
        request.rates,
    )


def _validate(request: Request) -> None:
    for name in ("resolution", "min_length", "slope_scale"):
        if getattr(request, name) < 0:
            raise InputError(f"{name.upper()}={getattr(request, name):g} is negative: give metres, 0 or more.")
    if request.transects is None:
        for name in ("positions", "rates"):
            if getattr(request, name):
                raise InputError(f"{name.upper()} needs TRANSECTS: give lines across the beach.")
        if request.keep == "seaward":
            raise InputError("KEEP=seaward needs TRANSECTS, which tell where the sea is: give them, or choose all or longest.")
    for path in (request.output, request.positions, request.rates):
        if path:
            check_destination(path)


def _trace(
    series: Series, level: float, progress: Progress, errors: list[EpochError] | None = None
) -> tuple[list[Array], float, float]:
    """Return the pieces of each date's contour, and the range of all heights."""
    grid = series.grid
    found: list[list[Array]] = [[] for _ in series.epochs]
    low, high = np.inf, -np.inf
    for column, row, width, height in progress.over(series.tiles()):
        # One cell more to the east and south: squares between cell centres, none twice.
        window = grid.window(column, row, min(width + 1, grid.width - column), min(height + 1, grid.height - row))
        heights = series.heights(window)
        if errors is not None:
            heights -= np.stack([_shift_on(error, window) for error in errors])
        if np.isfinite(heights).any():
            low, high = min(low, float(np.nanmin(heights))), max(high, float(np.nanmax(heights)))
        for pieces, values in zip(found, heights, strict=True):
            if min(values.shape) > 1 and len(new := segments(values, level, row, column)):
                pieces.append(new)
    return [np.concatenate(pieces) if pieces else np.empty((0, 2, 2)) for pieces in found], low, high


def _shift_on(error: EpochError, window: Grid) -> Array:
    x, y = window.centres(np.arange(window.height), np.arange(window.width))
    return error.shift.at(x[None, :], y[:, None])


def _cleaned(request: Request, lines: list[Any], transects: list[Transect]) -> tuple[list[Any], int]:
    """Return the lines that are kept, and how many are not."""
    kept = [line for line in lines if shapely.length(line) >= request.min_length]
    if request.keep == "longest" and kept:
        kept = [max(kept, key=shapely.length)]
    if request.keep == "seaward" and kept:
        chosen = set()
        for transect in transects:
            last = [(_meetings(transect, line)[-1:], i) for i, line in enumerate(kept)]
            some = [(places[0], i) for places, i in last if len(places)]
            if some:
                chosen.add(max(some)[1])
        kept = [kept[i] for i in sorted(chosen)]
    return kept, len(lines) - len(kept)


def _meetings(transect: Transect, line: Any) -> Array:
    """Return the distances (n,) along the transect, rising, where a line meets it."""
    places = shapely.get_coordinates(shapely.intersection(transect.line, line))
    return np.sort(shapely.line_locate_point(transect.line, shapely.points(places))) if len(places) else np.empty(0)


def _near(series: Series, epoch: Epoch, error: EpochError, x: float, y: float, scale: float) -> tuple[Array, Grid]:
    """Return a date's corrected heights about a place."""
    grid = series.grid
    east, south = scale / 2 / grid.cell + 2, scale / 2 / grid.step_north + 2
    column, row = (x - grid.west) / grid.cell, (grid.north - y) / grid.step_north
    c0, c1 = max(0, int(column - east)), min(grid.width, int(column + east) + 1)
    r0, r1 = max(0, int(row - south)), min(grid.height, int(row + south) + 1)
    window = grid.window(c0, r0, max(1, c1 - c0), max(1, r1 - r0))
    return epoch.aligned.read(window) - _shift_on(error, window), window


def _height_sigma(series: Series, epoch: Epoch, error: EpochError, x: float, y: float, level: float) -> float:
    """Return the sigma of the surface's height between cell centres at a place; NaN when not known."""
    grid = series.grid
    column, row = (x - grid.west) / grid.cell - 0.5, (grid.north - y) / grid.step_north - 0.5
    c, r = min(max(int(round(column)), 0), grid.width - 1), min(max(int(round(row)), 0), grid.height - 1)
    cell = float(epoch.sigma_on(grid.window(c, r, 1, 1))[0, 0])
    if error.common is not None:
        cell = error.common
    if error.model.random is None or error.model.structures is None or not np.isfinite(cell):
        return float("nan")
    fx, fy = column - np.floor(column), row - np.floor(row)
    # Noise of the cells is averaged between them; errors that neighbours share are not.
    share = error.model.random**2 * ((1 - fx) ** 2 + fx**2) * ((1 - fy) ** 2 + fy**2)
    share += sum(f**2 for f, _ in error.model.structures)
    shared = float(error.shared_variance(np.array(x), np.array(y), np.array(level)))
    return float(np.sqrt(share * cell**2 + shared))


def _measured(series: Series, epoch: Epoch, error: EpochError, lines: list[Any], removed: int, scale: float) -> Shoreline:
    """Return a date's lines with slope and sigmas at places spread evenly along them."""
    total = float(sum(shapely.length(line) for line in lines))
    slopes, heights = [], []
    step = max(scale / 2, total / _ALONG) if lines else 1.0
    for line in lines:
        for x, y in shapely.get_coordinates(
            shapely.line_interpolate_point(line, np.arange(step / 2, shapely.length(line), step))
        ):
            values, window = _near(series, epoch, error, x, y, scale)
            plane = slope_at(values, window, x, y, scale)
            slopes.append(np.nan if plane is None else float(np.hypot(*plane)))
            heights.append(_height_sigma(series, epoch, error, x, y, 0.0))
    slope, sigma = np.array(slopes, float), np.array(heights, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        return Shoreline(lines, removed, slope, sigma, sigma / slope)


def _position(
    series: Series, epoch: Epoch, error: EpochError, shore: Shoreline, transect: Transect, scale: float, factor: float
) -> Position | None:
    meetings = np.sort(np.concatenate([_meetings(transect, line) for line in shore.lines])) if shore.lines else np.empty(0)
    if not len(meetings):
        return None
    distance = float(meetings[-1])
    x, y = transect.at(np.array([distance]))[0].tolist()
    values, window = _near(series, epoch, error, x, y, scale)
    plane = slope_at(values, window, x, y, scale)
    slope = None if plane is None else float(np.dot(plane, transect.direction(distance)))
    height = _height_sigma(series, epoch, error, x, y, 0.0)
    known = None if np.isnan(height) else height
    sigma = known / abs(slope) if known is not None and slope else None
    # Over the scale the ground falls by no more than what is not known of its height.
    flat = slope is not None and known is not None and abs(slope) * scale < factor * known
    return Position(distance, (x, y), slope, known, sigma, flat, len(meetings))


def _tell(
    series: Series,
    shores: list[Shoreline],
    positions: list[list[Position | None]],
    transects: list[Transect],
    factor: float,
    scale: float,
    progress: Progress,
) -> None:
    flat = sum(p is not None and p.flat for row in positions for p in row)
    if flat:
        progress.warn(
            f"At {flat} of {sum(p is not None for row in positions for p in row)} positions the ground falls by less over "
            f"{scale:.3g} m than its height is known: their sigmas are large (field flat)."
        )
    if transects and not any(p is not None for row in positions for p in row):
        progress.warn("No transect meets a shoreline: lengthen TRANSECTS, or choose another DATUM.")
    landward = [t.name for t, row in zip(transects, positions, strict=True) if any(p and p.slope and p.slope > 0 for p in row)]
    if transects and 2 * len(landward) > len(transects):
        progress.warn(
            f"At {len(landward)} of {len(transects)} transects the ground rises seaward: if they were drawn from the sea to "
            "the land, set FLIP."
        )
    cells = max(series.grid.cell, series.grid.step_north)
    for epoch, shore in zip(series.epochs, shores, strict=True):
        if len(shore.sigma) and shore.removed > 5 and np.nanmedian(shore.slope) * cells < 0.5 * np.nanmedian(shore.height_sigma):
            progress.info(
                f"{epoch.name}: noise breaks the contour of this flat ground into pieces ({shore.removed} left out); "
                "a coarser RESOLUTION gives a calmer line, and one that is not drawn seaward by noise."
            )


def _write(
    request: Request,
    series: Series,
    shores: list[Shoreline],
    transects: list[Transect],
    positions: list[list[Position | None]],
    moves: list[Moves],
    factor: float,
) -> None:
    shown = [(epoch, shore) for epoch, shore in zip(series.epochs, shores, strict=True) if shore.lines]
    fields: dict[str, list[Any]] = {
        "date": [e.name for e, _ in shown],
        "years": [float(series.years[series.epochs.index(e)]) for e, _ in shown],
        "datum": [request.datum] * len(shown),
        "length": [s.length for _, s in shown],
        "parts": [len(s.lines) for _, s in shown],
        "removed": [s.removed for _, s in shown],
        "slope": [_median(s.slope) for _, s in shown],
        "height_sigma": [_median(s.height_sigma) for _, s in shown],
        "sigma": [_median(s.sigma) for _, s in shown],
        "sigma_largest": [_median(s.sigma, 0.95) for _, s in shown],
    }
    lines = [shapely.multilinestrings(s.lines) for _, s in shown]
    write_layer(request.output, "shorelines", series.grid.crs, fields, lines, "MultiLineString")
    if request.positions:
        rows, points = [], []
        for transect, row, move in zip(transects, positions, moves, strict=True):
            for epoch, place, columns in zip(series.epochs, row, move.positions(row, factor), strict=True):
                if place is not None:
                    rows.append({"transect": transect.name, "date": epoch.name, **columns})
                    points.append(shapely.Point(place.place))
        if rows:
            columns_ = {name: [row[name] for row in rows] for name in rows[0]}
            write_layer(request.positions, "positions", series.grid.crs, columns_, points, "Point")
    if request.rates:
        told = [{"transect": t.name, **move.columns(series)} for t, move in zip(transects, moves, strict=True)]
        columns_ = {name: [row[name] for row in told] for name in told[0]}
        write_layer(request.rates, "rates", series.grid.crs, columns_, [t.line for t in transects], "LineString")


def _median(values: Array, share: float = 0.5) -> float | None:
    values = values[np.isfinite(values)]
    return float(np.quantile(values, share)) if len(values) else None
