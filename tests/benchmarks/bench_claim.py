"""The claim of enhancement on simulated beaches: JPG, RAW and both enhanced, under both thresholds of detection.

    python tests/benchmarks/bench_claim.py FOLDER [SEED]

28 photographs of 1800 x 1350 pixels from 48 m, of beaches whose sand has a contrast of 4 % and of 1.2 %, with 5 control and 12
check points. It takes about half an hour of two processors; what stands in FOLDER is kept, so that an interrupted run goes on.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from strandline.core.comparison import compareinputs
from strandline.core.contract import VectorSource
from strandline.core.simulation import simulatesurvey
from strandline.core.vector import read_layer

CONTRASTS = (0.04, 0.012)
COLUMNS = ("features", "oriented", "mtp", "mtp_percent", "mmtp", "mmtp_percent", "mse", "coverage_percent")
ERRORS = ("plani", "alti", "plani_check", "alti_check")


def compared(
    folder: Path, contrast: float, threshold: Any, seed: int, size: tuple[float, float] = (50, 58)
) -> list[dict[str, Any]]:
    """Return the rows of the comparison of a simulated beach of ``size`` (length, width; m)."""
    flight = folder / f"beach-{contrast:g}-{seed}"
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
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def source(path: Path) -> VectorSource:
    """Return a file's first layer in its own CRS."""
    return VectorSource(str(path), "")


def main() -> None:
    """Print a table for each contrast and threshold."""
    folder = Path(sys.argv[1])
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 11
    for contrast in CONTRASTS:
        for threshold in ("noise", "fixed"):
            rows = compared(folder, contrast, threshold, seed)
            print(f"\ncontrast {100 * contrast:g} %, threshold {threshold}")
            print("case   " + "".join(f"{c:>17}" for c in (*COLUMNS, *ERRORS, "ratio to JPG")))
            base = rows[0]["mtp"]
            for row in rows:
                numbers = [row[c] for c in (*COLUMNS, *ERRORS)] + [row["mtp"] / base if base and row["mtp"] else None]
                print(f"{row['case']:<7}" + "".join(f"{'-' if n is None or n != n else f'{n:.3f}':>17}" for n in numbers))


if __name__ == "__main__":
    main()
