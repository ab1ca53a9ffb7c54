"""Tests of single observations against the rest of an adjustment, and what it would be without one control point.

The tests are Baarda's (1968) for errors of one or two components: with v the reduced residual, C its covariance as given, Qv = C
- J Q J^T that after the adjustment and E the way in which an error enters, ``t = u^T N^-1 u`` with ``u = E^T C^-1 v`` and
``N = E^T C^-1 Qv C^-1 E`` is chi-squared, and ``N^-1 u`` estimates the error.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from .adjusted import Adjusted
from .cameras import POSE
from .network import Control
from .sightings import rows

Array = NDArray[np.float64]

_UNCONTROLLED = 0.01  # redundancy number below which an error would hardly show
_SINGULAR = 1e-6  # of what is left when a control point is taken out

Part = Literal["mark", "plan", "height", "GNSS plan", "GNSS height"]


@dataclass(frozen=True)
class Test:
    """Whether one observation is wrong: a mark (``item`` of control point ``index``), a point's or a position's plan or height.

    ``error`` (k,) is the estimated error (px or m), ``statistic`` its chi-squared of k degrees, ``redundancy`` (0 to k) how much
    of an error shows.
    """

    part: Part
    index: int
    item: int
    error: Array
    statistic: float
    redundancy: float

    @property
    def size(self) -> float:
        """The length of the error."""
        return float(np.linalg.norm(self.error))

    @property
    def chance(self) -> float:
        """The probability of as large a statistic without an error."""
        return float(stats.chi2.sf(self.statistic, len(self.error)))

    @property
    def ratio(self) -> float:
        """The error in units of its sigma."""
        return float(np.sqrt(self.statistic))


def tests(adjusted: Adjusted) -> list[Test]:
    """Return the tests of all marks, control points and positions whose errors would show."""
    found: list[Test] = []
    for index, one in enumerate(adjusted.control):
        found += _control_tests(adjusted, index, one)
    if len(adjusted.positions):
        found += list(_position_tests(adjusted))
    return found


def _reduced(adjusted: Adjusted, index: int) -> tuple[Array, Array, Array, Array]:
    """Return derivatives by unknowns and point, the reduced residual (2m,), and its covariance as given (2m, 2m)."""
    one = adjusted.control[index]
    jacobian, by_point, left = rows(adjusted.cameras, one.sighting, adjusted.places[index], len(adjusted.cofactor))
    spread = np.diag(np.repeat(one.sighting.sigma**2, 2)) + by_point @ one.covariance @ by_point.T
    return jacobian, by_point, left - by_point @ (one.ground - adjusted.places[index]), spread


def _control_tests(adjusted: Adjusted, index: int, one: Control) -> Iterator[Test]:
    jacobian, by_point, left, spread = _reduced(adjusted, index)
    if not np.isfinite(left).all():
        return
    weight = np.linalg.inv(spread)
    after = weight @ (spread - jacobian @ adjusted.cofactor @ jacobian.T) @ weight
    weighted = weight @ left
    for item, sigma in enumerate(one.sighting.sigma):
        enters = np.zeros((len(left), 2))
        enters[2 * item, 0] = enters[2 * item + 1, 1] = 1.0
        yield from _test("mark", index, item, enters, weighted, after, np.eye(2) * sigma**2)
    for part, axes in (("plan", (0, 1)), ("height", (2,))):
        own = one.covariance[np.ix_(axes, axes)]
        yield from _test("plan" if part == "plan" else "height", index, -1, -by_point[:, axes], weighted, after, own)


def _position_tests(adjusted: Adjusted) -> Iterator[Test]:
    positions, cofactor = adjusted.positions, adjusted.cofactor
    with_bias = len(cofactor) > adjusted.cameras.columns
    left = adjusted.position_residuals() - adjusted.bias
    for i, (view, sigma) in enumerate(zip(positions.view, positions.sigma, strict=True)):
        own = np.arange(POSE * view + 3, POSE * view + 6)
        fitted = cofactor[np.ix_(own, own)]
        if with_bias:
            common = np.arange(len(cofactor) - 3, len(cofactor))
            cross = cofactor[np.ix_(own, common)]
            fitted = fitted + cross + cross.T + cofactor[np.ix_(common, common)]
        weight = np.diag(1.0 / sigma**2)
        after = weight @ (np.diag(sigma**2) - fitted) @ weight
        for part, axes in (("GNSS plan", [0, 1]), ("GNSS height", [2])):
            own_covariance = np.diag(sigma[axes] ** 2)
            name: Part = "GNSS plan" if part == "GNSS plan" else "GNSS height"
            yield from _test(name, i, -1, np.eye(3)[:, axes], weight @ left[i], after, own_covariance)


def _test(part: Part, index: int, item: int, enters: Array, weighted: Array, after: Array, own: Array) -> Iterator[Test]:
    normal = enters.T @ after @ enters
    redundancy = float(np.trace(normal @ own))
    if redundancy < _UNCONTROLLED * len(own):
        return
    u = enters.T @ weighted
    error = np.asarray(np.linalg.solve(normal, u), float)
    yield Test(part, index, item, error, float(u @ error), redundancy)


def without(adjusted: Adjusted, index: int) -> tuple[Array, Array] | None:
    """Return the change (u,) of the unknowns and their covariance (u, u) when a control point and its marks are taken out.

    To first order, which is exact to far below the sigmas: the adjustment stands, and what is taken out moves it little. None
    when the rest does not determine the block.
    """
    jacobian, _, left, spread = _reduced(adjusted, index)
    if not np.isfinite(left).all():
        return np.zeros(len(adjusted.cofactor)), adjusted.cofactor
    weight = np.linalg.inv(spread)
    root = np.linalg.cholesky((weight + weight.T) / 2).T @ jacobian
    gain = adjusted.cofactor @ root.T
    rest = np.eye(len(root)) - root @ gain
    if np.linalg.eigvalsh((rest + rest.T) / 2)[0] < _SINGULAR:
        return None
    cofactor = adjusted.cofactor + gain @ np.linalg.solve(rest, gain.T)
    return -cofactor @ (jacobian.T @ (weight @ left)), cofactor
