"""How far errors are alike: an empirical variogram of stable ground and the spherical model fitted to it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]
_PAIRS, _FAR_PAIRS, _LAGS, _LEAST_PAIRS = 8_000, 80_000, 24, 200
_RANGES = 28  # candidates
_BAND = 0.08  # of a lag, either way
_SEED = 20150


@dataclass(frozen=True)
class Variogram:
    """Variances: the ``nugget``, and nested ``structures`` of sill and range (m); a range that is not resolved is inf.

    ``lags`` (m) and ``gamma`` are the empirical values it was fitted to.
    """

    nugget: float
    structures: tuple[tuple[float, float], ...]
    lags: tuple[float, ...] = ()
    gamma: tuple[float, ...] = ()

    @property
    def sill(self) -> float:
        """The sills together, without the nugget."""
        return sum(sill for sill, _ in self.structures)

    @property
    def reach(self) -> float:
        """The longest range; 0 without correlation."""
        return max((reach for _, reach in self.structures), default=0.0)

    def at(self, lag: Array) -> Array:
        """Return the model's half variogram at lags above zero; a structure without a known range does not count."""
        return self.nugget + sum((s * (1.0 - correlation(lag, r)) for s, r in self.structures), np.zeros(np.shape(lag)))


def correlation(distance: Array | float, reach: float) -> Array:
    """Return the spherical model's correlation at a distance (m); 1 everywhere for an infinite range, 0 beyond a range of 0.

    >>> correlation(np.array([0.0, 10.0, 20.0]), 20.0).tolist()
    [1.0, 0.3125, 0.0]
    """
    if reach <= 0:
        return np.asarray(np.asarray(distance) <= 0, float)
    h = np.minimum(np.asarray(distance, float) / reach, 1.0)
    return np.asarray(1.0 - 1.5 * h + 0.5 * h**3)


def fit_variogram(
    row: NDArray[np.int64], column: NDArray[np.int64], values: Array, steps: tuple[float, float]
) -> Variogram | None:
    """Return the variogram of ``values`` (n,) on cells ``row``, ``column`` (n,) of ``steps`` (rows, columns; m); None if too few.

    Half of Dowd's (1984) robust 2.198 median(d)^2 at log-spaced lags, from random pairs; fitted by a nugget and one or two
    spherical sills, not negative, for the best of many ranges up to half the area's extent. A range at that end is not resolved.
    """
    if len(values) < 100:
        return None
    extent = float(np.hypot(np.ptp(row) * steps[0], np.ptp(column) * steps[1]))
    shortest = min(steps)
    if extent < 8 * shortest:
        return None
    wanted = np.unique(np.round(np.geomspace(1.0, extent / 2 / shortest, _LAGS), 2)) * shortest
    lags, gamma, pairs = _empirical(row, column, values, steps, wanted)
    if len(lags) < 5:
        return None
    reaches = np.geomspace(1.5 * shortest, lags[-1], _RANGES)
    weight = np.sqrt(pairs)
    nugget, structures = _nested(lags, gamma, weight, reaches, pairs=False)
    for last in (False, False, True):
        # The scatter of an empirical value goes with the true one, which is the model's, not its own.
        expected = np.maximum(Variogram(nugget, structures).at(lags), 1e-9 * max(float(gamma.max()), 1e-30))
        nugget, structures = _nested(lags, gamma, weight / expected, reaches, pairs=last)
    told = tuple((sill, np.inf if reach >= reaches[-2] else reach) for sill, reach in structures)
    return Variogram(nugget, told, tuple(lags.tolist()), tuple(gamma.tolist()))


def _nested(
    lags: Array, gamma: Array, weight: Array, reaches: Array, *, pairs: bool
) -> tuple[float, tuple[tuple[float, float], ...]]:
    """Return the nugget and one structure of the weighted least squares, or two where ``pairs`` halve the squared misfit."""
    parts = np.column_stack([np.ones(len(lags)), *(1.0 - correlation(lags, float(r)) for r in reaches)]) * weight[:, None]
    wanted = gamma * weight

    def best(choices: Iterable[tuple[int, ...]]) -> tuple[float, list[float], tuple[int, ...]]:
        fits = []
        for choice in choices:
            sills, misfit = nnls(parts[:, [0, *(i + 1 for i in choice)]], wanted)
            fits.append((float(misfit) ** 2, sills.tolist(), choice))
        return min(fits)

    count = range(len(reaches))
    fit = best((i,) for i in count)
    if pairs and (two := best((i, k) for i in count for k in count if k > i + 2))[0] < 0.5 * fit[0]:
        fit = two
    _, (nugget, *sills), choice = fit
    return nugget, tuple((sill, float(reaches[i])) for sill, i in zip(sills, choice, strict=True) if sill > 0)


def _empirical(
    row: NDArray[np.int64], column: NDArray[np.int64], values: Array, steps: tuple[float, float], wanted: Array
) -> tuple[Array, Array, Array]:
    """Return true mean lags, half variograms and numbers of different pairs (m,) of the lags that have enough."""
    random = np.random.default_rng(_SEED)
    width = int(column.max()) + 1
    order = np.argsort(row * width + column)
    row, column, values = row[order], column[order], values[order]
    keys, count = row * width + column, len(row)
    far = random.integers(0, count, (_FAR_PAIRS, 2))
    apart = np.hypot(*((v[far[:, 0]] - v[far[:, 1]]) * step for v, step in zip((row, column), steps, strict=True)))
    lags, gamma, pairs = [], [], []
    for lag in wanted:
        first = random.integers(0, count, _PAIRS)
        angle = random.uniform(0, 2 * np.pi, _PAIRS)
        r = row[first] + np.rint(lag * np.sin(angle) / steps[0]).astype(np.int64)
        c = column[first] + np.rint(lag * np.cos(angle) / steps[1]).astype(np.int64)
        place = np.minimum(np.searchsorted(keys, r * width + c), count - 1)
        found = (r >= 0) & (c >= 0) & (c < width) & (keys[place] == r * width + c) & (place != first)
        a, b = first[found], place[found]
        # Where only some patches are at hand few cells have a partner far away, but some pairs of cells are that far apart.
        band = far[np.abs(apart / lag - 1.0) < _BAND][:_PAIRS]
        a, b = np.concatenate([a, band[:, 0]]), np.concatenate([b, band[:, 1]])
        different = np.unique(np.minimum(a, b) * count + np.maximum(a, b))
        if len(different) < _LEAST_PAIRS:
            continue
        a, b = different // count, different % count
        lags.append(float(np.mean(np.hypot((row[a] - row[b]) * steps[0], (column[a] - column[b]) * steps[1]))))
        gamma.append(0.5 * 2.198 * float(np.median(np.abs(values[a] - values[b]))) ** 2)
        pairs.append(float(len(different)))
    return np.asarray(lags), np.asarray(gamma), np.asarray(pairs)


@njit(cache=True)  # pragma: no cover
def pair_sum(x: Array, y: Array, left: Array, right: Array, reach: float) -> float:
    """Return the sum over ordered pairs i != k of left_i right_k rho(d_ik), symmetrised; rho as in ``correlation``."""
    order = np.argsort(x)
    x, y, left, right = x[order], y[order], left[order], right[order]
    total = 0.0
    for i in range(len(x)):
        for k in range(i + 1, len(x)):
            if x[k] - x[i] >= reach:
                break
            h = np.sqrt((x[i] - x[k]) ** 2 + (y[i] - y[k]) ** 2) / reach
            if h < 1.0:
                total += (left[i] * right[k] + left[k] * right[i]) * (1.0 - 1.5 * h + 0.5 * h * h * h)
    return total
