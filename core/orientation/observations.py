"""What is observed of a block on the ground: marks of ground points, and GNSS positions; and fits to any choice of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..errors import NotEnoughData
from ..frames import LocalFrame
from .control import GroundPoint
from .gnss import SHARED, Gnss, antenna_offsets
from .similarity import Fit, Shared, Similarity, fit
from .triangulation import Triangulated, triangulate

Array = NDArray[np.float64]

_UNDETERMINED = 0.5  # rad, or share of the scale: an axis known no better is not known; what is merely weak is told by its sigma


@dataclass(frozen=True)
class Seen:
    """A ground point and where its marks meet in the block, None with fewer than two marks in oriented photographs."""

    point: GroundPoint
    found: Triangulated | None
    marks: int
    wrong: tuple[str, ...] = ()  # marks that the others contradict
    single: str | None = None  # the photograph of the only mark


def find_marks(block: Block, points: Sequence[GroundPoint], sigma_mark: float) -> tuple[Seen, ...]:
    """Triangulate every ground point that has two marks or more in oriented photographs."""
    views = {v.name: v for v in block.views}
    # A ray is no better than the block's own rays.
    sigma = float(np.hypot(sigma_mark, np.median(block.errors) if len(block.errors) else 0.0))
    seen = []
    for point in points:
        marks = [m for m in point.marks if m.image in views]
        found = None
        if len(marks) >= 2:
            found = triangulate([views[m.image] for m in marks], np.array([[m.x, m.y] for m in marks]), sigma)
        wrong = () if found is None else tuple(m.image for m, used in zip(marks, found.used, strict=True) if not used)
        seen.append(Seen(point, found, len(marks), wrong, marks[0].image if len(marks) == 1 else None))
    return tuple(seen)


class Solver:
    """Holds the observations in one local frame, and fits any choice of them."""

    def __init__(self, block: Block, seen: Sequence[Seen], gnss: Gnss, frame: LocalFrame) -> None:
        self.block, self.seen, self.gnss, self.frame = block, seen, gnss, frame
        self.with_gnss, self.gnss_factor = False, 1.0
        nowhere, unknown = np.full(3, np.nan), np.full((3, 3), np.nan)
        self.model = np.array([s.found.point if s.found else nowhere for s in seen]).reshape(-1, 3)
        self.model_covariance = np.array([s.found.covariance if s.found else unknown for s in seen]).reshape(-1, 3, 3)
        self.given = np.array([s.point.coordinates for s in seen], float).reshape(-1, 3)
        self.ground = frame.from_crs(self.given) if len(seen) else self.given
        sigmas = np.array([[s.point.sigma_h, s.point.sigma_h, s.point.sigma_v] for s in seen], float).reshape(-1, 3)
        self.covariance = np.eye(3) * (sigmas**2)[:, None, :]
        self.centres = np.array([block.views[i].centre for i in gnss.view]).reshape(-1, 3)
        self.antennas = frame.from_crs(gnss.coordinates) if len(gnss) else self.centres

    def fit(self, used: NDArray[np.bool_], start: Similarity | None = None) -> Fit:
        """Fit on the used points, and on the positions when ``with_gnss``."""
        if not self.with_gnss:
            own = self.model_covariance[used]
            return fit(self.model[used], self.ground[used], self.covariance[used], model_covariance=own, start=start)
        members = np.concatenate([np.zeros(int(used.sum()), bool), np.ones(len(self.gnss), bool)])
        alone = not used.any()
        # Beside GCPs the positions' shared error is free: GCPs set the level. Alone, declared sigmas are taken at their word.
        sigma = np.array([SHARED[0], SHARED[0], SHARED[1]]) if alone else np.full(3, np.inf)
        shared = None if alone and self.gnss.declared else Shared(members, sigma)
        offsets = np.zeros_like(self.antennas)
        for _ in range(4 if self.gnss.lever.any() else 1):  # the lever turns with the solution
            solved = fit(
                np.concatenate([self.model[used], self.centres]),
                np.concatenate([self.ground[used], self.antennas - offsets]),
                np.concatenate([self.covariance[used], self.gnss.covariances(self.gnss_factor)]),
                model_covariance=np.concatenate([self.model_covariance[used], np.zeros((len(self.gnss), 3, 3))]),
                shared=shared,
                trust=not alone or self.gnss.declared,
                start=start,
            )
            offsets = antenna_offsets(self.block.views, self.gnss, solved.similarity)
        return solved

    def fit_without(self, used: NDArray[np.bool_], index: int, whole: Fit) -> Fit | None:
        """Fit without one of the used points, from the fit with it; None when the others do not determine the similarity."""
        rest = used.copy()
        rest[index] = False
        try:
            solved = self.fit(rest, whole.similarity)
        except NotEnoughData:
            return None
        return None if undetermined(solved, "-") else solved

    def errors(self, solved: Fit) -> Array:
        """Return computed minus given (n, 3) in the CRS; NaN where a point was not found."""
        errors = np.full((len(self.seen), 3), np.nan)
        found = np.isfinite(self.model[:, 0])
        if found.any():
            errors[found] = self.frame.to_crs(solved.similarity.apply(self.model[found])) - self.given[found]
        return errors

    def gnss_errors(self, solved: Fit) -> Array:
        """Return computed minus given antennas (g, 3) in the CRS."""
        if not len(self.gnss):
            return np.zeros((0, 3))
        offsets = antenna_offsets(self.block.views, self.gnss, solved.similarity)
        return self.frame.to_crs(solved.similarity.apply(self.centres) + offsets) - self.gnss.coordinates

    def predicted(self, solved: Fit, index: int) -> Array:
        """Return the predicted covariance (3, 3) of the error of a point that took no part in ``solved``."""
        own = self.own_covariance(solved)[index]
        return np.asarray(solved.factor * own + solved.uncertainty(self.ground[index : index + 1])[0])

    def own_covariance(self, solved: Fit) -> Array:
        """Return what surveying and marks alone say of the points' errors (n, 3, 3)."""
        turn = solved.similarity.scale * solved.similarity.rotation
        return np.asarray(self.covariance + turn @ self.model_covariance @ turn.T)


def undetermined(solved: Fit, what: str) -> str:
    """Return a sentence's beginning when a rotation or the scale is not determined, else an empty text."""
    sigmas = np.sqrt(np.diag(solved.covariance))
    if sigmas[3:6].max() > _UNDETERMINED:
        degrees = min(np.degrees(sigmas[3:6].max()), 180.0)
        return f"{what[0].upper()}{what[1:]} lie nearly on one line (the tilt about it is known to {degrees:.0f} degrees only)"
    if sigmas[6] > _UNDETERMINED:
        return f"{what[0].upper()}{what[1:]} lie so close together that the scale is known to {100 * sigmas[6]:.0f} % only"
    return ""
