"""Volumes of a zone, cell by cell by the share of the cell inside, and their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..raster import Grid
from .sampling import Sample, mixed
from .terms import COUNT, Moments, about_another
from .uncertainty import SAMPLE, ErrorModel, Systematic, correlated_variance, total

Array = NDArray[np.float64]
_LACKING = 0.05  # share of a zone's cells that may lack a precision
_CAREFUL = 0.95  # quantile of the zone's precision that they get
_HALF_NORMAL = 1.0 / np.sqrt(2.0 * np.pi)  # mean of max(0, noise) in sigmas


@dataclass(frozen=True)
class Cells:
    """A tile's values (rows, columns): change, sigma (NaN: not known), whether significant, BEFORE's height.

    ``after`` (rows + 2, columns + 2) are AFTER's heights with one cell around them; None when no shift in plan is asked for.
    """

    grid: Grid
    first: int  # number of the tile's top-left cell in the whole grid
    stride: int  # cells per row of the whole grid
    change: Array
    sigma: Array | None
    significant: NDArray[np.bool_] | None
    before: Array
    after: Array | None = None


@dataclass(frozen=True)
class Parts:
    """The sigmas (m3) of one volume; None: not known."""

    random: float | None
    correlated: float | None
    systematic: float | None

    @property
    def total(self) -> float | None:
        """Their root sum of squares, None unless all are known."""
        return total(self.random, self.correlated, self.systematic)


@dataclass(frozen=True)
class Volume:
    """A zone's result in m3 and m2; erosion and deposition are positive; None: not known, or nothing covered."""

    net: float | None
    sigma: Parts
    erosion: float | None
    erosion_sigma: Parts
    deposition: float | None
    deposition_sigma: Parts
    erosion_significant: float | None
    deposition_significant: float | None
    noise: float | None
    area: float
    covered_percent: float

    @property
    def net_significant(self) -> float | None:
        """Deposition minus erosion of the significant cells."""
        if self.deposition_significant is None or self.erosion_significant is None:
            return None
        return self.deposition_significant - self.erosion_significant


class _Sum:
    """Volume and sigma sums over some of a zone's cells, in cells and metres; ``lacking`` is the weight without a sigma."""

    def __init__(self) -> None:
        self.height, self.weight, self.lacking, self.sigmas, self.squares = 0.0, 0.0, 0.0, 0.0, 0.0
        self.sample = Sample(SAMPLE, 3)

    def parts(self, cell_area: float, fill: float | None, model: ErrorModel, shift_sigma: float | None) -> Parts:
        """Return the three sigmas of this sum; a cell that lacks a sigma has ``fill`` (m), None: nothing is known."""
        random = correlated = None
        if fill is not None:
            squares = self.squares + self.lacking * fill**2
            if model.random is not None:
                random = cell_area * model.random * float(np.sqrt(squares))
            if model.structures is not None:
                sample, count = self.sample.values, self.sample.count
                # The cells that lack one lie among the others, with which they err.
                lift = 1.0 + self.lacking * fill / self.sigmas if self.sigmas > 0 else 1.0
                known = (f * f * correlated_variance(sample, count, self.squares, reach) for f, reach in model.structures)
                alone = (f * f * self.lacking * fill**2 for f, _ in model.structures)
                correlated = cell_area * float(np.sqrt(lift**2 * sum(known) + sum(alone)))
        systematic = None if shift_sigma is None else cell_area * self.weight * shift_sigma
        return Parts(random, correlated, systematic)


class Tally:
    """Collects one zone's cells tile by tile."""

    def __init__(self, area: float) -> None:
        self._area = area
        self._net, self._down, self._up = _Sum(), _Sum(), _Sum()
        self._significant_down = self._significant_up = 0.0
        self._noise = 0.0
        self._origin: tuple[float, ...] | None = (
            None  # the first cell that was met: near the zone, so that squares keep their digits
        )
        self._terms = np.zeros(COUNT)  # share-weighted sums of the height's terms about it
        self._slopes = np.zeros(4)  # share-weighted sums of slopes east and north (per cell), and their weights
        self._detected = True
        self._cell_area = 0.0

    def add(self, tile: Cells, row: int, column: int, shares: Array) -> None:
        """Add the cells of a tile from ``row``, ``column`` on that lie inside by ``shares`` (rows, columns)."""
        part = (slice(row, row + shares.shape[0]), slice(column, column + shares.shape[1]))
        grid = tile.grid
        self._cell_area = grid.cell_area
        change, before = tile.change[part], tile.before[part]
        sigma = np.full_like(change, np.nan) if tile.sigma is None else tile.sigma[part]
        kept = np.zeros(change.shape, np.bool_) if tile.significant is None else tile.significant[part]
        groups = (self._net, self._down, self._up)
        limits = np.array([group.sample.limit for group in groups], np.uint64)
        if tile.after is None:
            after = np.full((shares.shape[0] + 2, shares.shape[1] + 2), np.nan)
        else:
            after = tile.after[row : row + shares.shape[0] + 2, column : column + shares.shape[1] + 2]
        sums, others, slopes = np.zeros((3, 6)), np.zeros(10), np.zeros(4)
        picked = np.zeros(change.shape, np.uint8)
        first = tile.first + row * tile.stride + column
        _gather(change, sigma, kept, before, after, shares, first, tile.stride, limits, sums, others, slopes, picked)
        corner = (*(float(v) for v in grid.centres(np.array(row), np.array(column))), 0.0)
        self._origin = self._origin or corner
        # Columns run east, rows south.
        east, south = grid.cell, -grid.step_north
        terms = others[:COUNT] * (1.0, east, south, 1.0, east * east, east * south, south * south)
        self._terms += about_another(self._origin, corner) @ terms
        self._slopes += slopes * (1.0 / east, 1.0 / south, 1.0, 1.0)
        down, up, noise = others[COUNT:].tolist()
        self._significant_down += down
        self._significant_up += up
        self._noise += _HALF_NORMAL * noise
        if sums[0, 1] > 0:
            self._detected &= tile.significant is not None
        for bit, (group, (metres, share, squares, count, lacking, sigmas)) in enumerate(zip(groups, sums.tolist(), strict=True)):
            group.height += metres
            group.weight += share
            group.squares += squares
            group.lacking += lacking
            group.sigmas += sigmas
            r, c = np.nonzero(picked & (1 << bit))
            x, y = grid.centres(r + row, c + column)
            group.sample.add(first + r * tile.stride + c, x, y, shares[r, c] * sigma[r, c], count=int(count))

    @property
    def slopes(self) -> tuple[float, float]:
        """The mean slopes of AFTER to the east and north."""
        east, north, first, second = self._slopes.tolist()
        return (east / first if first else 0.0, north / second if second else 0.0)

    @property
    def lacking(self) -> float:
        """The share (0..1) of the covered cells that lack a precision."""
        return self._net.lacking / self._net.weight if self._net.weight else 0.0

    def _fill(self) -> float | None:
        """Return the sigma (m) for cells that lack one, None where too many do."""
        if self._net.lacking == 0.0:
            return 0.0
        sample = self._net.sample.values
        return float(np.quantile(sample[:, 2], _CAREFUL)) if self.lacking < _LACKING and len(sample) else None

    def volume(self, model: ErrorModel, systematic: Systematic) -> Volume:
        """Return the zone's volumes."""
        weight, a = self._net.weight, self._cell_area
        if weight == 0.0:
            unknown = Parts(None, None, None)
            return Volume(None, unknown, None, unknown, None, unknown, None, None, None, self._area, 0.0)
        assert self._origin is not None
        shift_sigma = systematic.sigma(Moments(self._origin, tuple((self._terms / weight).tolist()), self.slopes))
        fill, detected = self._fill(), self._detected
        return Volume(
            net=a * self._net.height,
            sigma=self._net.parts(a, fill, model, shift_sigma),
            erosion=-a * self._down.height if self._down.height else 0.0,
            erosion_sigma=self._down.parts(a, fill, model, shift_sigma),
            deposition=a * self._up.height,
            deposition_sigma=self._up.parts(a, fill, model, shift_sigma),
            erosion_significant=a * self._significant_down if detected else None,
            deposition_significant=a * self._significant_up if detected else None,
            noise=a * (self._noise + _HALF_NORMAL * self._net.lacking * fill) if detected and fill is not None else None,
            area=self._area,
            covered_percent=min(100.0, 100.0 * a * weight / self._area),
        )


def without_precision(count: int, names: list[str], tallies: list[Tally]) -> str:
    """Return what ``count`` cells without a precision mean for the zones called ``names``."""
    told = f"{count} cells have a change but no precision: they are never significant"
    over = [name for name, tally in zip(names, tallies, strict=False) if tally.lacking >= _LACKING]
    some = any(0.0 < tally.lacking < _LACKING for tally in tallies)
    if some:
        told += f", and in NET_SIGMA they count with a careful precision, the {100 * _CAREFUL:g} % quantile of their zone's"
    if over:
        told += f"{';' if some else ', and'} in {', '.join(over)} they are more than {100 * _LACKING:g} %, so no sigma is known"
    return told + "."


@njit(cache=True)  # pragma: no cover
def _gather(
    change: Array,
    sigma: Array,
    kept: NDArray[np.bool_],
    before: Array,
    after: Array,
    shares: Array,
    first: int,
    stride: int,
    limits: NDArray[np.uint64],
    sums: Array,
    others: Array,
    slopes: Array,
    picked: NDArray[np.uint8],
) -> None:
    """Add cells to sums (all, falling, rising) and mark those that the samples take, a bit each.

    Sums: height, weight, squares and count of cells with a sigma, weight of those without one, weighted sigmas.

    ``others``: weight times 1, column, row, height before, column^2, column row, row^2; then significant fall and rise, sigma of
    what is not significant.

    ``slopes``: weight times rise per column and per row of ``after``, which has one cell around; the weights of both.
    """
    for r in range(change.shape[0]):
        for c in range(change.shape[1]):
            w, dh = shares[r, c], change[r, c]
            if not w > 0.0 or np.isnan(dh):
                continue
            s = w * sigma[r, c]
            known = not np.isnan(s)
            hashed = mixed(first + r * stride + c)
            side = 1 if dh < 0 else 2 if dh > 0 else 0
            for k in (0, side):
                sums[k, 0] += w * dh
                sums[k, 1] += w
                if not known:
                    sums[k, 4] += w
                else:
                    sums[k, 2] += s * s
                    sums[k, 3] += 1.0
                    sums[k, 5] += s
                    if hashed < limits[k]:
                        picked[r, c] |= 1 << k
                if side == 0:
                    break
            others[0] += w
            others[1] += w * c
            others[2] += w * r
            others[3] += w * before[r, c]
            others[4] += w * c * c
            others[5] += w * c * r
            others[6] += w * r * r
            for k, here in enumerate((_rise(after[r + 1, c : c + 3]), _rise(after[r : r + 3, c + 1]))):
                if not np.isnan(here):
                    slopes[k] += w * here
                    slopes[2 + k] += w
            if kept[r, c]:
                others[7] += w * max(-dh, 0.0)
                others[8] += w * max(dh, 0.0)
            elif known:
                others[9] += s


@njit(cache=True, inline="always")  # pragma: no cover
def _rise(three: Array) -> float:
    """Return the rise per cell at the middle one of three heights, from what is known of them; NaN of one alone."""
    before, here, after = three
    if np.isnan(before):
        return after - here
    if np.isnan(after):
        return here - before
    return (after - before) / 2.0
