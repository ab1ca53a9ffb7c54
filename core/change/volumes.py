"""Volumes of a zone, cell by cell by the share of the cell inside, and their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..raster import Grid
from .sampling import Sample
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

    def add(self, cells: NDArray[np.int64], x: Array, y: Array, share: Array, change: Array, sigma: Array | None) -> None:
        self.height += float(share @ change)
        self.weight += float(share.sum())
        if sigma is not None:
            part = share * sigma
            self.squares += float(part @ part)
            self.sample.add(cells, x, y, part)

    def parts(self, cell_area: float, known: bool, model: ErrorModel, shift_sigma: float | None) -> Parts:
        """Return the three sigmas of this sum."""
        random = correlated = None
        if known and model.random is not None:
            random = cell_area * model.random * float(np.sqrt(self.squares))
        if known and model.correlated is not None and model.reach is not None:
            correlated = 0.0
            if model.correlated > 0 and model.reach > 0:
                variance = correlated_variance(self.sample.values, self.sample.count, self.squares, model.reach)
                correlated = cell_area * model.correlated * float(np.sqrt(variance))
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
        rows, columns = np.nonzero((shares > 0) & np.isfinite(tile.change[row:, column:][: shares.shape[0], : shares.shape[1]]))
        if not len(rows):
            return
        share = shares[rows, columns]
        rows, columns = rows + row, columns + column
        grid = tile.grid
        self._cell_area = grid.cell_area
        change = tile.change[rows, columns]
        sigma = None if tile.sigma is None else tile.sigma[rows, columns]
        if sigma is None or not np.isfinite(sigma).all():
            sigma, self._sigma_known = None, False
        x, y = grid.centres(rows, columns)
        cells = tile.first + rows * tile.stride + columns
        self._net.add(cells, x, y, share, change, sigma)
        for some, chosen in ((self._down, change < 0), (self._up, change > 0)):
            some.add(cells[chosen], x[chosen], y[chosen], share[chosen], change[chosen], None if sigma is None else sigma[chosen])
        self._place += (share @ x, share @ y, share @ tile.before[rows, columns])
        if tile.significant is None:
            self._detected = False
            return
        kept = tile.significant[rows, columns]
        self._significant_down += float(share[kept] @ np.maximum(-change[kept], 0.0))
        self._significant_up += float(share[kept] @ np.maximum(change[kept], 0.0))
        if sigma is not None:
            self._noise += _HALF_NORMAL * float(share[~kept] @ sigma[~kept])

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
