"""CPU time of ``enhance`` per photograph beside that of reading its file, in the same run, on one thread.

    python tests/benchmarks/bench_enhance.py [photograph ...]

Without photographs it takes real ones from ../shared/data (or STRANDLINE_DATA). Reading is what ``enhance`` cannot do without:
the file's bytes, its decoding, and the sum of its channels; writing is the 8-bit image and, where there is one, its mask.
``enhance`` is to stay within three times the reading.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import shapely
from strandline.core.contract import encode
from strandline.core.files import file_digest
from strandline.core.photographs.enhancedimage import make_image
from strandline.core.photographs.enhancement import enhance_photograph
from strandline.core.photographs.masking import unmasked
from strandline.core.photographs.reading import read_channel_sum
from strandline.core.survey import Photograph

LIMIT = 3.0
REPEATS = 5
METHODS = ("bandpass", "arctan", "micmac", "equalize", "none")
SAMPLES = ("copr/images/IMG_0043.jpg", "brighton/DJI_0018.JPG", "raw/colorchart.dng", "raw/copr_0136_quarter_simulated.dng")


def cpu(function: Callable[[], object]) -> float:
    """Return the CPU seconds of a call, the least of a few after one that compiles."""
    function()
    times = []
    for _ in range(REPEATS):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


def photographs() -> list[Path]:
    """Return the files to measure."""
    if len(sys.argv) > 1:
        return [Path(name) for name in sys.argv[1:]]
    root = Path(__file__).resolve().parents[2]
    data = Path(os.environ.get("STRANDLINE_DATA", root.parent / "shared" / "data"))
    found = [data / name for name in SAMPLES if (data / name).is_file()]
    return found or sorted(data.glob("*/images/*.jpg"))[:1]


def measure(path: Path, folder: Path) -> float:
    """Print one photograph's table; return the largest ratio of the default method to reading."""
    described = Photograph(path.name, path.stat().st_size, file_digest(path), 0, 0, "")
    total = read_channel_sum(path, described, means=True)
    height, width = total.values.shape
    reading = cpu(lambda: read_channel_sum(path, described))
    print(f"{path.name}: {width} x {height}, reading {reading:.3f} s")
    shore = shapely.multipolygons([shapely.box(0, 0, width / 3, height)])
    valid = unmasked(shore, width, height)
    ratio = 0.0
    for method in METHODS:
        plain = cpu(lambda m=method: enhance_photograph(total, m))
        masked = cpu(lambda m=method: enhance_photograph(total, m, 101, valid))
        print(f"  {method:10}{plain:8.3f} s  {plain / reading:5.2f} of reading   with a mask {masked:6.3f} s")
        ratio = max(ratio, plain / reading) if method == METHODS[0] else ratio
    job = (str(path), encode(described), str(folder / f"{path.name}.tif"), METHODS[0], 101)
    for text, outline in (("", None), (" with a mask", shapely.to_wkb(shore, hex=True))):
        whole = cpu(lambda o=outline: make_image(*job, o, "key"))
        print(f"  file to file{text}: {whole:.3f} s, {whole / reading:.2f} of reading")
    return ratio


def main() -> None:
    """Measure each photograph and tell whether the limit holds."""
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as name:
        ratios = [measure(path, Path(name)) for path in photographs()]
    worst = float(np.max(ratios))
    print(f"{METHODS[0]} takes up to {worst:.2f} times the reading: {'within' if worst <= LIMIT else 'BEYOND'} {LIMIT:g}.")


if __name__ == "__main__":
    main()
