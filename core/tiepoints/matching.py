"""Matches of one pair of photographs: a few coarse features give the geometry, the geometry guides all the others.

Comparing every feature with every other costs seconds a pair, and on sand, which looks alike all over, it finds less:
the ratio test meets a rival somewhere in the other photograph. So the largest few features are compared exhaustively
(their product is one of whole numbers, exact in float32 in any order), a two-view geometry is fitted to them, and the
rest are compared only where that geometry allows.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import pycolmap
from numpy.typing import NDArray

from ..camera import Camera
from ..files import whole
from .features import Features, spread
from .guided import Prediction, by_homography, guided_matches
from .motion import by_neighbours

Array = NDArray[np.float64]

VERSION = 4  # part of the key under which matches are kept
LIMIT = 4.0 / 2000.0  # a verified match is this near its epipolar line (or homography), as a share of the longer side
LEAST = 15  # verified matches below which a pair is not one
_COARSE = 3000
_COARSE_RATIO = 0.85
_RATIO = 0.85
_PRODUCT = 0.80
_SOME = 2000  # matches from which a pair's geometry is found
_SHARE = 0.5  # of guided matches that agree with one geometry: nearly all where there is one, a fifth to a quarter by chance
_EQUAL = 512.0**2  # product of equal descriptors
_NONE = np.zeros((0, 2), np.int32)


@dataclass(frozen=True)
class PairMatches:
    """Verified matches (m, 2) of a pair, as indices of features, and COLMAP's two-view geometry.

    ``config`` is COLMAP's; the matrices (3, 3; second from first) are zero when absent. ``homography`` is the least-squares one
    of all matches, whether or not the ground is flat. ``likeness`` (m,) is the product of the descriptors, 1 for equal ones.
    """

    matches: NDArray[np.int32]
    config: int
    essential: Array
    fundamental: Array
    homography: Array
    likeness: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))

    @classmethod
    def none(cls) -> PairMatches:
        """Return what a pair without a verified geometry has."""
        zero = np.zeros((3, 3))
        return cls(_NONE, int(pycolmap.TwoViewGeometryConfiguration.DEGENERATE), zero, zero, zero)


def match_pair(first: Features, second: Features, cameras: tuple[Camera, Camera]) -> PairMatches:
    """Match two photographs and verify the matches against a two-view geometry."""
    chosen = [coarse(f, c) for f, c in zip((first, second), cameras, strict=True)]
    rough = mutual_matches(first.descriptors[chosen[0]], second.descriptors[chosen[1]], ratio=_COARSE_RATIO)
    rough = np.column_stack([chosen[0][rough[:, 0]], chosen[1][rough[:, 1]]]).astype(np.int32)
    geometry = verify(first, second, cameras, rough)
    kept = geometry.matches
    if len(kept) < LEAST:
        return PairMatches.none()
    turns = second.angle[kept[:, 1]] - first.angle[kept[:, 0]]
    guided = _match_all(
        first,
        second,
        cameras,
        geometry,
        turn=float(np.arctan2(np.median(np.sin(turns)), np.median(np.cos(turns)))),
        zoom=float(np.exp(np.median(np.log(second.scale[kept[:, 1]] / first.scale[kept[:, 0]])))),
    )
    return guided if len(guided.matches) > len(kept) else geometry


def match_predicted(first: Features, second: Features, cameras: tuple[Camera, Camera], homography: Array) -> PairMatches:
    """Match two photographs of which a homography (3, 3, second from first) is known roughly, to 3 % of the longer side."""
    a, b, _, c, d, *_ = (homography / homography[2, 2]).ravel()
    predicted = PairMatches(_NONE, 0, np.zeros((3, 3)), np.zeros((3, 3)), homography)
    return _match_all(
        first, second, cameras, predicted, turn=float(np.arctan2(c - b, a + d)), zoom=float(np.sqrt(max(a * d - b * c, 1e-6)))
    )


def _match_all(
    first: Features, second: Features, cameras: tuple[Camera, Camera], geometry: PairMatches, *, turn: float, zoom: float
) -> PairMatches:
    """Match all features where the geometry allows, and verify."""
    if min(len(first), len(second)) == 0 or abs(np.linalg.det(geometry.homography)) < 1e-9:
        return PairMatches.none()
    longer = max(cameras[1].width, cameras[1].height)
    reach = 0.03 * longer
    if len(kept := geometry.matches):
        mapped = cv2.perspectiveTransform(first.xy[kept[:, 0]][None], geometry.homography)[0]
        off = np.hypot(*(mapped - second.xy[kept[:, 1]]).T)
        reach = float(np.clip(1.5 * np.quantile(off, 0.98), 2 * LIMIT * longer, 0.1 * longer))
    limits = {"band": LIMIT * longer, "turn": turn, "zoom": zoom, "ratio": _RATIO, "least": _PRODUCT}

    def search(forward: Prediction, backward: Prediction, fundamental: Array | None) -> NDArray[np.int32]:
        found = guided_matches(first, second, forward, backward, fundamental, **limits)
        # One place seen under two orientations is one match.
        places = np.concatenate([first.xy[found[:, 0]], second.xy[found[:, 1]]], axis=1)
        _, unique = np.unique(np.rint(places), axis=0, return_index=True)
        return found[np.sort(unique)]

    there, back = geometry.homography, _inverse(geometry.homography)
    lines = geometry.fundamental if geometry.fundamental.any() else None
    found = search(by_homography(first, there, reach), by_homography(second, back, reach / max(zoom, 1e-6)), lines)
    verified = verify(first, second, cameras, found)
    if len(verified.matches) < _SHARE * len(found):
        return PairMatches.none()
    if len(verified.matches) < LEAST or abs(np.linalg.det(verified.homography)) < 1e-9:
        return verified
    # What is verified tells how the ground moves around each feature: there all are sought again, and nowhere else.
    there, back = verified.homography, _inverse(verified.homography)
    one, two = _places(first, second, verified.matches)
    forward = by_neighbours(first.xy, one, two, there, reach)
    backward = by_neighbours(second.xy, two, one, back, reach / max(zoom, 1e-6))
    found = search(forward, backward, None)
    good = _agree(*_places(first, second, found), verified.fundamental, there, LIMIT * longer)
    found = found[good]
    return replace(verified, matches=found, likeness=_likeness(first, second, found)) if len(found) >= LEAST else verified


def _inverse(homography: Array) -> Array:
    return np.asarray(np.linalg.inv(homography), np.float64)


def _places(first: Features, second: Features, matches: NDArray[np.int32]) -> tuple[Array, Array]:
    """Return where matches (m, 2) lie in both photographs, (m, 2) each."""
    return first.xy[matches[:, 0]].astype(np.float64), second.xy[matches[:, 1]].astype(np.float64)


def coarse(features: Features, camera: Camera) -> NDArray[np.intp]:
    """Return the indices of the largest features, spread over the photograph."""
    return spread(features.xy, features.scale, (camera.width, camera.height), _COARSE)


def mutual_matches(first: NDArray[np.uint8], second: NDArray[np.uint8], *, ratio: float) -> NDArray[np.int32]:
    """Return the mutually best matches (m, 2) of descriptors (n, 128) that pass the ratio test both ways."""
    if min(len(first), len(second)) < 2:
        return _NONE
    products = first.astype(np.float32) @ second.astype(np.float32).T
    forward = _passing(products, ratio)
    backward = _passing(products.T, ratio)
    index = np.flatnonzero(forward >= 0)
    index = index[backward[forward[index]] == index]
    return np.column_stack([index, forward[index]]).astype(np.int32)


def verify(first: Features, second: Features, cameras: tuple[Camera, Camera], matches: NDArray[np.int32]) -> PairMatches:
    """Return the matches that agree with one two-view geometry, found by RANSAC with a fixed seed.

    The geometry is that of a few thousand matches spread over the photograph: more take longer and tell no more.
    """
    if len(matches) < LEAST:
        return PairMatches.none()
    limit = LIMIT * max(*(max(c.width, c.height) for c in cameras))
    one, two = _places(first, second, matches)
    likeness = _likeness(first, second, matches)
    some = spread(first.xy[matches[:, 0]], likeness, (cameras[0].width, cameras[0].height), _SOME)
    options = pycolmap.TwoViewGeometryOptions()
    options.min_num_inliers = LEAST
    options.detect_watermark = False
    options.ransac.max_error = limit
    options.ransac.random_seed = 1
    given = [pycolmap.Camera(model=c.model, width=c.width, height=c.height, params=list(c.params)) for c in cameras]
    for camera in given:
        camera.has_prior_focal_length = False  # an uncertain focal length must not reject matches
    index = np.column_stack([np.arange(len(some), dtype=np.uint32)] * 2)
    found = pycolmap.estimate_two_view_geometry(given[0], one[some], given[1], two[some], index, options)
    essential, fundamental, plane = (np.zeros((3, 3)) if m is None else np.array(m, float) for m in (found.E, found.F, found.H))
    good = _agree(one, two, fundamental, plane, limit)
    if min(good.sum(), len(found.inlier_matches)) < LEAST:
        return PairMatches.none()
    fitted, _ = cv2.findHomography(one[good], two[good], 0)
    # A homography that sends the photograph's corner to infinity cannot predict anything.
    usable = fitted is not None and abs(fitted[2, 2]) > 1e-9
    homography = fitted / fitted[2, 2] if usable else np.zeros((3, 3))
    return PairMatches(matches[good], int(found.config), essential, fundamental, homography, likeness[good])


def _agree(first: Array, second: Array, fundamental: Array, plane: Array, limit: float) -> NDArray[np.bool_]:
    """Tell which points (n, 2) agree with the fundamental matrix (Sampson's distance), or with the homography if more do."""
    one, two = (np.column_stack([xy, np.ones(len(xy))]) for xy in (first, second))
    with np.errstate(divide="ignore", invalid="ignore"):
        line2, line1 = one @ fundamental.T, two @ fundamental
        product = np.einsum("nk,nk->n", two, line2)
        epipolar = product**2 / (line1[:, :2] ** 2 + line2[:, :2] ** 2).sum(axis=1) <= limit**2
        mapped = one @ plane.T
        planar = np.hypot(*(mapped[:, :2] / mapped[:, 2:] - second).T) <= limit
    return planar if planar.sum() > epipolar.sum() else epipolar


def _likeness(first: Features, second: Features, matches: NDArray[np.int32]) -> NDArray[np.float32]:
    """Return the product of the descriptors of each match, 1 for equal ones."""
    one, two = (f.descriptors[k].astype(np.float32) for f, k in zip((first, second), matches.T, strict=True))
    return np.einsum("nk,nk->n", one, two) / np.float32(_EQUAL)


def write_matches(path: Path, pair: PairMatches) -> None:
    """Write a pair's matches to an npz, whole or not at all."""
    with whole(path) as part, part.open("wb") as stream:
        np.savez(
            stream, matches=pair.matches, config=pair.config, essential=pair.essential, fundamental=pair.fundamental,
            homography=pair.homography, likeness=pair.likeness,
        )  # fmt: skip


def read_matches(path: Path) -> PairMatches:
    """Read what ``write_matches`` wrote."""
    with np.load(path, allow_pickle=False) as data:
        return PairMatches(
            data["matches"], int(data["config"]), data["essential"], data["fundamental"], data["homography"], data["likeness"]
        )


def _passing(products: NDArray[np.float32], ratio: float) -> NDArray[np.int64]:
    """Return the best column of each row where it passes the ratio test, else -1."""
    best = products.argmax(axis=1)
    rows = np.arange(len(products))
    top = products[rows, best]
    second = np.partition(products, -2, axis=1)[:, -2]
    unit = np.float32(_EQUAL)
    return np.where(np.maximum(unit - top, 0) <= ratio**2 * (unit - second), best, -1)
