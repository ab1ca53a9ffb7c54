"""The steps tiepoints and orient on reduced real photographs: results, resuming, refusals."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import laspy
import numpy as np
import pycolmap
import pytest
from strandline.core.errors import InputError, NotEnoughData
from strandline.core.orientation import orient
from strandline.core.orientation.mapping import read_network
from strandline.core.orientation.sparse import read_block
from strandline.core.photographs import createsurvey, enhance
from strandline.core.progress import Progress, Silent
from strandline.core.survey import Survey
from strandline.core.tiepoints import tiepoints

DATA = Path(os.environ.get("STRANDLINE_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data")
SAND = ["copr/images/IMG_0058.jpg", "copr/images/IMG_0061.jpg", "copr/images/IMG_0064.jpg", "copr/images/IMG_0067.jpg"]
SHORE = ["brighton/images/DJI_0028.JPG", "brighton/images/DJI_0029.JPG"]


class Listener(Silent):
    def __init__(self):
        self.told, self.warned = [], []

    def message(self, text, *, warning):
        (self.warned if warning else self.told).append(text)


def reduce(folder, names, factor=0.25):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        pixels = cv2.imread(str(DATA / name), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        assert pixels is not None, f"the shared data are missing: {DATA / name}"
        small = cv2.resize(pixels, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(folder / f"{Path(name).stem}.jpg"), small, [cv2.IMWRITE_JPEG_QUALITY, 95])


def make(folder, names, enhanced=True):
    reduce(folder / "images", names)
    survey = folder / "survey"
    createsurvey.run(createsurvey.Request(str(folder / "images"), str(survey)))
    if enhanced:
        enhance.run(enhance.Request(str(survey), window=51, workers=1))
    return survey


def tie(survey, listener=None, **more):
    return tiepoints.run(
        tiepoints.Request(str(survey), **{"max_features": 4000, "workers": 1, **more}), Progress(listener or Silent())
    )


def turn(survey, listener=None, **more):
    return orient.run(orient.Request(str(survey), **more), Progress(listener or Silent()))


def pairs_of(survey):
    database = pycolmap.Database.open(survey / "features.db")
    try:
        ids, geometries = database.read_two_view_geometries()
        return {int(i): np.array(g.inlier_matches) for i, g in zip(ids, geometries, strict=True)}
    finally:
        database.close()


@pytest.fixture(scope="module")
def sand(tmp_path_factory):
    """A survey of four photographs of sand, tied and oriented, and what the steps returned."""
    folder = tmp_path_factory.mktemp("sand")
    survey = make(folder, SAND)
    tied = tie(survey, output_html_file=str(folder / "tie.html"))
    turned = turn(survey, tie_points=str(folder / "points.laz"), output_html_file=str(folder / "turn.html"))
    return folder, survey, tied, turned


def test_sand_is_tied(sand):
    folder, survey, tied, _ = sand
    assert 2000 < tied.mean_features <= 4000
    assert tied.pair_count == 6
    assert tied.match_count == sum(len(m) for m in pairs_of(survey).values()) > 4000
    page = (folder / "tie.html").read_text(encoding="utf-8")
    assert page == (survey / "report" / "tiepoints.html").read_text(encoding="utf-8")
    assert page.count("<img") == 8  # coverage in two rows, matrix, histograms, three photographs and a detail
    assert "IMG_0061.jpg" in page


def test_sand_is_oriented(sand):
    folder, survey, _, turned = sand
    assert turned.oriented_count == 4
    # At a quarter of the size about half of 2,700 features are tie points.
    assert turned.mtp > 1000
    assert turned.mtp > turned.mmtp > 500
    assert turned.mtp_percent > 90
    assert turned.mmtp_percent > 90
    assert 0.01 < turned.mse < 0.1  # least-squares matching holds some hundredths of a pixel
    block = read_block(survey / "model")
    assert [v.name for v in block.views] == [f"IMG_00{n}.jpg" for n in (58, 61, 64, 67)]
    assert {v.camera.model for v in block.views} == {"OPENCV"}
    # The residuals of the model on disk are those that were told.
    off = []
    model = pycolmap.Reconstruction(survey / "model")
    for image in model.images.values():
        seen = [p for p in image.points2D if p.has_point3D()]
        off += [image.project_point(model.points3D[p.point3D_id].xyz) - p.xy for p in seen]
    assert np.sqrt(np.mean(np.sum(np.square(off), axis=1))) == pytest.approx(turned.mse, rel=0.02)
    assert len(off) / 4 == pytest.approx(turned.mtp * turned.mtp_percent / 100, rel=0.02)
    cloud = laspy.read(folder / "points.laz")
    assert len(cloud.points) == len(block.points)
    assert np.abs(np.asarray(cloud.xyz) - block.points).max() < 1e-5
    page = (folder / "turn.html").read_text(encoding="utf-8")
    assert page.count("<img") == 9  # residuals and their field, rays, three clouds, the barest photograph, coverage in two rows
    assert "OPENCV" in page


def test_running_again_is_the_same_and_keeps_what_stands(sand, tmp_path):
    folder, survey, tied, turned = sand
    before = Survey.open(survey)
    features = {p: p.stat().st_mtime_ns for p in (survey / "cache").glob("*/*.npz")}
    model = (survey / "model" / "points3D.bin").read_bytes()
    listener = Listener()
    assert tie(survey, listener) == tied
    assert "4 of 4" in listener.told[0]
    assert {p: p.stat().st_mtime_ns for p in (survey / "cache").glob("*/*.npz")} == features
    listener = Listener()
    again = turn(survey, listener, tie_points=str(tmp_path / "p.laz"), output_html_file=str(tmp_path / "t.html"))
    assert "already" in listener.told[0]
    assert again.mse == turned.mse
    assert (tmp_path / "p.laz").is_file()
    assert (tmp_path / "t.html").is_file()
    after = Survey.open(survey)
    for step in ("tiepoints", "orient"):
        assert after.record(step).fingerprint == before.record(step).fingerprint
        assert not after.is_stale(step)
    assert (survey / "model" / "points3D.bin").read_bytes() == model


def test_two_workers_give_the_same(sand, tmp_path):
    survey = make(tmp_path, SAND)
    tie(survey, workers=2)
    expected, found = pairs_of(sand[1]), pairs_of(survey)
    assert expected.keys() == found.keys()
    assert all(np.array_equal(expected[i], found[i]) for i in expected)
    assert Survey.open(survey).record("tiepoints").fingerprint == Survey.open(sand[1]).record("tiepoints").fingerprint
    turned = turn(survey)
    assert turned.mse == sand[3].mse
    assert (survey / "model" / "points3D.bin").read_bytes() == (sand[1] / "model" / "points3D.bin").read_bytes()


@pytest.mark.skipif(os.name == "nt", reason="kills by signal")
def test_a_killed_run_goes_on_where_it_was(sand, tmp_path):
    survey = make(tmp_path, SAND)
    code = f"from strandline.core.tiepoints import tiepoints as t;t.run(t.Request({str(survey)!r}, max_features=4000, workers=1))"
    for folder, files in (("features", 2), ("refined", 5)):  # four files of patches come before those of refined keypoints
        process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
        while process.poll() is None and len(list((survey / "cache" / folder).glob("[!.]*.npz"))) < files:
            time.sleep(0.01)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        assert Survey.open(survey).record("tiepoints") is None
    (survey / "cache" / "features" / ".part-1-x.npz").write_bytes(b"half")
    listener = Listener()
    result = tie(survey, listener)
    assert "stand already" in listener.told[0]
    assert result.match_count == sand[2].match_count
    assert Survey.open(survey).record("tiepoints").fingerprint == Survey.open(sand[1]).record("tiepoints").fingerprint
    assert not list((survey / "cache").glob("*/.part*"))
    expected, found = read_network(sand[1] / "features.db"), read_network(survey / "features.db")
    assert all(np.array_equal(expected.xy[i], found.xy[i]) for i in expected.names)
    assert all(np.array_equal(expected.matches[pair], found.matches[pair]) for pair in expected.matches)
    assert len(list((survey / "cache" / "refined").glob("*"))) == 4


def test_blocks_apart_are_named(tmp_path):
    survey = make(tmp_path, SAND[:3] + SHORE)
    listener = Listener()
    assert tie(survey, listener).pair_count == 4
    assert "DJI_0028.jpg, DJI_0029.jpg" in listener.warned[-1]
    assert "DJI_0028.jpg" in (survey / "report" / "tiepoints.html").read_text(encoding="utf-8")
    listener = Listener()
    assert turn(survey, listener, camera_model="radial").oriented_count == 3
    assert "DJI_0028.jpg, DJI_0029.jpg" in listener.warned[0]
    assert "DJI_0028.jpg, DJI_0029.jpg" in (survey / "report" / "orient.html").read_text(encoding="utf-8")


def test_a_calibration_is_held_or_started_from(sand, tmp_path):
    _, survey, _, _ = sand
    other = make(tmp_path, SAND[:3])
    tie(other)
    known = read_block(survey / "model").views[0].camera
    result = turn(other, calibration=str(survey), calibration_use="fixed")
    assert result.oriented_count == 3
    assert {v.camera for v in read_block(other / "model").views} == {known}
    turn(other, calibration=str(survey), calibration_use="prior", camera_model="radial")
    free = read_block(other / "model").views[0].camera
    assert free.model == "RADIAL"
    assert free.params[0] == pytest.approx(known.params[0], rel=0.1)


def test_a_calibration_of_another_camera_is_refused(sand, tmp_path):
    survey = make(tmp_path, SHORE)
    tie(survey)
    with pytest.raises(InputError, match="no photograph of the camera"):
        turn(survey, calibration=str(sand[1]))
    with pytest.raises(InputError, match="'orient'"):
        turn(sand[1], calibration=str(survey))


def test_without_enhanced_images_the_originals_are_used_with_a_warning(tmp_path):
    survey = make(tmp_path, SAND[1:3], enhanced=False)
    listener = Listener()
    assert tie(survey, listener, max_size=800).pair_count == 1
    assert "enhance" in listener.warned[0]
    record = Survey.open(survey).record("tiepoints")
    assert record.parameters["source"] == "original"
    assert set(record.built_on) == {"createsurvey"}
    with pytest.raises(InputError, match="enhance"):
        tie(survey, source="enhanced")
    # A pair alone can be oriented; no point has three rays then.
    turned = turn(survey, camera_model="simple_radial")
    assert (turned.oriented_count, turned.mmtp, turned.mmtp_percent) == (2, 0.0, None)


def test_too_little_is_one_sentence(tmp_path):
    alone = make(tmp_path / "one", SAND[:1], enhanced=False)
    with pytest.raises(NotEnoughData, match="two or more"):
        tie(alone)
    with pytest.raises(InputError, match="tiepoints"):
        turn(alone)
    apart = make(tmp_path / "two", ["copr/images/IMG_0022.jpg", "copr/images/IMG_0064.jpg"], enhanced=False)
    with pytest.raises(NotEnoughData, match="overlap"):
        tie(apart)
    assert Survey.open(apart).record("tiepoints") is None


def test_bad_requests_cost_nothing(sand):
    _, survey, _, _ = sand
    for more in ({"max_features": -1}, {"max_size": 50}):
        with pytest.raises(InputError, match=f"={next(iter(more.values()))} "):
            tie(survey, **more)
    with pytest.raises(InputError, match="laz"):
        turn(survey, tie_points="points.txt")
    with pytest.raises(InputError, match="no survey"):
        tie(survey.parent / "nowhere")
    assert not (survey.parent / "nowhere").exists()
    assert not Survey.open(survey).is_stale("orient")
