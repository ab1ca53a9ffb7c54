"""Keypoints of one track laid on each other by least-squares matching.

Detection places each keypoint by itself, to some tenths of a pixel. A track's keypoints show the same piece of ground: one of
them is the reference, and the others move to where its surroundings are found again. What does not look like the reference, or
lies away from where it was detected, is not the same piece of ground, and leaves the track.

Photographs are handled one at a time: first the patches around the references in each are cut out, then each photograph is
searched for the patches of others. Of what two photographs share, each keypoint must then move as those around it do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..files import bytes_digest, digest, whole
from ..progress import Progress
from .features import read_features
from .images import SearchedImage
from .leastsquares import cut_patches, holds_patch, match_patches
from .motion import consistent
from .pairs import Pair
from .tracks import within_tracks

Array = NDArray[np.float64]
Indices = NDArray[np.int32]
Run = Callable[[Callable[..., None], Iterable[tuple[Any, ...]], int, Progress], None]

VERSION = 2  # part of the key under which refined places are kept
_ALIKE = (0.6, 0.7)  # bounds of the correlation of a keypoint's surroundings with the reference's below which they differ
_EXPECTED = 0.75  # of the correlation that noise leaves the surroundings of most: that limit, within the bounds
_MOVED = 2.5  # pixels between a detected place and the refined one, beyond which that is another
_PLANE = 12  # keypoints two photographs must share for a homography to tell how patches are warped between them
_RELIEF = 0.02  # of the longer side: what relief moves keypoints against that homography
_ZOOMED = 2.0  # factor between that homography's local zoom and the keypoints' own beyond which it is not believed


@dataclass(frozen=True)
class Source:
    """Where a photograph's keypoints come from: the image searched, and what ``write_features`` wrote.

    The name of the features' file stands for the content of both.
    """

    image: SearchedImage
    features: Path


@dataclass(frozen=True)
class References:
    """Photograph and keypoint of each track's reference (-1: none), and its number among those of its photograph."""

    photograph: Indices
    keypoint: Indices
    row: Indices


def choose_references(
    sources: Sequence[Source], tracks: Sequence[Indices], matches: Mapping[Pair, NDArray[np.int32]]
) -> References:
    """Return the references of tracks; a track has none where no photograph holds a whole patch around its keypoint.

    The keypoint that matches most others of its track is the one least likely to be wrong; of several, the one nearest to the
    middle of its photograph sees the ground most from above.
    """
    count = max((int(t.max(initial=-1)) for t in tracks), default=-1) + 1
    best = np.zeros(count)
    photograph, keypoint, row = (np.full(count, -1, np.int32) for _ in range(3))
    degrees = [np.zeros(len(t), np.int32) for t in tracks]
    for (i, j), found in matches.items():
        inside = found[within_tracks(found, tracks[i], tracks[j])]
        np.add.at(degrees[i], inside[:, 0], 1)
        np.add.at(degrees[j], inside[:, 1], 1)
    for i, (source, track) in enumerate(zip(sources, tracks, strict=True)):
        xy = read_features(source.features).xy
        index = np.flatnonzero((track >= 0) & holds_patch(xy * source.image.reduction, source.image.working_size))
        score = degrees[i][index] + 1 - np.linalg.norm(xy[index] / np.array(source.image.size) - 0.5, axis=1)
        better = score > best[track[index]]
        index, score = index[better], score[better]
        best[track[index]], photograph[track[index]], keypoint[track[index]] = score, i, index
    order = np.argsort(photograph, kind="stable")
    starts = np.searchsorted(photograph[order], np.arange(len(sources) + 1))
    for a, b in zip(starts[:-1], starts[1:], strict=True):
        row[order[a:b]] = np.arange(b - a)
    return References(photograph, keypoint, row)


def refine_keypoints(
    sources: Sequence[Source],
    tracks: Sequence[Indices],
    matches: Mapping[Pair, NDArray[np.int32]],
    *,
    folder: Path,
    run: Run,
    progress: Progress,
) -> list[Path]:
    """Return for each photograph the file of its refined keypoints, for ``read_refined``.

    ``tracks`` is what ``build_tracks`` returned for ``matches``. Files are kept in ``folder`` under what they were made from.
    ``run`` makes calls of a function, in any order: it takes the function, the calls, their number and a progress.
    """
    references = choose_references(sources, tracks, matches)
    order = np.argsort(references.photograph, kind="stable")
    bounds = np.searchsorted(references.photograph[order], np.arange(len(sources) + 1))
    wanted = [references.keypoint[order[a:b]] for a, b in zip(bounds[:-1], bounds[1:], strict=True)]

    def named(source: Source, *key: Any) -> Path:
        return folder / f"{digest(VERSION, source.features.stem, *key)}.npz"

    cut = [named(s, bytes_digest(w.tobytes())) for s, w in zip(sources, wanted, strict=True)]

    def search(i: int) -> tuple[Indices, list[tuple[str, Indices, Indices]]]:
        """Return the references of photograph i, and for each other photograph its file, keypoints of i and rows of the file."""
        index = np.flatnonzero(tracks[i] >= 0).astype(np.int32)
        track = tracks[i][index]
        other = references.photograph[track]
        groups = [j for j in np.unique(other).tolist() if j not in (-1, i)]
        return index[other == i], [(str(cut[j]), index[other == j], references.row[track[other == j]]) for j in groups]

    refined, missing, needed = [], [], set()
    for i, source in enumerate(sources):
        own, parts = search(i)
        content = [(Path(name).stem, *(bytes_digest(a.tobytes()) for a in arrays)) for name, *arrays in parts]
        refined.append(named(source, bytes_digest(own.tobytes()), content))
        if not refined[-1].is_file():
            missing.append(i)
            needed |= {name for name, *_ in parts}
    cuts = [i for i, path in enumerate(cut) if str(path) in needed and not path.is_file()]
    run(_cut_references, ((sources[i], wanted[i], str(cut[i])) for i in cuts), len(cuts), progress.part(0.0, 0.3))
    run(_search_references, ((sources[i], *search(i), str(refined[i])) for i in missing), len(missing), progress.part(0.3, 1.0))
    return refined


def read_refined(source: Source, path: Path) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return a photograph's keypoints (n, 4: x, y, scale, angle) at their refined places, and which are well tied (n,)."""
    keypoints = read_features(source.features).keypoints()
    tied = np.zeros(len(keypoints), bool)
    with np.load(path, allow_pickle=False) as data:
        keypoints[data["keypoint"], :2] = data["xy"]
        tied[data["keypoint"]] = True
    return keypoints, tied


def affinities(first: NDArray[np.float32], second: NDArray[np.float32], longer: float) -> Array:
    """Return the map (n, 2, 2) of a step around each of the keypoints ``first`` (n, 4) to one around ``second``.

    It is that of the homography between all of them where this agrees with the keypoints' scales, else the turn and
    zoom of their scales and angles. ``longer`` is the longer side of the photograph.
    """
    zoom, turn = second[:, 2] / first[:, 2], second[:, 3] - first[:, 3]
    cosine, sine = zoom * np.cos(turn), zoom * np.sin(turn)
    result = np.stack([cosine, -sine, sine, cosine], axis=1).reshape(-1, 2, 2).astype(np.float64)
    if len(first) < _PLANE:
        return result
    xy = first[:, :2].astype(np.float64)
    plane, _ = cv2.findHomography(xy, second[:, :2].astype(np.float64), cv2.RANSAC, _RELIEF * longer)
    if plane is None:
        return result
    mapped = np.column_stack([xy, np.ones(len(xy))]) @ plane.T
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = mapped[:, 2, None, None]
        local = (plane[:2, :2] - mapped[:, :2, None] / depth * plane[2, :2]) / depth
        ratio = np.sqrt(np.linalg.det(local)) / zoom
        fine = (ratio < _ZOOMED) & (ratio > 1 / _ZOOMED)
    result[fine] = local[fine]
    return result


def _least_alike(correlation: NDArray[np.float32]) -> float:
    """Return the correlation (n,) below which surroundings are not the same, by what is usual between two photographs.

    Two looks at one patch, of signal S and noise N each, correlate by S / (S + N).
    """
    found = correlation[np.isfinite(correlation)]
    return float(np.clip(_EXPECTED * np.median(found), *_ALIKE)) if len(found) else _ALIKE[1]


def _working_keypoints(source: Source) -> NDArray[np.float32]:
    """Return keypoints (n, 4) in pixels of the image searched."""
    keypoints = read_features(source.features).keypoints()
    keypoints[:, :2] *= source.image.reduction
    keypoints[:, 2] *= source.image.reduction.mean()
    return keypoints


def _cut_references(source: Source, index: Indices, path: str) -> None:
    """Write the patches around the keypoints ``index`` of a photograph, and these keypoints."""
    keypoints = _working_keypoints(source)[index]
    image = source.image.read_reduced()
    with whole(Path(path)) as part, part.open("wb") as stream:
        np.savez(stream, patches=cut_patches(image, keypoints[:, :2]), keypoints=keypoints)


def _search_references(source: Source, own: Indices, parts: Sequence[tuple[str, Indices, Indices]], path: str) -> None:
    """Write where a photograph's keypoints lie once moved to the references of others; ``own`` are references themselves.

    ``parts`` names for each other photograph the file of its patches, the keypoints to be moved, and the rows of their patches.
    """
    keypoints = _working_keypoints(source)
    kept: list[NDArray[np.integer]] = [own]
    places: list[NDArray[np.floating]] = [keypoints[own, :2]]
    image = source.image.read_reduced() if parts else np.zeros((1, 1), np.uint8)
    for name, index, rows in parts:
        with np.load(name, allow_pickle=False) as data:
            patches, theirs = data["patches"][rows], data["keypoints"][rows]
        mine = keypoints[index]
        warp = affinities(theirs, mine, max(image.shape))
        place, correlation = match_patches(image, patches, theirs[:, :2].astype(np.float64), warp, mine[:, :2])
        with np.errstate(invalid="ignore"):
            found = (correlation >= _least_alike(correlation)) & (np.linalg.norm(place - mine[:, :2], axis=1) <= _MOVED)
        good = np.flatnonzero(found)
        good = good[consistent(theirs[good, :2].astype(np.float64), place[good])]
        kept.append(index[good])
        places.append(place[good])
    with whole(Path(path)) as part, part.open("wb") as stream:
        np.savez(stream, keypoint=np.concatenate(kept), xy=(np.concatenate(places) / source.image.reduction).astype(np.float32))
