"""How a shoreline moved along one transect, by the names that users of DSAS know (Himmelstoss et al. 2021)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .significance import coverage_factor
from .trend import fit_trend

if TYPE_CHECKING:
    from .series import Series
    from .shoreline import Position


@dataclass(frozen=True)
class Moves:
    """Seaward positive; metres and metres per year; None: not known.

    NSM, net shoreline movement from the oldest to the youngest position; SCE, the largest distance between any two; EPR, end
    point rate, NSM by the years between; LRR, linear regression rate, all dates alike; WLR, weighted by 1 / sigma^2. Each
    interval is that of CONFIDENCE.
    """

    count: int
    oldest: int | None
    youngest: int | None
    nsm: float | None
    nsm_sigma: float | None
    sce: float | None
    epr: float | None
    epr_sigma: float | None
    lrr: float | None
    lrr_half: float | None
    wlr: float | None
    wlr_sigma: float | None
    wlr_half: float | None
    factor: float

    def columns(self, series: Series) -> dict[str, Any]:
        """Return the columns of the layer RATES."""
        return {
            "positions": self.count,
            "from_date": None if self.oldest is None else series.epochs[self.oldest].name,
            "to_date": None if self.youngest is None else series.epochs[self.youngest].name,
            **interval("nsm", self.nsm, self.nsm_sigma, self.factor),
            "sce": self.sce,
            **interval("epr", self.epr, self.epr_sigma, self.factor),
            "lrr": self.lrr,
            "lrr_low": _minus(self.lrr, self.lrr_half),
            "lrr_high": _plus(self.lrr, self.lrr_half),
            "wlr": self.wlr,
            "wlr_sigma": self.wlr_sigma,
            "wlr_low": _minus(self.wlr, self.wlr_half),
            "wlr_high": _plus(self.wlr, self.wlr_half),
            "wlr_significant": None if self.wlr is None or self.wlr_half is None else int(abs(self.wlr) > self.wlr_half),
        }

    def positions(self, row: list[Position | None], factor: float) -> list[dict[str, Any]]:
        """Return the columns of the layer POSITIONS for each date."""
        told: list[dict[str, Any]] = []
        before: Position | None = None
        first = None if self.oldest is None else row[self.oldest]
        for place in row:
            if place is None:
                told.append({})
                continue
            columns: dict[str, Any] = {
                "distance": place.distance,
                "sigma": place.sigma,
                "slope": place.slope,
                "height_sigma": place.height_sigma,
                "flat": int(place.flat),
                "crossings": place.crossings,
            }
            for name, other in (("first", first), ("previous", before)):
                move = None if other is None or other is place else place.distance - other.distance
                sigma = None if move is None or other is None else _joined(place.sigma, other.sigma)
                columns |= interval(f"change_{name}", move, sigma, factor)
            told.append(columns)
            before = place
        return told


def moves_of(series: Series, row: list[Position | None], confidence: float) -> Moves:
    """Return the movement from the positions of one transect, one for each date or None."""
    factor = coverage_factor(confidence)
    known = [k for k, place in enumerate(row) if place is not None]
    places = [place for place in row if place is not None]
    if not places:
        return Moves(0, *(None,) * 12, factor)
    nothing = Moves(len(known), known[0], known[-1], *(None,) * 10, factor)
    if len(known) < 2:
        return nothing
    years = series.years[known]
    distance = np.array([place.distance for place in places])
    sigma = np.array([np.nan if place.sigma is None else place.sigma for place in places])
    nsm, nsm_sigma = float(distance[-1] - distance[0]), _joined(places[0].sigma, places[-1].sigma)
    span = float(years[-1] - years[0])
    plain = fit_trend(years, distance, None, confidence)
    weighted = fit_trend(years, distance, sigma, confidence) if np.isfinite(sigma).all() else None
    return Moves(
        len(known),
        known[0],
        known[-1],
        nsm,
        nsm_sigma,
        float(np.ptp(distance)),
        nsm / span,
        None if nsm_sigma is None else nsm_sigma / span,
        _number(plain.rate),
        _number(plain.half),
        None if weighted is None else _number(weighted.rate),
        None if weighted is None else _number(weighted.sigma),
        None if weighted is None else _number(weighted.half),
        factor,
    )


def interval(name: str, value: float | None, sigma: float | None, factor: float) -> dict[str, Any]:
    """Return the columns of a value: itself, sigma, low, high, and whether it differs from zero (1, 0, or None)."""
    half = None if value is None or sigma is None else factor * sigma
    return {
        name: value,
        f"{name}_sigma": sigma,
        f"{name}_low": _minus(value, half),
        f"{name}_high": _plus(value, half),
        f"{name}_significant": None if value is None or half is None else int(abs(value) > half),
    }


def _minus(value: float | None, half: float | None) -> float | None:
    return None if value is None or half is None else value - half


def _plus(value: float | None, half: float | None) -> float | None:
    return None if value is None or half is None else value + half


def _number(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None


def _joined(first: float | None, second: float | None) -> float | None:
    return None if first is None or second is None else float(np.hypot(first, second))
