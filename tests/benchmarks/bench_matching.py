"""Matching: CPU time per pair beside pycolmap's own, and what a survey of 1,000 photographs takes, from measured parts.

    OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1 python tests/benchmarks/bench_matching.py [folder of photographs]

All on one thread. pycolmap compares every feature with every other and verifies, ours compares the largest few thousand and then
all where the geometry allows. Four photographs in a row give six pairs.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pycolmap
from strandline.core.photographs.enhancement import enhance_photograph
from strandline.core.photographs.reading import channel_sum, decode_pixels
from strandline.core.progress import SILENT
from strandline.core.survey import Photograph, Position
from strandline.core.tiepoints.database import provisional_camera, write_database
from strandline.core.tiepoints.features import Features, detect, spread, write_features
from strandline.core.tiepoints.images import SearchedImage
from strandline.core.tiepoints.likeness import alike_pairs, largest
from strandline.core.tiepoints.matching import PairMatches, match_pair, write_matches
from strandline.core.tiepoints.pairs import choose_pairs, followers, pairs_through_others
from strandline.core.tiepoints.refinement import Source, read_refined, refine_keypoints
from strandline.core.tiepoints.tracks import build_tracks

SHARED = Path(os.environ.get("STRANDLINE_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data")
ROW = ("IMG_0055.jpg", "IMG_0058.jpg", "IMG_0061.jpg", "IMG_0064.jpg")
MANY, COUNT = 1000, 20000  # photographs and features of the survey on paper


def cpu(function: Callable[[], Any]) -> tuple[float, Any]:
    """Return the CPU seconds of a call and what it returns."""
    start = time.process_time()
    result = function()
    return time.process_time() - start, result


def peak_memory() -> float:
    """Return this process's peak (MB)."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def fewer(features: Features, photograph: Photograph, count: int) -> Features:
    """Return ``count`` of the features, the largest, spread."""
    best = spread(features.xy, features.scale, (photograph.width, photograph.height), count)
    return Features(features.xy[best], features.scale[best], features.angle[best], features.descriptors[best])


def theirs(photographs: list[Photograph], features: list[Features]) -> tuple[float, float]:
    """Return CPU seconds and verified matches per pair of pycolmap's exhaustive matching."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "features.db"
        write_database(path, photographs, (f.keypoints() for f in features), {}, count=sum(map(len, features)))
        database = pycolmap.Database.open(path)
        for i, found in enumerate(features):
            described = pycolmap.FeatureDescriptors(pycolmap.FeatureExtractorType.SIFT, found.descriptors)
            database.write_descriptors(i + 1, described)
        database.close()
        matching = pycolmap.FeatureMatchingOptions()
        matching.num_threads, matching.use_gpu = 1, False
        verification = pycolmap.TwoViewGeometryOptions()
        verification.ransac.max_error = 4.0 / 2000.0 * photographs[0].width
        seconds, _ = cpu(
            lambda: pycolmap.match_exhaustive(
                path, matching_options=matching, verification_options=verification, device=pycolmap.Device.cpu
            )
        )
        database = pycolmap.Database.open(path)
        verified = [len(g.inlier_matches) for g in database.read_two_view_geometries()[1]]
        database.close()
    return seconds / 6, sum(verified) / 6


def ours(photographs: list[Photograph], features: list[Features]) -> tuple[float, float, dict[tuple[int, int], PairMatches]]:
    """Return CPU seconds and verified matches per pair of ours, and the pairs."""
    cameras = [provisional_camera(p) for p in photographs]
    seconds, pairs = cpu(
        lambda: {(i, j): match_pair(features[i], features[j], (cameras[i], cameras[j])) for i, j in combinations(range(4), 2)}
    )
    return seconds / 6, sum(len(p.matches) for p in pairs.values()) / 6, pairs


def refinement(
    folder: Path, photographs: list[Photograph], features: list[Features], pairs: dict[tuple[int, int], PairMatches]
) -> tuple[float, float]:
    """Return CPU seconds per photograph to build tracks and refine them, and the keypoints that stay per photograph."""
    sources = []
    for photograph, found in zip(photographs, features, strict=True):
        path = folder / f"{photograph.name}.{len(found)}.npz"
        write_features(path, found)
        sources.append(Source(SearchedImage(photograph, folder / f"{photograph.name}.tif", True, None, 0), path))
    matches = {pair: m.matches for pair, m in pairs.items()}

    def run(function: Callable[..., None], calls: Any, total: int, progress: Any) -> None:
        for call in calls:
            function(*call)

    def work() -> list[Path]:
        tracks = build_tracks(matches, {pair: m.likeness for pair, m in pairs.items()}, [len(f) for f in features])
        return refine_keypoints(sources, tracks, matches, folder=folder / str(len(features[0])), run=run, progress=SILENT)

    work()  # compiles
    for path in (folder / str(len(features[0]))).glob("*"):
        path.unlink()
    seconds, files = cpu(work)
    return seconds / 4, sum(int(read_refined(s, f)[1].sum()) for s, f in zip(sources, files, strict=True)) / 4


def serpentine(count: int) -> list[Photograph]:
    """Return photographs of ten strips, 8 m apart, of a ground width of 32 m: 75 % overlap both ways."""
    length = count // 10
    places = [(k if row % 2 == 0 else length - 1 - k, row) for row in range(10) for k in range(length)]
    return [
        Photograph(
            f"{i:05d}.jpg", 1, "", 4000, 3000, "camera", focal=4000.0, relative_height=32.0, pitch=-90.0,
            position=Position(column * 8 / 111_320.0, row * 8 / 111_320.0, 32.0),
        )
        for i, (column, row) in enumerate(places)
    ]  # fmt: skip


def homographies(photographs: list[Photograph], pairs: list[tuple[int, int]]) -> dict[tuple[int, int], tuple[int, Any]]:
    """Return what verified pairs of ``serpentine`` would have: shifts by 125 pixels a metre."""
    place = np.array([(p.position.longitude, p.position.latitude) for p in photographs if p.position]) * 111_320.0 * 125
    result = {}
    for i, j in pairs:
        shift = np.eye(3)
        shift[:2, 2] = (place[i] - place[j]) * [1, -1]
        result[i, j] = (1000, shift)
    return result


def on_paper(pairs_per_photograph: float, matches: int) -> tuple[float, float]:
    """Return CPU seconds and memory (MB, beyond what stood) of tracks of a survey of MANY photographs of COUNT features."""
    before = peak_memory()
    reach = round(pairs_per_photograph)
    along = (COUNT - matches) // reach  # keypoints by which one photograph is ahead of the one before
    found = {
        (i, i + step): (np.arange(matches, dtype=np.int32)[:, None] + np.array([along * step, 0], np.int32))
        for i in range(MANY)
        for step in range(1, reach + 1)
        if i + step < MANY
    }
    likeness = {pair: np.linspace(0.8, 1.0, matches, dtype=np.float32) for pair in found}
    seconds, _ = cpu(lambda: build_tracks(found, likeness, [COUNT] * MANY))
    return seconds, peak_memory() - before


def alike(descriptors: list[Any], count: int) -> tuple[float, int]:
    """Return CPU seconds and number of pairs chosen by likeness among ``count`` photographs, jittered copies."""
    random = np.random.default_rng(0)
    copies = [(d + random.normal(0, 20, d.shape)).clip(0, 255).astype(np.uint8) for d in (descriptors * count)[:count]]
    following = followers(range(count), (1, 2, 3, 4))
    seconds, pairs = cpu(lambda: alike_pairs(copies, following, 16))
    return seconds, len(pairs | following)


def main() -> None:
    """Print the tables."""
    cv2.setNumThreads(1)
    source = Path(sys.argv[1]) if len(sys.argv) > 1 else SHARED / "copr" / "images"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        photographs, features, detection = [], [], []
        for file in ROW:
            grey, _ = enhance_photograph(channel_sum(decode_pixels((source / file).read_bytes())), "arctan", 101)
            cv2.imwrite(str(folder / f"{file}.tif"), grey)
            height, width = grey.shape
            photographs.append(Photograph(file, 1, "", width, height, "camera"))
            if not features:
                detect(grey[:600, :600], max_features=0, max_size=0)  # compiles
            seconds, found = cpu(lambda grey=grey: detect(grey, max_features=0, max_size=2000))
            features.append(found)
            detection.append(seconds)
        ours(photographs, [fewer(f, p, 2000) for f, p in zip(features, photographs, strict=True)])  # compiles
        print(f"{width} x {height} px, features sought at 2000 px in {np.mean(detection):.2f} s of CPU per photograph")
        print(
            f"{'':10}{'features':>10}{'CPU s/pair':>12}{'verified/pair':>15}{'refining, s/photograph':>24}{'kept/photograph':>17}"
        )
        row = "{:10}{:10.0f}{:12.3f}{:15.0f}"
        for count in (8000, COUNT, 0):
            some = [fewer(f, p, count) if count else f for f, p in zip(features, photographs, strict=True)]
            mean = float(np.mean([len(f) for f in some]))
            if count == 8000:
                print(row.format("pycolmap", mean, *theirs(photographs, some)))
            seconds, verified, pairs = ours(photographs, some)
            refined, kept = refinement(folder, photographs, some, pairs)
            print(row.format("ours", mean, seconds, verified) + f"{refined:24.2f}{kept:17.0f}")
            if count == COUNT:
                standing = seconds, refined, verified
                write_matches(folder / "pair.npz", pairs[0, 1])
                disk = (folder / f"{ROW[0]}.{len(some[0])}.npz").stat().st_size, (folder / "pair.npz").stat().st_size
                disk_refined = next((folder / str(len(some[0]))).glob("*")).stat().st_size
    per_pair, per_photograph, verified = standing
    print(f"\n{'photographs':>12}{'pairs':>8}{'per photograph':>16}{'CPU s to choose':>17}{'second round':>14}{'CPU s':>8}")
    for count in (MANY // 2, MANY, 2 * MANY):
        flight = serpentine(count)
        seconds, (chosen, _) = cpu(lambda flight=flight: choose_pairs(flight, "auto", lambda known, n: set()))
        known = homographies(flight, chosen)
        sizes = [(p.width, p.height) for p in flight]
        again, more = cpu(lambda known=known, sizes=sizes: pairs_through_others(known, sizes, 50))
        print(f"{count:12}{len(chosen):8}{len(chosen) / count:16.2f}{seconds:17.2f}{len(more):14}{again:8.2f}")
        if count == MANY:
            total = len(chosen) + len(more)
    print(f"\n{'photographs':>12}{'pairs':>8}{'per photograph':>16}{'CPU s to choose':>17}  without positions")
    size = photographs[0].width, photographs[0].height
    for count in (MANY // 4, MANY // 2, MANY):
        seconds, number = alike([largest(f, size) for f in features], count)
        print(f"{count:12}{number:8}{number / count:16.2f}{seconds:17.2f}")
    seconds, memory = on_paper(total / MANY, round(verified))
    print(f"\n{MANY} photographs of {COUNT} features, {total} pairs, from these parts:")
    print(f"  matching    {total * per_pair / 3600:6.2f} h of CPU")
    print(f"  refinement  {MANY * per_photograph / 3600:6.2f} h of CPU, and {seconds:.0f} s for the tracks of all")
    print(f"  memory      {memory / 1000:6.2f} GB for matches and tracks")
    print(
        f"  disk        {MANY * disk[0] / 1e9:6.2f} GB features, {total * disk[1] / 1e9:.2f} GB matches, "
        f"{MANY * disk_refined / 1e9:.2f} GB patches or refined places, "
        f"{(MANY * COUNT * 16 + 2 * total * verified * 8) / 1e9:.2f} GB features.db"
    )


if __name__ == "__main__":
    main()
