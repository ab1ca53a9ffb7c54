"""Verified matches per pair on a real dune, plain and enhanced, and the CPU seconds of all of it on one thread.

    OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1 python tests/benchmarks/bench_pairs.py

Eight photographs of 2000 pixels, the 13 pairs up to two apart, no limit on features; a match is verified when it is within 4
pixels of its pair's geometry. MicMac's SIFT gave 8,700 plain (181 s) and 13,800 with its filter (490 s) on the same.
"""

from __future__ import annotations

import os
import time
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from strandline.core.photographs.enhancement import enhance_photograph
from strandline.core.photographs.inspection import Inspection, inspect
from strandline.core.photographs.reading import read_channel_sum
from strandline.core.tiepoints.database import provisional_camera
from strandline.core.tiepoints.features import detect
from strandline.core.tiepoints.matching import match_pair

DATA = Path(os.environ.get("STRANDLINE_DATA", Path(__file__).parents[3] / "shared" / "data"))
NUMBERS = (43, 46, 49, 52, 55, 58, 61, 64)
METHODS: tuple[Any, ...] = ("none", "arctan", "micmac", "bandpass")


def main() -> None:
    """Print a line for each method."""
    cv2.setNumThreads(1)
    paths = [DATA / "copr" / "images" / f"IMG_00{n}.jpg" for n in NUMBERS]
    inspected = [inspect(str(p), p.name) for p in paths]
    photographs = [i.photograph for i in inspected if isinstance(i, Inspection)]
    cameras = [provisional_camera(p) for p in photographs]
    sums = [read_channel_sum(path, p, means=True) for path, p in zip(paths, photographs, strict=True)]
    small = detect(np.zeros((200, 200), np.uint8), max_features=0, max_size=0)
    match_pair(small, small, (cameras[0], cameras[0]))  # compiles
    print("method       features  verified per pair    CPU s")
    for method in METHODS:
        start = time.process_time()
        features = [detect(enhance_photograph(s, method)[0], max_features=0, max_size=2000) for s in sums]
        pairs = [(i, j) for i, j in combinations(range(len(paths)), 2) if j - i <= 2]
        verified = [len(match_pair(features[i], features[j], (cameras[i], cameras[j])).matches) for i, j in pairs]
        seconds = time.process_time() - start
        print(f"{method:<10} {np.mean([len(f) for f in features]):>10.0f} {np.mean(verified):>18.0f} {seconds:>8.1f}")


if __name__ == "__main__":
    main()
