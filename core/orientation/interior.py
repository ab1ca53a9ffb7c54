"""What of the interior orientation is adjusted, and what is known of it beforehand.

A beach is flat and a gimballed camera looks straight down: then focal length and flying height, principal point and tilt can
hardly be told apart. Every parameter therefore enters with what is known of it, as an observation: what the block cannot
tell stays known to its prior, and the covariance says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera import BROWN, PARAMETERS, Camera
from .focal import CALIBRATION_SIGMA, FILE_SIGMA, FocalPrior

Array = NDArray[np.float64]

_SQUARE = 5e-4  # relative; pixels of today's sensors are square
_CENTRED = 0.01  # of the longer side: how far off the middle makers let the principal point lie
_UNKNOWN_FOCAL = 0.1  # relative, when the files do not tell
# Of small cameras with fixed lenses, wide of what is seen: radial terms of a tenth, decentring terms of a thousandth.
_DISTORTION = {"k1": 0.3, "k2": 0.3, "p1": 0.005, "p2": 0.005, "k3": 0.3, "k4": 0.3, "k5": 0.3, "k6": 0.3}
# What a lens keeps from flight to flight: a judgement, not a measurement, for no two flights of one camera with control were at
# hand. Lenses of glass in aluminium change by some 20 to 30 parts in a million and degree, those with plastic elements by 100
# and more; ten degrees of the latter are 0.1 %, of the former 0.03 %, and 0.07 % lies between. An autofocus that moves from
# infinity to 50 m with 9 mm adds f / distance, 0.02 %. A calibration without a covariance is off by more: by CALIBRATION_SIGMA.
_KEPT_FOCAL = 0.0007  # relative
_KEPT_CENTRE = 0.0005  # of the longer side
# Some tenths of a pixel at the edge of the photograph.
_KEPT = {"k1": 5e-4, "k2": 1e-3, "p1": 5e-5, "p2": 5e-5, "k3": 1e-3, "k4": 1e-3, "k5": 1e-3, "k6": 1e-3}

# Beyond these a parameter is told of.
_RESTS = 0.7  # posterior over prior sigma
_TIED = 0.95  # correlation with the focal length, or of the principal point with the decentring


@dataclass(frozen=True)
class Interior:
    """The free parameters of one camera and what is known of them.

    ``names`` (q,); ``basis`` (12, q) derives ``Camera.brown()`` by them; ``information`` (q, q) is the inverse covariance of
    ``known`` (q,). A camera that is held has none. ``origin`` says where the knowledge is from, for reports.
    """

    names: tuple[str, ...]
    basis: Array
    known: Array
    information: Array
    origin: str = ""

    def values(self, brown: Array) -> Array:
        """Return the parameters (q,) in a camera's twelve."""
        return np.array([brown[np.flatnonzero(column)[0]] for column in self.basis.T])

    @property
    def sigma(self) -> Array:
        """The sigma (q,) of each parameter as known beforehand."""
        return np.sqrt(np.diag(np.linalg.inv(self.information))) if len(self.names) else np.zeros(0)


def held() -> Interior:
    """Return the interior orientation of a camera that is not adjusted."""
    return Interior((), np.zeros((12, 0)), np.zeros(0), np.zeros((0, 0)), "held")


def free(camera: Camera, focal: FocalPrior | None) -> Interior:
    """Return the free parameters of a camera's model; ``focal`` is what the files say of the focal length, None for nothing."""
    names = PARAMETERS[camera.model]
    side = max(camera.width, camera.height)
    now = camera.brown()
    prior = focal or FocalPrior(float(now[:2].mean()), _UNKNOWN_FOCAL * float(now[:2].mean()))
    means = {"f": prior.value, "fx": prior.value, "fy": prior.value, "cx": camera.width / 2, "cy": camera.height / 2}
    sigmas = {**_DISTORTION, "cx": _CENTRED * side, "cy": _CENTRED * side}
    known = np.array([means.get(name, 0.0) for name in names])
    return Interior(names, _basis(names), known, _information(names, prior, sigmas), "files" if focal else "nothing")


def calibrated(camera: Camera, calibration: Camera, covariance: Array | None = None) -> Interior:
    """Return the free parameters of ``camera``, known from a ``calibration`` with the covariance (q, q) of its adjustment.

    What lenses do from flight to flight is added to it: 0.07 % of the focal length and some tenths of a pixel of principal point
    and distortion, which is judged from how lenses expand, not measured.
    """
    names = PARAMETERS[camera.model]
    brown = calibration.brown()
    basis = _basis(names)
    known = np.array([brown[np.flatnonzero(column)[0]] for column in basis.T])
    side = max(camera.width, camera.height)
    kept = CALIBRATION_SIGMA if covariance is None else _KEPT_FOCAL
    prior = FocalPrior(float(brown[:2].mean()), kept * float(brown[:2].mean()))
    sigmas = {**_KEPT, "cx": _KEPT_CENTRE * side, "cy": _KEPT_CENTRE * side}
    information = _information(names, prior, sigmas)
    if covariance is not None and covariance.shape == information.shape:
        information = np.asarray(np.linalg.inv(np.linalg.inv(information) + covariance), float)
    return Interior(names, basis, known, information, "calibration")


def file_focal(focal: float | None) -> FocalPrior | None:
    """Return what a file's focal length (px) says, None for none."""
    return FocalPrior(focal, FILE_SIGMA * focal) if focal else None


def told(label: str, interior: Interior, covariance: Array, values: Array) -> list[str]:
    """Return a sentence on each parameter that the block does not determine, or not apart from another one.

    ``covariance`` (q, q) and ``values`` (q,) are the adjusted ones; ``label`` names the camera.
    """
    sigma, before = np.sqrt(np.diag(covariance)), interior.sigma
    sentences = []
    off = np.abs(values - interior.known) > 3 * before
    rests = [n for n, s, b, o in zip(interior.names, sigma, before, off, strict=True) if s > _RESTS * b and not o]
    if rests and interior.origin != "calibration":
        sentences.append(
            f"The block does not determine {', '.join(rests)} of {label}: {'it stays' if len(rests) == 1 else 'they stay'} at "
            "what was known beforehand; a simpler CAMERA_MODEL, or CALIBRATION, is safer."
        )
    correlation = covariance / np.maximum(np.outer(sigma, sigma), 1e-300)
    pairs = [("cx", "p1"), ("cy", "p2"), ("cx", "p2"), ("cy", "p1")]
    names: Sequence[str] = interior.names
    strong = [
        f"{a} with {b} ({correlation[names.index(a), names.index(b)]:+.2f})"
        for a, b in pairs
        if a in names and b in names and abs(correlation[names.index(a), names.index(b)]) > _TIED
    ]
    if strong:
        sentences.append(
            f"In {label} the adjustment can hardly tell {', '.join(strong)} apart: fly cross strips, or use a simpler "
            "CAMERA_MODEL."
        )
    if off.any():
        wrong = [
            f"{n} ({v:.5g} for {k:.5g})"
            for n, v, k, o in zip(names, values, interior.known, off, strict=True)
            if o and n in ("f", "fx", "fy", "cx", "cy")
        ]
        if wrong:
            sentences.append(
                f"The adjustment puts {', '.join(wrong)} of {label} beyond three sigmas of what was known beforehand: check that "
                "the photographs are not cropped or resized, and the control points."
            )
    return sentences


def merged(interiors: Mapping[int, Interior]) -> tuple[Array, NDArray[np.int64]]:
    """Return the padded bases (c, 12, q) and the number of free parameters (c,), in the order of the keys."""
    ordered = [interiors[key] for key in sorted(interiors)]
    most = max((len(i.names) for i in ordered), default=0)
    basis = np.zeros((len(ordered), 12, most))
    for c, one in enumerate(ordered):
        basis[c, :, : len(one.names)] = one.basis
    return basis, np.array([len(i.names) for i in ordered], np.int64)


def _basis(names: Sequence[str]) -> Array:
    basis = np.zeros((12, len(names)))
    for j, name in enumerate(names):
        for target in ("fx", "fy") if name == "f" else (name,):
            basis[BROWN.index(target), j] = 1.0
    return basis


def _information(names: Sequence[str], focal: FocalPrior, sigmas: Mapping[str, float]) -> Array:
    matrix = np.diag([1.0 / sigmas[n] ** 2 if n in sigmas else 0.0 for n in names])
    if "f" in names:
        matrix[names.index("f"), names.index("f")] = 1.0 / focal.sigma**2
        return matrix
    pair = [names.index("fx"), names.index("fy")]
    mean, ratio = np.array([0.5, 0.5]), np.array([1.0, -1.0])
    matrix[np.ix_(pair, pair)] = np.outer(mean, mean) / focal.sigma**2 + np.outer(ratio, ratio) / (_SQUARE * focal.value) ** 2
    return matrix
