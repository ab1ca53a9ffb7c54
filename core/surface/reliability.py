"""Which cells of a matched surface can be believed, and how precise they are."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

_LEAST = 0.2  # of the score, when so many views and cells take part that chance plays no role
_CHANCE = 2.3  # standard deviations of the score of noise, on top
_UNSURE = 0.5  # share of the neighbourhood where the plain best is another height than the regularised
_SCATTER = 0.35  # steps per view by which a height may differ from the median of its neighbours, which follows edges
_RESTLESS = 0.35  # share of the neighbourhood that may differ by more
_SPECKLE = 400  # cells, five windows; smaller islands, in height or all alone, are removed


def believable(
    height: Floats, score: Floats, sigma: Floats, views: NDArray[np.uint8], doubt: Floats, cells: int, step: float
) -> NDArray[np.bool_]:
    """Tell which cells (rows, columns) to keep.

    At least two views; a score above what chance gives (the mean correlation of m views of noise over n independent
    samples has the standard deviation sqrt(2 / (m (m - 1) n))); a neighbourhood where the plain best height mostly is the
    regularised one; heights that do not scatter from cell to cell, as those of leaves and of ripples do (where many views
    agree more is believed); and not an island of few cells.
    """
    m = np.maximum(views.astype(np.float32), 2)
    # Half of a window's cells are independent: resampling correlates neighbours.
    chance = np.sqrt(2.0 / (m * (m - 1) * 0.5 * cells))
    enough = (views >= 2) & np.isfinite(sigma)
    around = _mean(score, enough, 5)
    sure = _mean((doubt <= 2).astype(np.float32), enough, 7)
    apart = np.abs(height - cv2.medianBlur(height, 5)) > _SCATTER * views * step
    calm = _mean(apart.astype(np.float32), enough, 9) <= _RESTLESS
    good = enough & calm & (around >= _LEAST + _CHANCE * chance) & (score >= 0.5 * _LEAST) & (sure >= _UNSURE)
    return good & ~_speckles(height, good, step)


def _mean(values: Floats, where: NDArray[np.bool_], size: int) -> Floats:
    weight = cv2.blur(where.astype(np.float32), (size, size), borderType=cv2.BORDER_REFLECT_101)
    total = cv2.blur(np.where(where, values, 0).astype(np.float32), (size, size), borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(total / np.maximum(weight, 1e-6), np.float32)


def _speckles(height: Floats, good: NDArray[np.bool_], step: float) -> NDArray[np.bool_]:
    """Tell which good cells belong to islands: ``_SPECKLE`` cells at most, alone or three steps apart from what is around."""
    if not good.any():
        return np.zeros_like(good)
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(good.astype(np.uint8), connectivity=4)
    lonely = boxes[labels, cv2.CC_STAT_AREA] < _SPECKLE
    scaled = (height - height[good].min()) / step * 8.0
    coded = np.where(good, np.clip(scaled, 0, 32000), -1000).astype(np.int16)
    cv2.filterSpeckles(coded, -1000, _SPECKLE, 24)
    return np.asarray(good & (lonely | (coded == -1000)))


_STEP_ERROR = 0.03  # steps by which a parabola misses the best height, however sharp the texture


def matching_sigma(score: Floats, curvature: Floats, views: NDArray[np.uint8], cells: float, step: float) -> Floats:
    """Return the standard deviation of the height from the noise of matching (m); NaN where it cannot be told.

    For m views with independent noise, mean correlation rho over n cells and curvature kappa of the score along the
    height, least squares matching has sigma^2 = 2 (1 - rho) / (n (m - 1) kappa): the curvature holds texture, base and height
    together, as in sigma_Z = sigma_px GSD H / sqrt(sum (b - mean b)^2).
    The error of the step is added.
    """
    m = views.astype(np.float32)
    rho = np.clip(cv2.blur(score, (3, 3)), 0.0, 0.999)
    kappa = cv2.blur(curvature, (3, 3))
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma = np.sqrt(2.0 * (1.0 - rho) / (cells * np.maximum(m - 1, 1) * kappa) + (_STEP_ERROR * step) ** 2)
    return np.where((m >= 2) & (kappa > 0), sigma, np.nan).astype(np.float32)
