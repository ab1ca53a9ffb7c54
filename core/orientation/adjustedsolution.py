"""The georeferencing by bundle adjustment: from a similarity to the adjusted block, its residuals and what they say."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..frames import LocalFrame
from .adjusted import Adjusted
from .adjustmentnotes import loose_notes, unseen, weight_notes
from .alternatives import alternatives
from .assembly import Assembly, adjusted_block, network_of
from .cameras import POSE, Rays
from .common import of_adjustment
from .gnss import SHARED, Gnss, offsets
from .interior import Interior, told
from .naming import named, slipped, wrong_checks
from .network import Control, Network, Positions
from .observations import Seen
from .reliability import without
from .sightings import Sighting
from .singles import Entering, tested
from .solution import AdjustedCamera, Solution
from .weighting import Weighted, settle

Array = NDArray[np.float64]


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
    once = [i for i, s in enumerate(seen) if s.single and not s.point.check]
    control = [_control(seen[i], sightings[i], frame) for i in members]
    network = network_of(assembly, start.similarity, interiors, usable)
    sigma = float(np.median(assembly.block.errors)) if len(assembly.block.errors) else 1.0
    scatter = start.estimated_factor or 1.0

    def settled_on(network: Network, control: Sequence[Control], sigma: float) -> Weighted:
        positions = _positions(gnss, frame, with_control=bool(control or once), comparable=comparable)
        return settle(network, control, positions, declared=gnss.declared, sigma=sigma, scatter=scatter, told=step)

    settled, entering = settled_on(network, control, sigma), Entering((), (), ())
    if once:
        entering = tested(settled, [_control(seen[i], sightings[i], frame) for i in once])
        members += [once[k] for k in entering.members]
        control += entering.control
        settled = settled_on(settled.adjusted.network, control, settled.adjusted.sigma)
    adjusted = settled.adjusted
    block, kept = adjusted_block(assembly, start.similarity, adjusted.cameras, usable)
    errors, own, total = _errors(adjusted, seen, sightings, members, frame)
    loo, loo_sigma = _leave_one_out(adjusted, seen, members, frame)
    blunders, wrong_marks, wrong_positions = named(settled, seen, members, start)
    wrong_marks += slipped(entering, [seen[i] for i in once])
    checks = [i for i, s in enumerate(seen) if s.point.check and s.found is not None]
    blunders += wrong_checks(checks, seen, errors, total)
    cameras = _cameras(adjusted, sorted(interiors), interiors, labels)
    centre_sigma = _centre_sigma(adjusted)
    notes = [*weight_notes(settled, gnss, bool(control)), *loose_notes(centre_sigma, block)]
    notes += [unseen(seen[i]) for k, i in enumerate(once) if k not in entering.members]
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
        centre_sigma=centre_sigma,
        tie_sigma=_tie_sigma(adjusted, assembly.rays.only(kept), block),
        single=frozenset(seen[i].point.name for i in members if seen[i].single),
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


def _gnss_errors(adjusted: Adjusted, gnss: Gnss, frame: LocalFrame) -> Array:
    if not len(gnss):
        return np.zeros((0, 3))
    cameras = adjusted.cameras
    antenna = cameras.centre[gnss.view] + offsets(cameras.rotation[gnss.view], gnss.lever)
    return frame.to_crs(antenna) - gnss.coordinates


def _centre_sigma(adjusted: Adjusted) -> Array:
    n = len(adjusted.cameras.centre)
    return np.sqrt(np.diag(adjusted.cofactor)[: POSE * n].reshape(n, POSE)[:, 3:])


def _tie_sigma(adjusted: Adjusted, rays: Rays, block: Block) -> Array:
    """Return the sigmas (p, 3) of the block's points in E, N and U of the local frame, the georeferencing included."""
    covariances = adjusted.tie_covariances(rays, block.points)
    return np.asarray(np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)))
