"""A shift in plan of one model against the other, from the relief of stable ground (Nuth & Kaab 2011).

Where AFTER lies (dx, dy) beside BEFORE, the difference is -zx dx - zy dy beside level and tilts (Rosenholm & Torlegard 1988). The
slopes are those of both models' mean at the scale of a metre: noise of a cell's own slope hides the relief, and noise of one
model alone is in the difference, too. What both models' slopes share is relief, what they do not is noise, so that noise is no
information; along axes where it is as large as the relief the shift is not determined. Each round reads AFTER where the shift
found so far puts it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from ..errors import NotEnoughData
from ..progress import Progress
from .coregistration import LEAST, nmad, robust_fit
from .difference import Pair, with_halo
from .georeferencing import georeferenced
from .heighterror import direction
from .sampling import Sample
from .terms import Moments
from .uncertainty import SAMPLE, Systematic, fit_covariance
from .variogram import fit_variogram
from .zones import touched

Array = NDArray[np.float64]
_SCALE = 1.0  # metres over which heights are averaged before slopes are taken
_CELLS = 60_000  # of stable ground that are fitted
_ROUNDS = 12
_SETTLED = 1e-3  # metres
_SURE = 3.0  # sigmas from which a shift is applied
_SPREAD = 0.02  # share of its length that stable ground must be wide to carry a tilt across
_EXACT = 1e-12  # m2


@dataclass(frozen=True)
class PlanShift:
    """A shift (2,) of AFTER to the east and north (m): what is ``applied``, what was ``found`` and its ``covariance`` (2, 2).

    ``covariance`` holds what was known before, where stable ground does not tell. ``axes`` (2, k) are the directions it tells.
    ``alias`` (3, 2) are level and tilts about ``centre`` that fit the slopes of stable ground to the east and north, ``level``
    (2,) their means: what a shift makes of stable ground goes with the level and tilts that are taken off there, so that a zone
    suffers only by what its own slopes differ.
    """

    applied: tuple[float, float]
    found: tuple[float, float]
    covariance: Array
    axes: Array
    alias: Array = field(default_factory=lambda: np.zeros((3, 2)))
    centre: tuple[float, ...] = (0.0, 0.0)
    level: Array = field(default_factory=lambda: np.zeros(2))

    @property
    def moved(self) -> bool:
        """Whether anything is applied."""
        return self.applied != (0.0, 0.0)

    @property
    def uncertain(self) -> Array:
        """The second moments (2, 2) of what remains: not known, and known but not applied."""
        left = np.subtract(self.found, self.applied)
        return np.asarray(self.covariance + np.outer(left, left))

    def described(self) -> str:
        """Return it in words."""
        sigmas = np.sqrt(np.diag(self.covariance))
        east, north = (f"{f:+.3f} +- {s:.3f} m" for f, s in zip(self.found, sigmas, strict=True))
        return f"{east} to the east, {north} to the north"


@dataclass(frozen=True)
class WithPlan:
    """A systematic error with that of a shift in plan beside it; ``tilts`` says whether tilts were fitted beside the level."""

    vertical: Systematic
    plan: PlanShift
    fitted: int  # terms that stable ground has taken off: 0, 1 (level) or 3 (with tilts)

    def sigma(self, zone: Moments) -> float | None:
        """Return both together: a zone suffers from a shift in plan by the slopes that level and tilts do not take."""
        known = self.vertical.sigma(zone)
        if known is None:
            return None
        slopes = np.asarray(zone.slopes)
        if self.fitted:
            slopes = slopes - (self.plan.level if self.fitted == 1 else zone.about(self.plan.centre)[:3] @ self.plan.alias)
        return float(np.hypot(known, np.sqrt(max(0.0, float(slopes @ self.plan.uncertain @ slopes)))))


@dataclass(frozen=True)
class _Ground:
    """Stable cells: place in the grid and in metres, change, and slopes (n, 2) of BEFORE and of AFTER."""

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    x: Array
    y: Array
    change: Array
    before: Array
    after: Array
    count: int


def plan_shift(method: str, pair: Pair, stable: list[Any], given: float | None, progress: Progress) -> PlanShift | None:
    """Return the shift in plan, ``applied`` as ``method`` (COREGISTER) wants it; None where nothing is known of it.

    ``given`` (m), HORIZONTAL_SIGMA, is what is known beforehand; else what both georeferencings say, else a metre, which is what
    positions by GNSS without correction leave.

    Raises
    ------
    NotEnoughData
        When ``method`` is horizontal and stable ground does not determine it.
    """
    prior = _prior(pair, given)
    found = find_plan_shift(pair, stable, np.eye(2) if prior is None else prior, progress) if stable else None
    if found is None:
        if method == "horizontal":
            raise NotEnoughData(f"STABLE covers fewer than {LEAST} cells whose slopes both rasters tell: draw larger areas.")
        return None if prior is None else PlanShift((0.0, 0.0), (0.0, 0.0), prior, np.zeros((2, 0)))
    if method == "horizontal":
        if found.axes.shape[1] < 2:
            axis = found.axes[::-1, 0] * (-1, 1) if found.axes.shape[1] else None
            where = "" if axis is None else f" {direction(axis)}"
            raise NotEnoughData(
                f"STABLE has too little relief to tell a shift in plan{where}: add stable ground with slopes (dunes, rocks), "
                "or set COREGISTER to auto."
            )
        return replace(found, applied=found.found)
    if method == "auto":
        if found.moved:
            progress.info(f"STABLE shows that AFTER lies beside BEFORE ({found.described()}); it is read in its place.")
        return found
    if found.moved:
        progress.warn(f"COREGISTER={method} leaves a shift in plan that STABLE shows ({found.described()}): set it to auto.")
    return replace(found, applied=(0.0, 0.0))


def _prior(pair: Pair, given: float | None) -> Array | None:
    """Return the covariance (2, 2) of the shift in plan that is known beforehand, None when nothing says it."""
    if given is not None:
        return max(given, 1e-4) ** 2 * np.eye(2)
    blocks = [georeferenced(model.heights.label, model.heights.file.tags) for model in (pair.before, pair.after)]
    plans = [block.matrix[:2, :2] for block in blocks if block is not None]
    return np.asarray(sum(plans) + 1e-8 * np.eye(2)) if len(plans) == len(blocks) else None


def find_plan_shift(pair: Pair, stable: list[Any], prior: Array, progress: Progress) -> PlanShift | None:
    """Return the shift in plan that stable ground shows, ``applied`` where it is sure; None where it covers too little.

    ``prior`` (2, 2) is the covariance of what is known of it beforehand, which stands where stable ground tells nothing.
    """
    found = np.zeros(2)
    ground = _look(pair, stable, found, progress)
    if len(ground.change) < LEAST:
        return None
    fit = _fit(ground)
    for _ in range(_ROUNDS):
        if not fit.axes.shape[1] or float(np.hypot(*fit.step)) < _SETTLED:
            break
        found = found + fit.step
        ground = _look(pair, stable, found, progress)
        if len(ground.change) < LEAST:
            return None
        fit = _fit(ground)
    found = found + fit.step
    covariance = _covariance(pair, ground, fit)
    told = np.linalg.inv(prior) + (fit.axes @ np.linalg.inv(covariance) @ fit.axes.T if fit.axes.shape[1] else 0.0)
    along = fit.axes.T @ found
    applied = np.zeros(2)
    if len(along):
        sizes, turned = np.linalg.eigh(covariance)
        directions, parts = fit.axes @ turned, turned.T @ along
        for k in np.flatnonzero(np.abs(parts) > _SURE * np.sqrt(sizes)):
            applied += parts[k] * directions[:, k]
    return PlanShift(
        (float(applied[0]), float(applied[1])),
        (float(found[0]), float(found[1])),
        np.linalg.inv(told),
        fit.axes,
        fit.alias,
        fit.centre,
        (0.5 * (ground.before + ground.after)).mean(axis=0),
    )


@dataclass(frozen=True)
class _Fit:
    """One round: the ``step`` (2,) along the ``axes`` (2, k), with what its covariance needs."""

    step: Array
    axes: Array
    alias: Array
    centre: tuple[float, ...]
    slopes: Array  # (n, 2) of which level and tilts are taken off
    relief: Array  # (2, 2) mean square of what both models' slopes share
    residual: Array


def _fit(ground: _Ground) -> _Fit:
    centre = float(ground.x.mean()), float(ground.y.mean())
    flat = np.column_stack([np.ones(len(ground.x)), ground.x - centre[0], ground.y - centre[1]])
    mean = 0.5 * (ground.before + ground.after)
    carried = _carried(flat)
    into = carried @ np.linalg.pinv(flat @ carried)
    alias = into @ mean
    slopes = mean - flat @ alias
    apart = ground.after - ground.before
    apart = apart - flat @ (into @ apart)
    total, noise = slopes.T @ slopes / len(slopes), 0.25 * apart.T @ apart / len(slopes)
    relief = total - noise
    _, turned = np.linalg.eigh(total)
    clear = [k for k in (1, 0) if turned[:, k] @ relief @ turned[:, k] > max(turned[:, k] @ noise @ turned[:, k], _EXACT)]
    axes = turned[:, clear]
    design = np.column_stack([flat @ carried, -slopes @ axes])
    scale = np.abs(design).max(axis=0).clip(1e-12)
    fitted = robust_fit(design / scale, ground.change) / scale
    step = np.zeros(2)
    if len(clear):
        # Noise in the slopes shortens a step, by as much as it adds to them.
        lengthened = np.linalg.solve(axes.T @ relief @ axes, axes.T @ total @ axes @ fitted[-len(clear) :])
        step = axes @ lengthened
    return _Fit(step, axes, alias, centre, slopes, relief, ground.change - design @ fitted)


def _carried(flat: Array) -> Array:
    """Return level and the tilts (3, r) that stable ground is wide enough to carry."""
    lengths, axes = np.linalg.eigh(flat[:, 1:].T @ flat[:, 1:] / len(flat))
    extent = np.sqrt(np.maximum(lengths, 0.0))
    kept = [k for k in (1, 0) if extent[k] > max(_SPREAD * extent[1], 1e-9)]
    basis = np.zeros((3, 1 + len(kept)))
    basis[0, 0], basis[1:, 1:] = 1.0, axes[:, kept]
    return basis


def _covariance(pair: Pair, ground: _Ground, fit: _Fit) -> Array:
    """Return the covariance (k, k) along the fit's axes under the variogram of what it leaves."""
    if not fit.axes.shape[1]:
        return np.zeros((0, 0))
    steps = (pair.grid.step_north, pair.grid.cell)
    variogram = fit_variogram(ground.row, ground.column, fit.residual, steps)
    some = slice(0, SAMPLE)
    place = np.column_stack([ground.x[some], ground.y[some]])
    extent = float(np.hypot(*np.ptp(place, axis=0)))
    nugget, structures = (nmad(fit.residual) ** 2, ()) if variogram is None else (variogram.nugget, variogram.structures)
    if variogram is None:
        structures = ((nugget, extent),)
    told = tuple((sill, extent if np.isinf(reach) else reach) for sill, reach in structures)
    design = -fit.slopes[some] @ fit.axes
    naive = fit_covariance(design, place, max(nugget, _EXACT), told, ground.count)
    lift = np.linalg.solve(fit.axes.T @ fit.relief @ fit.axes, design.T @ design / len(design))
    return np.asarray(lift @ naive @ lift.T)


def _look(pair: Pair, stable: list[Any], shift: Array, progress: Progress) -> _Ground:
    """Return stable ground with AFTER read where ``shift`` puts it."""
    grid = pair.grid
    moved = pair.moved((float(shift[0]), float(shift[1])))
    halves = [max(1, round(0.5 * _SCALE / step)) for step in (grid.step_north, grid.cell)]
    halo = 2 * max(halves)
    sample = Sample(_CELLS, 9)
    tree = shapely.STRtree(stable)
    for column, row, width, height in pair.tiles(halo):
        window = grid.window(column, row, width, height)
        near = tree.query(shapely.box(*window.bounds))
        if not len(near):
            continue
        inside = touched([stable[i] for i in near], window, 0.5)
        if not inside.any():
            continue
        progress.at(0.0)
        around, inner = with_halo(grid, column, row, width, height, halo)
        change, before = moved.change(around)
        first, second = (_slopes(values, halves, (grid.step_north, grid.cell)) for values in (before, before + change))
        change, first, second = change[inner], first[:, *inner], second[:, *inner]
        known = inside & np.isfinite(change) & np.isfinite(first).all(axis=0) & np.isfinite(second).all(axis=0)
        rows, columns = np.nonzero(known)
        r, c = rows + row, columns + column
        x, y = grid.centres(r, c)
        values = (change[known], *first[:, known], *second[:, known])
        sample.add(r * grid.width + c, r.astype(float), c.astype(float), x, y, *values)
    r, c, x, y, change, *slopes = sample.values.T
    before, after = np.column_stack(slopes[:2]), np.column_stack(slopes[2:])
    return _Ground(r.astype(np.int64), c.astype(np.int64), x, y, change, before, after, sample.count)


def _slopes(heights: Array, halves: list[int], steps: tuple[float, float]) -> Array:
    """Return slopes to the east and north (2, rows, columns) of heights averaged over the scale; NaN beside holes."""
    down, across = halves
    known = np.isfinite(heights)
    share = uniform_filter(known.astype(float), (2 * down - 1, 2 * across - 1), mode="constant")
    smooth = uniform_filter(np.where(known, heights, 0.0), (2 * down - 1, 2 * across - 1), mode="constant")
    smooth = np.where(known & (share > 0.99), smooth / np.maximum(share, 0.5), np.nan)
    slopes = np.full((2, *heights.shape), np.nan)
    slopes[0, :, across:-across] = (smooth[:, 2 * across :] - smooth[:, : -2 * across]) / (2 * across * steps[1])
    slopes[1, down:-down] = (smooth[: -2 * down] - smooth[2 * down :]) / (2 * down * steps[0])
    return slopes
