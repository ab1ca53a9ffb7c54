"""How each model of a series errs by itself, so that any difference, sum or trend of them can be given its sigma.

A difference of dates has the errors of both, and two differences that share a date share its error: so errors are kept per
date, where they are independent. Stable ground shows each date's departure r_k = z_k - mean z of the dates. What is taken off is
a linear function of it, and the same function for all dates; the error of the mean drops out of all differences then, and what
remains of a date with the prior covariance P (of the terms of ``terms``; from its georeferencing, else none) is

    (I - B A) P (I - B A)' + B N B',    B the fitted terms, A = (T B)^+ T their fit to the terms T on stable ground,

N the fit's covariance under the variogram of what is left. The scatter of r_k holds (1 - 2/n) of the date's own variance and
1/n^2 of all: solved for the own (for two dates both are taken to be alike). How errors fade with
distance is pooled over the dates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.special import fdtrc

from ..errors import NotEnoughData
from ..progress import Progress
from .coregistration import LEAST, Shift, nmad, robust_fit
from .georeferencing import georeferenced
from .sampling import Sample
from .series import Series, SeriesRequest
from .terms import COUNT, height_terms
from .uncertainty import SAMPLE, ErrorModel, Fitted, Given, Systematic, fit_covariance
from .variogram import Variogram, fit_variogram
from .zones import touched

Array = NDArray[np.float64]
_CELLS = 60_000  # of stable ground that are kept
_PATCH = 32  # cells
_CHANCE = 0.001  # a tilt is taken off when chance shows one of any date more rarely
_THIN = 0.02  # share of its length that stable ground must be wide to carry a tilt across
_LEAST_OWN = 0.5  # of the dates' mean variance: a few patches of stable ground cannot tell that a date is far better than others
_FREE = 2.0  # a tilt that may be this many times the level's sigma is one that stable ground does not know
_EXACT = 1e-12  # m2; noise is not less, so that models without any can be compared too


@dataclass(frozen=True)
class EpochError:
    """What is taken off a date, its cells' sigma (m) where no other is known, how that divides, and what all its cells share."""

    shift: Shift
    common: float | None
    model: ErrorModel
    systematic: Systematic
    stable_nmad: float | None = None

    def point_sigma(self, sigma: Array, x: Array, y: Array, height: Array) -> Array:
        """Return the sigma (...) of single heights with the cells' ``sigma``; NaN where a part is not known."""
        if self.model.random is None or self.model.structures is None:
            return np.full(np.shape(sigma), np.nan)
        share = self.model.random**2 + sum(factor**2 for factor, _ in self.model.structures)
        return np.asarray(np.sqrt(share * sigma**2 + self.shared_variance(x, y, height)))

    def shared_variance(self, x: Array, y: Array, height: Array) -> Array:
        """Return the variance (...) of what all cells share at places; NaN where it is not known."""
        shape = np.broadcast_shapes(np.shape(x), np.shape(y), np.shape(height))
        told = self.systematic
        if isinstance(told, Given):
            return np.full(shape, np.nan if told.value is None else told.value**2)
        assert isinstance(told, Fitted)
        x, y, height = (np.broadcast_to(v, shape).ravel() for v in (x, y, height))
        terms = height_terms(x, y, height, told.centre)
        variance = np.einsum("ni,ij,nj->n", terms, told.covariance, terms) + told.beside**2
        if told.left:
            variance = variance + (terms @ np.array(told.left)) ** 2
        return np.asarray(np.maximum(variance, 0.0).reshape(shape))


@dataclass(frozen=True)
class Ground:
    """A random sample of the ``count`` cells of stable ground with a height at all dates.

    Heights and sigmas are (n, dates); ``patches`` keep neighbours.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    x: Array
    y: Array
    height: Array
    sigma: Array
    count: int
    patches: Ground | None = None


def stable_ground(series: Series, stable: list[Any], progress: Progress) -> Ground:
    """Return the heights of the cells of which at least half lies on stable ground.

    Raises
    ------
    NotEnoughData
        When too few have a height at every date.
    """
    grid, dates = series.grid, len(series.epochs)
    sample, patches = Sample(_CELLS, 4 + 2 * dates), Sample(_CELLS, 4 + 2 * dates)
    tree = shapely.STRtree(stable)
    alone = np.zeros(dates)
    for column, row, width, height in progress.over(series.tiles()):
        window = grid.window(column, row, width, height)
        near = tree.query(shapely.box(*window.bounds))
        if not len(near):
            continue
        inside = touched([stable[i] for i in near], window, 0.5)
        if not inside.any():
            continue
        heights = series.heights(window)
        known = np.isfinite(heights) & inside
        alone += known.sum(axis=(1, 2))
        rows, columns = np.nonzero(known.all(axis=0))
        r, c = rows + row, columns + column
        sigmas = series.sigmas(window)[:, rows, columns]
        values = (r.astype(float), c.astype(float), *grid.centres(r, c), *heights[:, rows, columns], *sigmas)
        sample.add(r * grid.width + c, *values)
        patches.add(r * grid.width + c, *values, patches=(r // _PATCH) * grid.width + c // _PATCH)
    if sample.count < LEAST:
        worst = series.epochs[int(np.argmin(alone))].name
        raise NotEnoughData(
            f"STABLE covers {sample.count} cells with a height at every date and {LEAST} are needed ({worst} covers the fewest): "
            "draw larger stable areas where all dates have heights, or leave STABLE out."
        )
    found = _ground(sample, dates)
    return found if sample.count <= _CELLS else replace(found, patches=_ground(patches, dates))


def epoch_errors(
    series: Series, request: SeriesRequest, ground: Ground | None, places: Array, progress: Progress
) -> list[EpochError]:
    """Return the error of each date, in their order; ``places`` (n, 2) are those where they will matter.

    Without stable ground nothing is taken off, and what all cells share is what the georeferencing's tag says, else
    REGISTRATION_SIGMA, else not known.

    Raises
    ------
    InputError
        When a tag is damaged.
    """
    west, south, east, north = series.grid.bounds
    if ground is None:
        centre: tuple[float, ...] = ((west + east) / 2, (south + north) / 2, 0.0)
        return [
            EpochError(
                Shift("none"),
                None,
                _given_model(request.correlation_range, epoch.sigma is not None),
                Given(request.registration_sigma) if prior is None else Fitted(prior, centre),
            )
            for epoch, prior in zip(series.epochs, _priors(series, centre), strict=True)
        ]
    centre = (float(ground.x.mean()), float(ground.y.mean()), float(ground.height.mean()))
    priors = _priors(series, centre)
    terms = height_terms(ground.x, ground.y, ground.height.mean(axis=1), centre)
    apart = ground.height - ground.height.mean(axis=1, keepdims=True)
    fits = {1: _fit(terms, apart, 1)}
    if _carries_plane(terms, max(series.grid.cell, series.grid.step_north)):
        fits[3] = _fit(terms, apart, 3)
    count = 3 if request.coregister == "plane" else 1
    if count not in fits:
        raise NotEnoughData("STABLE lies on one line, which leaves a plane free to tilt about it: add stable ground beside it.")
    noises = _noise(series, ground, terms, fits[count], request)
    if request.coregister in ("auto", "none") and 3 in fits and _tilted(fits[3], noises):
        count = 3
        progress.info("STABLE shows a tilt of one date against the others that chance does not explain: planes are fitted.")
        noises = _noise(series, ground, terms, fits[count], request)
    if request.correlation_range is None and any(np.isinf(r) for noise in noises for _, r in noise.model.structures or ()):
        progress.warn(
            "STABLE is too small to resolve the range of the correlated error: its unresolved part is taken to be alike in all "
            "cells, which is a bound; draw larger stable areas, or give CORRELATION_RANGE."
        )
    basis = np.eye(COUNT)[:, :count]
    alias = np.linalg.lstsq(terms[:, :count], terms, rcond=None)[0]
    rest = np.eye(COUNT) - basis @ alias
    free = count == 1 and all(p is None for p in priors) and _tilt_matters(noises, centre, places)
    if free:
        progress.warn(
            "STABLE does not reach far enough to tell a tilt of one date against another where it is asked for: that tilt is not "
            "known, and the sigmas leave it out unless REGISTRATION_SIGMA is given; add stable ground on other sides."
        )
    errors = []
    for k, (noise, prior) in enumerate(zip(noises, priors, strict=True)):
        own = np.zeros((COUNT, COUNT)) if prior is None else rest @ prior @ rest.T
        own[:count, :count] += noise.covariance[:count, :count]
        fitted = tuple(fits[count][k].tolist())
        shift = Shift("vertical" if count == 1 else "plane", fitted, centre[:2])
        left: tuple[float, ...] = ()
        if request.coregister == "none":
            left, shift = (*fitted, *(0.0,) * (COUNT - count)), Shift("none")
        systematic = Fitted(own, centre, left, (request.registration_sigma or 0.0) if free else 0.0)
        errors.append(EpochError(shift, noise.common, noise.model, systematic, noise.nmad))
    return errors


@dataclass(frozen=True)
class _Noise:
    """A date's own: NMAD of what is left of its departure, sigma of its cells where none is given, and what follows."""

    nmad: float
    common: float | None
    model: ErrorModel
    covariance: Array  # of level, and of tilts where stable ground carries them
    samples: float  # effective number of independent cells


def _fit(terms: Array, apart: Array, count: int) -> Array:
    """Return the robust coefficients (dates, count) of the departures."""
    return np.array([robust_fit(terms[:, :count], apart[:, k]) for k in range(apart.shape[1])])


def _noise(series: Series, ground: Ground, terms: Array, fits: Array, request: SeriesRequest) -> list[_Noise]:
    n, count = fits.shape
    apart = ground.height - ground.height.mean(axis=1, keepdims=True)
    left = apart - terms[:, :count] @ fits.T
    scatter = np.array([max(nmad(left[:, k]) ** 2, _EXACT) for k in range(n)])
    own = own_variances(scatter)
    cells = ground.patches or ground
    patch_terms = height_terms(cells.x, cells.y, cells.height.mean(axis=1), _centre(ground))
    patch_left = cells.height - cells.height.mean(axis=1, keepdims=True) - patch_terms[:, :count] @ fits.T
    sigma = np.where(np.isfinite(cells.sigma), cells.sigma, np.sqrt(own))
    mixed = np.sqrt(sigma**2 * (1.0 - 2.0 / n) + (sigma**2).sum(axis=1, keepdims=True) / n**2)
    steps = (series.grid.step_north, series.grid.cell)
    place = np.column_stack([ground.x, ground.y])[:SAMPLE]
    extent = float(np.hypot(np.ptp(ground.x), np.ptp(ground.y)))
    noises = []
    shape = _pooled(
        [
            fit_variogram(cells.row, cells.column, patch_left[:, k] / np.maximum(mixed[:, k], 1e-6), steps)
            for k in range(len(series.epochs))
        ]
    )
    if shape is not None and np.isinf(shape.reach):
        told = tuple((s, request.correlation_range or r if np.isinf(r) else r) for s, r in shape.structures)
        shape = replace(shape, structures=told)
    design = terms[:SAMPLE, : 3 if _carries_plane(terms, max(steps)) else 1]
    for k, epoch in enumerate(series.epochs):
        square = float(np.mean(sigma[:, k] ** 2))
        if shape is None:
            # Too few cells to tell noise from what they share: they count as one.
            model, whole = _given_model(request.correlation_range, True), Variogram(0.0, ((1.0, np.inf),))
        else:
            whole = shape
            if epoch.sigma is None:
                # The sigma is an estimate of the whole; so must be what it is divided into.
                much = 1.0 / max(shape.nugget + shape.sill, 1e-6)
                whole = replace(shape, nugget=much * shape.nugget, structures=tuple((much * s, r) for s, r in shape.structures))
            model = ErrorModel(float(np.sqrt(whole.nugget)), tuple((float(np.sqrt(s)), r) for s, r in whole.structures))
        ranges = tuple((s * square, extent if np.isinf(r) else r) for s, r in whole.structures)
        covariance = fit_covariance(design, place, max(_EXACT, whole.nugget * square), ranges, ground.count)
        for s, r in whole.structures:
            if np.isinf(r):  # all cells may err alike, or tilt most over the extent of stable ground: both are counted
                short = fit_covariance(design, place, 0.0, ((s * square, extent),), ground.count)
                covariance[0, 0] += s * square - short[0, 0]
        samples = square * (whole.nugget + whole.sill) / max(float(covariance[0, 0]), _EXACT)
        common = float(np.sqrt(own[k])) if epoch.sigma is None else None
        noises.append(_Noise(float(np.sqrt(scatter[k])), common, model, covariance, samples))
    return noises


def _pooled(variograms: list[Variogram | None]) -> Variogram | None:
    """Return the mean of the dates' variograms as a nugget, one sill with the mean range, and what is not resolved.

    Dates of one place err alike over distance, each to its own extent; a few patches cannot tell more for each of them.
    """
    found = [v for v in variograms if v is not None]
    if not found:
        return None
    structures = [structure for v in found for structure in v.structures]
    near = [(s, r) for s, r in structures if np.isfinite(r)]
    told = []
    if near:
        sill = sum(s for s, _ in near)
        told.append((sill / len(found), sum(s * r for s, r in near) / sill))
    if far := sum(s for s, r in structures if np.isinf(r)):
        told.append((far / len(found), np.inf))
    return Variogram(float(np.mean([v.nugget for v in found])), tuple(told))


def own_variances(scatter: Array) -> Array:
    """Return the dates' own variances (n,) from those of their departures from the mean of all, (1 - 2/n) v_k + sum v / n^2.

    A date much better than the others is given half of their mean variance.

    >>> own_variances(np.array([1.0, 1.0])), own_variances(np.array([4.0, 5.0, 6.0]) / 9.0)
    (array([2., 2.]), array([0.5       , 0.83333333, 1.16666667]))
    """
    n = len(scatter)
    if n == 1:
        return scatter
    if n == 2:
        return np.full(2, scatter.sum())
    own = (scatter - scatter.sum() * n / (n - 1.0) / n**2) / (1.0 - 2.0 / n)
    return np.asarray(np.maximum(own, _LEAST_OWN * own.mean()))


def _given_model(reach: float | None, sigma_known: bool) -> ErrorModel:
    """Without a variogram a sigma counts whole as random and whole as correlated over CORRELATION_RANGE, as in ``errormodel``."""
    if not sigma_known:
        return ErrorModel(None, None)
    return ErrorModel(1.0, None if reach is None else ((1.0, reach),) if reach > 0 else ())


def _priors(series: Series, centre: tuple[float, ...]) -> list[Array | None]:
    blocks = [georeferenced(epoch.heights.label, epoch.heights.file.tags) for epoch in series.epochs]
    return [None if block is None else block.heights(series.grid.crs, centre) for block in blocks]


def _tilted(fits: Array, noises: list[_Noise]) -> bool:
    """Tell whether any date's tilt is beyond chance, by Fisher's test with the effective number of cells."""
    n = len(fits)
    for k, noise in enumerate(noises):
        covariance = noise.covariance[1:, 1:] * (1.0 - 2.0 / n) + sum(o.covariance[1:, 1:] for o in noises) / n**2
        free = noise.samples - 3.0
        if free > 0 and fdtrc(2, free, float(fits[k, 1:] @ np.linalg.solve(covariance, fits[k, 1:])) / 2.0) < _CHANCE / n:
            return True
    return False


def _tilt_matters(noises: list[_Noise], centre: tuple[float, ...], places: Array) -> bool:
    """Tell whether a tilt that stable ground could not see would matter at the places."""
    noise = max(noises, key=lambda one: float(one.covariance[0, 0]))
    if len(noise.covariance) < 3:
        return True
    offsets = places - centre[:2]
    tilt = np.einsum("ni,ij,nj->n", offsets, noise.covariance[1:, 1:], offsets)
    return bool(np.sqrt(tilt.max()) > _FREE * np.sqrt(noise.covariance[0, 0]))


def _carries_plane(terms: Array, step: float) -> bool:
    lengths = np.sqrt(np.maximum(np.linalg.eigvalsh(terms[:, 1:3].T @ terms[:, 1:3] / len(terms)), 0.0))
    return bool(lengths[0] > max(step, _THIN * lengths[1]))


def _centre(ground: Ground) -> tuple[float, ...]:
    return float(ground.x.mean()), float(ground.y.mean()), float(ground.height.mean())


def _ground(sample: Sample, dates: int) -> Ground:
    values = sample.values
    places = values[:, :2].astype(np.int64)
    height, sigma = values[:, 4 : 4 + dates], values[:, 4 + dates :]
    return Ground(places[:, 0], places[:, 1], values[:, 2], values[:, 3], height, sigma, sample.count)
