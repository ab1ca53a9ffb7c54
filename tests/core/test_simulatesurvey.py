"""The step simulatesurvey: files, metadata, truth, repeatability, and what it refuses."""

import csv
import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rawpy
from numpy.testing import assert_allclose
from PIL import ExifTags, Image
from strandline.core.block import View
from strandline.core.camera import Camera
from strandline.core.contract import VectorSource
from strandline.core.errors import InputError
from strandline.core.frames import LocalFrame
from strandline.core.photographs.listing import list_photographs
from strandline.core.photographs.metadata import read_metadata
from strandline.core.simulation import sensor
from strandline.core.simulation.simulatesurvey import Request, Result, run
from strandline.core.vector import read_layer

SMALL = Request(
    output="",
    length=30.0,
    width=20.0,
    height=30.0,
    camera_width=400,
    camera_height=300,
    focal=325.0,
    forward_overlap=70.0,
    side_overlap=60.0,
    gcp_count=3,
    check_count=1,
    workers=1,
)
TINY = dataclasses.replace(SMALL, dates="one", height=20.0, camera_width=200, camera_height=200)
DAYS = ("2024-03-12", "2024-10-09")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    folder = tmp_path_factory.mktemp("simulated") / "survey"
    return folder, run(dataclasses.replace(SMALL, output=str(folder)))


def test_surveyed_points_err_by_their_sigmas(tmp_path: Path) -> None:
    run(dataclasses.replace(TINY, output=str(tmp_path / "s"), gcp_count=4, gcp_sigma_h=0.5, gcp_sigma_v=0.0, mark_sigma=0.0))
    with (tmp_path / "s" / "truth" / "targets.csv").open() as file:
        true = np.array([[float(row[k]) for k in "xyz"] for row in csv.DictReader(file)])
    layer = read_layer(VectorSource(str(tmp_path / "s" / DAYS[0] / "gcps.gpkg"), ""))
    given = np.array([[p.x, p.y, p.z] for p in layer.geometry])
    assert_allclose(given[:, 2], true[:, 2], atol=1e-3)  # half a metre aside, the ellipsoid bends by a hundredth of that
    assert 0.2 < np.std(given[:, :2] - true[:, :2]) < 1.0
    assert set(layer.fields["sigma_h"]) == {0.5}


def contents(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_folder_holds_what_a_survey_needs(made: tuple[Path, Result]) -> None:
    folder, result = made
    names = set(contents(folder))
    for day in DAYS:
        photographs = [n for n in names if n.startswith(f"{day}/jpg/")]
        assert len(photographs) == result.image_count
        # Each beside its RAW of the same name.
        assert {n.replace("/jpg/", "/raw/").replace(".jpg", ".dng") for n in photographs} == {
            n for n in names if n.startswith(f"{day}/raw/")
        }
        assert {f"{day}/gcps.gpkg", f"{day}/marks.csv", f"{day}/gcp_list.txt"} < names
    truth = ("before_dsm.tif", "after_dsm.tif", "difference.tif", "volumes.json", "volumes.csv", "cameras.json", "targets.csv")
    assert {f"truth/{name}" for name in truth} < names
    assert {"zones.gpkg", "stable.gpkg", "simulation.json", "report/simulatesurvey.html"} < names
    assert not [n for n in names if "fields" in n or ".part" in n or n.endswith(".lock")]
    assert not [p for p in folder.parent.iterdir() if p != folder]
    assert_allclose(result.gsd, 30.0 / 325.0)
    page = (folder / "report" / "simulatesurvey.html").read_text()
    # Green on dry sand: half a full well of 3839 DN above 256; sqrt(4500 + 16) electrons of noise at 2.344 a DN; 4 %.
    assert re.search(r"green</td><td[^>]*>2176<.*?>28\.67<.*?>1\.49\d<.*?>76\.7\d<", page, re.DOTALL)


def test_metadata_say_what_a_drone_says(made: tuple[Path, Result]) -> None:
    folder, _ = made
    cameras = json.loads((folder / "truth" / "cameras.json").read_text())
    frame = LocalFrame(**cameras["frame"])
    offsets = []
    for pose in cameras["views"][DAYS[0]]:
        with Image.open(folder / DAYS[0] / "jpg" / pose["image"]) as image:
            assert image.size == (400, 300)
            exif, xmp = image.getexif(), dict(re.findall(r'drone-dji:(\w+)="([^"]*)"', image.info["xmp"].decode()))
        photo, gps = exif.get_ifd(ExifTags.IFD.Exif), exif.get_ifd(ExifTags.IFD.GPSInfo)
        millimetres = float(photo[ExifTags.Base.FocalLength])
        assert_allclose(millimetres * float(photo[ExifTags.Base.FocalPlaneXResolution]) / 10, 325.0, rtol=1e-6)
        assert photo[ExifTags.Base.FocalLengthIn35mmFilm] == round(325 / 500 * 43.2666)
        assert photo[ExifTags.Base.DateTimeOriginal].startswith("2024:03:12 10:4")
        degrees = [
            sum(float(part) / 60**k for k, part in enumerate(gps[tag])) * (-1 if gps[tag - 1] in "SW" else 1)
            for tag in (ExifTags.GPS.GPSLongitude, ExifTags.GPS.GPSLatitude)
        ]
        height = float(gps[ExifTags.GPS.GPSAltitude])
        assert_allclose([float(xmp["GpsLongitude"]), float(xmp["GpsLatitude"])], degrees, atol=1e-9)
        assert_allclose(float(xmp["AbsoluteAltitude"]), height)
        assert float(xmp["RtkStdHgt"]) == 0.05
        assert float(xmp["GimbalPitchDegree"]) == -90
        assert float(xmp["GimbalYawDegree"]) in (8.0, -172.0)
        offsets.append(frame.from_wgs84(np.array([[*degrees, height]]))[0] - pose["centre"])
    # About ten photographs with a sigma of 3 and 5 cm: five sigmas for the largest, and not too good to be true.
    errors = np.array(offsets) / [0.03, 0.03, 0.05]
    assert np.abs(errors).max() < 5
    assert 0.5 < errors.std() < 1.6


@pytest.mark.parametrize("day", DAYS)
def test_marks_agree_with_poses_and_coordinates(made: tuple[Path, Result], day: str) -> None:
    folder, _ = made
    cameras = json.loads((folder / "truth" / "cameras.json").read_text())
    frame = LocalFrame(**cameras["frame"])
    camera = Camera(**{**cameras["camera"], "params": tuple(cameras["camera"]["params"])})
    views = {
        pose["image"]: View(pose["image"], camera, np.reshape(pose["rotation"], (3, 3)), np.array(pose["translation"]))
        for pose in cameras["views"][day]
    }
    layer = read_layer(VectorSource(str(folder / day / "gcps.gpkg"), "gcps"))
    assert layer.geometry is not None
    ground = {name: (p.x, p.y, p.z) for name, p in zip(layer.text("name"), layer.geometry, strict=True)}
    assert layer.text("role") == ["control"] * 3 + ["check"]
    with (folder / day / "marks.csv").open(newline="") as stream:
        marks = list(csv.DictReader(stream))
    assert {m["gcp"] for m in marks} == set(ground)
    errors = []
    for m in marks:
        local = frame.from_crs(np.array([ground[m["gcp"]]]))
        errors.append([float(m["x"]), float(m["y"])] - views[m["image"]].project(local)[0])
    # 0.3 px of a mark, and 1 cm of the ground points at 9.2 cm a pixel: 0.32 px in each direction.
    assert 0.15 < np.array(errors).std() < 0.5
    assert np.abs(errors).max() < 1.6
    lines = (folder / day / "gcp_list.txt").read_text().splitlines()
    assert lines[0] == "EPSG:32630"
    first = lines[1].split()
    # The centre of the top-left pixel is (0, 0) there.
    assert_allclose([float(first[3]) + 0.5, float(first[4]) + 0.5], [float(marks[0]["x"]), float(marks[0]["y"])], atol=1e-6)


def test_white_and_black_of_the_targets_are_in_the_photographs(made: tuple[Path, Result]) -> None:
    folder, _ = made
    with (folder / DAYS[0] / "marks.csv").open(newline="") as stream:
        for m in list(csv.DictReader(stream))[::5]:
            with Image.open(folder / DAYS[0] / "jpg" / m["image"]) as image:
                grey = np.asarray(image.convert("L"), float)
            x, y = int(float(m["x"])), int(float(m["y"]))
            patch = grey[y - 8 : y + 9, x - 8 : x + 9]
            assert np.percentile(patch, 80) - np.percentile(patch, 20) > 80


def test_jpg_is_made_of_the_raw(made: tuple[Path, Result], tmp_path: Path) -> None:
    folder, _ = made
    for path in sorted((folder / DAYS[1] / "raw").iterdir())[:2]:
        jpg = folder / DAYS[1] / "jpg" / f"{path.stem}.jpg"
        with rawpy.imread(str(path)) as raw:
            mosaic = raw.raw_image.copy()
        Image.fromarray(sensor.develop(mosaic)).save(tmp_path / "again.jpg", quality=90)
        with Image.open(tmp_path / "again.jpg") as again, Image.open(jpg) as kept:
            assert np.array_equal(np.asarray(again), np.asarray(kept))
        assert read_metadata(path.read_bytes()) == read_metadata(jpg.read_bytes())


def test_one_kind_makes_a_survey_and_both_are_refused(made: tuple[Path, Result], tmp_path: Path) -> None:
    day = made[0] / DAYS[0]
    jpg, raw = (list_photographs(day / kind, None, tmp_path) for kind in ("jpg", "raw"))
    assert [n.replace(".jpg", ".dng") for n in jpg] == raw
    with pytest.raises(InputError, match=rf"more than one file of {len(jpg)} exposures .* FILTER"):
        list_photographs(day, None, tmp_path)
    assert list_photographs(day, "*.dng", tmp_path) == [f"raw/{n}" for n in raw]
    assert list_photographs(day, "jpg/*", tmp_path) == [f"jpg/{n}" for n in jpg]


def test_truth_volumes_are_the_integral_of_the_difference(made: tuple[Path, Result]) -> None:
    folder, result = made
    with rasterio.open(folder / "truth" / "difference.tif") as file:
        change, transform = file.read(1).astype(float), file.transform
    with rasterio.open(folder / "truth" / "before_dsm.tif") as one, rasterio.open(folder / "truth" / "after_dsm.tif") as two:
        assert_allclose(two.read(1).astype(float) - one.read(1), change, atol=1e-5)
    zones = json.loads((folder / "truth" / "volumes.json").read_text())["zones"]
    by_name = {row["zone"]: row for row in zones}
    assert list(by_name) == ["dune", "berm", "foreshore", "all"]
    for key in ("erosion", "deposition", "net", "area"):
        assert_allclose(sum(by_name[z][key] for z in ("dune", "berm", "foreshore")), by_name["all"][key], rtol=1e-6)
    for row in zones:
        assert_allclose(row["deposition"] - row["erosion"], row["net"], rtol=1e-9)
    assert (result.erosion, result.deposition, result.net) == tuple(by_name["all"][k] for k in ("erosion", "deposition", "net"))
    # Cells whose centre lies in the zone, instead of shares of cells: 0.3 % and the border of a few cells.
    layer = read_layer(VectorSource(str(folder / "zones.gpkg"), "zones"))
    assert layer.geometry is not None
    import shapely

    rows, columns = np.indices(change.shape)
    x, y = transform @ (columns + 0.5, rows + 0.5)
    for name, polygon in zip(layer.text("name"), layer.geometry, strict=True):
        inside = shapely.contains_xy(polygon, x, y)
        cell = transform.a**2
        assert_allclose(inside.sum() * cell, by_name[name]["area"], rtol=2e-3)
        assert_allclose(-change[inside & (change < 0)].sum() * cell, by_name[name]["erosion"], rtol=5e-3, atol=0.01)


def test_same_seed_same_bytes_for_any_number_of_workers(made: tuple[Path, Result], tmp_path: Path) -> None:
    folder, result = made
    again = run(dataclasses.replace(SMALL, output=str(tmp_path / "b"), workers=2))
    assert dataclasses.replace(again, output="") == dataclasses.replace(result, output="")
    one, two = contents(folder), contents(tmp_path / "b")
    assert list(one) == list(two)
    assert [name for name in one if one[name] != two[name]] == []


def test_standing_simulation_is_kept_and_another_replaces_it(tmp_path: Path) -> None:
    tiny = dataclasses.replace(TINY, output=str(tmp_path / "s"), noise=0.0)
    first = run(tiny)
    assert (first.erosion, first.net) == (None, None)
    stamps = {p: p.stat().st_mtime_ns for p in (tmp_path / "s").rglob("*.jpg")}
    assert run(dataclasses.replace(tiny, output_html_file=str(tmp_path / "r.html"))) == first
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "s").rglob("*.jpg")} == stamps
    assert (tmp_path / "r.html").read_bytes() == (tmp_path / "s" / "report" / "simulatesurvey.html").read_bytes()
    before = contents(tmp_path / "s")
    run(dataclasses.replace(tiny, seed=2))
    after = contents(tmp_path / "s")
    assert list(before) == list(after)
    assert all(before[n] != after[n] for n in before if n.endswith(".jpg"))
    # Something of the user's in it: not replaced.
    (tmp_path / "s" / DAYS[0] / "survey").mkdir()
    (tmp_path / "s" / DAYS[0] / "survey" / "survey.json").write_text("{}")
    with pytest.raises(InputError, match=r"holds 2024-03-12/survey/survey\.json"):
        run(tiny)
    (tmp_path / "s" / DAYS[0] / "survey" / "survey.json").unlink()
    # A photograph lost: made again.
    next((tmp_path / "s").rglob("*.jpg")).unlink()
    run(dataclasses.replace(tiny, seed=2))
    assert contents(tmp_path / "s") == after


def test_failure_leaves_nothing_and_earlier_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from strandline.core.simulation import production

    tiny = dataclasses.replace(TINY, output=str(tmp_path / "s"))
    abandoned = tmp_path / ".part-1-s"  # of a run that was killed
    abandoned.mkdir()
    monkeypatch.setattr(production.outputs, "write_polygons", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        run(tiny)
    assert list(tmp_path.iterdir()) == []


def test_full_disk_is_one_sentence_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from strandline.core.simulation import dng

    def save_on_full_disk(path: Path, *rest: Any) -> None:
        save(Path("/dev/full") if path.stem.endswith("_0003") else path, *rest)

    save = dng.save_dng
    monkeypatch.setattr(dng, "save_dng", save_on_full_disk)
    with pytest.raises(InputError, match="the disk is full"):
        run(dataclasses.replace(TINY, output=str(tmp_path / "s")))
    assert list(tmp_path.iterdir()) == []


def test_other_folders_are_refused(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("x")
    with pytest.raises(InputError, match="not empty and holds no simulation"):
        run(dataclasses.replace(SMALL, output=str(tmp_path / "full")))
    with pytest.raises(InputError, match="is a file"):
        run(dataclasses.replace(SMALL, output=str(tmp_path / "full" / "thesis.txt")))
    assert contents(tmp_path) == {"full/thesis.txt": b"x"}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"forward_overlap": 100.0}, "FORWARD_OVERLAP is 100, but must lie between 0 and 98 %"),
        ({"side_overlap": -1.0}, "SIDE_OVERLAP"),
        ({"tilt": 45.0}, "TILT is 45, but must lie between 0 and 10 degrees"),
        ({"height": 2.0}, "to clear the dune"),
        ({"width": 1.0}, "WIDTH is 1"),
        ({"focal": 10.0}, "FOCAL is 10 px"),
        ({"camera_width": 10}, "CAMERA_WIDTH"),
        ({"contrast": 0.9}, "CONTRAST"),
        ({"noise": -0.5}, "NOISE"),
        ({"gcp_count": -1}, "GCP_COUNT"),
        ({"gcp_count": 200}, "no room for 201 targets"),
        ({"crs": "EPSG:4326"}, "projected"),
        ({"length": 5000.0, "width": 1000.0}, "more than can be rendered"),
    ],
)
def test_impossible_parameters_are_refused(tmp_path: Path, change: dict[str, object], told: str) -> None:
    with pytest.raises(InputError, match=told):
        run(dataclasses.replace(SMALL, output=str(tmp_path / "s"), **change))
    assert list(tmp_path.iterdir()) == []
