"""What is not known about a volume: random, correlated and systematic parts, each a sigma or None when nothing tells it.

Random errors are independent from cell to cell; correlated ones fade with distance; systematic ones are common to all cells:
what remains of a shift that was fitted, or of the georeferencing (Anderson 2019; Hugonnet et al. 2022).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .terms import Moments
from .variogram import pair_sum

Array = NDArray[np.float64]
SAMPLE = 2500  # cells of a zone whose pairs are summed


@dataclass(frozen=True)
class ErrorModel:
    """How the cells' sigmas divide.

    A cell's random sigma is ``random`` times its sigma; each structure of the correlated error is a factor of the cell's sigma
    and a range (m; inf: all cells err alike). None: not known.
    """

    random: float | None
    structures: tuple[tuple[float, float], ...] | None


class Systematic(Protocol):
    """An error common to all cells."""

    def sigma(self, zone: Moments) -> float | None:
        """Return the sigma (m) of the mean change of a zone with its covered cells' mean terms; None: not known."""


@dataclass(frozen=True)
class Given:
    """The same for every zone: REGISTRATION_SIGMA, or None for "not known"."""

    value: float | None

    def sigma(self, zone: Moments) -> float | None:
        """Return it."""
        return self.value


@dataclass(frozen=True)
class Fitted:
    """What is not known of a level, plane or combined surface about ``centre``: covariance (p, p), p 1, 3 or 7 as in ``Shift``.

    ``left`` (p,) is what is known to remain in the difference because another correction was asked for; ``beside`` (m) is an
    error of all cells that the covariance does not hold.
    """

    covariance: Array
    centre: tuple[float, ...]
    left: tuple[float, ...] = ()
    beside: float = 0.0

    def sigma(self, zone: Moments) -> float | None:
        """Return sqrt(g' Cov g + (g' left)^2 + beside^2) , g the mean terms: as the error is linear in them, that is exact."""
        g = zone.about(self.centre)[: len(self.covariance)]
        known = float(g @ self.left) if self.left else 0.0
        return float(np.sqrt(max(0.0, float(g @ self.covariance @ g)) + known**2 + self.beside**2))


def correlated_variance(sample: Array, count: int, squares: float, reach: float) -> float:
    """Return sum_i sum_k s_i s_k rho(d_ik) over the ``count`` cells of a zone, from a random sample of them.

    ``sample`` (m, 3) holds x, y and s = share times sigma; ``squares`` is the exact sum of s**2 (a cell paired with itself);
    the pairs of different cells are scaled from the sample's to all (Hugonnet et al. 2022, eq. 18, without its diagonal's bias).
    """
    if reach <= 0 or len(sample) < 2:
        return squares
    x, y, s = (np.ascontiguousarray(column) for column in sample.T)
    pairs = float(s.sum()) ** 2 - float(s @ s) if np.isinf(reach) else pair_sum(x, y, s, s, reach)
    m = len(sample)
    return squares + max(0.0, pairs) * (count * (count - 1.0)) / (m * (m - 1.0))


def fit_covariance(design: Array, place: Array, nugget: float, structures: tuple[tuple[float, float], ...], count: int) -> Array:
    """Return the covariance (p, p) of a least-squares fit on ``count`` cells with correlated errors.

    ``design`` (m, p) and ``place`` (m, 2) are a random sample of the cells. Cov = N^-1 X' Sigma X N^-1 with N = X'X and
    Sigma = nugget I + the sum of sill rho over the ``structures`` (sill, range).
    """
    m, p = design.shape
    inverse = np.linalg.inv(design.T @ design / m)
    inner = np.zeros((p, p))
    x, y = np.ascontiguousarray(place[:, 0]), np.ascontiguousarray(place[:, 1])
    for i in range(p):
        for k in range(i, p):
            left, right = np.ascontiguousarray(design[:, i]), np.ascontiguousarray(design[:, k])
            same = float(left @ right)
            inner[i, k] = nugget * same / m / count
            for sill, reach in structures:
                inner[i, k] += sill * same / m / count
                if reach > 0 and m > 1:
                    different = left.sum() * right.sum() - same if np.isinf(reach) else pair_sum(x, y, left, right, reach)
                    inner[i, k] += sill * different / (m * (m - 1.0)) * (1.0 - 1.0 / count)
            inner[k, i] = inner[i, k]
    return np.asarray(inverse @ inner @ inverse)


def total(*parts: float | None) -> float | None:
    """Return the root sum of squares; None when a part is not known."""
    known = [p for p in parts if p is not None]
    return float(np.sqrt(sum(p * p for p in known))) if len(known) == len(parts) else None
