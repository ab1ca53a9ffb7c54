"""The georeferencing by bundle adjustment: from a similarity to the adjusted block, its residuals and what they say."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ..block import Block
from ..frames import LocalFrame
from .adjusted import Adjusted
from .alternatives import alternatives
from .assembly import Assembly, adjusted_block, network_of
from .blunders import Blunder
from .cameras import POSE
from .common import of_adjustment
from .gnss import SHARED, Gnss, offsets
from .interior import Interior, told
from .marks import listed
from .network import Control, Positions
from .observations import Seen
from .reliability import Test, without
from .sightings import Sighting
from .solution import AdjustedCamera, Solution, WrongMark
from .weighting import FALSE_ALARM, Weighted, settle

Array = NDArray[np.float64]

_TIE_SAMPLE = 2000  # tie points whose own sigma is computed
_HOLDS_HEIGHT = 0.01  # m, and twice what positions alone would give: what must be told of heights without control
_ALIKE = 3.0  # tie points that count as one: what is told of
_LOOSE, _LOOSE_MATTERS = 5.0, 0.5  # times the others' sigma, and metres
_ENLARGED = 9.0  # variance factor of ground points that is told of


def solve_adjustment(
    assembly: Assembly,
    start: Solution,
    gnss: Gnss,
    interiors: Mapping[int, Interior],
    *,
    sigma_mark: float,
    comparable: bool,
    usable: NDArray[np.bool_],
    labels: Mapping[int, str],
    compare: bool = True,
    step: Callable[[], None] = lambda: None,
) -> Solution:
    """Adjust the block from where a similarity put it.

    ``interiors`` and ``labels`` are by camera id; ``usable`` (p,) tells which tie points may take part; ``compare`` asks for the
    alternatives; ``step`` is called before each adjustment.

    Raises
    ------
    NotEnoughData
        When the observations do not determine the block.
    """
    frame = start.frame
    seen = start.seen
    view_of = {view.name: i for i, view in enumerate(start.block.views)}
    sightings = [_sighting(s, view_of, sigma_mark) for s in seen]
    members = [i for i, s in enumerate(seen) if not s.point.check and s.found is not None]
    control = [_control(seen[i], sightings[i], frame) for i in members]
    positions = _positions(gnss, frame, with_control=bool(control), comparable=comparable)
    network = network_of(assembly, start.similarity, interiors, usable)
    sigma = float(np.median(assembly.block.errors)) if len(assembly.block.errors) else 1.0
    settled = settle(
        network, control, positions, declared=gnss.declared, sigma=sigma, scatter=start.estimated_factor or 1.0, told=step
    )
    adjusted = settled.adjusted
    block, kept = adjusted_block(assembly, start.similarity, adjusted.cameras, usable)
    errors, own, total = _errors(adjusted, seen, sightings, members, frame)
    loo, loo_sigma = _leave_one_out(adjusted, seen, members, frame)
    blunders, wrong_marks, wrong_positions = _named(settled, seen, members, start)
    checks = [i for i, s in enumerate(seen) if s.point.check and s.found is not None]
    blunders += _wrong_checks(checks, seen, errors, total)
    cameras = _cameras(adjusted, sorted(interiors), interiors, labels)
    notes = [*_weight_notes(settled, gnss, bool(control)), *_loose_notes(adjusted, block)]
    for camera, interior, c in zip(cameras, adjusted.network.interiors, range(len(cameras)), strict=True):
        if len(interior.names):
            notes += told(camera.label, interior, adjusted.interior_covariance(c), camera.values)
    return Solution(
        "adjustment",
        frame,
        start.similarity,
        block,
        kept,
        of_adjustment(adjusted),
        "GNSS" if not control else "control and GNSS" if len(gnss) else "control",
        seen,
        errors,
        own,
        loo,
        loo_sigma,
        tuple(blunders),
        _gnss_errors(adjusted, gnss, frame),
        tuple(wrong_positions),
        wrong_marks=tuple(wrong_marks),
        notes=tuple(notes),
        cameras=tuple(cameras),
        pixel_sigma=adjusted.sigma,
        centre_sigma=_centre_sigma(adjusted),
        tie_sigma=_tie_sigma(adjusted),
        predicted=_predicted(seen, total),
        alternatives=tuple(
            alternatives(settled, assembly.block, start, gnss, sightings, comparable=comparable, step=step) if compare else ()
        ),
    )


def _sighting(seen: Seen, view_of: Mapping[str, int], sigma: float) -> Sighting:
    marks = [m for m in seen.point.marks if m.image in view_of]
    each = np.full(len(marks), sigma)
    if seen.found is not None:
        # What the block in its free shape contradicts starts with its own size as sigma, so that it hides no other error.
        length = np.linalg.norm(seen.found.residuals, axis=1)
        each = np.where(seen.found.used | ~np.isfinite(length), each, np.hypot(sigma, length))
    xy = np.array([(m.x, m.y) for m in marks], float).reshape(-1, 2)
    return Sighting(seen.point.name, np.array([view_of[m.image] for m in marks], np.int64), xy, each)


def _control(seen: Seen, sighting: Sighting, frame: LocalFrame) -> Control:
    point = seen.point
    return Control(
        sighting, frame.from_crs(point.coordinates[None])[0], np.diag([point.sigma_h**2, point.sigma_h**2, point.sigma_v**2])
    )


def _positions(gnss: Gnss, frame: LocalFrame, *, with_control: bool, comparable: bool) -> Positions:
    """Return the positions; beside control points they may share an error, alone only when they do not tell their sigma."""
    shared = np.zeros(3)
    if len(gnss) and (with_control or not gnss.declared):
        shared = np.array([SHARED[0], SHARED[0], SHARED[1] if comparable else np.inf])
    antenna = frame.from_crs(gnss.coordinates) if len(gnss) else np.zeros((0, 3))
    return Positions(gnss.view, antenna, gnss.sigmas[:, [0, 0, 1]], gnss.lever, shared)


def _errors(
    adjusted: Adjusted, seen: Sequence[Seen], sightings: Sequence[Sighting], members: Sequence[int], frame: LocalFrame
) -> tuple[Array, Array, Array]:
    """Return computed minus given (n, 3) in the CRS, sigmas of survey and marks (n, 3), and whole covariances (n, 3, 3)."""
    errors, own = np.full((len(seen), 3), np.nan), np.full((len(seen), 3), np.nan)
    total = np.full((len(seen), 3, 3), np.nan)
    weighted = {i: adjusted.control[k].sighting for k, i in enumerate(members)}
    nothing = np.zeros_like(adjusted.cofactor)
    for i, one in enumerate(seen):
        if one.found is None:
            continue
        sighting = weighted.get(i, sightings[i])
        place, covariance = adjusted.intersect(sighting)
        surveyed = np.diag([one.point.sigma_h**2, one.point.sigma_h**2, one.point.sigma_v**2])
        errors[i] = frame.to_crs(place[None])[0] - one.point.coordinates
        total[i] = covariance + surveyed
        own[i] = np.sqrt(np.diag(adjusted.intersect(sighting, nothing)[1] + surveyed))
    return errors, own, total


def _predicted(seen: Sequence[Seen], total: Array) -> Array:
    """Return the sigmas (n, 3) of check points' errors; a control point's residual has another one."""
    check = np.array([s.point.check for s in seen], bool)
    sigmas = np.sqrt(np.diagonal(total, axis1=1, axis2=2)).reshape(-1, 3)
    return np.where(check[:, None], sigmas, np.nan)


def _leave_one_out(adjusted: Adjusted, seen: Sequence[Seen], members: Sequence[int], frame: LocalFrame) -> tuple[Array, Array]:
    errors, sigmas = np.full((len(seen), 3), np.nan), np.full((len(seen), 3), np.nan)
    for k, i in enumerate(members):
        left = without(adjusted, k)
        if left is None:
            continue
        change, cofactor = left
        one = adjusted.control[k]
        place, covariance = adjusted.intersect(one.sighting, cofactor, change)
        errors[i] = frame.to_crs(place[None])[0] - seen[i].point.coordinates
        sigmas[i] = np.sqrt(np.diag(covariance + one.covariance))
    return errors, sigmas


def _named(
    settled: Weighted, seen: Sequence[Seen], members: Sequence[int], start: Solution
) -> tuple[list[Blunder], list[WrongMark], list[Blunder]]:
    """Return wrong ground points, marks and positions, with the marks that were found wrong before the adjustment."""
    names = [view.name for view in start.block.views]
    points, marks, positions = [], [], []
    for test in settled.named:
        if test.part == "mark":
            sighting = settled.adjusted.control[test.index].sighting
            marks.append(_wrong_mark(test, sighting, names))
        elif test.part in ("plan", "height"):
            points.append(Blunder(seen[members[test.index]].point.name, test.part, test.size, test.ratio))
        else:
            part = "plan" if test.part == "GNSS plan" else "height"
            positions.append(Blunder(names[settled.adjusted.positions.view[test.index]], part, test.size, test.ratio))
    told_already = {(m.gcp, m.image) for m in marks}
    for one in seen:
        found = one.found
        if found is None:
            continue
        images = [m.image for m in one.point.marks if m.image in set(names)]
        for image, used, residual in zip(images, found.used, found.residuals, strict=True):
            if not used and (one.point.name, image) not in told_already:
                size = float(np.linalg.norm(residual))
                marks.append(WrongMark(one.point.name, image, size, np.inf))
    return points, marks, positions


def _wrong_mark(test: Test, sighting: Sighting, names: Sequence[str]) -> WrongMark:
    return WrongMark(sighting.name, names[sighting.view[test.item]], test.size, test.ratio)


def _wrong_checks(checks: Sequence[int], seen: Sequence[Seen], errors: Array, total: Array) -> list[Blunder]:
    named = []
    for i in checks:
        for part, axes in (("plan", [0, 1]), ("height", [2])):
            left, spread = errors[i][axes], total[i][np.ix_(axes, axes)]
            statistic = float(left @ np.linalg.solve(spread, left))
            if stats.chi2.sf(statistic, len(axes)) * 2 * len(checks) < FALSE_ALARM:
                named.append(Blunder(seen[i].point.name, part, float(np.linalg.norm(left)), float(np.sqrt(statistic))))
    return named


def _cameras(
    adjusted: Adjusted, ids: Sequence[int], interiors: Mapping[int, Interior], labels: Mapping[int, str]
) -> list[AdjustedCamera]:
    found = []
    for c, key in enumerate(ids):
        interior = interiors[key]
        covariance = adjusted.interior_covariance(c)
        found.append(
            AdjustedCamera(
                labels[key],
                interior.origin,
                interior.names,
                interior.values(adjusted.cameras.brown[c]),
                interior.sigma,
                np.sqrt(np.diag(covariance)),
                covariance,
            )
        )
    return found


def _weight_notes(settled: Weighted, gnss: Gnss, with_control: bool) -> list[str]:
    notes, factors = [], settled.factors
    effect = settled.adjusted.effect
    if effect > _ALIKE:
        notes.append(
            f"Residuals of neighbouring tie points are alike, as a rolling shutter or a lens beyond its model makes them: "
            f"{effect:.0f} of them count as one, and what is known beforehand of the camera weighs more."
        )
    worst = max(factors["plan"], factors["height"])
    if worst > _ENLARGED:
        notes.append(
            f"The control points fit {np.sqrt(factors['plan']):.0f} times worse in plan and {np.sqrt(factors['height']):.0f} "
            "times worse in height than their sigmas say, and all of them do: their sigmas are taken as that much larger; give "
            "their true SIGMA_H and SIGMA_V."
        )
    if factors["mark"] > 1.0:
        notes.append(
            f"The marks scatter {np.sqrt(factors['mark']):.1f} times as much as SIGMA_MARK says, and are weighted accordingly."
        )
    grown = np.sqrt(max(factors["GNSS plan"], factors["GNSS height"]))
    if gnss.declared and grown > 1.0:
        notes.append(f"The GNSS positions scatter up to {grown:.1f} times as much as they say, and are weighted accordingly.")
    if with_control and len(gnss):
        bias, sigma = settled.adjusted.bias, np.sqrt(np.diag(settled.adjusted.cofactor)[-3:])
        large = np.abs(bias) > np.maximum(4 * sigma, 3 * np.median(settled.adjusted.positions.sigma, axis=0))
        if large.any() and gnss.declared:
            notes.append(
                "Against the control points the GNSS positions are all off by "
                f"{-bias[0]:+.2f} m east, {-bias[1]:+.2f} m north and {-bias[2]:+.2f} m in height, which is taken off: the two "
                "may stand on different reference stations, datums or kinds of height."
            )
    return notes


def _loose_notes(adjusted: Adjusted, block: Block) -> list[str]:
    """Say which photographs are known far worse than the others."""
    sigma = np.linalg.norm(_centre_sigma(adjusted), axis=1)
    loose = sigma > max(_LOOSE * float(np.median(sigma)), _LOOSE_MATTERS)
    if not loose.any() or loose.mean() > 0.5:
        return []
    names = [view.name for view, one in zip(block.views, loose, strict=True) if one]
    are = "is" if len(names) == 1 else "are"
    return [
        f"{listed(names)} {are} known to {sigma[loose].max():.1f} m only against the rest of the block, which is known to "
        f"{np.median(sigma):.2f} m: too few tie points join them to more than one photograph of it; do not use their ground, or "
        "give control points on it."
    ]


def _gnss_errors(adjusted: Adjusted, gnss: Gnss, frame: LocalFrame) -> Array:
    if not len(gnss):
        return np.zeros((0, 3))
    cameras = adjusted.cameras
    antenna = cameras.centre[gnss.view] + offsets(cameras.rotation[gnss.view], gnss.lever)
    return frame.to_crs(antenna) - gnss.coordinates


def _centre_sigma(adjusted: Adjusted) -> Array:
    n = len(adjusted.cameras.centre)
    return np.sqrt(np.diag(adjusted.cofactor)[: POSE * n].reshape(n, POSE)[:, 3:])


def _tie_sigma(adjusted: Adjusted) -> Array:
    """Return the median sigma (3,) of tie points from the whole covariance, the georeferencing included."""
    rays = np.diff(adjusted.network.ties.start)
    chosen = np.flatnonzero(rays >= 3)
    chosen = chosen[:: max(1, len(chosen) // _TIE_SAMPLE)].astype(np.int64)
    variances = []
    for part in np.array_split(chosen, max(1, len(chosen) // 200)):
        follows, held = adjusted.influence(part)
        total = np.einsum("saj,jk,sak->sa", follows, adjusted.cofactor, follows, optimize=True)
        variances.append(total + np.diagonal(held, axis1=1, axis2=2))
    return np.asarray(np.sqrt(np.nanmedian(np.concatenate(variances), axis=0)))
