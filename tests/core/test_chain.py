"""The whole chain on a small simulated survey, as the door starts it: against the truth, killed, repeated, and on a full disk."""

import json
import os
import resource
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import cv2  # noqa: F401 - before pycolmap
import numpy as np
import pycolmap
import pytest
import rasterio
import shapely
from strandline.core.georef import Georef
from strandline.core.survey import Survey
from strandline.core.vector import write_layer

STEPS = ("createsurvey", "enhance", "tiepoints", "orient", "georeference", "exportdsm")
DAY = "2024-03-12"
SIMULATION = {
    "dates": "one",
    "length": 24.0,
    "width": 20.0,
    "height": 40.0,
    "forward_overlap": 70.0,
    "side_overlap": 60.0,
    "camera_width": 800,
    "camera_height": 600,
    "focal": 650.0,
    "contrast": 0.06,
    "gcp_count": 5,
    "check_count": 4,
    "workers": 1,
}
GSD = 40.0 / 650.0  # 6.2 cm on the beach
CELL = 0.25  # m
# Marks of 0.5 px in photographs a quarter of the height apart: five points leave the level known to less than a ground pixel.
LEVEL = 1.5 * GSD
# Heights are matched to a third of a pixel once the block's tilt is taken off; half leaves room for other machines.
SCATTER = 0.5 * GSD
# Of three numbers with their covariance: the 99.9 % quantile of chi2.
PLANE = 16.3


def requests(folder, simulation, workers):
    """Return the requests of all steps, for a survey and its outputs in ``folder``."""
    day, survey = simulation / DAY, {"survey": str(folder / "survey")}
    many = {**survey, "workers": workers}
    return {
        "createsurvey": {"images": str(day / "jpg"), "output": str(folder / "survey")},
        "enhance": many,
        "tiepoints": many,
        "orient": many,
        "georeference": {
            **survey,
            "gcps": {"path": str(day / "gcps.gpkg"), "layer": "gcps"},
            "name_field": "name",
            "role_field": "role",
            "sigma_h_field": "sigma_h",
            "sigma_v_field": "sigma_v",
            "marks": {"path": str(day / "marks.csv"), "layer": "marks"},
            "residuals": str(folder / "residuals.gpkg"),
        },
        "exportdsm": {
            **many,
            "resolution": CELL,
            "output": str(folder / "out" / "dsm.tif"),
            "precision": str(folder / "out" / "precision.tif"),
        },
    }


def start(folder, step, request, **options):
    """Start a step as the door does: a process group of its own, lines of JSON on standard output."""
    path = folder / f"{step}.json"
    path.write_text(json.dumps(request))
    words = [sys.executable, "-m", "strandline", step, str(path)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, **options)


def run(folder, step, request, **options):
    """Run a step to its end; return its exit status and last line."""
    with start(folder, step, request, **options) as process:
        told, _ = process.communicate(timeout=300)
    return process.returncode, json.loads(told.splitlines()[-1])


def done(folder, step, request):
    """Run a step that must succeed; return its result."""
    status, line = run(folder, step, request)
    assert status == 0, line
    return line["result"]


def members(group):
    """Return the processes of a group that live; what has ended and waits to be collected does not count."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, its_group = path.read_text().rpartition(")")[2].split()[:3]
        except OSError:
            continue
        if int(its_group) == group and state not in "ZX":
            found.append(int(path.parent.name))
    return found


def kill(folder, step, request, *, beyond, group):
    """Kill a step with SIGKILL at its first progress beyond a fraction; all its group, or only its leader.

    Returns the fraction it had come to.
    """
    with start(folder, step, request) as process:
        for text in process.stdout:
            line = json.loads(text)
            assert line["type"] != "error", line
            if line["type"] == "progress" and line["fraction"] > beyond:
                break
        else:
            pytest.fail(f"{step} ended before it was killed")
        (os.killpg if group else os.kill)(process.pid, signal.SIGKILL)
        process.stdout.read()
        process.wait()
        assert process.returncode == -signal.SIGKILL
    deadline = time.monotonic() + 10  # workers notice that their parent is gone
    while members(process.pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert members(process.pid) == []
    return line["fraction"]


def parts(folder):
    """Return what is unfinished anywhere in a folder."""
    return list(folder.rglob(".part-*"))


@pytest.fixture(scope="module")
def simulation(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chain")
    result = done(folder, "simulatesurvey", {**SIMULATION, "output": str(folder / "sim")})
    assert result["image_count"] == 8
    return folder / "sim"


@pytest.fixture(scope="module")
def whole(simulation, tmp_path_factory):
    """The chain without interruption, by one worker: its folder, requests, results and the CPU time of each step (s)."""
    folder = tmp_path_factory.mktemp("whole")
    wanted = requests(folder, simulation, 1)
    results, seconds = {}, {}
    for step in STEPS:
        before = cpu()
        results[step] = done(folder, step, wanted[step])
        seconds[step] = cpu() - before
    return folder, wanted, results, seconds


def cpu():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def read(path):
    with rasterio.open(path) as file:
        return file.read(1, masked=True).filled(np.nan), file.transform


def matches_of(survey):
    """Return what a COLMAP database holds of features and matches."""
    found = []
    with sqlite3.connect(survey / "features.db") as database:
        for table, key in (("cameras", "camera_id"), ("images", "image_id"), ("keypoints", "image_id"), ("matches", "pair_id")):
            found.append(database.execute(f"SELECT * FROM {table} ORDER BY {key}").fetchall())
        geometry = "SELECT pair_id, rows, cols, data, config, F, E, H FROM two_view_geometries ORDER BY pair_id"
        found.append(database.execute(geometry).fetchall())
    return found


def test_the_surface_is_the_true_one(simulation, whole):
    folder, _, results, _ = whole
    assert results["createsurvey"]["position_count"] == 8
    assert results["orient"]["oriented_count"] == 8
    assert results["orient"]["mse"] < 0.5  # noise of the simulated sensor and of the detector
    georeference = results["georeference"]
    assert (georeference["control_count"], georeference["check_count"]) == (5, 4)
    assert georeference["plani_check"] < GSD
    assert georeference["alti_check"] < 2 * GSD
    error, points = surface_errors(folder, simulation)
    assert len(error) * CELL**2 > 0.9 * SIMULATION["length"] * SIMULATION["width"]
    assert abs(np.median(error)) < LEVEL
    # Shift and tilt are as large as the georeferencing says that they may be, and the rest is matching.
    georef = Georef.read(Survey.open(folder / "survey"))
    local = georef.frame.from_crs(points) - georef.pivot
    design = np.column_stack([np.ones(len(local)), local[:, 1], -local[:, 0]])  # shift up, rotations about east and north
    weight = np.ones(len(error))
    for _ in range(20):  # robust, for water has no true height
        plane = np.linalg.lstsq(design * np.sqrt(weight)[:, None], error * np.sqrt(weight), rcond=None)[0]
        left = error - design @ plane
        scatter = 1.4826 * np.median(np.abs(left - np.median(left)))
        weight = 1 / np.maximum(1.0, np.abs(left) / (2 * scatter))
    assert scatter < SCATTER
    covariance = np.reshape(georef.covariance, (10, 10))[2:5, 2:5]
    assert plane @ np.linalg.solve(covariance, plane) < PLANE


def surface_errors(folder, simulation):
    """Return DSM minus truth where both are known, and the places and heights (n, 3) in the CRS.

    A cell's height is compared with the mean of the true cells of 5 cm in it.
    """
    surface, place = read(folder / "out" / "dsm.tif")
    truth, at = read(simulation / "truth" / "before_dsm.tif")
    assert place.a == CELL
    each = round(CELL / at.a)
    row, column = np.mgrid[0 : surface.shape[0], 0 : surface.shape[1]]
    west, north = place.c + column * CELL, place.f - row * CELL
    left, top = np.round((west - at.c) / at.a).astype(int), np.round((at.f - north) / at.a).astype(int)
    inside = (left >= 0) & (top >= 0) & (left + each <= truth.shape[1]) & (top + each <= truth.shape[0])
    offsets = np.arange(each)
    cells = truth[top[inside][:, None, None] + offsets[:, None], left[inside][:, None, None] + offsets]
    error = surface[inside] - cells.mean(axis=(1, 2))
    points = np.stack([west[inside] + CELL / 2, north[inside] - CELL / 2, surface[inside]], axis=1)
    return error[np.isfinite(error)], points[np.isfinite(error)].astype(float)


# Where each step is killed: well inside its work, and whether its workers are killed with it or have to notice.
KILLS = {
    "createsurvey": (-1.0, True),
    "enhance": (0.05, True),
    "tiepoints": (0.5, False),
    "orient": (0.3, True),
    "georeference": (0.25, True),
    "exportdsm": (0.3, True),
}


@pytest.fixture(scope="module")
def killed(simulation, tmp_path_factory):
    """The chain with two workers, each step killed once and run again."""
    folder = tmp_path_factory.mktemp("killed")
    wanted = requests(folder, simulation, 2)
    results = {}
    for step in STEPS:
        beyond, group = KILLS[step]
        assert kill(folder, step, wanted[step], beyond=beyond, group=group) < 1.0
        if step != "createsurvey":
            survey = Survey.open(folder / "survey")
            assert survey.record(step) is None
            assert all(survey.require(earlier) for earlier in STEPS[: STEPS.index(step)])
        results[step] = done(folder, step, wanted[step])
        assert parts(folder) == []
    return folder, results


def test_a_chain_of_killed_steps_ends_as_if_nothing_had_happened(whole, killed):
    folder, _, results, _ = whole
    again, resumed = killed
    for step in STEPS[1:]:
        numbers = [{k: v for k, v in found[step].items() if not isinstance(v, str)} for found in (results, resumed)]
        assert numbers[0] == numbers[1], step
    first, second = folder / "survey", again / "survey"
    images = sorted(p.relative_to(first) for p in (first / "enhanced").rglob("*") if p.is_file())
    assert len(images) == 8
    assert all((first / p).read_bytes() == (second / p).read_bytes() for p in images)
    assert matches_of(first) == matches_of(second)
    a, b = (pycolmap.Reconstruction(s / "model") for s in (first, second))
    assert a.num_points3D() == b.num_points3D()
    for index in a.reg_image_ids():
        poses = [m.images[index].cam_from_world().matrix() for m in (a, b)]
        assert np.abs(poses[0] - poses[1]).max() < 1e-9  # of a free frame about one unit wide: far below 1e-6 px
    names = ("dsm.tif", "precision.tif")
    for (x, at), (y, there) in ((read(folder / "out" / n), read(again / "out" / n)) for n in names):
        assert at == there
        assert np.array_equal(x, y, equal_nan=True)
    fingerprints = [{s: Survey.open(f).record(s).fingerprint for s in STEPS} for f in (first, second)]
    assert fingerprints[0] == fingerprints[1]


def test_a_finished_step_is_quick_to_run_again_and_stays_the_same(whole):
    folder, wanted, results, seconds = whole
    survey = folder / "survey"
    before = {s: Survey.open(survey).record(s).fingerprint for s in STEPS}
    files = {p: p.stat().st_mtime_ns for p in [survey / "model" / "images.bin", folder / "out" / "dsm.tif"]}
    start_cpu = cpu()
    for step in STEPS:
        assert done(folder, step, wanted[step]) == results[step]
    # What is left is starting Python six times, reading, and the report of each step.
    assert cpu() - start_cpu < 0.65 * sum(seconds.values())
    assert {s: Survey.open(survey).record(s).fingerprint for s in STEPS} == before
    assert {p: p.stat().st_mtime_ns for p in files} == files


def short_of_disk(limit):
    """Return options under which no file may grow beyond ``limit`` bytes, as on a full disk."""
    return {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))}


@pytest.mark.parametrize(
    ("step", "change"),
    [
        ("enhance", {"method": "micmac"}),
        ("tiepoints", {"max_features": 1500}),
        ("georeference", {"sigma_mark": 0.7}),
        ("exportdsm", {"resolution": 0.3}),
    ],
)
def test_a_full_disk_is_one_sentence_and_costs_no_earlier_result(whole, step, change):
    folder, wanted, _, _ = whole
    survey = folder / "survey"
    before = {s: Survey.open(survey).record(s) for s in STEPS}
    rasters = {p: p.read_bytes() for p in sorted((folder / "out").iterdir())}
    status, line = run(folder, step, {**wanted[step], **change}, **short_of_disk(30_000))
    assert status == 1, line
    assert line["type"] == "error"
    assert "disk is full" in line["text"]
    assert line["text"].count(". ") == 0
    assert {s: Survey.open(survey).record(s) for s in STEPS} == before
    assert all(Survey.open(survey).require(s) for s in STEPS)
    assert {p: p.read_bytes() for p in sorted((folder / "out").iterdir())} == rasters
    done(folder, step, wanted[step])
    assert parts(folder) == []


@pytest.mark.parametrize(
    ("step", "change", "why"),
    [
        ("enhance", {"survey": "/nowhere"}, "/nowhere is not a survey folder"),
        ("georeference", {"gcps": ("gcps.gpkg", "EPSG:32755")}, "km from the GNSS positions"),
        ("georeference", {"gcps": ("gcps.gpkg", "EPSG:2229")}, "US survey foot"),
        ("georeference", {"marks": ("unknown.csv", None)}, "in IMG_0001.jpg"),
        ("georeference", {"output_html_file": "/proc/page.html"}, "The report /proc/page.html cannot be written"),
        ("exportdsm", {"area": ("away.gpkg", None)}, "AREA lies outside"),
        ("exportdsm", {"resolution": 1e-300}, "RESOLUTION=1e-300"),
        ("exportdsm", {"resolution": 1e9}, "leaves only 1 x 1 cells"),
        ("exportdsm", {"output": "/proc/dsm.tif"}, "The raster /proc/dsm.tif cannot be written"),
        ("exportdsm", {"precision": "OUTPUT"}, "is named for two outputs"),
    ],
)
def test_bad_input_is_one_sentence_and_writes_nothing(simulation, whole, tmp_path, step, change, why):
    folder, wanted, _, _ = whole
    (tmp_path / "unknown.csv").write_text((simulation / DAY / "marks.csv").read_text().replace("20240312", "IMG"))
    (tmp_path / "gcps.gpkg").write_bytes((simulation / DAY / "gcps.gpkg").read_bytes())
    away = shapely.multipolygons([shapely.box(5e5, 4.8e6, 5e5 + 9, 4.8e6 + 9)])
    write_layer(str(tmp_path / "away.gpkg"), "away", "EPSG:32630", {"id": [1]}, [away], "MultiPolygon")
    request = dict(wanted[step])
    for key, value in change.items():
        request[key] = request["output"] if value == "OUTPUT" else value
        if isinstance(value, tuple):
            name, crs = value
            request[key] = {"path": str(tmp_path / name), "layer": name.partition(".")[0], "crs": crs}
    before = contents(folder)
    status, line = run(folder, step, request)
    assert status == 1, line
    assert why in line["text"]
    assert line["text"].count(". ") == 0
    assert contents(folder) == before


def contents(folder):
    """Return size and time of what lies in a folder, but for the requests and the lock."""
    files = [p for p in folder.rglob("*") if p.is_file() and p.parent != folder and p.name != "survey.lock"]
    return {p: (p.stat().st_size, p.stat().st_mtime_ns) for p in files}


def test_another_enhancement_makes_stale_what_was_built_on_it(whole):
    """The last test of this file, because it changes the survey that the others share."""
    folder, wanted, _, _ = whole
    done(folder, "enhance", {**wanted["enhance"], "method": "micmac"})
    survey = Survey.open(folder / "survey")
    assert [s for s in STEPS if survey.is_stale(s)] == ["tiepoints", "orient", "georeference", "exportdsm"]
    dsm = (folder / "out" / "dsm.tif").read_bytes()
    status, line = run(folder, "exportdsm", wanted["exportdsm"])
    assert status == 1
    assert "'georeference'" in line["text"]
    assert "stale" in line["text"]
    assert (folder / "out" / "dsm.tif").read_bytes() == dsm
