"""Positions of the photographs from GNSS, as observations of their projection centres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS

from ..block import View
from ..errors import InputError
from ..frames import transformer
from ..survey import Photograph
from .similarity import Similarity

Array = NDArray[np.float64]

# Where a file tells no sigma: how the positions of one flight scatter against each other (only the ratio of the two matters,
# their size is estimated), and the error they share, which no residual shows. Heights in EXIF may come from a barometer.
SCATTER = (1.0, 1.5)
SHARED = (2.0, 10.0)


@dataclass(frozen=True)
class Gnss:
    """Antenna positions: ``view`` (n,) indexes the block's views, ``coordinates`` (n, 3) are in the survey's CRS.

    ``sigmas`` (n, 2) are in plan and height (m); ``declared`` tells whether the files gave them. ``lever`` (3,) leads from
    the projection centre to the antenna: right, forward, up of the levelled flight frame (m). ``notes`` says what was set aside.
    """

    view: NDArray[np.int64]
    coordinates: Array
    sigmas: Array
    declared: bool
    lever: Array
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of positions."""
        return len(self.view)

    def covariances(self, factor: float = 1.0) -> Array:
        """Return (n, 3, 3), the sigmas' squares times ``factor``."""
        return np.asarray(np.eye(3) * (self.sigmas[:, [0, 0, 1]] ** 2 * factor)[:, None, :])


def gnss_of(views: Sequence[View], photographs: Sequence[Photograph], crs: str, lever_arm: str | None) -> Gnss:
    """Return the positions of the oriented photographs that have one with a height.

    Raises
    ------
    InputError
        When LEVER_ARM is not three numbers.
    """
    by_name = {p.name: p.position for p in photographs}
    placed = [(i, p) for i, v in enumerate(views) if (p := by_name.get(v.name)) is not None]
    found = [(i, p) for i, p in placed if p.height is not None]
    told = sum(p.sigma_h is not None and p.sigma_v is not None for _, p in found)
    declared = bool(found) and told == len(found)
    notes = []
    if len(found) < len(placed):
        notes.append(f"{len(placed) - len(found)} of {len(placed)} GNSS positions have no height and are not used.")
    if 0 < told < len(found):
        notes.append(f"Only {told} of {len(found)} GNSS positions tell their sigma: all are taken as telling none.")
    sigmas = np.array([[p.sigma_h, p.sigma_v] if declared else SCATTER for _, p in found], float).reshape(-1, 2)
    coordinates = np.zeros((len(found), 3))
    if found:
        to_crs = transformer("EPSG:4326", CRS.from_user_input(crs))
        coordinates[:, 0], coordinates[:, 1] = to_crs.transform([p.longitude for _, p in found], [p.latitude for _, p in found])
        coordinates[:, 2] = [p.height for _, p in found]
    views_found = np.array([i for i, _ in found], np.int64)
    return Gnss(views_found, coordinates, sigmas, declared, _lever(lever_arm), tuple(notes))


def antenna_offsets(views: Sequence[View], gnss: Gnss, similarity: Similarity) -> Array:
    """Return the way from each projection centre to its antenna (n, 3) in the local frame."""
    turns = np.array([views[i].rotation @ similarity.rotation.T for i in gnss.view]).reshape(-1, 3, 3)
    return offsets(turns, gnss.lever)


def offsets(rotation: Array, lever: Array) -> Array:
    """Return the way from projection centre to antenna (n, 3) of cameras turned by ``rotation`` (n, 3, 3; camera from local).

    ``lever`` (3,) is right, forward, up of the flight frame, which stands upright; its forward is where the photograph's top
    points.
    """
    if not lever.any():
        return np.zeros((len(rotation), 3))
    tops = -rotation[:, 1, :]
    tops[:, 2] = 0.0
    forward = tops / np.linalg.norm(tops, axis=1)[:, None]
    right = np.stack([forward[:, 1], -forward[:, 0], np.zeros(len(forward))], axis=1)
    return np.asarray(lever[0] * right + lever[1] * forward + lever[2] * np.array([0.0, 0.0, 1.0]))


def _lever(text: str | None) -> Array:
    if not text or not text.strip():
        return np.zeros(3)
    try:
        lever = np.array([float(word) for word in text.replace(",", " ").replace(";", " ").split()])
    except ValueError:
        lever = np.zeros(0)
    if len(lever) != 3 or not np.isfinite(lever).all():
        raise InputError(f"LEVER_ARM {text!r} is not three numbers: give right, forward and up in metres, such as '0 0.1 0.25'.")
    return lever
