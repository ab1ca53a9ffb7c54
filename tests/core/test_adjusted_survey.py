"""Georeferencing a survey on disk by adjustment: what it writes, refuses and repeats."""

import cv2  # noqa: F401 - before pycolmap
import laspy
import numpy as np
import pycolmap
import pytest
import shapely
from strandline.core.contract import VectorSource
from strandline.core.errors import InputError, NotEnoughData
from strandline.core.georef import FOLDER, Georef
from strandline.core.orientation import bundle
from strandline.core.orientation.calibration import read_calibration
from strandline.core.orientation.georeference import Request, run
from strandline.core.orientation.sparse import read_block
from strandline.core.survey import Survey
from strandline.core.vector import read_layer, write_layer
from test_georeference import CAMERA, CENTRE, FRAME, GCPS, UTM, Scene

PIXEL = 40.0 / 3000.0  # m


def adjusted(scene, names=None, gnss=True, **options):
    return run(scene.request(names, gnss=gnss, method="adjustment", **options))


def noisy(scene, sigma=0.3, seed=8):
    """Give every tie-point observation of the scene's model an error, as matching has it."""
    folder = scene.folder / "survey" / "model"
    model = pycolmap.Reconstruction(folder)
    rng = np.random.default_rng(seed)
    for image_id in sorted(model.reg_image_ids()):
        for point in model.images[image_id].points2D:
            point.xy = point.xy + rng.normal(size=2) * sigma
    model.write(folder)
    return scene


def test_the_default_is_the_adjustment():
    assert Request("x").method == "adjustment"


def test_block_and_truth_agree(tmp_path):
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03))
    scene.survey_gcps(0.007, 0.01)
    result = adjusted(scene, check="middle, west", sigma_h=0.007, sigma_v=0.01)
    errors = scene.errors()
    assert np.abs(np.median(errors, axis=0)).max() < 0.6 * PIXEL
    assert np.sqrt(np.mean(errors[:, 2] ** 2)) < 3 * PIXEL  # a point's own noise of five rays is one and a half
    assert (result.control_count, result.check_count) == (4, 2)
    assert result.plani_check < 2 * PIXEL
    assert result.plani_loo is not None
    assert "bundle adjustment on 4 control points and the GNSS positions of 10 photographs" in scene.report()
    for heading in ("What one more control point buys", "Adjustment", "Camera c", "sigma beforehand"):
        assert heading in scene.report()


def test_files_hold_one_solution(tmp_path):
    """Poses, cameras and points of georeferenced/ reproject to within the noise, and georef.json tells the camera."""
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03))
    adjusted(scene)
    survey = Survey.open(tmp_path / "survey")
    georef = Georef.read(survey)
    assert georef.method == "adjustment"
    covariance = np.reshape(georef.covariance, (10, 10))
    assert np.linalg.eigvalsh(covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))).min() > 0
    model = pycolmap.Reconstruction(tmp_path / "survey" / FOLDER)
    assert model.compute_mean_reprojection_error() < 0.5
    (camera,) = georef.cameras
    assert camera.names == ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
    assert list(camera.values) == pytest.approx(list(next(iter(model.cameras.values())).params))
    block = read_block(tmp_path / "survey" / FOLDER)
    true = np.array([FRAME.to_crs(v.centre[None])[0] for v in scene.views])
    centres = georef.frame.to_crs(np.array([v.centre for v in block.views]))
    assert np.abs(centres - true).max() < 0.15
    photos = read_layer(VectorSource(str(tmp_path / "photos.gpkg"), "photos"))
    assert np.all(photos.numbers("sigma_v") < 0.1)
    free = pycolmap.Reconstruction(tmp_path / "survey" / "model")
    assert list(free.cameras[1].params) == list(CAMERA.params)  # the free model stays as it was


def test_its_calibration_serves_another_survey(tmp_path):
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03))
    adjusted(scene)
    survey = Survey.open(tmp_path / "survey")
    known = read_calibration(str(tmp_path / "survey"), survey.photographs)
    one = known[survey.photographs[0].name]
    assert one.covariance.shape == (8, 8)
    assert one.camera.params[0] == pytest.approx(Georef.read(survey).cameras[0].values[0])


def test_tie_points_on_the_sea_are_left_out(tmp_path):
    """Those of the western third move by decimetres from photograph to photograph, as foam does."""
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03))
    folder = tmp_path / "survey" / "model"
    model = pycolmap.Reconstruction(folder)
    rng = np.random.default_rng(3)
    west = {key for key, place in zip(sorted(model.points3D), scene.points, strict=True) if place[0] < -10}
    for image_id in sorted(model.reg_image_ids()):
        drift = rng.normal(size=2) * 20.0
        for point in model.images[image_id].points2D:
            if point.has_point3D() and point.point3D_id in west:
                point.xy = point.xy + drift
    model.write(folder)
    x, y = CENTRE[:2]
    sea = str(tmp_path / "sea.gpkg")
    write_layer(sea, "sea", UTM, {"id": [1]}, [shapely.box(x - 60, y - 60, x - 9, y + 60)], "Polygon")
    adjusted(scene)
    spoilt = Georef.read(Survey.open(tmp_path / "survey"))
    result = adjusted(scene, ignore=VectorSource(sea, "sea"))
    left = pycolmap.Reconstruction(tmp_path / "survey" / FOLDER)
    assert len(left.points3D) == pytest.approx(len(scene.points) - len(west), abs=12)  # the polygon's edge is not theirs
    assert not west & set(left.points3D)
    assert result.alti_control < 0.03
    held = Georef.read(Survey.open(tmp_path / "survey"))
    assert held.covariance[0] < spoilt.covariance[0]


def test_two_control_points_and_positions_are_enough(tmp_path):
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03, gnss_shift=(0.8, -0.5, 0.6)))
    result = adjusted(scene, ["north west", "south east"])
    assert np.abs(np.median(scene.errors(), axis=0)).max() < 0.03
    assert result.plani_gnss == pytest.approx(np.hypot(0.8, 0.5), abs=0.06)
    assert "the GNSS positions are all off by" in scene.report()


def test_a_single_mark_takes_part_and_is_told(tmp_path):
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03))
    for name in ("middle", "west"):
        first, *_ = [m for m in scene.marks if m[0] == name]
        scene.marks = [m for m in scene.marks if m[0] != name] + [first]
    result = adjusted(scene, check="west")
    assert (result.control_count, result.check_count) == (5, 0)
    assert "middle has one mark, which takes part" in scene.report()
    assert "west is not used: it has 1 mark" in scene.report()  # a check point with one ray has no place to check
    residuals = read_layer(VectorSource(str(tmp_path / "residuals.gpkg"), "residuals"))
    roles = dict(zip(residuals.text("name"), residuals.text("role"), strict=True))
    assert (roles["middle"], roles["west"]) == ("control, one mark", "check, not used")


def test_nothing_but_single_marks_needs_positions(tmp_path):
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03))
    scene.marks = [next(m for m in scene.marks if m[0] == name) for name in ("north west", "south east")]
    result = adjusted(scene, ["north west", "south east"])
    assert result.control_count == 2
    assert result.plani_control is None
    with pytest.raises(NotEnoughData, match="None of the 2 control points"):
        adjusted(scene, ["north west", "south east"], gnss=False)


def test_each_tie_point_is_written_with_its_sigma(tmp_path):
    """In the CRS, at the places of georeferenced/; without an adjustment no sigma is made up."""
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03))
    cloud = str(tmp_path / "ties.laz")
    result = adjusted(scene, tie_points=cloud)
    assert result.tie_points == cloud
    written = laspy.read(cloud)
    model = pycolmap.Reconstruction(tmp_path / "survey" / FOLDER)
    local = np.array([model.points3D[key].xyz for key in sorted(model.points3D)])
    places = Georef.read(Survey.open(tmp_path / "survey")).frame.to_crs(local)
    assert np.asarray(written.xyz) == pytest.approx(places, abs=1e-5)
    assert written.header.parse_crs().to_epsg() == int(UTM.split(":")[1])
    sigmas = np.column_stack([written[f"sigma_{axis}"] for axis in "enu"])
    assert np.all((sigmas[:, 2] > 0.1 * PIXEL) & (sigmas[:, 2] < 20 * PIXEL))
    assert np.all(sigmas[:, 2] > sigmas[:, :2].min(axis=1))  # heights of near-vertical rays are the weaker
    assert "Each tie point in the colour of its own predicted sigma" in scene.report()
    run(scene.request(method="similarity", tie_points=cloud))
    assert [d.name for d in laspy.read(cloud).point_format.extra_dimensions] == ["residual"]
    with pytest.raises(InputError, match="must be LAS or LAZ"):
        adjusted(scene, tie_points=str(tmp_path / "ties.txt"))


def test_again_is_the_same_to_the_bit(tmp_path):
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03))
    adjusted(scene)
    first = {p.name: p.read_bytes() for p in sorted((tmp_path / "survey" / FOLDER).glob("*.bin"))}
    (tmp_path / "survey" / "georef.json").unlink()
    adjusted(scene)
    assert first == {p.name: p.read_bytes() for p in sorted((tmp_path / "survey" / FOLDER).glob("*.bin"))}


def test_a_failure_costs_nothing(tmp_path, monkeypatch):
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03))
    adjusted(scene)
    before = (tmp_path / "survey" / "georef.json").read_bytes()
    empty = str(tmp_path / "empty.gpkg")
    write_layer(empty, "empty", UTM, {"id": []}, [], "Polygon")
    with pytest.raises(InputError, match="no polygons"):
        adjusted(scene, ignore=VectorSource(empty, "empty"))

    def fails(*_):
        raise MemoryError

    monkeypatch.setattr(bundle, "reduce", fails)
    with pytest.raises(MemoryError):
        adjusted(scene, sigma_mark=0.7)
    assert (tmp_path / "survey" / "georef.json").read_bytes() == before
    assert not Survey.open(tmp_path / "survey").is_stale("georeference")


def test_held_cameras_stay_and_are_told(tmp_path):
    scene = noisy(Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03))
    scene.survey.finish("orient", "2", built_on=(), parameters={"calibration": "gone", "calibration_use": "fixed"}, result={})
    adjusted(scene)
    moved = pycolmap.Reconstruction(tmp_path / "survey" / FOLDER)
    assert list(moved.cameras[1].params) == list(CAMERA.params)
    assert "Its interior orientation was held" in scene.report()


def test_control_of_all_points_is_listed(tmp_path):
    scene = noisy(Scene(tmp_path))
    result = adjusted(scene, gnss=False)
    assert result.control_count == len(GCPS)
    residuals = read_layer(VectorSource(str(tmp_path / "residuals.gpkg"), "residuals"))
    assert np.all(residuals.numbers("loo_sigma_v") > 0)
