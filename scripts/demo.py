"""From the photographs of a simulated beach at two dates to volumes, through QGIS alone: what ``make demo`` runs.

    .engine/bin/python scripts/demo.py [FOLDER]

Everything goes through ``qgis_process``, as a user's own script would. What stands is used again. The last table sets the
measured volumes beside the true ones. The exit status is not 0 when a step fails.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
import shutil
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROVIDER = "strandline"
NOISE = ("QStandardPaths", "DeprecationWarning", "Problem with GRASS")  # what QGIS always says


class StepFailed(Exception):
    """A step ended with an error, whose text this is."""


class Qgis:
    """QGIS without a window, with a profile of its own, and a memory of the files it made."""

    def __init__(self, folder: Path) -> None:
        self._program = find_qgis()
        self._environment = {
            "QT_QPA_PLATFORM": "offscreen",
            "QGIS_PLUGINPATH": str(ROOT / ".build" / "plugins"),
            "QGIS_CUSTOM_CONFIG_PATH": str(ROOT / ".build" / "profile"),
            **os.environ,
        }
        self._memory = folder / "steps.json"
        self._engine = digest(*sorted((ROOT / "core").rglob("*.py")))
        enabled = Path(self._environment["QGIS_CUSTOM_CONFIG_PATH"]) / "strandline-enabled"
        if not enabled.is_file():
            self._call("plugins", "enable", PROVIDER)
            enabled.touch()

    def run(self, step: str, **parameters: object) -> dict[str, object]:
        """Run an algorithm and return its outputs."""
        print(f"  {step:<15}", end="", flush=True)
        start = time.monotonic()
        given = [f"{key}={value}" for key, value in parameters.items()]
        answer = json.loads(self._call("--json", "run", f"{PROVIDER}:{step}", "--", *given))
        print(f"{time.monotonic() - start:6.1f} s", flush=True)
        for text in answer.get("log", {}).get("warning", []):
            print(f"    ! {text}")
        return dict(answer["results"])

    def make(self, step: str, inputs: list[Path], **parameters: object) -> dict[str, object]:
        """Run an algorithm whose outputs lie outside a survey, unless it has made them from the same inputs before."""
        key = hashlib.sha256(f"{step} {sorted(parameters.items())} {digest(*inputs)} {self._engine}".encode()).hexdigest()
        memory = json.loads(self._memory.read_text()) if self._memory.is_file() else {}
        made = [str(value) for value in parameters.values() if str(value).endswith((".tif", ".gpkg", ".html"))]
        output = str(parameters["OUTPUT"])
        known = memory.get(output)
        if known and known["key"] == key and all(Path(path).is_file() for path in made):
            print(f"  {step:<15}  stands")
            return dict(known["results"])
        results = self.run(step, **parameters)
        memory[output] = {"key": key, "results": results}
        self._memory.write_text(json.dumps(memory, indent=1))
        return results

    def _call(self, *arguments: str) -> str:
        command = [self._program, *arguments]
        done = subprocess.run(command, env=self._environment, capture_output=True, text=True, check=False)
        if done.returncode:
            lines = (done.stderr + done.stdout).splitlines()
            told = [line for line in lines if line.strip() and not any(word in line for word in NOISE)]
            raise StepFailed("\n".join(dict.fromkeys(told[-30:])) or f"qgis_process ended with {done.returncode}")
        return done.stdout


def main() -> int:
    """Run the chain; return the exit status."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "demo").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    try:
        qgis = Qgis(folder)
        simulation = folder / "simulation"
        print("A beach before and after a storm")
        qgis.run("simulatesurvey", OUTPUT=simulation, HEIGHT=50)
        accuracy = {}
        days = sorted(path.name for path in simulation.iterdir() if (path / "jpg").is_dir())
        for name, day in zip(("before", "after"), days, strict=True):
            print(f"{day} ({name})")
            accuracy[name] = survey(qgis, simulation / day, folder / name)
        print("Change")
        change = difference(qgis, simulation, folder)
    except StepFailed as error:
        print(f"\n\nThe step failed:\n{error}", file=sys.stderr)
        return 1
    summary(folder, accuracy, change)
    print(f"\n{time.monotonic() - start:.0f} s in all")
    return 0


def survey(qgis: Qgis, flight: Path, folder: Path) -> dict[str, object]:
    """Take one flight from photographs to a DSM; return the accuracy of its georeferencing and surface."""
    place = folder / "survey"
    qgis.run("createsurvey", IMAGES=flight / "jpg", OUTPUT=place)
    qgis.run("enhance", SURVEY=place)
    qgis.run("tiepoints", SURVEY=place)
    oriented = qgis.run("orient", SURVEY=place)
    ground = qgis.run(
        "georeference",
        SURVEY=place,
        GCPS=flight / "gcps.gpkg",
        NAME_FIELD="name",
        ROLE_FIELD="role",
        MARKS=flight / "marks.csv",
        GCP_HEIGHTS="ellipsoidal",
        GNSS_HEIGHTS="ellipsoidal",
        RESIDUALS=folder / "residuals.gpkg",
    )
    surface = qgis.make(
        "exportdsm",
        [place / "georef.json", *sorted((place / "georeferenced").glob("*"))],
        SURVEY=place,
        OUTPUT=folder / "dsm.tif",
        PRECISION=folder / "precision.tif",
        CORRELATION=folder / "correlation.tif",
        ORTHO=folder / "ortho.tif",
    )
    return {**oriented, **ground, **surface}


def difference(qgis: Qgis, simulation: Path, folder: Path) -> dict[str, object]:
    """Compare the two DSMs; return the numbers."""
    place = folder / "change"
    place.mkdir(exist_ok=True)
    before, after = folder / "before", folder / "after"
    return qgis.make(
        "dsmdifference",
        [side / name for side in (before, after) for name in ("dsm.tif", "precision.tif")],
        BEFORE=before / "dsm.tif",
        AFTER=after / "dsm.tif",
        BEFORE_PRECISION=before / "precision.tif",
        AFTER_PRECISION=after / "precision.tif",
        ZONES=simulation / "zones.gpkg",
        STABLE=simulation / "stable.gpkg",
        OUTPUT=place / "difference.tif",
        SIGNIFICANT=place / "significant.tif",
        VOLUMES=place / "volumes.gpkg",
        OUTPUT_HTML_FILE=place / "report.html",
    )


def summary(folder: Path, accuracy: dict[str, dict[str, object]], change: dict[str, object]) -> None:
    """Print what came out beside what is true."""
    print("\nAccuracy on check points, and of the surface's matching (median, 1 sigma)")
    for name, numbers in accuracy.items():
        told = [f"{label} {centimetres(numbers.get(key))}" for label, key in SHOWN]
        print(f"  {name:<8}{numbers.get('ORIENTED_COUNT')} photographs oriented; " + ", ".join(told))
    with (folder / "simulation" / "truth" / "volumes.csv").open(newline="") as stream:
        truth = {row["zone"]: row for row in csv.DictReader(stream)}
    print("\nVolumes (m3)      measured net   sigma      true    error/sigma")
    rows = volumes(folder / "change" / "volumes.gpkg")
    rows.append({"zone": "all", "net": change.get("NET"), "sigma": change.get("NET_SIGMA")})
    for row in rows:
        net, sigma, true = row["net"], row["sigma"], float(truth[str(row["zone"])]["net"])
        if net is None:
            print(f"  {row['zone']:<14}     not known")
            continue
        ratio = f"{(float(net) - true) / float(sigma):10.1f}" if sigma else "         -"
        spread = f"{float(sigma):10.1f}" if sigma else " not known"
        print(f"  {row['zone']:<14}{float(net):14.1f}{spread}{true:10.1f}{ratio}")
    print("\nSurfaces, difference and reports")
    files = [folder / side / name for side in ("before", "after") for name in ("dsm.tif", "ortho.tif", "precision.tif")]
    files += sorted((folder / "change").glob("*.*"))
    files += [folder / "simulation" / "report" / "simulatesurvey.html", *sorted(folder.glob("*/survey/report/*.html"))]
    for path in files:
        print(f"  {os.path.relpath(path)}")


SHOWN = (("plan", "PLANI_CHECK"), ("height", "ALTI_CHECK"), ("matching", "MEDIAN_PRECISION"))


def volumes(path: Path) -> list[dict[str, object]]:
    """Return the rows of the GeoPackage of volumes, which any SQLite reads."""
    with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as database:
        database.row_factory = sqlite3.Row
        table = database.execute("SELECT table_name FROM gpkg_contents").fetchone()[0]
        return [dict(row) for row in database.execute(f'SELECT zone, net, sigma FROM "{table}"')]


def centimetres(value: object) -> str:
    """Return metres as text in centimetres."""
    return f"{100 * value:.1f} cm" if isinstance(value, float) else "not known"


def digest(*paths: Path) -> str:
    """Return a fingerprint of the files' contents."""
    state = hashlib.sha256()
    for path in paths:
        if path.is_file():
            state.update(hashlib.sha256(path.read_bytes()).digest())
    return state.hexdigest()


def find_qgis() -> str:
    """Return the qgis_process to call; the script of Debian's 3.22 of that name is broken, its program is not."""
    for name in ("qgis_process.bin", "qgis_process"):
        found = shutil.which(name)
        if found:
            return found
    raise StepFailed("qgis_process is not installed: run 'make setup'.")


if __name__ == "__main__":
    sys.exit(main())
