"""Predicted and measured marks of a simulated survey, whose true poses stand in for an orientation."""

import json
import shutil
from dataclasses import replace

import cv2  # noqa: F401 - before pycolmap
import numpy as np
import pycolmap
import pytest
import shapely
from strandline.core.block import Block, View
from strandline.core.camera import Camera
from strandline.core.contract import VectorSource, decode
from strandline.core.errors import InputError, NotEnoughData
from strandline.core.frames import LocalFrame
from strandline.core.georef import FOLDER, Georef
from strandline.core.orientation import georeference, predictmarks
from strandline.core.orientation.control import GroundPoint
from strandline.core.orientation.prediction import ground_covariance, predict
from strandline.core.orientation.refining import agreeing
from strandline.core.orientation.targets import Found
from strandline.core.orientation.triangulation import triangulate
from strandline.core.photographs import createsurvey
from strandline.core.simulation import simulatesurvey
from strandline.core.survey import Survey
from strandline.core.vector import read_layer, write_layer

DAY = "2024-03-12"
UTM = "EPSG:32631"
SHIFT = np.array([0.12, -0.08, 0.10])  # m, what the georeferencing errs by: some two pixels
LEVEL = np.diag([0.1**2] * 3 + [1e-4**2] * 4)


def frame():
    return LocalFrame.at(UTM, 500_000.0, 4_900_000.0, 0.0)


def nadir(name="a.jpg", centre=(0.0, 0.0, 100.0), size=(800, 600)):
    camera = Camera("PINHOLE", *size, (1000.0, 1000.0, size[0] / 2, size[1] / 2))
    rotation = np.diag([1.0, -1.0, -1.0])
    return View(name, camera, rotation, -rotation @ np.array(centre))


def block_of(*views):
    none = np.zeros(0, np.int32)
    return Block(tuple(views), np.zeros((0, 3)), np.zeros(0), none, none, none)


def ground(name, local, sigma_h=1e-6, sigma_v=1e-6):
    return GroundPoint(name, frame().to_crs(np.array([local], float))[0], False, sigma_h, sigma_v)


def georef(covariance):
    """Return a georeferencing that errs by a similarity's covariance (7, 7), or () for an unknown one, and does not bend."""
    if not len(covariance):
        return Georef(frame(), "similarity", (), (0.0, 0.0, 0.0))
    wide = np.zeros((10, 10))
    wide[:7, :7] = covariance
    return Georef(frame(), "similarity", (), (0.0, 0.0, 0.0), tuple(np.ravel(wide).tolist()))


def test_a_prediction_by_hand():
    # 100 m above, a focal length of 1000 px: a metre is ten pixels. 0.1 m of shift and 0.3 px of pose in each axis.
    (p,) = predict(block_of(nadir()), georef(np.diag([0.1**2] * 3 + [0.0] * 4)), [ground("G", (10, 5, 0))])
    assert p.pixel == pytest.approx([500.0, 250.0], abs=1e-3)
    # At 10 m to the side a metre of height is a pixel, so that the 0.1 m of height add 0.1 and 0.05 px.
    assert np.diag(p.covariance) == pytest.approx([1 + 0.09 + 0.01, 1 + 0.09 + 0.0025], rel=1e-3)
    assert p.sigma == pytest.approx(np.sqrt(1.09625), rel=1e-3)
    assert p.off_axis == pytest.approx(np.hypot(100, 50), abs=1e-3)
    (own,) = predict(block_of(nadir()), georef(np.zeros((7, 7))), [ground("G", (10, 5, 0), sigma_h=0.2)])
    assert own.sigma == pytest.approx(np.hypot(2.0, 0.3), rel=1e-3)


def test_the_covariance_is_that_of_a_thousand_georeferencings():
    rng = np.random.default_rng(2)
    root = np.diag([0.05, 0.05, 0.1, 2e-3, 2e-3, 1e-3, 1e-3]) @ rng.normal(size=(7, 7)) * 0.5
    point = np.array([25.0, -12.0, 3.0])
    view = nadir()
    (p,) = predict(block_of(view), georef(root @ root.T), [ground("G", point)])
    changes = rng.normal(size=(20_000, 7)) @ root.T
    moved = point + changes[:, :3] + np.cross(changes[:, 3:6], point) + changes[:, 6:] * point
    assert np.cov(view.project(moved).T) == pytest.approx(p.covariance - 0.09 * np.eye(2), rel=0.05, abs=0.05)


def test_order_frame_and_what_cannot_be_seen():
    views = (
        nadir("far.jpg", (25.0, 0, 100)),
        nadir("near.jpg"),
        nadir("below.jpg", (0, 0, -100)),
        nadir("off.jpg", (90, 0, 100)),
    )
    found = predict(block_of(*views), georef(np.zeros((7, 7))), [ground("B", (0, 0, 0)), ground("A", (5, 0, 0))])
    assert [(p.point, views[p.view].name) for p in found] == [(0, "near.jpg"), (0, "far.jpg"), (1, "near.jpg"), (1, "far.jpg")]
    (edge,) = predict(block_of(nadir()), georef(LEVEL), [ground("G", (40.1, 0, 0))])
    assert not edge.inside  # a pixel outside, with a sigma of one: it may be in the frame
    folding = replace(nadir(), camera=Camera("SIMPLE_RADIAL", 800, 600, (1000.0, 400.0, 300.0, -8.0)))
    assert predict(block_of(folding), georef(LEVEL), [ground("G", (30, 0, 0))]) == []


def test_a_covariance_that_is_not_known_is_nan():
    assert np.isnan(ground_covariance(georef(()), np.zeros((2, 3)))).all()
    (p,) = predict(block_of(nadir()), georef(()), [ground("G", (0, 0, 0))])
    assert np.isnan(p.sigma)


def test_marks_that_contradict_each_other_are_not_taken():
    views = [nadir(f"{k}.jpg", (10.0 * k, 0, 100)) for k in range(4)]
    predictions = predict(block_of(*views), georef(LEVEL), [ground("G", (15, 0, 0)), ground("H", (15, 8, 0))])
    found = {k: Found(*map(float, p.pixel), 0.05, 0.95, "quadrants") for k, p in enumerate(predictions)}
    block = block_of(*views)
    assert agreeing(block, predictions, found) == (found, set())
    wrong = {**found, 0: replace(found[0], y=found[0].y + 12.0)}
    taken, contradicted = agreeing(block, predictions, wrong)
    assert contradicted == {0}
    assert set(taken) == set(found) - {0}
    weak = {**found, 1: replace(found[1], score=0.6)}
    assert set(agreeing(block, predictions, weak)[0]) == set(found) - {1}
    twin = next(k for k, p in enumerate(predictions) if p.point == 1 and p.view == predictions[0].view)
    same = {**found, twin: replace(found[0])}
    assert {0, twin} <= agreeing(block, predictions, same)[1]


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """A simulated flight and a survey of it per kind of photograph, oriented by the truth and georeferenced with an error."""
    folder = tmp_path_factory.mktemp("flight")
    request = simulatesurvey.Request(
        str(folder / "sim"), "one", 24.0, 20.0, height=30.0, camera_width=800, camera_height=600, focal=650.0, gcp_count=4,
        check_count=2, forward_overlap=70.0, side_overlap=50.0, workers=1,
    )  # fmt: skip
    simulatesurvey.run(request)
    for kind in ("jpg", "raw"):
        createsurvey.run(createsurvey.Request(str(folder / "sim" / DAY / kind), str(folder / kind)))
        orient(folder / kind, folder / "sim")
    return folder


def truth(simulation):
    data = json.loads((simulation / "truth" / "cameras.json").read_text())
    camera = decode(Camera, data["camera"])
    views = {
        v["image"].rpartition(".")[0]: View(v["image"], camera, np.reshape(v["rotation"], (3, 3)), np.array(v["translation"]))
        for v in data["views"][DAY]
    }
    return decode(LocalFrame, data["frame"]), views


def orient(folder, simulation):
    """Write the true poses as the survey's model, and moved by SHIFT as its georeferenced one."""
    local, views = truth(simulation)
    survey = Survey.open(folder)
    layer = read_layer(VectorSource(str(simulation / DAY / "gcps.gpkg"), "gcps"))
    places = local.from_crs(shapely.get_coordinates(layer.geometry, include_z=True))
    rng = np.random.default_rng(0)
    points = np.repeat(places, 10, axis=0) + rng.normal(size=(10 * len(places), 3)) * [2.0, 2.0, 0.1]
    for target, shift in (("model", np.zeros(3)), (FOLDER, SHIFT)):
        model = pycolmap.Reconstruction()
        camera = next(iter(views.values())).camera
        model.add_camera_with_trivial_rig(
            pycolmap.Camera(model=camera.model, width=camera.width, height=camera.height, params=camera.params, camera_id=1)
        )
        tracks = [pycolmap.Track() for _ in points]
        for number, photo in enumerate(survey.photographs, start=1):
            view = views[photo.name.rpartition(".")[0]]
            pixels = view.project(points)
            good = np.isfinite(pixels).all(axis=1)
            pose = pycolmap.Rigid3d(pycolmap.Rotation3d(view.rotation), view.translation - view.rotation @ shift)
            image = pycolmap.Image(name=photo.name, camera_id=1, image_id=number, keypoints=pixels[good])
            model.add_image_with_trivial_frame(image, pose)
            for slot, index in enumerate(np.flatnonzero(good)):
                tracks[index].add_element(number, slot)
        for place, track in zip(points + shift, tracks, strict=True):
            model.points3D[model.add_point3D(place, track)].error = 0.3
        (folder / target).mkdir()
        model.write(folder / target)
    replace(georef(LEVEL), frame=local).write(survey)
    survey.finish("orient", "1", built_on=("createsurvey",), parameters={}, result={})
    survey.finish("georeference", "2", built_on=("orient",), parameters={}, result={})


def request_for(flight, kind, tmp_path, **more):
    given = {
        "survey": str(flight / kind), "output": str(tmp_path / "marks.gpkg"), "name_field": "name", "workers": 1,
        "gcps": VectorSource(str(flight / "sim" / DAY / "gcps.gpkg"), "gcps"),
        "sigma_h_field": "sigma_h", "sigma_v_field": "sigma_v",
    }  # fmt: skip
    return predictmarks.Request(**{**given, **more})


def true_places(flight):
    """True pixels by point and photograph, from all the simulator's marks (0.3 px) and the true poses; and how many it marks."""
    _, views = truth(flight / "sim")
    table = read_layer(VectorSource(str(flight / "sim" / DAY / "marks.csv"), "marks"))
    images = [i.rpartition(".")[0] for i in table.text("image")]
    places, marked = {}, set(zip(table.text("gcp"), images, strict=True))
    for name in dict.fromkeys(table.text("gcp")):
        rows = [i for i, g in enumerate(table.text("gcp")) if g == name]
        marks = np.column_stack([table.numbers("x"), table.numbers("y")])[rows]
        met = triangulate([views[images[i]] for i in rows], marks, 0.3)
        places.update({(name, image): view.project(met.point[None])[0] for image, view in views.items()})
    return places, marked


def rows_of(path):
    table = read_layer(VectorSource(str(path), "marks"))
    names = zip(table.text("gcp"), (i.rpartition(".")[0] for i in table.text("image")), strict=True)
    numbers = np.column_stack([table.numbers(c) for c in ("x", "y", "sigma", "score")])
    return dict(zip(names, numbers, strict=True))


def test_predictions_are_off_by_what_their_sigma_says(flight, tmp_path, progress, listener):
    result = predictmarks.run(request_for(flight, "jpg", tmp_path), progress)
    rows, (places, marked) = rows_of(tmp_path / "marks.gpkg"), true_places(flight)
    assert marked <= set(rows)
    assert result.mark_count == len(rows)
    assert result.missed_count == 0
    assert np.isnan([r[3] for r in rows.values()]).all()
    errors = np.array([(rows[k][:2] - places[k]) / rows[k][2] for k in marked])
    # SHIFT is 1.2, 0.8 and 1 sigma: the errors are nearly the same everywhere, and about one sigma.
    assert 0.5 < np.sqrt(np.mean(errors**2)) < 1.6
    assert "no measurements" in listener.infos[-1]


@pytest.mark.parametrize("kind", ["jpg", "raw"])
def test_all_targets_are_measured(flight, tmp_path, kind):
    page = tmp_path / "page.html"
    result = predictmarks.run(request_for(flight, kind, tmp_path, refine="target", output_html_file=str(page)))
    rows, (places, marked) = rows_of(tmp_path / "marks.gpkg"), true_places(flight)
    assert marked <= set(rows)
    # The places themselves come from some five marks of 0.3 px each: this finds a wrong target, and the next lines the error.
    assert max(np.abs(rows[k][:2] - places[k]).max() for k in rows) < 0.6
    _, views = truth(flight / "sim")
    squares, freedom = 0.0, 0
    for name in {gcp for gcp, _ in rows}:
        keys = [k for k in rows if k[0] == name]
        met = triangulate([views[image] for _, image in keys], np.array([rows[k][:2] for k in keys]), 0.3)
        squares, freedom = squares + np.sum(met.residuals**2), freedom + 2 * len(keys) - 3
    assert np.sqrt(squares / freedom) < 0.08
    assert (np.array(list(rows.values()))[:, 3] >= 0.75).all()
    assert result.missed_count <= 0.1 * len(rows)  # targets cut by the frame
    text = page.read_text()
    assert text == Survey.open(flight / kind).report_path("predictmarks").read_text()
    assert "data:image/jpeg;base64" in text
    assert "://" not in text


def test_the_table_is_what_georeference_takes(flight, tmp_path):
    request = request_for(flight, "jpg", tmp_path, refine="target")
    predictmarks.run(request)
    copy = tmp_path / "copy"
    shutil.copytree(flight / "jpg", copy)
    survey = Survey.open(copy)
    images = flight / "sim" / DAY / "jpg"
    assert Survey.create(copy, images, survey.crs, list(survey.photographs)).record("orient")
    marks = VectorSource(request.output, "marks")
    result = georeference.run(
        georeference.Request(str(copy), gcps=request.gcps, name_field="name", role_field="role", marks=marks, sigma_mark=0.1)
    )
    assert result.control_count == 4
    assert result.check_count == 2
    # The points were surveyed to 1 and 2 cm.
    assert result.plani_check < 0.04
    assert result.alti_check < 0.08


def test_no_code_is_found_on_painted_targets(flight, tmp_path):
    result = predictmarks.run(request_for(flight, "jpg", tmp_path, refine="code"))
    assert result.mark_count == 0
    assert result.missed_count > 20
    assert len(rows_of(tmp_path / "marks.gpkg")) == 0


def moved(flight, tmp_path, shift=(0, 0, 0), crs=None, names=None, z=True):
    layer = read_layer(VectorSource(str(flight / "sim" / DAY / "gcps.gpkg"), "gcps"))
    places = shapely.get_coordinates(layer.geometry, include_z=True) + shift
    points = shapely.points(places if z else places[:, :2])
    path = str(tmp_path / "moved.gpkg")
    fields = {"name": names or layer.text("name")}
    write_layer(path, "moved", crs or layer.crs, fields, list(points), "Point Z" if z else "Point")
    return {"gcps": VectorSource(path, "moved"), "sigma_h_field": None, "sigma_v_field": None}


@pytest.mark.parametrize(
    ("change", "error", "told"),
    [
        ({"shift": (0, 0, 47.0)}, NotEnoughData, "m above the surveyed ground: are their heights of another kind"),
        ({"shift": (5000.0, 0, 0)}, NotEnoughData, "is 500. m from that of the block; check the CRS"),
        ({"crs": "EPSG:4326"}, InputError, "are no degrees"),
        ({"crs": "EPSG:2229"}, InputError, "does not declare the unit of its heights"),
        ({"z": False}, InputError, "have no heights: choose HEIGHT_FIELD"),
        ({"names": list("abcdef")}, InputError, "No name of moved ends with a number"),
        ({"names": ["a"] * 6}, InputError, "share a name"),
    ],
)
def test_points_that_cannot_be_used_are_refused_in_a_sentence(flight, tmp_path, change, error, told):
    with pytest.raises(error, match=told):
        predictmarks.run(request_for(flight, "jpg", tmp_path, refine="code", **moved(flight, tmp_path, **change)))
    assert not (tmp_path / "marks.gpkg").exists()


def test_an_odd_height_is_told_where_points_are_still_seen(flight, tmp_path, progress, listener):
    predictmarks.run(request_for(flight, "jpg", tmp_path, **moved(flight, tmp_path, (0, 0, -12.0))), progress)
    assert any("m below the surveyed ground" in text for text in listener.warnings)


def test_an_empty_layer_is_refused(flight, tmp_path):
    path = str(tmp_path / "none.gpkg")
    write_layer(path, "none", UTM, {"name": []}, [], "Point Z")
    with pytest.raises(InputError, match="is empty: add points"):
        predictmarks.run(request_for(flight, "jpg", tmp_path, gcps=VectorSource(path, "none")))


def test_a_survey_that_is_not_georeferenced_is_refused(flight, tmp_path):
    createsurvey.run(createsurvey.Request(str(flight / "sim" / DAY / "jpg"), str(tmp_path / "new")))
    with pytest.raises(InputError, match="has no 'georeference' yet"):
        predictmarks.run(request_for(flight, "jpg", tmp_path, survey=str(tmp_path / "new")))


def test_a_photograph_that_is_gone_stops_the_measuring_and_not_the_prediction(flight, tmp_path, progress, listener):
    copy, images = tmp_path / "survey", tmp_path / "images"
    shutil.copytree(flight / "jpg", copy)
    shutil.copytree(flight / "sim" / DAY / "jpg", images)
    survey = Survey.open(copy)
    Survey.create(copy, images, survey.crs, list(survey.photographs))
    for path in sorted(images.iterdir())[1:-1]:
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2] * 2)
        path.write_bytes(path.read_bytes().ljust(survey.photographs[0].bytes, b"\0"))
    with pytest.raises(InputError, match=r"has changed since the survey was made"):
        predictmarks.run(request_for(flight, "jpg", tmp_path, survey=str(copy), refine="target"))
    assert not (tmp_path / "marks.gpkg").exists()
    result = predictmarks.run(request_for(flight, "jpg", tmp_path, survey=str(copy)), progress)
    assert result.mark_count > 20
    assert any(text.startswith("No picture: ") for text in listener.warnings)


def test_workers_change_nothing(flight, tmp_path):
    tables = []
    for workers in (1, 2):
        predictmarks.run(request_for(flight, "jpg", tmp_path, refine="target", workers=workers))
        tables.append(rows_of(tmp_path / "marks.gpkg"))
    assert tables[0].keys() == tables[1].keys()
    # OpenCV's filters round otherwise on one thread, as in workers, than on several.
    assert max(np.abs(tables[0][k][:2] - tables[1][k][:2]).max() for k in tables[0]) < 1e-3
