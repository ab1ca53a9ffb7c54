"""The robust seven-parameter similarity from the free frame to the ground, with its covariance.

Ground point ``y = scale * rotation @ x + shift``. Umeyama (1991) gives the start, Gauss-Newton on anisotropic covariances with
Huber's weights (Huber 1964, k = 1.345) the solution. Small changes are written about a ``pivot`` c of the ground frame:
``dy = dt + w x (y - c) + ds (y - c)``, seven numbers in the order shift, rotation, scale. Observations that share one
constant error (GNSS positions of one flight) may carry it as three more unknowns with a prior sigma.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import NotEnoughData

Array = NDArray[np.float64]

# A Gaussian exceeds 1.345 sigma in 17.9 % of cases, the length of two such components 1.855 sigma.
HUBER_HEIGHT, HUBER_PLAN = 1.345, 1.855
_GAUSS_MAD = 0.6744897501960817
_START_TRIPLES = 300
_LEAST_FACTOR = 1e-6  # a thousandth of the given sigmas; keeps exact points solvable


@dataclass(frozen=True)
class Similarity:
    """``y = scale * rotation @ x + shift``."""

    scale: float
    rotation: Array  # (3, 3)
    shift: Array  # (3,)

    def apply(self, points: Array) -> Array:
        """Return the transformed points (n, 3)."""
        return np.asarray(self.scale * np.asarray(points, float) @ self.rotation.T + self.shift)

    def moved(self, change: Array, pivot: Array) -> Similarity:
        """Return the similarity followed by a small change (7,) about ``pivot``."""
        turn, grow = _rotation(change[3:6]), float(np.exp(change[6]))
        shift = pivot + grow * turn @ (self.shift - pivot) + change[:3]
        return Similarity(self.scale * grow, turn @ self.rotation, shift)


@dataclass(frozen=True)
class Shared:
    """A constant error common to some observations: which ones (n,), and its prior sigma (3,), inf when free."""

    mask: NDArray[np.bool_]
    sigma: Array


@dataclass(frozen=True)
class Fit:
    """A solved similarity.

    ``residuals`` (n, 3) are computed minus given, the shared error included; ``weights`` (n, 2) Huber's for plan and
    height; ``covariance`` (7, 7) about ``pivot`` includes ``factor``, the variance factor applied to the given covariances;
    ``estimated_factor`` is what the residuals say (None without redundancy). ``shared`` (3,) is the shared error.
    """

    similarity: Similarity
    pivot: Array
    covariance: Array
    factor: float
    estimated_factor: float | None
    redundancy: int
    residuals: Array
    weights: Array
    shared: Array

    def uncertainty(self, points: Array) -> Array:
        """Return the covariances (n, 3, 3) that the similarity gives to ground points (n, 3)."""
        design = design_matrix(points, self.pivot)
        return np.asarray(design @ self.covariance @ design.transpose(0, 2, 1))


def umeyama(model: Array, ground: Array, weights: Array | None = None) -> Similarity:
    """Return the least-squares similarity of paired points (n, 3), weights (n,) (Umeyama 1991, equations 40 to 43).

    Raises
    ------
    NotEnoughData
        When there are fewer than three points or they lie on one line, in either frame.
    """
    scale, rotation, shift, good = _umeyama(np.asarray(model, float)[None], np.asarray(ground, float)[None], weights)
    if len(model) < 3 or not good[0]:
        raise NotEnoughData("The points are fewer than three or lie on one line: add a point away from that line.")
    return Similarity(float(scale[0]), rotation[0], shift[0])


def design_matrix(points: Array, pivot: Array) -> Array:
    """Return the derivatives (n, 3, 7) of ground points (n, 3) by shift, rotation and scale about ``pivot``."""
    d = np.asarray(points, float) - pivot
    design = np.zeros((len(d), 3, 7))
    design[:, :, :3] = np.eye(3)
    design[:, 0, 4], design[:, 0, 5] = d[:, 2], -d[:, 1]
    design[:, 1, 3], design[:, 1, 5] = -d[:, 2], d[:, 0]
    design[:, 2, 3], design[:, 2, 4] = d[:, 1], -d[:, 0]
    design[:, :, 6] = d
    return design


def fit(
    model: Array,
    ground: Array,
    covariance: Array,
    *,
    model_covariance: Array | None = None,
    shared: Shared | None = None,
    trust: bool = True,
    start: Similarity | None = None,
) -> Fit:
    """Fit the similarity robustly.

    Parameters
    ----------
    model, ground
        Paired points (n, 3).
    covariance
        Of the ground points (n, 3, 3), m2.
    model_covariance
        Of the model points (n, 3, 3) in model units, or None for exact ones.
    shared
        An error common to some of the ground points.
    trust
        Whether the covariances are known: the variance factor is then never below 1. Otherwise it is estimated.
    start
        Where to start from, when something near is known.

    Raises
    ------
    NotEnoughData
        When the points do not determine seven parameters.
    """
    model, ground = np.asarray(model, float), np.asarray(ground, float)
    n = len(model)
    umeyama(model, ground)  # refuses what does not determine a similarity
    similarity = start or _start(model, ground, covariance)
    pivot = ground.mean(axis=0)
    # Without a shared error its three unknowns are held at 0 by a prior that nothing contradicts.
    shared = shared or Shared(np.zeros(n, bool), np.ones(3))
    member, error = shared.mask.astype(float)[:, None], np.zeros(3)
    prior = np.zeros((10, 10))
    prior[7:, 7:] = np.diag(1.0 / shared.sigma**2)
    # A prior is an observation: it pays for its own unknown.
    redundancy = 3 * n - 7 - int(np.isinf(shared.sigma).sum())
    weights, spread = np.ones((n, 2)), 1.0
    for iteration in range(60):
        computed = similarity.apply(model)
        total = _total_covariance(covariance, model_covariance, similarity)
        wanted = ground - computed - member * error
        if redundancy >= 3:
            lengths, whitened = _standardised(wanted, total)
            if iteration < 20:  # later it stands, so that the weights can settle
                spread = max(_spread(whitened, 3 * n - redundancy), 1.0 if trust else _LEAST_FACTOR**0.5)
            weights = _huber(lengths / spread)
        root = np.sqrt(weights[:, [0, 0, 1]])
        weight = root[:, :, None] * np.linalg.inv(total) * root[:, None, :]
        design = np.concatenate([design_matrix(computed, pivot), member[:, :, None] * np.eye(3)], axis=2)
        normal = prior + np.einsum("nij,nik,nkl->jl", design, weight, design)
        right = np.einsum("nij,nik,nk->j", design, weight, wanted) - prior[:, 7:] @ error
        change = _solve(normal, right)
        similarity = similarity.moved(change[:7], pivot)
        error = error + change[7:]
        reach = float(np.abs(ground - pivot).max()) + 1e-9
        if iteration >= 20 and max(np.abs(change[:3]).max(), np.abs(change[3:7]).max() * reach) < 1e-7:
            break
    residuals = similarity.apply(model) - ground
    lengths, whitened = _standardised(-residuals - member * error, total)
    estimated = _variance_factor(whitened, weights, lengths / spread, redundancy, error, shared) if redundancy > 0 else None
    factor = max(1.0, estimated or 0.0) if trust else (1.0 if estimated is None else max(estimated, _LEAST_FACTOR))
    # The prior of the shared error is a statement of its own that the residuals say nothing about.
    inverse = _solve((normal - prior) / factor + prior, np.eye(10))
    return Fit(similarity, pivot, inverse[:7, :7], factor, estimated, redundancy, residuals, weights, error)


def _umeyama(models: Array, grounds: Array, weights: Array | None = None) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Solve many sets (k, n, 3) at once: scales (k,), rotations (k, 3, 3), shifts (k, 3), and which are determined (k,)."""
    count = models.shape[1]
    w = np.full(count, 1.0 / count) if weights is None else np.asarray(weights, float) / np.sum(weights)
    mx, my = np.einsum("n,kni->ki", w, models), np.einsum("n,kni->ki", w, grounds)
    x, y = models - mx[:, None], grounds - my[:, None]
    u, d, vt = np.linalg.svd(np.einsum("n,kni,knj->kij", w, y, x))
    e = np.ones((len(models), 3))
    e[:, 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    rotation = np.einsum("kij,kj,kjl->kil", u, e, vt)
    spread = np.einsum("n,kni,kni->k", w, x, x)
    # A line makes the second singular value vanish; a plane only the third.
    good = (d[:, 1] > 1e-10 * d[:, 0]) & (spread > 0)
    scale = np.sum(d * e, axis=1) / np.where(good, spread, 1.0)
    return scale, rotation, my - scale[:, None] * np.einsum("kij,kj->ki", rotation, mx), good


def _start(model: Array, ground: Array, covariance: Array) -> Similarity:
    """Return a start that outliers cannot draw away: of the fits to three points the one most others agree with.

    The measure is the least quantile of residuals (Rousseeuw 1984), with the quantile that three-point fits call for.
    """
    everything = umeyama(model, ground)
    n = len(model)
    if n < 5:
        return everything
    if n <= 13:
        triples = np.array(list(itertools.combinations(range(n), 3)))
    else:
        rng = np.random.default_rng(0)
        triples = np.array([rng.choice(n, 3, replace=False) for _ in range(_START_TRIPLES)])
    scale, rotation, shift, good = _umeyama(model[triples], ground[triples])
    left = ground - scale[:, None, None] * np.einsum("kij,nj->kni", rotation, model) - shift[:, None]
    squares = np.einsum("kni,nij,knj->kn", left, np.linalg.inv(covariance), left, optimize=True)
    scores = np.where(good, np.sort(squares, axis=1)[:, (n + 4) // 2 - 1], np.inf)
    best = int(np.argmin(scores))
    return Similarity(float(scale[best]), rotation[best], shift[best]) if good[best] else everything


def _total_covariance(ground: Array, model: Array | None, similarity: Similarity) -> Array:
    if model is None:
        return ground
    turn = similarity.scale * similarity.rotation
    return np.asarray(ground + turn @ model @ turn.T)


def _standardised(residuals: Array, covariance: Array) -> tuple[Array, Array]:
    """Return lengths (n, 2) of plan and height residuals in their own sigmas, and whitened residuals (n, 3)."""
    plan = np.einsum("ni,nij,nj->n", residuals[:, :2], np.linalg.inv(covariance[:, :2, :2]), residuals[:, :2])
    height = np.abs(residuals[:, 2]) / np.sqrt(covariance[:, 2, 2])
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), residuals[:, :, None])[:, :, 0]
    return np.stack([np.sqrt(plan), height], axis=1), whitened


def _spread(whitened: Array, unknowns: int) -> float:
    """Return the robust scale: the median of the residuals but the smallest, which the unknowns absorb."""
    return float(np.median(np.sort(np.abs(whitened).ravel())[unknowns:])) / _GAUSS_MAD


def _huber(lengths: Array) -> Array:
    return np.asarray(np.minimum(1.0, np.array([HUBER_PLAN, HUBER_HEIGHT]) / np.maximum(lengths, 1e-12)))


def _variance_factor(whitened: Array, weights: Array, lengths: Array, redundancy: int, error: Array, shared: Shared) -> float:
    """Return the variance factor under Huber's weights: clipped residuals count as clipped (Huber 1981, 7.6)."""
    clipped = weights[:, [0, 0, 1]] * whitened
    inside = np.mean(np.repeat(lengths <= np.array([HUBER_PLAN, HUBER_HEIGHT]), [2, 1], axis=1))
    squares = float(np.sum(clipped**2) + np.sum((error / shared.sigma) ** 2))
    return squares / redundancy / max(float(inside), 0.25)


def _solve(normal: Array, right: Array) -> Array:
    """Solve the normal equations, scaled so that metres, radians and the scale weigh alike.

    Raises
    ------
    NotEnoughData
        When they are singular.
    """
    diagonal = np.sqrt(np.diag(normal))
    if not np.all(diagonal > 0):
        raise NotEnoughData("The control points do not determine the seven parameters: add points.")
    scaled = normal / diagonal[:, None] / diagonal
    values, vectors = np.linalg.eigh(scaled)
    if values[0] < 1e-13 * values[-1]:
        raise NotEnoughData("The control points do not determine the seven parameters: add a point away from their line.")
    factor = diagonal if right.ndim == 1 else diagonal[:, None]
    solved = vectors @ ((vectors.T @ (right / factor)).T / values).T
    return np.asarray(solved / factor)


def _rotation(vector: Array) -> Array:
    """Return the rotation matrix of a rotation vector (3,), radians (Rodrigues 1840)."""
    angle = float(np.linalg.norm(vector))
    cross = np.array([[0.0, -vector[2], vector[1]], [vector[2], 0.0, -vector[0]], [-vector[1], vector[0], 0.0]])
    if angle < 1e-8:
        return np.asarray(np.eye(3) + cross + cross @ cross / 2)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * cross + (1 - np.cos(angle)) / angle**2 * cross @ cross)
