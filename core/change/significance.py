"""The level of detection: which cells have changed."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

Array = NDArray[np.float64]
HALO = 2  # cells beyond a tile that the coherence of its outer cells looks at
_SIDE = 2 * HALO + 1
_THRESHOLD = 0.6  # share of like neighbours where coherence begins to speak (Wheaton et al. 2010)


def coverage_factor(confidence: float) -> float:
    """Return the two-sided normal quantile (1.96 for 0.95; Lane et al. 2003).

    >>> round(coverage_factor(0.95), 3)
    1.96
    """
    return NormalDist().inv_cdf(0.5 + confidence / 2.0)


def beyond_detection(change: Array, sigma: Array | float, confidence: float) -> NDArray[np.bool_]:
    """Return where |change| exceeds the level of detection; False where either is NaN."""
    return np.asarray(np.abs(change) > coverage_factor(confidence) * sigma)


def coherent(change: Array, sigma: Array | float, confidence: float) -> NDArray[np.bool_]:
    """Return where the change is probable given its size and its neighbours' sign (Wheaton et al. 2010).

    With p_E = 2 Phi(|change| / sigma) - 1 and p_A = ((like - 0.6 n) / 0.4 n) in 0..1, of n cells with a value in the 5 x 5 window
    (the cell itself among them) ``like`` having the cell's sign, a cell is kept when p_A p_E / (p_A p_E + (1 - p_A) (1 - p_E))
    reaches ``confidence``. Cells without a value are not counted. No change (0) is never significant. A change that is
    certain by size (p_E = 1) among neighbours that all speak against it (p_A = 0) is not kept: 0/0 is the limit 0.
    """
    known = np.isfinite(change)
    rising, falling = known & (change > 0), known & (change < 0)
    like = np.where(rising, _window_sum(rising), np.where(falling, _window_sum(falling), 0.0))
    count = np.maximum(_window_sum(known), 1.0)
    agreement = np.clip((like / count - _THRESHOLD) / (1.0 - _THRESHOLD), 0.0, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = erf(np.abs(change) / sigma / np.sqrt(2.0))
        both = agreement * size
        posterior = np.where(both > 0, both / (both + (1 - agreement) * (1 - size)), 0.0)
    return np.asarray(posterior >= confidence)


def _window_sum(mask: NDArray[np.bool_]) -> Array:
    sums = np.pad(np.pad(mask.astype(float), HALO).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    return np.asarray(sums[_SIDE:, _SIDE:] - sums[:-_SIDE, _SIDE:] - sums[_SIDE:, :-_SIDE] + sums[:-_SIDE, :-_SIDE])
