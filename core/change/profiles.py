"""Step ``profiles``: heights along transects at several dates, and the sand above a datum per metre of beach."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..contract import VectorSource
from ..errors import InputError, NotEnoughData
from ..progress import SILENT, Progress
from ..vector import check_destination, write_layer
from .alignment import Aligned
from .crosssection import Crossing, Sand, sand_above, seaward_crossing, together
from .epocherror import EpochError, epoch_errors, stable_ground
from .heard import Heard
from .linesamples import Line, hidden, join, sample_line, weighted_sigma
from .profilesreport import ProfileFindings, write_report
from .series import Epoch, Series, SeriesRequest, covered_by, open_series, validate
from .significance import coverage_factor
from .transects import Transect, read_transects, require_some_inside
from .zones import read_zones

Array = NDArray[np.float64]
_NODES = 5_000_000  # of all transects together
_SLOPE_CELLS, _SLOPE = 5.0, 5.0  # the default scale of slopes: 5 cells, 5 m at least


@dataclass(frozen=True, kw_only=True)
class Request(SeriesRequest):
    """Metres. ``output`` and ``points`` are GeoPackages to write; ``start`` and ``end`` are distances from the landward end."""

    transects: VectorSource
    transect_field: str | None = None
    flip: bool = False
    datum: float = 0.0
    spacing: float = 0.0
    start: float = 0.0
    end: float | None = None
    slope_scale: float = 0.0
    output: str
    points: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Means over the transects, in m3 per metre of beach and metres, of the last date against the first; None: not known."""

    output: str
    transect_count: int
    date_count: int
    mean_change: float | None
    mean_change_sigma: float | None
    mean_width_change: float | None
    covered_percent: float
    points: str | None = None


@dataclass(frozen=True)
class Section:
    """One transect at one date: its nodes, corrected; the sand, the share of the section with heights (%), the crossing."""

    line: Line
    sand: Sand
    covered_percent: float
    crossing: Crossing | None


@dataclass(frozen=True)
class Change:
    """Of the sand (m3/m) against another date over what both cover, its sigma (None: not known), and the share covered (%)."""

    volume: float | None
    sigma: float | None
    covered_percent: float


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Sample the profiles, sum them and compare the dates."""
    validate(request, (request.output, request.points, request.output_html_file), least=1)
    _validate(request)
    heard = Heard(progress)
    progress = Progress(heard)
    with ExitStack() as files:
        series = open_series(request, files, progress.part(0.0, 0.4))
        transects = read_transects(request.transects, request.transect_field, series.grid.crs, flip=request.flip)
        outside = require_some_inside(transects, covered_by(series))
        if outside:
            progress.warn(f"{len(outside)} transect(s) lie outside the DSMs: {_some(outside)}; their rows are empty.")
        beyond = [t.name for t in transects if t.length <= request.start]
        if beyond:
            raise InputError(f"START={request.start:g} m lies beyond the end of {_some(beyond)}: give a smaller one.")
        coarsest = max(epoch.heights.cell for epoch in series.epochs)
        spacing = request.spacing or coarsest
        if sum(t.length for t in transects) / spacing > _NODES:
            raise InputError(f"SPACING={spacing:g} m makes more than {_NODES:,} points: give a larger one.")
        scale = request.slope_scale or max(_SLOPE, _SLOPE_CELLS * coarsest)
        ground = None
        if request.stable:
            shapes = [zone.shape for zone in read_zones(request.stable, "STABLE", None, series.grid.crs)]
            ground = stable_ground(series, shapes, progress.part(0.4, 0.55))
        ends = shapely.get_coordinates([t.line for t in transects])
        errors = epoch_errors(series, request, ground, ends, progress)
        if len(series.epochs) == 1:
            progress.warn("There is one date only: profiles have no change.")
        sections = []
        for transect in progress.part(0.55, 0.85).over(transects):
            row = [
                _section(request, series, e, error, transect, spacing, scale)
                for e, error in zip(series.epochs, errors, strict=True)
            ]
            sections.append(row)
    heights = np.concatenate([s.line.height for row in sections for s in row])
    if not np.isfinite(heights).any():
        raise NotEnoughData("No transect has a height at any date: move TRANSECTS to where the DSMs have heights.")
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    if not low < request.datum < high:
        progress.warn(
            f"DATUM={request.datum:g} m lies outside the profiles' heights ({low:.2f} to {high:.2f} m): no profile crosses it."
        )
    _check_direction(transects, sections, progress)
    factor = coverage_factor(request.confidence)
    rows = _rows(request, series, errors, transects, sections, factor)
    lines = [t.line for t in transects for _ in series.epochs]
    write_layer(request.output, "profiles", series.grid.crs, _columns(rows), lines, "LineString")
    if request.points:
        _write_points(request.points, series, errors, transects, sections)
    mean = (
        mean_change(request, sections, errors, 0, len(series.epochs) - 1) if len(series.epochs) > 1 else Change(None, None, 0.0)
    )
    widths = [
        r["width_change_first"] for r in rows if r["date"] == series.epochs[-1].name and r["width_change_first"] is not None
    ]
    covered = float(np.mean([s.covered_percent for row in sections for s in row]))
    if request.output_html_file:
        findings = ProfileFindings(
            request, series, errors, transects, sections, rows, mean, spacing, scale, tuple(heard.warnings)
        )
        write_report(request.output_html_file, findings)
    progress.at(1.0)
    return Result(
        request.output,
        len(transects),
        len(series.epochs),
        mean.volume,
        mean.sigma,
        float(np.mean(widths)) if widths and len(series.epochs) > 1 else None,
        covered,
        request.points,
    )


def _validate(request: Request) -> None:
    for name in ("spacing", "start", "slope_scale"):
        if getattr(request, name) < 0:
            raise InputError(f"{name.upper()}={getattr(request, name):g} is negative: give metres, 0 or more.")
    if request.end is not None and request.end <= request.start:
        raise InputError(f"END={request.end:g} m does not lie beyond START={request.start:g} m: give a larger one.")
    for path in (request.output, request.points):
        if path:
            check_destination(path)


def _section(
    request: Request, series: Series, epoch: Epoch, error: EpochError, transect: Transect, spacing: float, scale: float
) -> Section:
    distance = transect.nodes(spacing)
    line = sample_line(epoch.heights, series.grid.crs, transect, distance, spacing)
    x, y = line.place.T
    height = line.height - error.shift.at(x, y)
    if series.ignore:
        height[hidden(line, series.ignore)] = np.nan
    line = replace(line, height=height, sigma=_cell_sigmas(epoch, error, series.grid.crs, transect, distance, spacing))
    start, end = request.start, min(transect.length, transect.length if request.end is None else request.end)
    sand = sand_above(distance, height, request.datum, start, end)
    crossing = seaward_crossing(distance, height, request.datum, start, end, scale)
    return Section(line, sand, min(100.0, 100.0 * sand.covered / (end - start)), crossing)


def _cell_sigmas(epoch: Epoch, error: EpochError, crs: str, transect: Transect, distance: Array, spacing: float) -> Array:
    """Return the sigma of a cell at each node (n,); NaN where it is not known."""
    if not isinstance(epoch.sigma, Aligned):
        value = error.common if epoch.sigma is None else epoch.sigma
        return np.full(len(distance), np.nan if value is None else value)
    sigma = sample_line(epoch.sigma.heights, crs, transect, distance, spacing).height
    sigma[~(sigma > 0)] = np.nan
    return sigma


def change_between(request: Request, before: Section, after: Section, errors: tuple[EpochError, EpochError]) -> Change:
    """Return the change of the sand from one date to another where both have heights."""
    distance = before.line.distance
    start, end = request.start, min(float(distance[-1]), float(distance[-1]) if request.end is None else request.end)
    sands = [sand_above(distance, h, request.datum, start, end) for h in together(before.line.height, after.line.height)]
    covered = min(100.0, 100.0 * sands[0].covered / (end - start))
    if sands[0].covered <= 0:
        return Change(None, None, 0.0)
    sigmas = [
        weighted_sigma(s.line, sand.weight, error).total for s, sand, error in zip((before, after), sands, errors, strict=True)
    ]
    return Change(sands[1].volume - sands[0].volume, _joined(*sigmas), covered)


def mean_change(request: Request, sections: list[list[Section]], errors: list[EpochError], first: int, last: int) -> Change:
    """Return the mean change over all transects that both dates cover; transects near one another err alike, which is counted."""
    kept: list[tuple[Line, Line]] = []
    volumes: list[float] = []
    weights: tuple[list[Array], list[Array]] = ([], [])
    for row in sections:
        before, after = row[first], row[last]
        distance = before.line.distance
        end = min(float(distance[-1]), float(distance[-1]) if request.end is None else request.end)
        sands = [
            sand_above(distance, h, request.datum, request.start, end) for h in together(before.line.height, after.line.height)
        ]
        if sands[0].covered > 0:
            kept.append((before.line, after.line))
            volumes.append(sands[1].volume - sands[0].volume)
            for side in (0, 1):
                weights[side].append(sands[side].weight)
    if not kept:
        return Change(None, None, 0.0)
    sigmas = [
        weighted_sigma(join([pair[side] for pair in kept]), np.concatenate(weights[side]) / len(kept), errors[k]).total
        for side, k in ((0, first), (1, last))
    ]
    return Change(float(np.mean(volumes)), _joined(*sigmas), 100.0 * len(kept) / len(sections))


def width_sigma(section: Section, error: EpochError) -> float | None:
    """Return the sigma (m) of where the profile crosses the datum: that of the height there by the slope."""
    crossing = section.crossing
    assert crossing is not None
    sigma = weighted_sigma(section.line, crossing.weight, error).total
    return None if sigma is None or crossing.slope == 0 else sigma / abs(crossing.slope)


def _rows(
    request: Request,
    series: Series,
    errors: list[EpochError],
    transects: list[Transect],
    sections: list[list[Section]],
    factor: float,
) -> list[dict[str, Any]]:
    rows = []
    for transect, row in zip(transects, sections, strict=True):
        for k, (epoch, section, error) in enumerate(zip(series.epochs, row, errors, strict=True)):
            some = section.sand.covered > 0
            told: dict[str, Any] = {
                "transect": transect.name,
                "date": epoch.name,
                "volume": section.sand.volume if some else None,
                "volume_sigma": weighted_sigma(section.line, section.sand.weight, error).total if some else None,
                "covered_percent": section.covered_percent,
            }
            for name, other in (("first", 0), ("previous", k - 1)):
                change = change_between(request, row[other], section, (errors[other], error)) if k else Change(None, None, 0.0)
                told |= _interval(f"change_{name}", change.volume, change.sigma, factor)
                told[f"change_{name}_covered_percent"] = change.covered_percent if k else None
            crossing = section.crossing
            sigma = None if crossing is None else width_sigma(section, error)
            told["width"] = None if crossing is None else crossing.distance - request.start
            told["width_sigma"] = sigma
            told["slope"] = None if crossing is None else crossing.slope
            told["crossings"] = 0 if crossing is None else crossing.count
            moved = moved_sigma = None
            if k and crossing is not None and row[0].crossing is not None:
                moved = crossing.distance - row[0].crossing.distance
                moved_sigma = _joined(sigma, width_sigma(row[0], errors[0]))
            told |= _interval("width_change_first", moved, moved_sigma, factor)
            rows.append(told)
    return rows


def _interval(name: str, value: float | None, sigma: float | None, factor: float) -> dict[str, Any]:
    """Return the columns of a value: itself, sigma, low, high, and whether it differs from zero (1, 0, or NULL)."""
    known = value is not None and sigma is not None
    return {
        name: value,
        f"{name}_sigma": sigma,
        f"{name}_low": value - factor * sigma if known else None,  # type: ignore[operator]
        f"{name}_high": value + factor * sigma if known else None,  # type: ignore[operator]
        f"{name}_significant": int(abs(value) > factor * sigma) if known else None,  # type: ignore[arg-type, operator]
    }


def _write_points(
    path: str, series: Series, errors: list[EpochError], transects: list[Transect], sections: list[list[Section]]
) -> None:
    columns: dict[str, list[Any]] = {name: [] for name in ("transect", "date", "distance", "height", "sigma")}
    points = []
    for transect, row in zip(transects, sections, strict=True):
        for epoch, section, error in zip(series.epochs, row, errors, strict=True):
            line = section.line
            count = len(line.distance)
            columns["transect"] += [transect.name] * count
            columns["date"] += [epoch.name] * count
            columns["distance"] += line.distance.tolist()
            columns["height"] += line.height.tolist()
            columns["sigma"] += np.where(np.isfinite(line.height), height_sigma(line, error), np.nan).tolist()
            points += shapely.points(line.place).tolist()
    write_layer(path, "profile_points", series.grid.crs, columns, points, "Point")


def height_sigma(line: Line, error: EpochError) -> Array:
    """Return the sigma (n,) of the nodes' heights; NaN where it is not known."""
    x, y = line.place.T
    return error.point_sigma(line.sigma, x, y, np.nan_to_num(line.height))


def _check_direction(transects: list[Transect], sections: list[list[Section]], progress: Progress) -> None:
    """Warn when most profiles rise to their ends."""
    rising = []
    for transect, row in zip(transects, sections, strict=True):
        slopes = []
        for section in row:
            known = np.isfinite(section.line.height)
            if known.sum() > 2:
                slopes.append(np.polyfit(section.line.distance[known], section.line.height[known], 1)[0])
        if slopes and np.median(slopes) > 0:
            rising.append(transect.name)
    if 2 * len(rising) > len(transects):
        progress.warn(
            f"{len(rising)} of {len(transects)} transects rise towards their end ({_some(rising)}), which is to be seaward: "
            "if they were drawn from the sea to the land, set FLIP."
        )


def _columns(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
    return {name: [row[name] for row in rows] for name in rows[0]}


def _joined(*sigmas: float | None) -> float | None:
    known = [s for s in sigmas if s is not None]
    return float(np.sqrt(sum(s * s for s in known))) if len(known) == len(sigmas) else None


def _some(names: list[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
