"""Volumes of zones date by date, over the ground that has a height at every date, and the errors that each date brings.

With V_k the volume of the zone at date k, all that is told is made of V_k - V_1, and each V_k errs by itself: a change since the
first date has the variance v_1 + v_k, one since the previous v_(k-1) + v_k. Consecutive changes share a date (their covariance is
-v_k), so that they add up to the change from first to last with its own variance, not with the sum of theirs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from .epocherror import EpochError
from .series import Series
from .trend import Trend, fit_trend
from .volumes import Cells, Parts, Tally
from .zones import Zone, cell_shares

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ZoneSeries:
    """A zone's net volume since the first date (n,; m3), what each date's sum errs by, erosion and deposition, ground and rate.

    ``erosion`` and ``deposition`` (n, 2) are since the first and since the previous date, positive m3; NaN at the first date.
    ``without`` (n,) is the share of the zone (%) that would be covered without one date. All is NaN when nothing is covered.
    """

    zone: Zone
    net: Array
    parts: list[Parts]
    erosion: Array
    deposition: Array
    area: float
    covered_percent: float
    without: Array
    trend: Trend

    @property
    def sigmas(self) -> Array:
        """What each date's volume errs by (n,; m3), NaN where it is not known."""
        return np.array([np.nan if p.total is None else p.total for p in self.parts])

    def change(self, since: int, date: int) -> tuple[float, float]:
        """Return the net change (m3) between two dates and its sigma, NaN where it is not known."""
        return float(self.net[date] - self.net[since]), float(np.hypot(*self.sigmas[[since, date]]))


class ZoneTally:
    """Collects one zone tile by tile: a tally per date."""

    def __init__(self, zone: Zone, dates: int) -> None:
        self.zone = zone
        self._area = float(shapely.area(zone.shape))
        self._tallies = [Tally(self._area) for _ in range(dates)]
        self._moved = np.zeros((dates, 2, 2))
        self._covered = 0.0
        self._without = np.zeros(dates)

    def add(self, tile: Cells, heights: Array, sigmas: Array) -> None:
        """Add the cells of a tile with the dates' corrected heights and sigmas (dates, rows, columns)."""
        found = cell_shares(self.zone.shape, tile.grid)
        if found is None:
            return
        row, column, shares = found
        part = (slice(None), slice(row, row + shares.shape[0]), slice(column, column + shares.shape[1]))
        known = np.isfinite(heights[part])
        all_ = known.all(axis=0)
        area = tile.grid.cell_area
        self._covered += area * float(shares[all_].sum())
        missing = (~known).sum(axis=0)
        for k in range(len(heights)):
            self._without[k] += area * float(shares[(missing == 0) | ((missing == 1) & ~known[k])].sum())
        if not all_.any():
            return
        first = heights[part][0]
        base = np.where(all_, first, np.nan)
        for k, tally in enumerate(self._tallies):
            change = np.where(all_, heights[part][k] - first, np.nan)
            window = tile.grid.window(column, row, shares.shape[1], shares.shape[0])
            number = tile.first + row * tile.stride + column
            tally.add(Cells(window, number, tile.stride, change, sigmas[part][k], None, base), 0, 0, shares)
            for side, since in enumerate((0, max(k - 1, 0))):
                moved = area * (shares * np.where(all_, heights[part][k] - heights[part][since], 0.0))
                self._moved[k, side] += float(np.maximum(-moved, 0.0).sum()), float(np.maximum(moved, 0.0).sum())

    def series(self, years: Array, errors: list[EpochError], confidence: float) -> ZoneSeries:
        """Return the zone's volumes and their rate (m3/year)."""
        volumes = [tally.volume(e.model, e.systematic) for tally, e in zip(self._tallies, errors, strict=True)]
        net = np.array([np.nan if v.net is None else v.net for v in volumes])
        parts = [v.sigma for v in volumes]
        sigmas = np.array([np.nan if p.total is None else p.total for p in parts])
        trend = fit_trend(years, net, sigmas if np.isfinite(sigmas).all() else None, confidence)
        moved = np.where(np.isfinite(net)[:, None, None], self._moved, np.nan)
        moved[0] = np.nan
        percent = 100.0 / self._area
        covered = min(100.0, percent * self._covered)
        without = np.minimum(100.0, percent * self._without)
        return ZoneSeries(self.zone, net, parts, moved[:, :, 0], moved[:, :, 1], self._area, covered, without, trend)


def rows_of(series: Series, zone: ZoneSeries, factor: float) -> list[dict[str, Any]]:
    """Return the rows of the table for one zone, one for each date."""
    rows = []
    for k, epoch in enumerate(series.epochs):
        row: dict[str, Any] = {"zone": zone.zone.name, "date": epoch.name, "years": float(series.years[k])}
        for name, since, side in (("", 0, 0), ("_previous", k - 1, 1)):
            net, sigma = zone.change(since, k) if k else (0.0 if not name and np.isfinite(zone.net[0]) else np.nan, np.nan)
            row |= {
                f"net{name}": net,
                f"sigma{name}": sigma,
                f"low{name}": net - factor * sigma,
                f"high{name}": net + factor * sigma,
                f"significant{name}": int(abs(net) > factor * sigma) if np.isfinite(net) and np.isfinite(sigma) else None,
                f"erosion{name}": zone.erosion[k, side],
                f"deposition{name}": zone.deposition[k, side],
            }
        part = zone.parts[k]
        row |= {"date_sigma": part.total, "date_sigma_random": part.random, "date_sigma_correlated": part.correlated}
        row |= {"date_sigma_systematic": part.systematic, "area": zone.area, "covered_percent": zone.covered_percent}
        rows.append({key: _or_none(value) for key, value in row.items()})
    return rows


def rate_columns(zone: ZoneSeries) -> dict[str, Any]:
    """Return the columns of the layer of zones."""
    rate, half = float(zone.trend.rate), float(zone.trend.half)
    net, sigma = zone.change(0, len(zone.net) - 1)
    known = np.isfinite(rate) and np.isfinite(half)
    covered = zone.area * zone.covered_percent / 100.0
    row = {
        "zone": zone.zone.name,
        "net": net,
        "sigma": sigma,
        "rate": rate,
        "rate_sigma": float(zone.trend.sigma),
        "rate_low": rate - half,
        "rate_high": rate + half,
        "rate_significant": int(abs(rate) > half) if known else None,
        "height_rate": rate / covered if covered else np.nan,
        "dates": int(zone.trend.count),
        "area": zone.area,
        "covered_percent": zone.covered_percent,
    }
    return {key: _or_none(value) for key, value in row.items()}


def _or_none(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value
