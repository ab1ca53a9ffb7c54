"""CPU time of the features of one photograph, ours and pycolmap's, of the same size and count, on one thread each.

    python tests/benchmarks/bench_features.py [photograph] [max_size]

Ours are limited to the number that pycolmap is given; a second line has no limit.
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pycolmap
from strandline.core.tiepoints.features import detect, write_features

DATA = Path(os.environ.get("STRANDLINE_DATA", Path(__file__).parents[3] / "shared" / "data"))
COUNT = 20_000


def timed(function: Callable[[], Any]) -> tuple[Any, float]:
    """Return what a call returns, and its CPU seconds."""
    start = time.process_time()
    result = function()
    return result, time.process_time() - start


def theirs(path: Path, count: int) -> int:
    """Return the number of features that pycolmap finds, with its defaults for all but size, count and threads."""
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads = 1
    options.use_gpu = False
    options.max_image_size = 1_000_000
    options.sift.max_num_features = count
    database = path.with_suffix(".db")
    pycolmap.extract_features(database, path.parent, [path.name], extraction_options=options, device=pycolmap.Device.cpu)
    with pycolmap.Database.open(database) as opened:
        return int(opened.num_keypoints())


def ours(path: Path, count: int) -> int:
    """Return the number of features that we find, kept in a file."""
    image = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
    found = detect(image, max_features=count, max_size=0)
    write_features(path.with_suffix(".npz"), found)
    return len(found)


if __name__ == "__main__":
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else DATA / "copr" / "images" / "IMG_0043.jpg"
    cv2.setNumThreads(1)
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        sys.exit(f"The photograph {path} cannot be read.")
    size = int(sys.argv[2]) if len(sys.argv) > 2 else max(image.shape)
    image = cv2.resize(image, None, fx=size / max(image.shape), fy=size / max(image.shape), interpolation=cv2.INTER_AREA)
    detect(image[:200, :200], max_features=0, max_size=0)  # compiles
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "photograph.png"
        cv2.imwrite(str(copy), image)
        every, seconds_every = timed(lambda: ours(copy, 0))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        number, seconds = timed(lambda: ours(copy, COUNT))
        other, seconds_other = timed(lambda: theirs(copy, COUNT))
    print(f"{path.name}, {image.shape[1]} x {image.shape[0]} pixels, one thread, from a file to a file")
    print(f"ours     {number:8} features {seconds:7.2f} s")
    print(f"pycolmap {other:8} features {seconds_other:7.2f} s   ratio {seconds_other / seconds:.1f}")
    print(f"ours     {every:8} features {seconds_every:7.2f} s   without a limit; peak of memory {peak:.0f} MB")
