"""The ideal target laid on a photograph by least squares: its centre, how well it is known, and how alike both are.

Both kinds have two straight edges or bars that cross in the centre, under any angle, so that perspective changes nothing in the
model. With the signed distances ``s1``, ``s2`` of a pixel from the two lines and a blur ``b``:

* quadrants, alternating: ``E(s1) E(s2)``, with ``E(s) = erf(s / b)``, -1 to 1;
* a cross of bars of half a width ``w``: ``2 (1 - (1 - B(s1)) (1 - B(s2))) - 1``, with ``B(s) = (E(s + w) - E(s - w)) / 2``.

Grey = offset + gain * model; a negative gain is the same target with black and white exchanged. Both are symmetric about their
centre, so a camera's tone curve, which moves a blurred edge towards its dark side, does not move the centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

Array = NDArray[np.float64]
Kind = Literal["quadrants", "cross"]

_SAMPLES = 2500  # pixels of a window that are used
_ROUNDS = 25
_SETTLED = 1e-3  # px
_LEAST_ANGLE = np.radians(50.0)  # between the two lines: that of a target seen up to 60 degrees off its normal
_HUBER = 1.5
_RECENTRE = 0.1  # of the window
_BLURRED = 0.35  # of the window: what is softer is shade, not paint
_UNEVEN = 0.4  # of the gain, by which a sector's mean may differ from the model: a corner or an edge is a target in part only
_CONTRAST = 0.7  # of all that the window spans; a larger gain is a degenerate fit


@dataclass(frozen=True)
class Fitted:
    """An ideal target that was laid on an image.

    ``parameters`` are x, y, the two lines' directions (rad), blur and, of a cross, half a bar's width (px; pixel centres at whole
    numbers). ``covariance`` (2, 2) is the centre's, ``likeness`` the correlation of image and model, ``gain`` half the step from
    black to white, ``level`` the grey between them.
    """

    kind: Kind
    radius: float
    parameters: Array
    covariance: Array
    likeness: float
    gain: float
    level: float

    @property
    def centre(self) -> Array:
        """The centre (2,) with pixel centres at whole numbers."""
        return self.parameters[:2]


def fit_target(image: NDArray[np.float32], kind: Kind, start: Array, radius: float) -> Fitted | None:
    """Lay the target on the pixels within ``radius`` of the start by damped least squares with Huber's weights.

    ``start`` is a ``Fitted.parameters``; the window is laid anew where the centre moved. None when the window leaves the image,
    or the fit leaves what a target can be: the centre does not settle, the lines come closer than 50 degrees, the blur is wide
    beside the window, or a sector is not what it ought to be.
    """
    first = _fit(image, kind, start, radius)
    if first is None or np.hypot(*(first.centre - start[:2])) < _RECENTRE * radius:
        return first
    second = _fit(image, kind, first.parameters, radius)
    return None if second is None or np.hypot(*(second.centre - first.centre)) > _RECENTRE * radius else second


def _fit(image: NDArray[np.float32], kind: Kind, start: Array, radius: float) -> Fitted | None:
    window = _window(image, start[:2], radius)
    if window is None:
        return None
    xy, values = window
    # The directions of the lines relative to the window, blur and width as logarithms: they stay positive.
    p = np.concatenate([start[:4], np.log(start[4:])])
    weights = np.ones(len(values))
    damping, best = 1e-2, np.inf
    settled = False
    level, gain = _linear(_model(kind, xy, p), values, weights)
    for _ in range(_ROUNDS):
        model = _model(kind, xy, p)
        level, gain = _linear(model, values, weights)
        residuals = values - level - gain * model
        design = np.column_stack([gain * _slopes(kind, xy, p), np.ones(len(values)), model])
        scale = 1.4826 * float(np.median(np.abs(residuals))) + 1e-9
        weights = np.minimum(1.0, _HUBER * scale / np.maximum(np.abs(residuals), 1e-12))
        best = float(np.sum(weights * residuals**2))
        normal, right = design.T @ (weights[:, None] * design), design.T @ (weights * residuals)
        while damping < 1e6:
            change = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), right)[: len(p)]
            tried = p + np.clip(change, -_longest(radius, len(p)), _longest(radius, len(p)))
            again = _model(kind, xy, tried)
            offset, factor = _linear(again, values, weights)
            if np.sum(weights * (values - offset - factor * again) ** 2) <= best:
                p, damping = tried, max(damping / 5, 1e-7)
                settled = bool(np.abs(change[:2]).max() < _SETTLED)
                break
            damping *= 5
        else:
            settled = True
        if settled:
            break
    if not _possible(p, start, radius):
        return None
    model = _model(kind, xy, p)
    level, gain = _linear(model, values, weights)
    residuals = values - level - gain * model
    if abs(gain) > _CONTRAST * np.ptp(values) or _unevenness(xy, p, residuals) > _UNEVEN * abs(gain):
        return None
    design = np.column_stack([gain * _slopes(kind, xy, p), np.ones(len(values)), model])
    spread = float(values.std() * model.std())
    likeness = abs(float(np.mean((values - values.mean()) * (model - model.mean())))) / spread if spread > 0 else 0.0
    inverse = np.linalg.pinv(design.T @ (weights[:, None] * design))
    variance = float(np.sum(weights * residuals**2)) / max(len(values) - design.shape[1], 1)
    parameters = np.concatenate([p[:4], np.exp(p[4:])])
    return Fitted(kind, radius, parameters, inverse[:2, :2] * variance, likeness, abs(gain), level)


def starts_at(kind: Kind, x: float, y: float, phase: float, radius: float) -> list[Array]:
    """Return parameters to start from, of a target whose second (quadrants) or fourth harmonic (cross) has this phase (rad).

    The brightest directions are those of a cross's bars, or with dark bars those between them.
    """
    if kind == "quadrants":
        # cos(2 (t - turn)) is largest in the middle of the bright quadrants; the edges are 45 degrees to both sides.
        turn = phase / 2
        return [np.array([x, y, turn + np.pi / 4, turn - np.pi / 4, 1.2])]
    half = max(0.2 * radius, 1.0)
    return [np.array([x, y, turn, turn + np.pi / 2, 1.2, half]) for turn in (phase / 4, phase / 4 + np.pi / 4)]


def _possible(p: Array, start: Array, radius: float) -> bool:
    angle = abs((p[2] - p[3] + np.pi / 2) % np.pi - np.pi / 2)
    narrow = len(p) == 5 or p[5] < np.log(0.5 * radius)
    near = float(np.hypot(*(p[:2] - start[:2]))) < 0.5 * radius
    return bool(np.isfinite(p).all() and angle > _LEAST_ANGLE and p[4] < np.log(_BLURRED * radius) and narrow and near)


def _unevenness(xy: Array, p: Array, residuals: Array) -> float:
    """Return the largest mean residual of the four sectors between the lines, and of the four between their bisectors."""
    x, y = xy[:, 0] - p[0], xy[:, 1] - p[1]
    s1, s2 = np.cos(p[2]) * y - np.sin(p[2]) * x, np.cos(p[3]) * y - np.sin(p[3]) * x
    worst = 0.0
    for a, b in ((s1, s2), (s1 + s2, s1 - s2)):
        sector = 2 * (a > 0) + (b > 0)
        count = np.bincount(sector, minlength=4)
        if count.min() < 5:
            return float("inf")
        worst = max(worst, float(np.abs(np.bincount(sector, residuals, 4) / count).max()))
    return worst


def _longest(radius: float, count: int) -> Array:
    """Return how far parameters may go in one round."""
    return np.array([0.25 * radius, 0.25 * radius, 0.3, 0.3, 0.5, 0.5])[:count]


def _window(image: NDArray[np.float32], centre: Array, radius: float) -> tuple[Array, Array] | None:
    """Return coordinates (n, 2) and values (n,) of the pixels within ``radius`` of ``centre``, some of them in a large window."""
    x, y = (round(float(c)) for c in centre)
    reach = int(np.ceil(radius))
    if x < reach or y < reach or x + reach >= image.shape[1] or y + reach >= image.shape[0]:
        return None
    rows, columns = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    inside = np.flatnonzero(rows.ravel() ** 2 + columns.ravel() ** 2 <= radius**2)
    if len(inside) > _SAMPLES:
        # At random, for a lattice could miss a line that runs along it; with the same seed, for the same result.
        inside = inside[np.random.default_rng(0).permutation(len(inside))[:_SAMPLES]]
    r, c = rows.ravel()[inside] + y, columns.ravel()[inside] + x
    return np.column_stack([c, r]).astype(float), image[r, c].astype(float)


def _model(kind: Kind, xy: Array, p: Array) -> Array:
    """Return the ideal target (n,), -1 to 1, at ``xy`` (n, 2)."""
    first, second = (_line(kind, xy, p, which)[0] for which in (2, 3))
    return first * second if kind == "quadrants" else 2.0 * (first + second - first * second) - 1.0


def _slopes(kind: Kind, xy: Array, p: Array) -> Array:
    """Return the derivatives (n, k) of the model by its parameters (k,)."""
    (first, d1), (second, d2) = (_line(kind, xy, p, which) for which in (2, 3))
    if kind == "quadrants":
        return d1 * second[:, None] + d2 * first[:, None]
    return 2.0 * (d1 * (1.0 - second)[:, None] + d2 * (1.0 - first)[:, None])


def _line(kind: Kind, xy: Array, p: Array, which: int) -> tuple[Array, Array]:
    """Return a factor (n,), the edge or bar along the line in direction ``p[which]``, and its derivatives (n, k)."""
    x, y, blur = xy[:, 0] - p[0], xy[:, 1] - p[1], float(np.exp(p[4]))
    cosine, sine = float(np.cos(p[which])), float(np.sin(p[which]))
    s = cosine * y - sine * x
    slopes = np.zeros((len(s), len(p)))
    if kind == "quadrants":
        value, by_s = erf(s / blur), _bell(s, blur)
        slopes[:, 4] = -s * by_s
    else:
        half = float(np.exp(p[5]))
        upper, lower = _bell(s + half, blur), _bell(s - half, blur)
        value, by_s = 0.5 * (erf((s + half) / blur) - erf((s - half) / blur)), 0.5 * (upper - lower)
        slopes[:, 4] = -0.5 * ((s + half) * upper - (s - half) * lower)
        slopes[:, 5] = 0.5 * half * (upper + lower)
    slopes[:, 0], slopes[:, 1] = sine * by_s, -cosine * by_s
    slopes[:, which] = -(sine * y + cosine * x) * by_s
    return np.asarray(value), slopes


def _bell(s: Array, blur: float) -> Array:
    """Return the derivative of ``erf(s / blur)`` by s."""
    return np.asarray(2.0 / np.sqrt(np.pi) / blur * np.exp(-((s / blur) ** 2)))


def _linear(model: Array, values: Array, weights: Array) -> tuple[float, float]:
    """Return the offset and gain that bring the model to the values."""
    total = weights.sum()
    m, v = float(weights @ model) / total, float(weights @ values) / total
    variance = float(weights @ (model - m) ** 2)
    gain = float(weights @ ((model - m) * (values - v))) / variance if variance > 0 else 0.0
    return v - gain * m, gain
