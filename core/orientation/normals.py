"""The reduced normal equations, solved by Cholesky's method on a scaled matrix; the first unknowns are the views' poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from ..errors import NotEnoughData
from .cameras import POSE

Array = NDArray[np.float64]

_SINGULAR = 2e-14  # of the largest eigenvalue: below, it is rounding
_LOOSE = 10.0  # m
_WITH = 0.2  # of the largest motion: what moves with it


def solve(matrix: Array, side: Array, views: int) -> Array:
    """Return the solution (u,) of the normal equations of a block of ``views``; raises what ``_factor`` raises."""
    scale = _scale(matrix)
    factor = _factor(matrix * scale * scale[:, None], scale, views)
    return np.asarray(scale * cho_solve(factor, scale * side))


def inverse(matrix: Array, views: int) -> Array:
    """Return the inverse (u, u) of the normal matrix of a block of ``views``; raises what ``_factor`` raises."""
    scale = _scale(matrix)
    factor = _factor(matrix * scale * scale[:, None], scale, views)
    whole = cho_solve(factor, np.eye(len(matrix)), overwrite_b=True, check_finite=False)
    whole = (whole + whole.T) / 2
    return np.asarray(whole * scale * scale[:, None])


def _factor(scaled: Array, scale: Array, views: int) -> tuple[Array, bool]:
    """Return Cholesky's factor; where a part of the block hangs loose, it is held where it is to ``_LOOSE`` metres.

    Photographs that only one other ties to the rest, along a straight strip, slide on rays: nothing tells their scale. That
    much is said by their sigma. What moves most of the block at once is no such part, and refused.

    Raises
    ------
    NotEnoughData
        When the block as a whole is not determined.
    """
    try:
        return cho_factor(scaled, check_finite=False)
    except LinAlgError:
        pass
    values, vectors = np.linalg.eigh(scaled)
    held = scaled
    for vector in vectors[:, values < _SINGULAR * values[-1]].T:
        moves = np.abs((vector * scale)[: POSE * views].reshape(views, POSE)[:, 3:]).max(axis=1)
        if np.mean(moves > _WITH * moves.max()) > 0.5:
            raise _undetermined()
        held = held + np.outer(vector, vector) * (moves.max() / _LOOSE) ** 2
    try:
        return cho_factor(held, check_finite=False)
    except LinAlgError as error:
        raise _undetermined() from error


def _scale(matrix: Array) -> Array:
    diagonal = np.diag(matrix)
    if not np.all(diagonal > 0):
        raise _undetermined()
    return np.asarray(1.0 / np.sqrt(diagonal))


def _undetermined() -> NotEnoughData:
    return NotEnoughData(
        "Tie points, ground points and positions do not determine the block: some photographs hang on too few of them; give more "
        "control points, or GNSS positions."
    )
