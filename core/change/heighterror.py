"""How one model errs against the other in height: level, tilts, scale and bending, from stable ground and both georeferencings.

The error of the difference is modelled by coefficients of 1, x, y, z, x^2, xy and y^2 about a centre (``terms``). The
georeferencings give their prior covariance. Stable ground observes level and tilts, and bending where the georeferencings know of
it, by a robust fit, in which the rest shows as far as it looks like these there; the fit's covariance follows from the variogram
of what is left. Generalised least squares joins both (Tarantola 2005, chapter 3): where stable ground tells nothing the prior
stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.special import chdtrc

from ..progress import Progress
from .coregistration import Shift, nmad, robust_fit
from .difference import Stable
from .georeferencing import Georeferenced
from .terms import COUNT, IN_METRES, height_terms
from .uncertainty import SAMPLE, fit_covariance
from .variogram import Variogram, fit_variogram
from .zones import Zone

Array = NDArray[np.float64]
_THIN = 0.02  # share of its length that stable ground must be wide to carry a tilt across
_CONFLICT = 0.001  # stable ground and georeferencings contradict each other when chance would part them so more rarely
_SURE = 1e-9  # share of the largest variance below which another is none
_EXACT = 1e-12  # m2; noise is not less, so that models without any can be compared too
_FREE = 2.0  # a tilt that may be this many times the level's sigma at a zone is one that stable ground does not know


@dataclass(frozen=True)
class HeightError:
    """Expected error and covariance (p, p) about ``shift.centre``; p is 1 (level), 3 (plane) or 7 (with scale and bending).

    ``stable`` is the plane of stable ground with its covariance (3, 3), ``prior`` the georeferencings' covariance (7, 7).
    ``covariance`` is None when it is not known. ``free`` says that a tilt is neither known nor in the covariance, ``bends`` that
    both georeferencings know how far they may be bent.
    """

    shift: Shift
    covariance: Array | None
    stable: tuple[Shift, Array] | None = None
    prior: Array | None = None
    free: bool = False
    bends: bool = False

    def left_by(self, applied: Shift) -> tuple[float, ...]:
        """Return the coefficients (p,) of what is expected to remain when ``applied`` is taken off; none for its own shift."""
        expected = np.array(self.shift.coefficients)
        if applied == self.shift or len(expected) == 1:
            return ()  # a level of stable ground is the median, which is what is taken off
        left = expected - applied.about(self.shift.centre)[: len(expected)]
        return tuple(left.tolist())

    def exceeded_by(self, applied: Shift) -> bool:
        """Tell whether ``applied`` leaves more in the difference than what is not known explains."""
        left = np.array(self.left_by(applied))
        if self.covariance is None or not len(left):
            return False
        units = IN_METRES[: len(left), : len(left)]
        sizes, axes = np.linalg.eigh(units @ self.covariance @ units.T)
        open_ = sizes > _SURE * sizes[-1]  # what no georeferencing knows of has no variance
        squares = (axes.T @ units @ left)[open_] ** 2 / sizes[open_]
        return bool(chdtrc(np.count_nonzero(open_), squares.sum()) < _CONFLICT)


@dataclass(frozen=True)
class _Observation:
    """``values`` (r,) = ``design`` (r, 7) times the error's coefficients plus noise of ``covariance`` (r, r).

    ``basis`` (7, r) makes coefficients of the values: level, ``tilts`` in number, then bending beside these. ``samples`` is the
    effective number of independent cells.
    """

    values: Array
    covariance: Array
    basis: Array
    design: Array
    tilts: int
    samples: float


def from_georeferencing(prior: Georeferenced, centre: tuple[float, ...]) -> HeightError:
    """Return what the tags alone tell: no expected error, and the sum of both covariances."""
    covariance = prior.covariance(centre)
    return HeightError(Shift("combined", (0.0,) * COUNT, centre), covariance, prior=covariance, bends=prior.bends)


def from_both(ground: Stable, prior: Georeferenced, steps: tuple[float, float], progress: Progress) -> HeightError:
    """Return the generalised least squares of stable ground and both georeferencings."""
    centre = _centre(ground)
    first = _observe(ground, centre, None, steps, prior.bends)
    covariance = prior.covariance(centre)
    spread = first.design @ covariance @ first.design.T + first.covariance
    misfit = float(first.values @ np.linalg.solve(spread, first.values))
    if chdtrc(len(first.values), misfit) < _CONFLICT:
        factor = misfit / len(first.values)
        covariance = covariance * factor
        progress.warn(
            f"STABLE contradicts the two georeferencings (it shows {np.sqrt(factor):.1f} times the error that they allow): their "
            "sigmas are enlarged by that; check that STABLE has not moved, and the control points."
        )
    mean, _ = _joined(first, covariance)
    # What the fit swallowed of the correlated noise shows in the residuals of the expected error.
    second = _observe(ground, centre, Shift("combined", tuple(mean.tolist()), centre), steps, prior.bends)
    mean, posterior = _joined(second, covariance)
    shift = Shift("combined", tuple(mean.tolist()), centre)
    return HeightError(shift, posterior, _plane(second, centre), covariance, bends=prior.bends)


def from_stable(ground: Stable, level: Shift, zones: list[Zone], steps: tuple[float, float], progress: Progress) -> HeightError:
    """Return what stable ground alone tells: a plane as far as it carries one, else the ``level`` fitted to it.

    A tilt is taken off whether it is significant or not. Leaving in one that is not, and counting what it may be, is wrong both
    ways: without a tilt the sigma is too large, and just below significance the tilt is several times it. ``free`` says that
    ground on one line tells nothing of the tilt across.
    """
    centre = _centre(ground)
    seen = _observe(ground, centre, None, steps)
    if _variogram(ground, level, steps) is None:
        return HeightError(level, None, free=True)
    plane, covariance = _plane(seen, centre)
    error = HeightError(plane if seen.tilts else level, covariance, (plane, covariance), free=seen.tilts < 2)
    axis = _unseen(seen, centre, zones)
    if axis is None:
        return error
    told = f"STABLE does not reach far enough {axis} to tell a tilt of one model against the other in that direction"
    if error.free:
        progress.warn(f"{told}: NET_SIGMA leaves it out unless REGISTRATION_SIGMA is given; add stable ground there.")
    else:
        progress.warn(f"{told}, which makes NET_SIGMA large: add stable ground there.")
    return error


def from_plane(ground: Stable, plane: Shift, steps: tuple[float, float]) -> HeightError:
    """Return the ``plane`` fitted to stable ground as what is expected, whether its tilt is significant or not."""
    seen = _observe(ground, _centre(ground), None, steps)
    if seen.tilts < 2:
        return HeightError(plane, None)
    covariance = _plane(seen, plane.centre)[1]
    return HeightError(plane, covariance, (plane, covariance))


def _joined(seen: _Observation, prior: Array) -> tuple[Array, Array]:
    """Return the mean (7,) and covariance (7, 7) after the observation."""
    spread = seen.design @ prior @ seen.design.T + seen.covariance
    gain = np.linalg.solve(spread, seen.design @ prior).T
    rest = np.eye(COUNT) - gain @ seen.design
    # Joseph's form stays symmetric and positive.
    return gain @ seen.values, rest @ prior @ rest.T + gain @ seen.covariance @ gain.T


def _observe(
    ground: Stable, centre: tuple[float, ...], expected: Shift | None, steps: tuple[float, float], bends: bool = False
) -> _Observation:
    """Fit as much as stable ground carries; noise is what level and tilts of it leave, or what the ``expected`` error leaves."""
    terms = height_terms(ground.x, ground.y, ground.height, centre)
    basis, tilts = _basis(terms, min(steps), bends)
    values = robust_fit(terms @ basis, ground.change)
    # Fitted bending would swallow correlated noise as well, and then be believed.
    flat = basis[:, : 1 + tilts] @ values[: 1 + tilts]
    residual = Shift("combined", tuple(flat.tolist()), centre) if expected is None else expected
    variogram = _variogram(ground, residual, steps)
    if variogram is None:
        # Too few cells to tell noise from what they share: they count as one, and carry no tilt.
        basis, tilts, values = basis[:, :1], 0, np.array([float(np.median(ground.change))])
        noise = nmad(ground.change) ** 2
        variogram = Variogram(0.0, ((max(noise, _EXACT), np.inf),))
        covariance, samples = np.array([[variogram.sill]]), 1.0
    else:
        covariance = _covariance(ground, terms @ basis, variogram)
        samples = _variance(ground, variogram) / covariance[0, 0]
    alias = np.linalg.lstsq(terms @ basis, terms, rcond=None)[0]
    return _Observation(values, covariance, basis, np.asarray(alias), tilts, samples)


def _basis(terms: Array, step: float, bends: bool) -> tuple[Array, int]:
    """Return what stable ground can carry (7, r), and how many tilts are among it.

    Level and the tilts along its principal axes, the longer first; where it ``bends`` also what of x^2, xy and y^2 is not like a
    plane there, by principal components, the larger first.
    """
    lengths, axes = np.linalg.eigh(terms[:, 1:3].T @ terms[:, 1:3] / len(terms))
    extent = np.sqrt(np.maximum(lengths, 0.0))
    kept = [i for i in (1, 0) if extent[i] > max(step, _THIN * extent[1])]
    flat = np.zeros((COUNT, 1 + len(kept)))
    flat[0, 0] = 1.0
    flat[1:3, 1:] = axes[:, kept]
    if not bends or not kept:
        return flat, len(kept)
    bent = np.eye(COUNT)[:, 4:]
    bent = bent - flat @ np.linalg.lstsq(terms @ flat, terms @ bent, rcond=None)[0]
    lengths, axes = np.linalg.eigh(bent.T @ terms.T @ terms @ bent / len(terms))
    size = np.sqrt(np.maximum(lengths, 0.0))
    some = [i for i in (2, 1, 0) if size[i] > max(step * step, _THIN * size[2])]
    return np.hstack([flat, bent @ axes[:, some]]), len(kept)


def _plane(seen: _Observation, centre: tuple[float, ...]) -> tuple[Shift, Array]:
    count = 1 + seen.tilts
    basis = seen.basis[:3, :count]
    level, east, north = (basis @ seen.values[:count]).tolist()
    return Shift("plane", (level, east, north), centre[:2]), np.asarray(basis @ seen.covariance[:count, :count] @ basis.T)


def _unseen(seen: _Observation, centre: tuple[float, ...], zones: list[Zone]) -> str | None:
    """Return in which direction a tilt that stable ground cannot tell would matter at a zone, None when in none."""
    offsets = shapely.get_coordinates(shapely.centroid([zone.shape for zone in zones])) - centre[:2]
    known = dict(enumerate(np.sqrt(np.diag(seen.covariance))[1:].tolist()))
    axes = seen.basis[1:3, 1:].T
    if len(axes) == 1:
        axes = np.vstack([axes, [-axes[0, 1], axes[0, 0]]])
    elif len(axes) == 0:
        axes = np.eye(2)
    level = float(np.sqrt(seen.covariance[0, 0]))
    for i in (1, 0):  # the shorter axis is the likelier one
        reach = float(np.abs(offsets @ axes[i]).max())
        if known.get(i, np.inf) * reach > _FREE * level:
            return direction(axes[i])
    return None


def direction(axis: Array) -> str:
    """Return an axis (east, north) as words."""
    names = ("from west to east", "from south-west to north-east", "from south to north", "from north-west to south-east")
    return names[round(float(np.degrees(np.arctan2(axis[1], axis[0]))) % 180.0 / 45.0) % 4]


def _centre(ground: Stable) -> tuple[float, ...]:
    return float(ground.x.mean()), float(ground.y.mean()), float(ground.height.mean())


def _known_sigma(ground: Stable) -> Array:
    """Return the cells' sigmas; 1 m for all where they are not known, as only their ratios count."""
    known = ground.sigma is not None and bool((ground.sigma > 0).all())
    return ground.sigma if known and ground.sigma is not None else np.ones(len(ground.change))


def _variogram(ground: Stable, shift: Shift, steps: tuple[float, float]) -> Variogram | None:
    """Return the variogram of residual / sigma on stable ground, None where it is too small."""
    cells = ground.patches or ground
    residual = cells.change - shift.at(cells.x, cells.y, cells.height)
    return fit_variogram(cells.row, cells.column, residual / _known_sigma(cells), steps)


def _variance(ground: Stable, variogram: Variogram) -> float:
    return max(_EXACT, float(np.mean(_known_sigma(ground) ** 2)) * (variogram.nugget + variogram.sill))


def _covariance(ground: Stable, design: Array, variogram: Variogram) -> Array:
    """Return the covariance (p, p) of a fit of ``design`` (n, p), whose first column is the level.

    A range that is not resolved lifts all cells alike, or tilts them most when it is as long as stable ground: both are counted.
    """
    # The cells come in random order, so the first are a random sample.
    some = slice(0, SAMPLE)
    place = np.column_stack([ground.x[some], ground.y[some]])
    variance = float(np.mean(_known_sigma(ground) ** 2))
    extent = float(np.hypot(*np.ptp(place, axis=0)))
    told = tuple((sill * variance, extent if np.isinf(reach) else reach) for sill, reach in variogram.structures)
    covariance = fit_covariance(design[some], place, max(_EXACT, variogram.nugget * variance), told, ground.count)
    for sill, reach in variogram.structures:
        if np.isinf(reach):
            short = fit_covariance(design[some], place, 0.0, ((sill * variance, extent),), ground.count)
            covariance[0, 0] += sill * variance - short[0, 0]
    return covariance
