"""Volumes of a zone, cell by cell by the share of the cell inside, and their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..raster import Grid
from .sampling import Sample, mixed
from .uncertainty import SAMPLE, ErrorModel, Systematic, correlated_variance, total

Array = NDArray[np.float64]
_HALF_NORMAL = 1.0 / np.sqrt(2.0 * np.pi)  # mean of max(0, noise) in sigmas


@dataclass(frozen=True)
class Cells:
    """A tile's values (rows, columns): change, sigma (NaN: not known), whether significant, BEFORE's height."""

    grid: Grid
    first: int  # number of the tile's top-left cell in the whole grid
    stride: int  # cells per row of the whole grid
    change: Array
    sigma: Array | None
    significant: NDArray[np.bool_] | None
    before: Array


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
    """Volume and sigma sums over some of a zone's cells, in cells and metres."""

    def __init__(self) -> None:
        self.height, self.weight, self.squares = 0.0, 0.0, 0.0
        self.sample = Sample(SAMPLE, 3)

    def parts(self, cell_area: float, known: bool, model: ErrorModel, shift_sigma: float | None) -> Parts:
        """Return the three sigmas of this sum."""
        random = correlated = None
        if known and model.random is not None:
            random = cell_area * model.random * float(np.sqrt(self.squares))
        if known and model.structures is not None:
            sample, count = self.sample.values, self.sample.count
            variance = sum(f * f * correlated_variance(sample, count, self.squares, reach) for f, reach in model.structures)
            correlated = cell_area * float(np.sqrt(variance))
        systematic = None if shift_sigma is None else cell_area * self.weight * shift_sigma
        return Parts(random, correlated, systematic)


class Tally:
    """Collects one zone's cells tile by tile."""

    def __init__(self, area: float) -> None:
        self._area = area
        self._net, self._down, self._up = _Sum(), _Sum(), _Sum()
        self._significant_down = self._significant_up = 0.0
        self._noise = 0.0
        self._place = np.zeros(3)  # share-weighted sums of x, y, height before
        self._sigma_known = self._detected = True
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
        sums, others = np.zeros((3, 4)), np.zeros(7)
        picked = np.zeros(change.shape, np.uint8)
        first = tile.first + row * tile.stride + column
        _gather(change, sigma, kept, before, shares, first, tile.stride, limits, sums, others, picked)
        x0, y0 = (float(v) for v in grid.centres(np.array(row), np.array(column)))
        weight, by_column, by_row, height, down, up, noise = others.tolist()
        self._place += (weight * x0 + by_column * grid.cell, weight * y0 - by_row * grid.step_north, height)
        self._significant_down += down
        self._significant_up += up
        self._noise += _HALF_NORMAL * noise
        if sums[0, 1] > 0:
            self._sigma_known &= bool(np.isfinite(sums[0, 2]))
            self._detected &= tile.significant is not None
        for bit, (group, (metres, share, squares, count)) in enumerate(zip(groups, sums.tolist(), strict=True)):
            group.height += metres
            group.weight += share
            group.squares += squares
            r, c = np.nonzero(picked & (1 << bit))
            x, y = grid.centres(r + row, c + column)
            group.sample.add(first + r * tile.stride + c, x, y, shares[r, c] * sigma[r, c], count=int(count))

    def volume(self, model: ErrorModel, systematic: Systematic) -> Volume:
        """Return the zone's volumes."""
        weight, a = self._net.weight, self._cell_area
        if weight == 0.0:
            unknown = Parts(None, None, None)
            return Volume(None, unknown, None, unknown, None, unknown, None, None, None, self._area, 0.0)
        x, y, before = self._place / weight
        shift_sigma = systematic.sigma(float(x), float(y), float(before), float(before + self._net.height / weight))
        known, detected = self._sigma_known, self._detected
        return Volume(
            net=a * self._net.height,
            sigma=self._net.parts(a, known, model, shift_sigma),
            erosion=-a * self._down.height if self._down.height else 0.0,
            erosion_sigma=self._down.parts(a, known, model, shift_sigma),
            deposition=a * self._up.height,
            deposition_sigma=self._up.parts(a, known, model, shift_sigma),
            erosion_significant=a * self._significant_down if detected else None,
            deposition_significant=a * self._significant_up if detected else None,
            noise=a * self._noise if detected and known else None,
            area=self._area,
            covered_percent=min(100.0, 100.0 * a * weight / self._area),
        )


@njit(cache=True)  # pragma: no cover
def _gather(
    change: Array,
    sigma: Array,
    kept: NDArray[np.bool_],
    before: Array,
    shares: Array,
    first: int,
    stride: int,
    limits: NDArray[np.uint64],
    sums: Array,
    others: Array,
    picked: NDArray[np.uint8],
) -> None:
    """Add cells to sums (all, falling, rising; height, weight, squares, count) and mark those that the samples take, a bit each.

    ``others``: weight, weight by column and by row, height before, significant fall and rise, sigma of what is not significant.
    """
    for r in range(change.shape[0]):
        for c in range(change.shape[1]):
            w, dh = shares[r, c], change[r, c]
            if not w > 0.0 or np.isnan(dh):
                continue
            s = w * sigma[r, c]
            hashed = mixed(first + r * stride + c)
            side = 1 if dh < 0 else 2 if dh > 0 else 0
            sums[0, 0] += w * dh
            sums[0, 1] += w
            sums[0, 2] += s * s
            sums[0, 3] += 1.0
            if hashed < limits[0]:
                picked[r, c] |= 1
            if side:
                sums[side, 0] += w * dh
                sums[side, 1] += w
                sums[side, 2] += s * s
                sums[side, 3] += 1.0
                if hashed < limits[side]:
                    picked[r, c] |= 1 << side
            others[0] += w
            others[1] += w * c
            others[2] += w * r
            others[3] += w * before[r, c]
            if kept[r, c]:
                others[4] += w * max(-dh, 0.0)
                others[5] += w * max(dh, 0.0)
            else:
                others[6] += s
