"""The same surface to the bit: by 1, 2 and 8 processes, by a Dask cluster, and by a run that was killed and went on.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/bench_resume.py SURVEY [RESOLUTION]

The survey is copied. Dask takes part when its package ``distributed`` is installed. Ends with 1 when anything differs.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import laspy
import numpy as np
import rasterio
from strandline.core.contract import encode
from strandline.core.surface.exportdsm import Request, run
from strandline.core.survey import Survey

RASTERS = ("output", "precision", "correlation", "views", "filled", "ortho")


def copied(source: Path, folder: Path) -> Path:
    """Return a copy of a survey, without what the step left in it, whose photographs stay where they are."""
    target = folder / "survey"
    shutil.rmtree(target, ignore_errors=True)
    keep = shutil.ignore_patterns("dense", "enhanced", "cache", "report", "features.db")
    shutil.copytree(source, target, ignore=keep)
    content = json.loads((target / "survey.json").read_text())
    content["images"] = str(Survey.open(source).images)
    content["steps"].pop("exportdsm", None)
    (target / "survey.json").write_text(json.dumps(content))
    return target


def request(survey: Path, out: Path, resolution: float, **options: object) -> Request:
    """Return a request for all outputs."""
    out.mkdir(exist_ok=True)
    files = {name: str(out / f"{name}.tif") for name in RASTERS}
    return Request(str(survey), resolution=resolution, fill=1.0, points=str(out / "points.laz"), **files, **options)  # type: ignore[arg-type]


def digest(out: Path) -> str:
    """Return a digest of all that the outputs hold."""
    total = hashlib.blake2b(digest_size=8)
    for name in RASTERS:
        with rasterio.open(out / f"{name}.tif") as file:
            total.update(file.read().tobytes())
    cloud = laspy.read(out / "points.laz")
    for layer in (cloud.X, cloud.Y, cloud.Z, cloud.red, cloud["sigma"]):
        total.update(np.ascontiguousarray(layer).tobytes())
    return total.hexdigest()


def killed(survey: Path, out: Path, resolution: float, tiles: int) -> None:
    """Start a run in another process and kill it when so many tiles of the finest level stand."""
    asked = out / "request.json"
    out.mkdir(exist_ok=True)
    asked.write_text(json.dumps(encode(request(survey, out, resolution, workers=2))))
    command = [sys.executable, "-m", "strandline", "exportdsm", str(asked)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True) as process:
        while process.poll() is None and len(list((survey / "dense").glob("*/level0/*.npz"))) < tiles:
            time.sleep(0.05)
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    left = [path.name for path in out.iterdir() if path.name.endswith((".tif", ".laz")) and not path.name.startswith(".part-")]
    assert not left, f"a killed run left {left}"
    asked.unlink()


def main() -> int:
    """Run all and compare."""
    source, resolution = Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 0.1
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder)

        def made(name: str, survey: Path, **options: object) -> None:
            run(request(survey, base / name, resolution, **options))
            found[name] = digest(base / name)
            print(f"{name:20s} {found[name]}", flush=True)

        for workers in (1, 2, 8):
            made(f"{workers} processes", copied(source, base), workers=workers)
        survey = copied(source, base)
        killed(survey, base / "killed", resolution, 2)
        made("killed", survey, workers=1)
        try:
            from distributed import LocalCluster
        except ImportError:
            print("Dask is not installed: left out.")
        else:
            with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
                made("Dask", copied(source, base), scheduler=cluster.scheduler_address)
    alike = len(set(found.values())) == 1
    print("all alike" if alike else "they differ")
    return 0 if alike else 1


if __name__ == "__main__":
    sys.exit(main())
