"""Finding a painted target within a circle of a photograph: four alternating quadrants, or a cross on a plain ground.

Around the centre of four alternating quadrants grey runs through two periods per turn, around that of a cross through four. So
the second and fourth angular harmonics in a disc, beside all the variance in the disc, find both at once, whatever their turn,
and hardly change under perspective. Discs of ten to some hundred pixels are tried on images reduced by steps of the square root
of two. Where the harmonics are strongest the ideal target is fitted (``targetfit``), in the widest window in which it fits.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .targetfit import Fitted, Kind, fit_target, starts_at

Array = NDArray[np.float64]
Image = NDArray[np.float32]

ACCEPT = 0.75  # score from which a mark is taken
SMALLEST = 5.0  # px, the smallest radius of a window
_DISC = 5  # px of a reduced image
_STEP = float(np.sqrt(2.0))
_PEAKS = 4  # candidates per harmonic and level
_TRIED = 6  # candidates of a kind that are fitted
_WIDENED = 3  # candidates whose window is widened
_ALIKE, _ALIKE_STILL = 0.85, 0.99  # likeness from which a window is widened, and the share of the best it must keep
_OWN = 1.0  # window radii within which what is found is the same centre
_CLUTTER = 3.5  # times the usual response: what the best of a few places reaches by chance
_USUAL = 0.25  # quantile of the responses; lower than the median, for a large target fills much of a crop
_PER_HARMONIC: tuple[tuple[int, Kind], ...] = ((2, "quadrants"), (4, "cross"))
# What rendered targets scatter by at best (px); the bars of a cross taper under perspective, which the model leaves out.
_FINEST: dict[Kind, float] = {"quadrants": 0.03, "cross": 0.06}
_CORRELATED = 2.0  # neighbouring pixels share noise (demosaicing, JPG), which the fit takes for independent


@dataclass(frozen=True)
class Found:
    """A target's centre (px from the corner of the top-left pixel), its sigma (px, an axis), score, and what it is."""

    x: float
    y: float
    sigma: float
    score: float
    what: str


@dataclass(frozen=True)
class _Candidate:
    kind: Kind
    x: float
    y: float
    phase: float
    radius: float
    rank: float
    clutter: float  # the usual response at this scale over the one here


def largest_radius(width: int, height: int) -> float:
    """Return the radius (px) of the largest target that is sought in photographs of this size."""
    return float(np.clip(max(width, height) / 40, 40.0, 150.0))


def find_target(image: Image, centre: Array, radius: float, largest: float) -> Found | None:
    """Return the target whose centre lies within ``radius`` of ``centre``, None when there is nothing like one.

    Parameters
    ----------
    image
        Grey values (rows, columns), any scale; it ought to hold ``largest`` pixels beyond the circle.
    centre, radius
        The circle, in pixels from the corner of the top-left pixel.
    largest
        Radius of the largest target in pixels.

    Returns
    -------
    Found or None
        The score is ``likeness**2 (1 - q**2)``: of the correlation of the image with the ideal target, and of the strength ``q``
        of the next best place over its own, or of what the surroundings show by chance. Two equal targets score 0. Take it from
        ``ACCEPT`` on.
    """
    fits: list[tuple[Fitted, float]] = []
    candidates = _candidates(image, np.asarray(centre) - 0.5, radius, largest)
    for candidate in candidates:
        for start in starts_at(candidate.kind, candidate.x, candidate.y, candidate.phase, candidate.radius):
            fitted = fit_target(image, candidate.kind, start, candidate.radius)
            if fitted is not None and float(np.hypot(*(fitted.centre + 0.5 - centre))) <= radius:
                fits.append((fitted, candidate.clutter))
    fits.sort(key=lambda f: -_strength(f[0]))
    fits[:_WIDENED] = [(_widened(image, f, largest), clutter) for f, clutter in fits[:_WIDENED]]
    if not fits:
        return None
    best, clutter = max(fits, key=lambda f: _strength(f[0]))
    others = [_strength(f) for f, _ in fits if float(np.hypot(*(f.centre - best.centre))) > _OWN * best.radius]
    rival = max([*others, 0.0]) / _strength(best)
    score = best.likeness**2 * max(0.0, 1.0 - max(rival, _CLUTTER * clutter) ** 2)
    sigma = float(np.hypot(_CORRELATED * np.sqrt(max(float(np.trace(best.covariance)), 0.0) / 2), _FINEST[best.kind]))
    return Found(float(best.centre[0]) + 0.5, float(best.centre[1]) + 0.5, sigma, float(min(score, 1.0)), best.kind)


def _strength(fitted: Fitted) -> float:
    """Return by what candidates compete: how much they explain, which is contrast over the window, and how well."""
    return fitted.gain * fitted.radius * fitted.likeness**2 + 1e-12


def _widened(image: Image, fitted: Fitted, largest: float) -> Fitted:
    """Return the fit in the widest window in which the target still looks like one; narrower windows are tried too."""
    best = fitted
    for radius in (fitted.radius / _STEP, fitted.radius / 2):
        if radius < SMALLEST or best.likeness > _ALIKE:
            break
        narrow = fit_target(image, best.kind, best.parameters, radius)
        if narrow is not None and narrow.likeness > best.likeness:
            best = narrow
    radius, peak = best.radius * _STEP, best.likeness
    while radius <= largest and best.likeness > _ALIKE:
        wide = fit_target(image, best.kind, best.parameters, radius)
        if wide is None or wide.likeness < max(_ALIKE, _ALIKE_STILL * peak) or wide.gain < 0.8 * best.gain:
            break
        best, radius, peak = wide, radius * _STEP, max(peak, wide.likeness)
    return best


def _candidates(image: Image, centre: Array, radius: float, largest: float) -> list[_Candidate]:
    """Return where the harmonics are strong within the circle, the most promising first; pixel centres at whole numbers."""
    found: list[_Candidate] = []
    factor = SMALLEST / _DISC
    while factor * _DISC <= largest:
        size = (max(1, round(image.shape[1] / factor)), max(1, round(image.shape[0] / factor)))
        if min(size) < 2 * _DISC + 1:
            break
        level = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if factor > 1 else image
        scale = np.array([image.shape[1] / size[0], image.shape[0] / size[1]])
        around, within = (centre + 0.5) / scale - 0.5, radius / factor + 0.5
        for order, kind in _PER_HARMONIC:
            found += _peaks(np.asarray(level, np.float32), order, kind, around, within, scale)
        factor *= _STEP
    found.sort(key=lambda c: -c.rank)
    kept: list[_Candidate] = []
    for c in found:
        # The same place at neighbouring scales is one candidate, the stronger one.
        if not any(k.kind == c.kind and np.hypot(k.x - c.x, k.y - c.y) < 0.6 * max(k.radius, c.radius) for k in kept):
            kept.append(c)
    return [c for _, kind in _PER_HARMONIC for c in [k for k in kept if k.kind == kind][:_TRIED]]


def _peaks(level: Image, order: int, kind: Kind, centre: Array, radius: float, scale: Array) -> list[_Candidate]:
    """Return the strongest local maxima of a harmonic within a circle of a reduced image."""
    real, imaginary, disc = _kernels(order)
    options = {"ddepth": cv2.CV_32F, "borderType": cv2.BORDER_REFLECT_101}
    a, b = (cv2.filter2D(level, kernel=k, **options) for k in (real, imaginary))
    mean, square = (cv2.filter2D(v, kernel=disc, **options) for v in (level - level.mean(), (level - level.mean()) ** 2))
    variance = np.maximum(square - mean**2, 1e-12)
    strength = np.hypot(a, b)
    purity = np.minimum(strength**2 / (2 * variance), 1.0)  # share of the variance in this harmonic
    rank = strength * purity * np.sqrt(scale.mean())  # a large target is less by chance than a small one
    peak = rank >= cv2.dilate(rank, np.ones((5, 5), np.uint8))
    rows, columns = np.nonzero(peak)
    inside = np.hypot(columns - centre[0], rows - centre[1]) <= radius
    rows, columns = rows[inside], columns[inside]
    order_of = np.argsort(-rank[rows, columns])[:_PEAKS]
    usual = float(np.quantile(strength, _USUAL))
    return [
        _Candidate(
            kind,
            float((columns[i] + 0.5) * scale[0] - 0.5),
            float((rows[i] + 0.5) * scale[1] - 0.5),
            float(np.arctan2(b[rows[i], columns[i]], a[rows[i], columns[i]])),
            float(_DISC * scale.mean()),
            float(rank[rows[i], columns[i]]),
            usual / float(strength[rows[i], columns[i]] + 1e-12),
        )
        for i in order_of
    ]


def _kernels(order: int) -> tuple[Image, Image, Image]:
    """Return cosine and sine of the harmonic over a disc, and the disc, as weights of means.

    A pattern ``cos(order t)`` of amplitude A gives a strength of A; its variance is A**2 / 2.
    """
    y, x = np.mgrid[-_DISC : _DISC + 1, -_DISC : _DISC + 1].astype(float)
    r, t = np.hypot(x, y), np.arctan2(y, x)
    weight = ((r > 0) & (r <= _DISC + 0.3)).astype(float)
    weight /= weight.sum()
    cosine, sine = (2 * weight * f(order * t) for f in (np.cos, np.sin))
    return cosine.astype(np.float32), sine.astype(np.float32), weight.astype(np.float32)
