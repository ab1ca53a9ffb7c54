"""The bundle adjustment of tie points, ground control, GNSS positions and interior orientations, with its full covariance.

Tie points and ground points are eliminated; what is solved for are poses, free interior parameters, and a constant error
of the GNSS positions where there is one. A ground point observed at G with covariance S_G and marked in photographs gives the
reduced observation ``r - Jp (G - X) = Ja da + e`` with ``Cov(e) = S_m + Jp S_G Jp^T``: what is left after its place is
eliminated. Every covariance here is that of the whole adjustment, never one with other unknowns held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import NotEnoughData
from . import bundle
from .adjusted import Adjusted
from .cameras import POSE, Cameras
from .network import Control, Network, Positions, antennas, tie_residuals
from .normals import inverse, solve
from .sightings import rows

Array = NDArray[np.float64]

_ROUNDS = 40
_WEIGHING = 6  # rounds after which the tie points' weights and sigma stand, so that the rest can settle
_STILL = 1e-6  # m, and px at the image's edge: a change below which the adjustment stands
_HUBER = 2.5  # sigmas of a tie point's 2D residual, or of a position's, beyond which it weighs less (Huber 1964)
_HALVINGS = 8  # of a step that overshoots
_GAIN = 1e-6  # of the sum of squares in sigmas: below, no unknown moves by more than a thousandth of its own
_NOISE = 1e-10  # of the cost: what rounding may add
_LEAST_SIGMA = 1e-4  # px; keeps exact observations solvable


def adjust(
    network: Network,
    control: Sequence[Control],
    positions: Positions,
    *,
    sigma: float,
    fixed_sigma: bool = False,
    effect: float = 1.0,
) -> Adjusted:
    """Adjust by Gauss-Newton, with steps halved that overshoot, and Huber's weights on tie points and positions.

    ``sigma`` (px) is that of tie points to start with; the residuals tell it, unless it is ``fixed_sigma``. ``effect`` is by how
    much they overstate themselves (see ``independence``): so many of them count as one.

    Raises
    ------
    NotEnoughData
        When the observations do not determine the unknowns, or the adjustment does not settle.
    """
    state = _State(network, np.array([c.ground for c in control]).reshape(-1, 3), np.zeros(3))
    weights = _weights(state, positions, sigma, effect)
    cost, weighed = _cost(state, control, positions, weights), 0
    for _ in range(_ROUNDS):
        system = _system(state, control, positions, weights)
        change = solve(system.matrix, system.side, len(network.cameras.centre))
        for _ in range(_HALVINGS):
            tried = _moved(state, control, weights, change)
            trial = _cost(tried, control, positions, weights)
            if trial <= cost * (1 + _NOISE):
                break
            change = change / 2
        gain, step = cost - trial, _size(network, change)
        state, cost = tried, trial
        if weighed < _WEIGHING:
            weighed += 1
            if not fixed_sigma:
                sigma = _tie_sigma(system.residuals, weights.tie * sigma**2 * effect, network)
            weights = _weights(state, positions, sigma, effect)
            cost = _cost(state, control, positions, weights)
        elif step < _STILL or gain < _GAIN:
            break
    else:
        raise NotEnoughData(
            "The adjustment does not settle: tie points, ground points and positions contradict each other; look at the "
            "residuals of METHOD=similarity."
        )
    whole = inverse(_system(state, control, positions, weights).matrix, len(network.cameras.centre))
    return Adjusted(state.network, tuple(control), positions, state.places, state.bias, sigma, effect, weights.tie, whole)


@dataclass(frozen=True)
class _State:
    """What is adjusted: the network, the control points' places (k, 3), and the positions' common error (3,)."""

    network: Network
    places: Array
    bias: Array


@dataclass(frozen=True)
class _Weights:
    """Of the tie points' rays (m,) and of positions (g, 3); they stand while steps are tried."""

    tie: Array
    position: Array


@dataclass(frozen=True)
class _System:
    matrix: Array
    side: Array
    residuals: Array


def _weights(state: _State, positions: Positions, sigma: float, effect: float) -> _Weights:
    left = positions.antenna - antennas(state.network.cameras, positions) - state.bias
    return _Weights(_tie_weights(state.network, sigma) / effect, position_weights(left, positions.sigma))


def _moved(state: _State, control: Sequence[Control], weights: _Weights, change: Array) -> _State:
    network = state.network
    cameras = network.cameras.moved(change[: network.cameras.columns])
    places = _follow_control(control, network.cameras, state.places, change)
    bias = state.bias + change[-3:] if len(change) > network.cameras.columns else state.bias
    return _State(replace(network, cameras=cameras, points=_followed(network, cameras, weights.tie, change)), places, bias)


def _cost(state: _State, control: Sequence[Control], positions: Positions, weights: _Weights) -> float:
    """Return the sum of weighted squares; infinite when a ray that could be seen no longer can."""
    network, cameras = state.network, state.network.cameras
    tie = tie_residuals(network)
    total = float(np.sum(np.where(weights.tie > 0, weights.tie * np.sum(tie**2, axis=1), 0.0)))
    for c, interior in enumerate(network.interiors):
        off = interior.known - interior.values(cameras.brown[c])
        total += float(off @ interior.information @ off)
    if len(positions):
        left = positions.antenna - antennas(cameras, positions) - state.bias
        total += float(np.sum(weights.position * left**2))
        if (positions.shared > 0).any():
            total += float(np.sum((state.bias / np.where(positions.shared > 0, positions.shared, _LEAST_SIGMA)) ** 2))
    for one, place in zip(control, state.places, strict=True):
        left = rows(cameras, one.sighting, place, cameras.columns)[2]
        off = one.ground - place
        total += float(np.sum((left / np.repeat(one.sighting.sigma, 2)) ** 2) + off @ np.linalg.solve(one.covariance, off))
    return total if np.isfinite(total) else np.inf


def _system(state: _State, control: Sequence[Control], positions: Positions, weights: _Weights) -> _System:
    network, bias = state.network, state.bias
    c, t = network.cameras, network.ties
    columns = c.columns
    matrix, side, residuals = bundle.reduce(t.arrays, weights.tie, network.points, c.arrays, c.interior_column, columns)
    matrix = np.triu(matrix) + np.triu(matrix, 1).T
    for k, (first, interior) in enumerate(zip(c.interior_column, network.interiors, strict=True)):
        part = slice(first, first + len(interior.names))
        matrix[part, part] += interior.information
        side[part] += interior.information @ (interior.known - interior.values(c.brown[k]))
    with_bias = bool(len(positions)) and bool((positions.shared > 0).any())
    size = columns + 3 * with_bias
    if with_bias:
        matrix, side = np.pad(matrix, (0, 3)), np.append(side, np.zeros(3))
        common = np.where(positions.shared > 0, positions.shared, _LEAST_SIGMA)
        matrix[range(columns, size), range(columns, size)] += 1.0 / common**2
        side[columns:] -= bias / common**2
    if len(positions):
        _add_positions(matrix, side, c, positions, bias, weights.position)
    for one, place in zip(control, state.places, strict=True):
        jacobian, by_point, left = rows(c, one.sighting, place, size)
        effective = left - by_point @ (one.ground - place)
        spread = np.diag(np.repeat(one.sighting.sigma**2, 2)) + by_point @ one.covariance @ by_point.T
        weighted = np.linalg.solve(spread, np.column_stack([jacobian, effective]))
        used = np.flatnonzero(np.any(jacobian != 0, axis=0))
        matrix[np.ix_(used, used)] += jacobian[:, used].T @ weighted[:, used]
        side[used] += jacobian[:, used].T @ weighted[:, -1]
    return _System(matrix, side, residuals)


def _add_positions(matrix: Array, side: Array, cameras: Cameras, positions: Positions, bias: Array, weight: Array) -> None:
    with_bias = len(side) > cameras.columns
    left = positions.antenna - antennas(cameras, positions) - bias
    for view, w, r in zip(positions.view, weight, left, strict=True):
        own = np.arange(POSE * view + 3, POSE * view + 6)
        matrix[own, own] += w
        side[own] += w * r
        if with_bias:
            common = np.arange(len(side) - 3, len(side))
            matrix[common, common] += w
            matrix[own, common] += w
            matrix[common, own] += w
            side[common] += w * r


def position_weights(left: Array, sigma: Array) -> Array:
    """Return Huber's weights over sigma squared (g, 3), for plan and height apart, of the positions' residuals (g, 3)."""
    plan = np.hypot(*(left[:, :2] / sigma[:, :2]).T)
    height = np.abs(left[:, 2] / sigma[:, 2])
    shrink = np.minimum(1.0, _HUBER / np.maximum(np.stack([plan, plan, height], axis=1), 1e-12))
    return np.asarray(shrink / sigma**2)


def _tie_weights(network: Network, sigma: float) -> Array:
    length = np.hypot(*tie_residuals(network).T) / sigma
    weight = np.minimum(1.0, _HUBER / np.maximum(np.where(np.isfinite(length), length, np.inf), 1e-12)) / sigma**2
    return np.asarray(weight)


def _tie_sigma(residuals: Array, shrink: Array, network: Network) -> float:
    """Return the sigma per axis (px) that weighted residuals tell, with what the unknowns took up given back."""
    good = np.isfinite(residuals[:, 0])
    points = len(np.unique(network.ties.point[good]))
    redundancy = 2 * int(good.sum()) - 3 * points - network.cameras.columns
    if redundancy <= 0:
        raise NotEnoughData("The tie points hold too few rays to adjust the block: orient it with more overlap.")
    return max(float(np.sqrt(np.sum(shrink[good] * np.sum(residuals[good] ** 2, axis=1)) / redundancy)), _LEAST_SIGMA)


def _followed(network: Network, moved: Cameras, weight: Array, change: Array) -> Array:
    """Return the points after the change: by the linear equations, then to where their rays meet, which long steps miss."""
    c, t = network.cameras, network.ties
    points = bundle.follow(t.arrays, weight, network.points, c.arrays, c.interior_column, change)
    return np.asarray(bundle.intersect(t.arrays, weight, points, moved.arrays, 1)[0])


def _follow_control(control: Sequence[Control], cameras: Cameras, places: Array, change: Array) -> Array:
    moved = places.copy()
    for k, one in enumerate(control):
        jacobian, by_point, left = rows(cameras, one.sighting, places[k], len(change))
        effective = left - by_point @ (one.ground - places[k])
        spread = np.diag(np.repeat(one.sighting.sigma**2, 2)) + by_point @ one.covariance @ by_point.T
        moved[k] = one.ground + one.covariance @ by_point.T @ np.linalg.solve(spread, effective - jacobian @ change)
    return moved


def _size(network: Network, change: Array) -> float:
    """Return the largest change in metres, or in pixels of a turn."""
    poses = change[: POSE * len(network.cameras.centre)].reshape(-1, POSE)
    focal = float(network.cameras.brown[:, 0].max())
    return float(max(np.abs(poses[:, 3:]).max(), focal * np.abs(poses[:, :3]).max()))
