"""The claim of enhancement on simulated beaches: JPG, RAW and both enhanced, under both thresholds of detection.

    python tests/benchmarks/bench_claim.py FOLDER [SEED] [--small] [--noise | --fixed]

28 photographs of 1800 x 1350 pixels from 48 m, of beaches whose sand has a contrast of 4 % and of 1.2 %, with 5 control and 12
check points. It takes about half an hour of two processors; what stands in FOLDER is kept, so that an interrupted run goes on.
With --small it takes six photographs of each beach.

Check points carry the noise of their survey and of their marks, which is the same in all cases and larger than what they differ
by. So the truth of the simulation is asked too, without control: the model is laid on the true camera centres, and ``centres``
(mm) is the root mean square of what is left there. Tie points are compared with the true surface in cells of 5 m: ``shape``
(mm) is the root mean square of the cells' medians after the best plane, what the block is bent by; ``height`` (mm) the
normalised median deviation of single points from their cell's median, what the noise of the photographs leaves.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from scipy.ndimage import map_coordinates
from strandline.core.comparison import compareinputs
from strandline.core.contract import VectorSource, decode
from strandline.core.frames import LocalFrame
from strandline.core.orientation.similarity import umeyama
from strandline.core.orientation.sparse import read_block
from strandline.core.simulation import simulatesurvey
from strandline.core.vector import read_layer

CONTRASTS = (0.04, 0.012)
COLUMNS = ("features", "oriented", "mtp", "mtp_percent", "mmtp", "mmtp_percent", "mse", "coverage_percent")
ERRORS = ("plani", "alti", "plani_check", "alti_check")
TRUE = ("centres", "height", "shape")
LARGE = (50, 58)  # m of shore and across it
SMALL = (20, 24)  # m of shore: six photographs
_CELL = 5.0  # m
_FEW = 50  # tie points below which a cell tells nothing


def compared(folder: Path, contrast: float, threshold: Any, seed: int, size: tuple[float, float] = LARGE) -> list[dict[str, Any]]:
    """Return the rows of the comparison of a simulated beach of ``size`` (length, width; m)."""
    flight = folder / f"{'beach' if size == LARGE else 'small'}-{contrast:g}-{seed}"
    simulatesurvey.run(
        simulatesurvey.Request(
            str(flight), dates="one", length=size[0], width=size[1], height=48, camera_width=1800, camera_height=1350, focal=1650,
            contrast=contrast, tilt=2, gcp_count=5, check_count=12, seed=seed,
        )
    )  # fmt: skip
    (date,) = flight.glob("????-*")
    table = folder / f"{flight.name}-{threshold}.gpkg"
    if not table.is_file():
        compareinputs.run(
            compareinputs.Request(
                jpg=str(date / "jpg"), raw=str(date / "raw"), gcps=source(date / "gcps.gpkg"), name_field="name",
                role_field="role", marks=source(date / "marks.csv"), threshold=threshold,
                surveys=str(folder / table.stem), table=str(table), output_html_file=str(table.with_suffix(".html")),
            )
        )  # fmt: skip
    columns = read_layer(source(table)).fields
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    return [row | true_errors(folder / table.stem / f"survey-{row['case']}" / "model", flight) for row in rows]


def true_errors(model: Path, flight: Path) -> dict[str, float | None]:
    """Return how far (mm) an oriented block, laid on the true camera centres, lies from the simulated truth."""
    if not model.is_dir():
        return dict.fromkeys(TRUE)
    block = read_block(model)
    told = json.loads((flight / "truth" / "cameras.json").read_text(encoding="utf-8"))
    frame = decode(LocalFrame, told["frame"])
    centres = {Path(v["image"]).stem: v["centre"] for views in told["views"].values() for v in views}
    true = np.array([centres[Path(v.name).stem] for v in block.views])
    found = np.array([v.centre for v in block.views])
    laid = umeyama(found, true)
    places = frame.to_crs(laid.apply(block.points))
    with rasterio.open(flight / "truth" / "before_dsm.tif") as surface:
        column, row = ~surface.transform * (places[:, 0], places[:, 1])
        heights = map_coordinates(surface.read(1), [row - 0.5, column - 0.5], order=1, cval=np.nan)
    error = places[:, 2] - heights
    places, error = places[np.isfinite(error)], error[np.isfinite(error)]
    cells = np.unique((places[:, :2] // _CELL).astype(int), axis=0, return_inverse=True)[1].ravel()
    members = [np.flatnonzero(cells == k) for k in range(cells.max() + 1)]
    members = [m for m in members if len(m) >= _FEW]
    middle = np.array([np.median(error[m]) for m in members])
    at = np.array([places[m, :2].mean(axis=0) for m in members])
    plane = np.column_stack([at - at.mean(axis=0), np.ones(len(at))])
    loose = np.concatenate([error[m] - c for m, c in zip(members, middle, strict=True)])
    bent = middle - plane @ np.linalg.lstsq(plane, middle)[0]
    return {
        "centres": 1000 * float(np.sqrt(((laid.apply(found) - true) ** 2).sum(axis=1).mean())),
        "height": 1000 * 1.4826 * float(np.median(np.abs(loose))),
        "shape": 1000 * float(np.sqrt((bent**2).mean())),
    }


def source(path: Path) -> VectorSource:
    """Return a file's first layer in its own CRS."""
    return VectorSource(str(path), "")


def main() -> None:
    """Print a table for each contrast and threshold."""
    asked = [a for a in sys.argv[1:] if not a.startswith("--")]
    thresholds = [t for t in ("noise", "fixed") if f"--{t}" in sys.argv] or ["noise", "fixed"]
    folder = Path(asked[0])
    seed = int(asked[1]) if len(asked) > 1 else 11
    for contrast in CONTRASTS:
        for threshold in thresholds:
            size = SMALL if "--small" in sys.argv else LARGE
            rows = compared(folder, contrast, threshold, seed, size)
            print(f"\ncontrast {100 * contrast:g} %, threshold {threshold}")
            print("case   " + "".join(f"{c:>17}" for c in (*COLUMNS, *ERRORS, *TRUE, "ratio to JPG")))
            base = rows[0]["mtp"]
            for row in rows:
                numbers = [row[c] for c in (*COLUMNS, *ERRORS, *TRUE)] + [row["mtp"] / base if base and row["mtp"] else None]
                print(f"{row['case']:<7}" + "".join(f"{'-' if n is None or n != n else f'{n:.3f}':>17}" for n in numbers))


if __name__ == "__main__":
    main()
