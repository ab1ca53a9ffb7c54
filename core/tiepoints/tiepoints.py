"""Step ``tiepoints``: features, pairs and verified matches in a COLMAP database."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..camera import Camera
from ..contract import decode, encode
from ..errors import InputError, NotEnoughData
from ..files import digest, remove
from ..parallel import run_calls
from ..photographs.listing import some
from ..progress import SILENT, Progress
from ..survey import Photograph, Survey, held
from . import features, matching
from .database import NAME, provisional_camera, write_database
from .features import read_features
from .images import SearchedImage, searched_image
from .likeness import alike_pairs, largest
from .matching import PairMatches
from .pairs import Pair, blocks, choose_pairs, pairs_through_others
from .refinement import Source, read_refined, refine_keypoints
from .tiereport import write_report
from .ties import count_ties, name_weak
from .tracks import build_tracks, within_tracks

CACHE = "cache"  # features and matches, so that what is done need not be done again; it may be deleted
_FEW = 12
_TRUSTED = 50  # matches from which a pair may tell where a third photograph lies


@dataclass(frozen=True)
class Request:
    """``max_features`` 0 is no limit; ``max_size`` is the longer side in pixels features are looked for at, 0 is full.

    ``threshold`` "noise" takes what stands out of each photograph's own noise, "fixed" what exceeds one contrast for all.
    """

    survey: str
    source: Literal["auto", "enhanced", "original"] = "auto"
    max_features: int = 20000
    max_size: int = 0
    pairs: Literal["auto", "exhaustive", "sequential"] = "auto"
    threshold: Literal["noise", "fixed"] = "noise"
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """Mean features per photograph, verified pairs, verified matches over all pairs."""

    output: str
    mean_features: float
    pair_count: int
    match_count: int


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Find tie points.

    Features are kept per photograph and matches per pair, under the content they were made from, so that a run that was
    interrupted goes on where it was, and one with other photographs does only what is new.

    Raises
    ------
    InputError
        When the request cannot be met, or a photograph has gone, changed, or cannot be decoded.
    NotEnoughData
        When there are no two photographs, or no two that share anything.
    """
    check_limits(request.max_features, request.max_size)
    Survey.open(request.survey)  # before a lock is put into a folder that is none
    with held(request.survey, "tiepoints"):
        survey = Survey.open(request.survey)
        survey.require("createsurvey")
        photographs = survey.photographs
        if len(photographs) < 2:
            raise NotEnoughData(f"The survey {survey.folder} has {len(photographs)} photograph: tie points need two or more.")
        enhanced = _use_enhanced(request, survey, progress)
        images = [searched_image(survey, p, enhanced=enhanced, max_size=request.max_size) for p in photographs]
        cache = survey.folder.absolute() / CACHE
        found = _features(request, images, cache / "features", progress.part(0.0, 0.4))
        counts = [len(read_features(path)) for path in found]
        if min(counts) == 0:
            empty = [p.name for p, n in zip(photographs, counts, strict=True) if n == 0]
            progress.warn(f"No features were found in {some(empty)}.")
        pairs, rule, keys = _pairs(request, photographs, found, cache / "matches", progress.part(0.4, 0.7))
        sources = [Source(image, path) for image, path in zip(images, found, strict=True)]
        pairs, refined = _refine(request, sources, pairs, cache / "refined", progress.part(0.7, 0.95))
        if not pairs:
            raise NotEnoughData(
                f"No two photographs of {survey.folder} share {matching.LEAST} points: check that they overlap"
                + ("." if enhanced else ", and run strandline:enhance first.")
            )
        keypoints = (read_refined(s, path)[0] for s, path in zip(sources, refined, strict=True))
        write_database(
            survey.folder / NAME, photographs, keypoints, pairs, count=sum(counts), before=lambda: survey.forget("tiepoints")
        )
        match_count = sum(len(p.matches) for p in pairs.values())
        groups = blocks(len(photographs), pairs)
        ties = count_ties(photographs, found, pairs)
        notes = [note for note in (_apart(photographs, groups), name_weak(photographs, ties)) if note]
        for note in notes:
            progress.warn(note)
        write_report(
            survey,
            photographs,
            [image.path for image in images] if enhanced else None,
            found,
            pairs,
            ties,
            rule=rule,
            notes=notes,
            copy=request.output_html_file,
        )
        result = Result(request.survey, float(np.mean(counts)), len(pairs), match_count)
        survey.finish(
            "tiepoints",
            digest([path.stem for path in refined], keys, [p.name for p in photographs]),
            built_on=("createsurvey", "enhance") if enhanced else ("createsurvey",),
            parameters={
                "source": "enhanced" if enhanced else "original",
                "max_features": request.max_features,
                "max_size": request.max_size,
                "pairs": request.pairs,
                "threshold": request.threshold,
            },
            result={"mean_features": result.mean_features, "pair_count": len(pairs), "match_count": match_count},
        )
        _remove_strays(cache, {*found, *refined, *(cache / "matches" / f"{key}.npz" for key in keys)})
    progress.at(1.0)
    return result


def check_limits(max_features: int, max_size: int) -> None:
    """Refuse, before any work, limits under which nothing could be found.

    Raises
    ------
    InputError
        When one of them is such.
    """
    if max_features < 0:
        raise InputError(f"MAX_FEATURES={max_features} is negative: give a number, or 0 for no limit.")
    if max_size < 0 or 0 < max_size < 200:
        raise InputError(f"MAX_SIZE={max_size} is too small to find anything: give 200 or more, or 0 for full size.")


def _use_enhanced(request: Request, survey: Survey, progress: Progress) -> bool:
    """Tell whether the enhanced images are to be used, and warn when ``auto`` must do without."""
    if request.source != "auto":
        if request.source == "enhanced":
            survey.require("enhance")
        return request.source == "enhanced"
    if survey.record("enhance") is not None and not survey.is_stale("enhance"):
        return True
    why = "are stale" if survey.record("enhance") else "have not been made"
    progress.warn(f"The enhanced images {why}, so the photographs themselves are used: on sand, run strandline:enhance first.")
    return False


def _features(request: Request, images: Sequence[SearchedImage], folder: Path, progress: Progress) -> list[Path]:
    """Return the file with the features of each image, after making those that are missing."""
    parameters = [features.VERSION, request.max_features, request.threshold]
    paths = [folder / f"{digest(image.content(), parameters)}.npz" for image in images]
    missing = [i for i, path in enumerate(paths) if not path.is_file()]
    if len(missing) < len(paths):
        progress.info(f"The features of {len(paths) - len(missing)} of {len(paths)} photographs stand already.")
    calls = ((images[i], str(paths[i]), request.max_features, request.threshold) for i in missing)
    _run_all(request, _find_features, calls, len(missing), progress)
    return paths


def _find_features(image: SearchedImage, path: str, max_features: int, threshold: Literal["noise", "fixed"]) -> None:
    """Write the features of an image."""
    found = features.detect(
        image.read(), max_features=max_features, max_size=image.max_size, threshold=threshold, mask=image.read_mask()
    )
    features.write_features(Path(path), found)


def _pairs(
    request: Request, photographs: Sequence[Photograph], found: Sequence[Path], folder: Path, progress: Progress
) -> tuple[dict[Pair, PairMatches], str, list[str]]:
    """Return the verified pairs, the rule by which pairs were chosen, and the keys of all files of matches."""

    def alike(known: set[Pair], count: int) -> set[Pair]:
        descriptors = (largest(read_features(path), (p.width, p.height)) for p, path in zip(photographs, found, strict=True))
        return alike_pairs(descriptors, known, count, progress.part(0.0, 0.1))

    chosen, rule = choose_pairs(photographs, request.pairs, alike)
    cameras = [encode(provisional_camera(p)) for p in photographs]

    def key(i: int, j: int, *more: Any) -> str:
        return digest(matching.VERSION, found[i].stem, found[j].stem, cameras[i], cameras[j], *more)

    def match(wanted: dict[Pair, tuple[str, Any]], part: Progress) -> dict[Pair, PairMatches]:
        paths = {pair: folder / f"{name}.npz" for pair, (name, _) in wanted.items()}
        missing = [pair for pair, path in paths.items() if not path.is_file()]
        calls = ((str(found[i]), str(found[j]), cameras[i], cameras[j], str(paths[i, j]), wanted[i, j][1]) for i, j in missing)
        # To start workers takes longer than a few pairs.
        workers = 1 if len(missing) < _FEW and not request.scheduler else request.workers
        _run_all(replace(request, workers=workers), _match_files, calls, len(missing), part)
        result = {pair: matching.read_matches(path) for pair, path in paths.items()}
        return {pair: m for pair, m in result.items() if len(m.matches)}

    first = {(i, j): (key(i, j), None) for i, j in chosen}
    verified = match(first, progress.part(0.1, 0.9))
    sizes = [(p.width, p.height) for p in photographs]
    through = pairs_through_others({k: (len(m.matches), m.homography) for k, m in verified.items()}, sizes, _TRUSTED)
    second = {(i, j): (key(i, j, h.tolist()), h.tolist()) for i, j, h in through}
    more = match(second, progress.part(0.9, 1.0))
    names = sorted(name for name, _ in (*first.values(), *second.values()))
    text = f"{len(chosen)} pairs were compared ({rule}), and {len(second)} more that a third photograph pointed to"
    return dict(sorted({**verified, **more}.items())), text, names


def _match_files(
    first: str, second: str, camera1: dict[str, Any], camera2: dict[str, Any], path: str, homography: list[list[float]] | None
) -> None:
    """Match the features in two files and write what is found, which may be nothing."""
    a, b = read_features(Path(first)), read_features(Path(second))
    cameras = decode(Camera, camera1), decode(Camera, camera2)
    if homography is None:
        found = matching.match_pair(a, b, cameras)
    else:
        found = matching.match_predicted(a, b, cameras, np.array(homography))
    matching.write_matches(Path(path), found)


def _refine(
    request: Request, sources: Sequence[Source], pairs: dict[Pair, PairMatches], folder: Path, progress: Progress
) -> tuple[dict[Pair, PairMatches], list[Path]]:
    """Return the matches between well tied keypoints, and for each photograph the file of its refined keypoints."""
    counts = [len(read_features(s.features)) for s in sources]
    matches = {pair: m.matches for pair, m in pairs.items()}
    tracks = build_tracks(matches, {pair: m.likeness for pair, m in pairs.items()}, counts)

    refined = refine_keypoints(sources, tracks, matches, folder=folder, run=partial(_run_all, request), progress=progress)
    tied = [np.where(read_refined(s, path)[1], track, -1) for s, path, track in zip(sources, refined, tracks, strict=True)]
    kept = {}
    for (i, j), pair in pairs.items():
        inside = within_tracks(pair.matches, tied[i], tied[j])
        if inside.sum() >= matching.LEAST:
            kept[i, j] = replace(pair, matches=pair.matches[inside], likeness=pair.likeness[inside])
    return kept, refined


def _run_all(
    request: Request, function: Callable[..., None], calls: Iterable[tuple[Any, ...]], total: int, progress: Progress
) -> None:
    """Make calls of a function that returns nothing."""
    for _ in run_calls(function, calls, workers=request.workers, scheduler=request.scheduler, progress=progress, total=total):
        pass


def _apart(photographs: Sequence[Photograph], groups: list[list[int]]) -> str:
    """Return in one sentence which photographs are not tied to the rest, nothing when all are in one block."""
    if len(groups) == 1:
        return ""
    names = "; ".join(some(photographs[i].name for i in group) for group in groups[1:6])
    return (
        f"The photographs fall into {len(groups)} blocks that share no tie points, of which only the largest "
        f"({len(groups[0])} photographs) will be oriented; apart are: {names}."
    )


def _remove_strays(folder: Path, used: set[Path]) -> None:
    """Remove from the cache what this run did not use."""
    for path in folder.glob("*/*"):
        if path not in used:
            remove(path)
