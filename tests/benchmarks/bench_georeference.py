"""Georeferencing of simulated flights: errors against the truth, whether sigmas are true, what is named, and how long it takes.

    python tests/benchmarks/bench_georeference.py [SEEDS]
    python tests/benchmarks/bench_georeference.py --rendered FOLDER [SEEDS]

28 photographs from 48 m, ground pixel 2.9 cm, marks of 0.25 px, ground points of 7 mm and 10 mm, RTK of 3 cm, and a lens that is
not known to the adjustment. The first form draws tie points (0.3 px) without photographs, in some minutes; the second renders
beaches of 1.2 % contrast as RAW and takes them through enhancement, tie points and orientation, which takes four minutes of a
processor a seed. What stands in FOLDER is kept.
"""

from __future__ import annotations

import csv
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "core"))

from blocks import Flown, Scene, flown
from strandline.core.contract import VectorSource
from strandline.core.orientation import georeference, interior, orient
from strandline.core.orientation.domes import dome_of
from strandline.core.orientation.solution import Solution
from strandline.core.photographs import createsurvey, enhance
from strandline.core.simulation import simulatesurvey
from strandline.core.simulation.flight import lens
from strandline.core.tiepoints import tiepoints
from strandline.core.vector import read_layer

Array = NDArray[np.float64]
GSD = 48.0 / 1650.0


def rms(values: Array) -> Array:
    """Return the root mean squares of the columns."""
    return np.asarray(np.sqrt(np.nanmean(np.square(values), axis=0)))


def row(label: str, scene: Scene, seeds: range, solve: Callable[[Flown], Solution] | None = None) -> None:
    """Print errors, ratios to predicted sigmas, and how many runs named something."""
    errors, surveyed, ratios, left_out, middle, named, domes, started = [], [], [], [], [], 0, 0, time.perf_counter()
    for seed in seeds:
        flight = flown(replace(scene, seed=seed), calibration=None)
        solution = solve(flight) if solve else flight.adjusted()
        check = np.array([p.check for p in flight.points])
        errors.append(flight.truth_errors(solution))
        surveyed.append(solution.errors[check])
        assert solution.predicted is not None
        ratios.append(solution.errors[check] / solution.predicted[check])
        left_out.append((solution.loo / solution.loo_sigma)[~check])
        middle.append(np.sqrt(solution.common.uncertainty(solution.common.pivot[None])[0, 2, 2]))
        named += bool(solution.blunders or solution.wrong_marks or solution.gnss_blunders)
        dome = dome_of(solution, flight.gnss)
        domes += dome is not None and dome.significant
    true, given = rms(np.concatenate(errors)), rms(np.concatenate(surveyed))
    z, loo = rms(np.concatenate(ratios)), np.concatenate(left_out)
    print(
        f"{label:34s}{np.hypot(*true[:2]) / GSD:7.2f}{true[2] / GSD:7.2f}{np.hypot(*given[:2]) / GSD:9.2f}{given[2] / GSD:7.2f}"
        f"{100 * np.mean(middle):9.1f}   {z[0]:5.2f}{z[1]:5.2f}{z[2]:5.2f}   {_triple(loo)}{named:7d}{domes:6d}"
        f"{(time.perf_counter() - started) / len(seeds):8.1f}",
        flush=True,
    )


def _triple(values: Array) -> str:
    return "".join(f"{v:5.2f}" for v in rms(values)) if len(values) and np.isfinite(values).any() else "    -    -    -"


def drawn(seeds: range) -> None:
    """Print the table of blocks without photographs."""
    print(
        f"{len(seeds)} seeds; errors in ground pixels of {100 * GSD:.1f} cm, against the truth and surveyed check points;\n"
        "mid: predicted sigma of heights in the block's middle (cm); z: RMS of error over predicted sigma (E, N, U);\n"
        "runs in which something was named, and in which a dome was told; seconds per run"
    )
    print(
        f"{'':34s}{'plan':>7}{'height':>7}{'plan':>9}{'height':>7}{'mid':>9}{'z check':>18}{'z left out':>18}{'named':>7}"
        f"{'dome':>6}{'s':>8}"
    )
    scene = Scene()
    row("5 control points", scene, seeds)
    row("1 control point, GNSS off by 1 m", replace(scene, control=1, bias=(0.6, -0.5, 0.6)), seeds)
    row("RTK alone, tilts of 2 degrees", replace(scene, control=0, checks=17, relief=1.5), seeds)
    row("RTK alone, gimballed over flat sand", replace(scene, control=0, checks=17, tilt=0.5, relief=0.3), seeds)
    true = interior.calibrated(lens(*scene.size, scene.focal), lens(*scene.size, scene.focal), np.eye(8) * 1e-12)
    row(
        "  the same, calibration of another survey", replace(scene, control=0, checks=17, tilt=0.5, relief=0.3), seeds,
        lambda flight: flight.adjusted(true),
    )  # fmt: skip
    row("a mark off by 30 px", replace(scene, wrong_mark=30.0), seeds)
    row("a point off by 0.5 m in plan", replace(scene, wrong_gcp=0.5), seeds)
    row("a point off by 0.5 m in height", replace(scene, wrong_height=0.5), seeds)
    attainable(scene)
    fixed(seeds)
    large()


def attainable(scene: Scene) -> None:
    """Print what the check points' own survey and marks leave, and what the covariance of the adjustment predicts beside it.

    With weights that are true the latter is the bound of Cramer and Rao: no unbiased adjustment of the same data does better.
    """
    flight = flown(scene)
    check = np.array([p.check for p in flight.points])
    solution = flight.adjusted()
    assert solution.predicted is not None
    for label, sigma in (("their survey and marks alone", solution.sigmas), ("predicted, the bound", solution.predicted)):
        own = rms(sigma[check])
        print(f"at surveyed check points, {label}: {np.hypot(*own[:2]) / GSD:.3f} plan, {own[2] / GSD:.3f} height")


def fixed(seeds: range) -> None:
    """Print how often a calibration that is held, and wrong or right, raises the alarm of a dome."""
    scene = Scene(control=5, checks=12)
    good = lens(*scene.size, scene.focal)
    values = list(good.params)
    values[4] -= 0.002  # k1: five centimetres
    for label, camera in (("wrong", replace(good, params=tuple(values))), ("right", good)):
        alarms, rises = 0, []
        for seed in seeds:
            flight = flown(replace(scene, seed=seed), calibration=camera)
            dome = dome_of(flight.adjusted(interior.held()), flight.gnss)
            alarms += dome is not None and dome.significant
            rises.append(dome.amplitude if dome else np.nan)
        print(f"calibration held, {label}: dome of {100 * np.mean(rises):+.1f} cm told in {alarms} of {len(seeds)} runs")


def large() -> None:
    """Print time and memory of a large block."""
    scene = Scene(length=250.0, width=250.0, points=1500, control=9, checks=9)
    flight = flown(scene)
    started = time.perf_counter()
    solution = flight.adjusted(compare=True)
    spent = time.perf_counter() - started
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    error = rms(flight.truth_errors(solution))
    print(
        f"{len(solution.block.views)} photographs, {len(solution.block.points)} tie points: {spent:.0f} s, {memory:.1f} GB at "
        f"most; check points {np.hypot(*error[:2]) / GSD:.2f} and {error[2] / GSD:.2f} pixels off"
    )


def rendered(folder: Path, seeds: range) -> None:
    """Print the errors of whole chains from enhanced RAW photographs."""
    true, given, ratios, left_out = [], [], [], []
    for seed in seeds:
        survey, request = _survey(folder, seed)
        result = georeference.run(request)
        layer = read_layer(VectorSource(request.residuals or "", "residuals"))
        check = np.array([r.startswith("check") for r in layer.text("role")])
        errors = np.column_stack([layer.numbers(c) for c in ("dE", "dN", "dU")])
        with (folder / f"seed{seed}" / "truth" / "targets.csv").open() as file:
            truth = {r["name"]: [float(r[k]) for k in "xyz"] for r in csv.DictReader(file)}
        assert layer.geometry is not None
        places = np.array([[p.x, p.y, p.z] for p in layer.geometry])
        true.append((errors + places - [truth[n] for n in layer.text("name")])[check])
        given.append(errors[check])
        sigma = np.column_stack([layer.numbers(c) for c in ("sigma_dE", "sigma_dN", "sigma_dU")])
        ratios.append((errors / sigma)[check])
        loo = np.column_stack([layer.numbers(c) for c in ("loo_dE", "loo_dN", "loo_dU")])
        left_out.append((loo / np.column_stack([layer.numbers("loo_sigma_h")] * 2 + [layer.numbers("loo_sigma_v")]))[~check])
        print(seed, result.plani_check, result.alti_check, flush=True)
    print(f"{len(seeds)} rendered beaches, 5 control points, {len(np.concatenate(given))} check points")
    for label, values in (("against the truth", true), ("against their survey", given)):
        e = rms(np.concatenate(values)) / GSD
        print(f"  check points {label}: {np.hypot(*e[:2]):.2f} plan, {e[2]:.2f} height (ground pixels)")
    z, loo = _triple(np.concatenate(ratios)), _triple(np.concatenate(left_out))
    print(f"  RMS of error over predicted sigma (E, N, U): check points {z}, left out {loo}")


def _survey(folder: Path, seed: int) -> tuple[Path, georeference.Request]:
    beach = folder / f"seed{seed}"
    simulatesurvey.run(
        simulatesurvey.Request(
            str(beach), dates="one", length=50, width=58, height=48, camera_width=1800, camera_height=1350, focal=1650,
            contrast=0.012, tilt=2, gnss_sigma_h=0.03, gnss_sigma_v=0.03, gcp_sigma_h=0.007, gcp_sigma_v=0.010, mark_sigma=0.25,
            gcp_count=5, check_count=12, seed=seed, workers=1,
        )
    )  # fmt: skip
    (date,) = beach.glob("????-*")
    survey = folder / f"seed{seed}-survey"
    createsurvey.run(createsurvey.Request(images=str(date / "raw"), output=str(survey)))
    enhance.run(enhance.Request(survey=str(survey)))
    tiepoints.run(tiepoints.Request(survey=str(survey)))
    orient.run(orient.Request(survey=str(survey)))
    options: dict[str, Any] = {"name_field": "name", "role_field": "role", "sigma_h": 0.007, "sigma_v": 0.010, "sigma_mark": 0.25}
    return survey, georeference.Request(
        str(survey), VectorSource(str(date / "gcps.gpkg"), ""), marks=VectorSource(str(date / "marks.csv"), ""),
        residuals=str(folder / f"seed{seed}.gpkg"), **options,
    )  # fmt: skip


def main() -> None:
    """Run what is asked for."""
    if sys.argv[1:2] == ["--rendered"]:
        rendered(Path(sys.argv[2]), range(101, 101 + int(sys.argv[3] if len(sys.argv) > 3 else 20)))
    else:
        drawn(range(1, 1 + int(sys.argv[1] if len(sys.argv) > 1 else 20)))


if __name__ == "__main__":
    main()
