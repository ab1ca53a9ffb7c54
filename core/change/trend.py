"""A straight line through dated values: its rate, and an interval that holds whether the sigmas or the scatter rule.

Weighted least squares with weights 1 / sigma^2 (WLR of the shoreline literature; Thieler et al. 2009), or all alike where a sigma
is not known (LRR). Errors of measurement give the rate the sigma 1 / sqrt(S), S = sum w (t - mean t)^2; but a coast does not
move on a line, so that the scatter about it gives another, sqrt(chi^2 / (n - 2) / S), which is to be taken with Student's
quantile. The interval is the wider of both.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

Array = NDArray[np.float64]
LEAST = 3  # dates


@dataclass(frozen=True)
class Trend:
    """Per series (...): rate per year, its sigma, half the width of its interval, number of values; NaN: not determined."""

    rate: Array
    sigma: Array
    half: Array
    count: NDArray[np.int64]

    @property
    def significant(self) -> NDArray[np.bool_]:
        """Where the interval leaves zero out."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.abs(self.rate) > self.half)


def fit_trend(years: Array, values: Array, sigma: Array | None, confidence: float) -> Trend:
    """Return the trends of ``values`` (n, ...) at ``years`` (n,); NaN values do not count.

    ``sigma`` (n, ...) are of independent errors; None or NaN: not known, and then all dates of that series weigh alike and
    only the scatter tells.
    """
    known = np.isfinite(values)
    count = known.sum(axis=0)
    shape = (-1,) + (1,) * (values.ndim - 1)
    t = years.reshape(shape)
    trusted = np.zeros(values.shape[1:], np.bool_)
    weight = known.astype(float)
    if sigma is not None:
        with np.errstate(invalid="ignore"):
            told = sigma > 0
        trusted = np.asarray((told | ~known).all(axis=0))
        weight = np.where(known & trusted, 1.0 / np.where(told, sigma, 1.0) ** 2, weight)
    with np.errstate(invalid="ignore", divide="ignore"):
        total = weight.sum(axis=0)
        filled = np.where(known, values, 0.0)
        late = t - (weight * t).sum(axis=0) / total
        mean = (weight * filled).sum(axis=0) / total
        spread = (weight * late**2).sum(axis=0)
        rate = (weight * late * (filled - mean)).sum(axis=0) / spread
        squares = (weight * (filled - mean - rate * late) ** 2).sum(axis=0)
        free = np.maximum(count - 2, 1)
        of_errors = np.where(trusted, 1.0 / np.sqrt(spread), 0.0)
        of_scatter = np.sqrt(squares / free / spread)
    enough = count >= LEAST
    normal, student = NormalDist().inv_cdf(0.5 + confidence / 2.0), stdtrit(free, 0.5 + confidence / 2.0)
    nothing = np.where(enough, 0.0, np.nan)
    return Trend(
        np.asarray(rate + nothing),
        np.asarray(np.maximum(of_errors, of_scatter) + nothing),
        np.asarray(np.maximum(normal * of_errors, student * of_scatter) + nothing),
        count.astype(np.int64),
    )
