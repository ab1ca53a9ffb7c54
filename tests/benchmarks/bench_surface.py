"""CPU time of the surface's kernels on one processor, in nanoseconds, beside those of another implementation when one is named.

    NUMBA_NUM_THREADS=1 python tests/benchmarks/bench_surface.py [other.py]

``other.py`` must hold ``ortho``, ``zncc`` and ``sgm_dir``, with one photograph, one plane and one direction per call.
"""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Callable

import numpy as np
from strandline.core.surface.correlation import correlate
from strandline.core.surface.regularisation import aggregate
from strandline.core.surface.sampling import sample

SIDE, VIEWS, HYPOTHESES = 288, 8, 13


def cpu(function: Callable[[], object], count: int) -> float:
    """Return the CPU seconds of a call, after one that compiles."""
    function()
    start = time.process_time()
    for _ in range(count):
        function()
    return (time.process_time() - start) / count


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a photograph, a camera looking down from 48 m, and a flat surface."""
    image = (np.random.default_rng(0).random((1350, 1800)) * 255).astype(np.float32)
    matrix = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 48]])
    brown = np.array([1650.0, 1650, 900, 675, -0.045, 0.01, 1e-4, 1e-4, 0, 0, 0, 0])
    return image, matrix, brown, np.zeros((SIDE, SIDE), np.float32)


def ours() -> dict[str, float]:
    """Return nanoseconds per cell and view (sampling), and hypothesis (correlation), and direction (regularisation)."""
    image, matrix, brown, height = scene()
    cells = SIDE * SIDE
    corner = np.array([1.0, 0, 0])
    out = np.empty((VIEWS, SIDE, SIDE), np.float32)

    def take(i: int) -> None:
        sample(image, corner, matrix, brown, 4.0, -8.0, 8.0, 0.06, height, 0.1 * i, out[i])

    for i in range(VIEWS):
        take(i)
        out[i] -= out[i].mean()
    times = {"sampling": cpu(lambda: take(0), 20) / cells}
    for small, large in ((2, 2), (4, 4), (2, 4)):
        score = np.empty((SIDE - 2 * large, SIDE - 2 * large), np.float32)
        seen = np.ones((VIEWS, *score.shape), bool)
        name = f"correlation {2 * large + 1}x{2 * large + 1}" if small == large else "correlation adaptive"

        def plane(small: int = small, large: int = large, seen: np.ndarray = seen, score: np.ndarray = score) -> None:
            correlate(out, seen, small, large, 2.0, 12.0 if large > small else 0.0, score)

        times[name] = cpu(plane, 5) / cells / VIEWS
    count = np.full((SIDE, SIDE), HYPOTHESES, np.int32)
    first = np.full((SIDE, SIDE), -6, np.int32)
    offset = np.arange(cells, dtype=np.int64).reshape(SIDE, SIDE) * HYPOTHESES
    costs = np.random.default_rng(1).random(cells * HYPOTHESES).astype(np.float32)
    total = np.zeros_like(costs)
    for name, down, right in (("across", 0, 1), ("along", 1, 0), ("diagonal", 1, 1)):

        def paths(down: int = down, right: int = right) -> None:
            aggregate(costs, offset, first, count, height, 0.1, down, right, 0.1, 0.6, total)

        times[f"regularisation {name}"] = cpu(paths, 5) / cells / HYPOTHESES
    return {k: 1e9 * v for k, v in times.items()}


def theirs(path: str) -> dict[str, float]:
    """Return the other implementation's nanoseconds under our names."""
    spec = importlib.util.spec_from_file_location("other", path)
    assert spec is not None
    assert spec.loader is not None
    other = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(other)
    image, matrix, _, height = scene()
    cells = SIDE * SIDE
    out = np.empty((VIEWS, SIDE, SIDE), np.float32)

    def take(i: int) -> None:
        other.ortho(image, matrix, 1650.0, 900.0, 675.0, -0.045, 1.0, -8.0, 8.0, 0.06, height, 0.1 * i, out[i])

    for i in range(VIEWS):
        take(i)
    plane = np.empty((SIDE, SIDE), np.float32)
    costs = np.random.default_rng(1).random((HYPOTHESES, SIDE, SIDE)).astype(np.float32)
    total = np.zeros_like(costs)
    times = {"sampling": cpu(lambda: take(0), 20) / cells}
    for half in (2, 4):
        name = f"correlation {2 * half + 1}x{2 * half + 1}"
        times[name] = cpu(lambda half=half: other.zncc(out, half, 2.0, plane), 3) / cells / VIEWS  # type: ignore[misc]
    times["correlation adaptive"] = times["correlation 5x5"] + times["correlation 9x9"]
    for name, down, right in (("across", 0, 1), ("along", 1, 0), ("diagonal", 1, 1)):

        def paths(down: int = down, right: int = right) -> None:
            other.sgm_dir(costs, total, down, right, 0.1, 0.6)

        times[f"regularisation {name}"] = cpu(paths, 3) / cells / HYPOTHESES
    return {k: 1e9 * v for k, v in times.items()}


if __name__ == "__main__":
    mine = ours()
    others = theirs(sys.argv[1]) if len(sys.argv) > 1 else {}
    for name, value in mine.items():
        beside = f"   other {others[name]:6.1f}   ratio {others[name] / value:5.1f}" if name in others else ""
        print(f"{name:26} {value:6.2f} ns{beside}")
