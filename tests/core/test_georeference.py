"""Georeferencing a simulated block by a similarity, from files to files; the adjustment has tests of its own."""

import json
import re
from dataclasses import replace

import cv2  # noqa: F401 - before pycolmap
import numpy as np
import pycolmap
import pytest
import shapely
from scipy.spatial.transform import Rotation
from strandline.core.block import View
from strandline.core.camera import Camera
from strandline.core.contract import VectorSource
from strandline.core.errors import InputError, NotEnoughData
from strandline.core.frames import LocalFrame, transformer
from strandline.core.georef import FOLDER, Georef
from strandline.core.orientation.georeference import Request, run
from strandline.core.orientation.heights import plan_heights, undulation
from strandline.core.orientation.similarity import Similarity
from strandline.core.orientation.triangulation import triangulate
from strandline.core.raster import Grid, Patch, write_cog
from strandline.core.survey import Photograph, Position, Survey
from strandline.core.vector import read_layer, write_layer

UTM = "EPSG:32631"
CENTRE = np.array([512000.0, 4983000.0, 3.0])
FRAME = LocalFrame.at(UTM, *CENTRE)
CAMERA = Camera("OPENCV", 4000, 3000, (3000.0, 3000.0, 2010.0, 1490.0, -0.05, 0.02, 0.0005, -0.0003))
HEIGHT = 40.0  # a pixel is 1.3 cm on the ground
FREE = Similarity(8.0, Rotation.from_euler("xyz", [150.0, 20.0, 70.0], degrees=True).as_matrix(), np.array([3.0, -5.0, 30.0]))
GCPS = {
    "north west": (-18, 22, 0.5),
    "north east": (18, 21, -0.3),
    "south west": (-17, -22, 0.2),
    "south east": (19, -20, 1.5),
    "middle": (1, 2, 0.8),
    "west": (-16, 1, -0.5),
}


def flight(strips=2):
    """Two strips of five, 20 m apart, nadir within a few degrees."""
    rng = np.random.default_rng(4)
    views = []
    for k in range(5 * strips):
        strip, along = divmod(k, 5)
        centre = np.array([(strip - (strips - 1) / 2) * 20.0, (along - 2) * 10.0, HEIGHT])
        if strips > 1:
            centre += rng.normal(size=3)
        yaw = 180.0 * strip + rng.normal() * 3
        up = Rotation.from_euler("ZXY", [yaw, 180 + rng.normal() * 2, rng.normal() * 2], degrees=True).as_matrix()
        rotation = up.T
        views.append(View(f"DJI_{k + 1:04d}.JPG", CAMERA, rotation, -rotation @ centre))
    return views


def free(views, points):
    """Return views and points in the free frame, of which FREE is the way back."""
    back = FREE.rotation.T
    moved = []
    for view in views:
        rotation = view.rotation @ FREE.rotation
        centre = back @ (view.centre - FREE.shift) / FREE.scale
        moved.append(View(view.name, view.camera, rotation, -rotation @ centre))
    return moved, (points - FREE.shift) @ back.T / FREE.scale


def write_model(folder, views, points):
    model = pycolmap.Reconstruction()
    camera = pycolmap.Camera(model="OPENCV", width=CAMERA.width, height=CAMERA.height, params=CAMERA.params, camera_id=1)
    model.add_camera_with_trivial_rig(camera)
    seen = [np.isfinite(v.project(points)).all(axis=1) for v in views]
    tracks = [pycolmap.Track() for _ in points]
    for number, (view, mask) in enumerate(zip(views, seen, strict=True), start=1):
        image = pycolmap.Image(name=view.name, camera_id=1, image_id=number, keypoints=view.project(points)[mask])
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(view.rotation), view.translation)
        model.add_image_with_trivial_frame(image, pose)
        for slot, index in enumerate(np.flatnonzero(mask)):
            tracks[index].add_element(number, slot)
    for place, track in zip(points, tracks, strict=True):
        model.points3D[model.add_point3D(place, track)].error = 0.3
    folder.mkdir(parents=True)
    model.write(folder)


def within(pixels):
    return np.isfinite(pixels).all() and (pixels >= 0).all() and pixels[0] <= CAMERA.width and pixels[1] <= CAMERA.height


class Scene:
    """A survey on disk, with the layers a user would give."""

    def __init__(self, folder, *, strips=2, mark_noise=0.3, gnss_noise=0.0, gnss_sigma=None, gnss_shift=(0, 0, 0), seed=0):
        rng = np.random.default_rng(seed)
        self.folder = folder
        self.views = flight(strips)
        relief = rng.uniform([-28, -30, -1], [28, 30, 2], (400, 3))
        self.points = relief
        free_views, free_points = free(self.views, relief)
        write_model(folder / "survey" / "model", free_views, free_points)
        to_wgs84 = transformer(UTM, "EPSG:4326")
        photographs = []
        for view in self.views:
            at = FRAME.to_crs(view.centre[None])[0] + gnss_shift + rng.normal(size=3) * gnss_noise
            longitude, latitude = to_wgs84.transform(*at[:2])
            position = Position(longitude, latitude, float(at[2]), gnss_sigma, gnss_sigma)
            photographs.append(Photograph(view.name, 1, "x", CAMERA.width, CAMERA.height, "c", position=position))
        self.survey = Survey.create(folder / "survey", folder, LocalFrame.at(UTM, *CENTRE).crs, photographs)
        self.survey.finish("orient", "1", built_on=(), parameters={}, result={})
        self.gcps = {n: FRAME.to_crs(np.array([p], float))[0] for n, p in GCPS.items()}
        self.marks = []
        for name, place in GCPS.items():
            for view in self.views:
                pixels = view.project(np.array([place], float))[0]
                if within(pixels):
                    self.marks.append([name, view.name, *(pixels + rng.normal(size=2) * mark_noise)])

    def survey_gcps(self, sigma_h, sigma_v, seed=5):
        rng = np.random.default_rng(seed)
        self.gcps = {n: p + rng.normal(size=3) * [sigma_h, sigma_h, sigma_v] for n, p in self.gcps.items()}

    def request(self, names=None, gnss=False, **options):
        chosen = {n: self.gcps[n] for n in (names if names is not None else self.gcps)}
        layers = {}
        if chosen:
            path = str(self.folder / "gcps.gpkg")
            write_layer(path, "gcps", UTM, {"id": list(chosen)}, list(shapely.points(list(chosen.values()))), "Point Z")
            table = self.folder / "marks.csv"
            rows = [f'"{g}","{i}","{x!r}","{y!r}"' for g, i, x, y in ([g, i, float(x), float(y)] for g, i, x, y in self.marks)]
            table.write_text("GCP,Image,X,Y\n" + "\n".join(rows) + "\n", encoding="utf-8")
            layers = {"gcps": VectorSource(path, "gcps"), "marks": VectorSource(str(table), "marks"), "name_field": "id"}
        residuals, photos = str(self.folder / "residuals.gpkg"), str(self.folder / "photos.gpkg")
        return Request(
            **{
                "survey": str(self.folder / "survey"),
                "use_gnss": gnss,
                "method": "similarity",
                "residuals": residuals,
                "photos": photos,
                **layers,
                **options,
            }
        )

    def errors(self):
        """Return where the georeferenced tie points lie against the truth, in the CRS."""
        model = pycolmap.Reconstruction(self.folder / "survey" / FOLDER)
        points = np.array([model.points3D[key].xyz for key in sorted(model.points3D)])
        frame = Georef.read(Survey.open(self.folder / "survey")).frame
        return frame.to_crs(points) - FRAME.to_crs(self.points)

    def report(self):
        return (self.folder / "survey" / "report" / "georeference.html").read_text(encoding="utf-8")


# Triangulation


def marks_of(place, views, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    seen = [(v, v.project(np.array([place], float))[0]) for v in views]
    seen = [(v, p) for v, p in seen if within(p)]
    return [v for v, _ in seen], np.array([p for _, p in seen]) + rng.normal(size=(len(seen), 2)) * noise


def test_exact_marks_meet_in_the_point():
    views, marks = marks_of((3, -4, 1), flight())
    found = triangulate(views, marks, 0.5)
    assert found.point == pytest.approx([3, -4, 1], abs=1e-6)
    assert np.abs(found.residuals).max() < 1e-4
    assert found.agree


def test_triangulation_covariance_covers_the_truth():
    """The 95 % ellipsoid holds the truth in 95 % of 400 points; binomial scatter is 1.1 %, three of these are allowed."""
    inside = 0
    for seed in range(400):
        views, marks = marks_of((3, -4, 1), flight(), 0.5, seed)
        found = triangulate(views, marks, 0.5)
        error = found.point - [3, -4, 1]
        inside += error @ np.linalg.solve(found.covariance, error) <= 7.815  # chi2, three degrees of freedom
    assert inside / 400 == pytest.approx(0.95, abs=0.034)


@pytest.mark.parametrize("shift", [30.0, 900.0])
def test_one_wrong_mark_is_found(shift):
    views, marks = marks_of((3, -4, 1), flight(), 0.3)
    marks[2] += [shift, shift / 2]
    found = triangulate(views, marks, 0.5)
    assert list(np.flatnonzero(~found.used)) == [2]
    assert np.linalg.norm(found.residuals[2]) == pytest.approx(np.hypot(shift, shift / 2), rel=0.1)
    assert found.point == pytest.approx([3, -4, 1], abs=0.05)
    assert found.agree


def test_two_contradicting_marks_lose_weight_instead():
    views, marks = marks_of((3, -4, 1), flight(1))
    views, marks = views[:2], marks[:2]
    sound = triangulate(views, marks, 0.5)
    marks[1, 0] += 40.0  # across the base, where rays cannot meet
    found = triangulate(views, marks, 0.5)
    assert not found.agree
    assert found.covariance[0, 0] > 100 * sound.covariance[0, 0]


def test_parallel_rays_do_not_meet():
    view = flight()[0]
    assert triangulate([view, view], np.array([[2000.0, 1500.0], [2000.0, 1500.0]]), 0.5) is None


# Heights


@pytest.mark.parametrize(
    ("gcp", "gnss", "geoid", "with_gcps", "kind", "sign", "comparable"),
    [
        ("orthometric", "ellipsoidal", True, True, "orthometric", -1, True),
        ("ellipsoidal", "orthometric", True, True, "ellipsoidal", 1, True),
        ("orthometric", "ellipsoidal", False, True, "orthometric", 0, False),
        ("orthometric", "orthometric", False, True, "orthometric", 0, True),
        ("unknown", "unknown", False, True, "unknown", 0, True),
        ("unknown", "ellipsoidal", True, False, "orthometric", -1, True),
        ("unknown", "ellipsoidal", False, False, "ellipsoidal", 0, True),
    ],
)
def test_kinds_of_heights(gcp, gnss, geoid, with_gcps, kind, sign, comparable):
    plan = plan_heights(gcp, gnss, geoid=geoid, with_gcps=with_gcps, with_gnss=True)
    assert (plan.kind, plan.sign, plan.comparable) == (kind, sign, comparable)


def test_a_geoid_between_unknown_kinds_is_refused():
    with pytest.raises(InputError, match="GNSS_HEIGHTS is unknown"):
        plan_heights("orthometric", "unknown", geoid=True, with_gcps=True, with_gnss=True)


def test_a_geoid_raster_is_read_between_cell_centres(tmp_path):
    # Undulation = 40 + column + 10 row on cells of 100 m, so bilinear reading is exact.
    row, column = np.mgrid[0:4, 0:5]
    grid = Grid(511000.0, 4984000.0, 500.0, 5, 4, FRAME.crs)
    path = str(tmp_path / "geoid.tif")
    write_cog(path, grid, [Patch(0, 0, (40.0 + column + 10.0 * row)[None].astype(np.float32))])
    points = np.array([[511250.0, 4983750.0], [511500.0, 4983500.0]])
    assert undulation(path, points, UTM) == pytest.approx([40.0, 40.5 + 5.0])
    assert undulation("-12.5", points, UTM) == pytest.approx([-12.5, -12.5])
    with pytest.raises(InputError, match="no value"):
        undulation(path, np.array([[600000.0, 4983500.0]]), UTM)
    with pytest.raises(InputError, match="neither a number nor a file"):
        undulation("egm.tif", points, UTM)


# The step


def test_exact_control_gives_the_exact_block(tmp_path):
    scene = Scene(tmp_path, mark_noise=0.0)
    result = run(scene.request())
    # The marks are written with all digits; the map's curvature is in the local frame, so nothing is left over.
    assert np.abs(scene.errors()).max() < 1e-4
    assert (result.control_count, result.check_count) == (6, 0)
    assert max(result.plani_control, result.alti_control, result.plani_loo, result.alti_loo) < 1e-4
    assert result.plani_check is result.alti_check is result.plani_gnss is result.alti_gnss is result.doming is None
    assert result.output == str(tmp_path / "survey")


def test_written_files_agree(tmp_path):
    scene = Scene(tmp_path)
    run(scene.request())
    survey = Survey.open(tmp_path / "survey")
    georef = Georef.read(survey)
    similarity = Similarity(georef.similarity[0], np.reshape(georef.similarity[1:10], (3, 3)), np.array(georef.similarity[10:]))
    model = pycolmap.Reconstruction(tmp_path / "survey" / "model")
    moved = pycolmap.Reconstruction(tmp_path / "survey" / FOLDER)
    assert set(model.points3D) == set(moved.points3D)
    for key in list(model.points3D)[:20]:
        assert similarity.apply(model.points3D[key].xyz[None])[0] == pytest.approx(moved.points3D[key].xyz, abs=1e-9)
    assert np.abs(np.median([p.xyz for p in moved.points3D.values()], axis=0)[:2]).max() < 1.0  # the origin is the block's middle
    covariance = np.reshape(georef.covariance, (10, 10))[:7, :7]
    assert covariance == pytest.approx(covariance.T)
    assert np.linalg.eigvalsh(covariance).min() > 0
    assert georef.accuracy["control_count"] == 6
    residuals = read_layer(VectorSource(str(tmp_path / "residuals.gpkg"), "residuals"))
    assert residuals.text("name") == list(GCPS)
    assert residuals.geometry[0].x == pytest.approx(scene.gcps["north west"][0])
    assert residuals.numbers("plani") == pytest.approx(np.hypot(residuals.numbers("dE"), residuals.numbers("dN")))
    photos = read_layer(VectorSource(str(tmp_path / "photos.gpkg"), "photos"))
    assert len(photos) == 10
    assert photos.numbers("height") == pytest.approx([FRAME.to_crs(v.centre[None])[0, 2] for v in scene.views], abs=0.1)
    assert np.isnan(photos.numbers("dE")).all()  # USE_GNSS is false


def test_noise_gives_the_errors_it_should(tmp_path):
    scene = Scene(tmp_path, mark_noise=0.5)
    scene.survey_gcps(0.01, 0.02)
    result = run(scene.request(check="middle, West"))
    # Six points of 1 and 2 cm and marks of 0.5 px: means over 40 points of block must stay within 3 cm (3 sigma of the level).
    assert np.abs(scene.errors()).max() < 0.06
    assert (result.control_count, result.check_count) == (4, 2)
    assert 0.001 < result.plani_check < 0.05
    assert 0.001 < result.alti_check < 0.08
    assert result.plani_loo > result.plani_control


def test_predicted_uncertainty_covers_the_error(tmp_path):
    """Of 40 surveys with other noise, the error in the block's middle is within 95 % in nearly all (binomial: at least 34)."""
    inside = 0
    scene = Scene(tmp_path, mark_noise=0.0)
    truth, exact = dict(scene.gcps), [list(m) for m in scene.marks]
    for seed in range(40):
        rng = np.random.default_rng(seed)
        scene.gcps = dict(truth)
        scene.survey_gcps(0.01, 0.02, seed)
        scene.marks = [[g, i, x + rng.normal() * 0.3, y + rng.normal() * 0.3] for g, i, x, y in exact]
        run(scene.request(residuals=None, photos=None))
        georef = Georef.read(Survey.open(tmp_path / "survey"))
        error = scene.errors().mean(axis=0)
        shift = np.reshape(georef.covariance, (10, 10))[:3, :3]
        inside += error @ np.linalg.solve(shift, error) <= 7.815
    assert inside >= 34


def test_a_blunder_is_named_with_its_size_and_kept(tmp_path):
    scene = Scene(tmp_path)
    scene.survey_gcps(0.01, 0.02)
    scene.gcps["south east"] = scene.gcps["south east"] + [0.0, 0.0, 0.9]
    result = run(scene.request())
    assert result.control_count == 6
    named = re.search(r"(.{10}) is off by ([0-9.]+) m in (plan|height)", scene.report())
    assert named[1] == "south east"
    assert float(named[2]) == pytest.approx(0.9, abs=0.1)  # five points of 2 cm predict a corner to 4 cm
    assert named[3] == "height"
    assert "next to no weight" in scene.report()
    assert np.abs(scene.errors()).max() < 0.12  # least squares bends it by 0.5 m
    residuals = read_layer(VectorSource(str(tmp_path / "residuals.gpkg"), "residuals"))
    at = residuals.text("name").index("south east")
    assert residuals.numbers("dU")[at] == pytest.approx(-0.9, abs=0.12)
    assert residuals.fields["blunder"].tolist() == [n == "south east" for n in residuals.text("name")]


def test_handheld_control_is_no_blunder_but_its_sigma_is_called_wrong(tmp_path):
    scene = Scene(tmp_path)
    scene.survey_gcps(1.8, 2.5)
    run(scene.request())
    assert "times worse than their sigmas say" in scene.report()
    assert "is off by" not in scene.report()


def test_a_wrong_mark_is_named(tmp_path):
    scene = Scene(tmp_path)
    at = next(i for i, m in enumerate(scene.marks) if m[0] == "middle")
    scene.marks[at][2] += 60.0
    run(scene.request())
    assert f"The mark of middle in {scene.marks[at][1]} contradicts its other marks" in scene.report()
    assert np.abs(scene.errors()).max() < 0.1


def test_gnss_alone(tmp_path):
    scene = Scene(tmp_path, gnss_noise=0.3, gnss_shift=(1.5, -1.0, 4.0))
    result = run(scene.request([], gnss=True))
    assert 0.1 < result.plani_gnss < 0.7
    assert 0.05 < result.alti_gnss < 0.6
    assert result.control_count == 0
    # The shared error stays in the block, and is in the covariance.
    assert scene.errors().mean(axis=0) == pytest.approx([1.5, -1.0, 4.0], abs=0.5)
    sigmas = np.sqrt(np.diag(np.reshape(Georef.read(Survey.open(tmp_path / "survey")).covariance, (10, 10))))
    assert sigmas[0] > 1.9
    assert sigmas[2] > 9.0
    assert "may be shifted by metres" in scene.report()


def test_a_focal_length_gone_astray_is_called_out(tmp_path):
    scene = Scene(tmp_path, gnss_sigma=0.03)
    photographs = [replace(p, focal=2500.0) for p in scene.survey.photographs]
    survey = Survey.create(tmp_path / "survey", tmp_path, scene.survey.crs, photographs)
    survey.finish("orient", "1", built_on=(), parameters={}, result={})
    run(scene.request([], gnss=True))
    assert "changed the focal length by +20 %" in scene.report()
    covariance = np.reshape(Georef.read(Survey.open(tmp_path / "survey")).covariance, (10, 10))
    assert np.sqrt(covariance[2, 2]) == pytest.approx(0.2 * HEIGHT, rel=0.1)


def test_positions_that_tell_less_are_counted(tmp_path):
    scene = Scene(tmp_path, gnss_sigma=0.03)
    photographs = list(scene.survey.photographs)
    photographs[0] = replace(photographs[0], position=replace(photographs[0].position, height=None))
    photographs[1] = replace(photographs[1], position=replace(photographs[1].position, sigma_v=None))
    survey = Survey.create(tmp_path / "survey", tmp_path, scene.survey.crs, photographs)
    survey.finish("orient", "1", built_on=(), parameters={}, result={})
    run(scene.request([], gnss=True))
    assert "1 of 10 GNSS positions have no height" in scene.report()
    assert "Only 8 of 9 GNSS positions tell their sigma" in scene.report()


def test_without_a_crs_of_its_own_the_survey_takes_the_controls(tmp_path):
    scene = Scene(tmp_path, mark_noise=0.0)
    survey = Survey.create(tmp_path / "survey", tmp_path, None, [replace(p, position=None) for p in scene.survey.photographs])
    survey.finish("orient", "1", built_on=(), parameters={}, result={})
    run(scene.request())
    assert np.abs(scene.errors()).max() < 1e-4
    with pytest.raises(InputError, match="has no CRS"):
        run(scene.request([]))


def test_another_crs_than_the_surveys(tmp_path):
    scene = Scene(tmp_path, mark_noise=0.0)
    run(scene.request(crs="EPSG:2154"))
    frame = Georef.read(Survey.open(tmp_path / "survey")).frame
    assert "Lambert-93" in frame.crs
    model = pycolmap.Reconstruction(tmp_path / "survey" / FOLDER)
    points = frame.to_crs(np.array([model.points3D[key].xyz for key in sorted(model.points3D)]))
    expected = FRAME.to_crs(scene.points)
    expected[:, 0], expected[:, 1] = transformer(UTM, "EPSG:2154").transform(expected[:, 0], expected[:, 1])
    assert np.abs(points - expected).max() < 1e-3


def test_a_wrong_position_is_named(tmp_path):
    scene = Scene(tmp_path, gnss_noise=0.1)
    photographs = list(scene.survey.photographs)
    position = photographs[3].position
    photographs[3] = replace(photographs[3], position=replace(position, latitude=position.latitude + 2e-4))  # 22 m
    survey = Survey.create(tmp_path / "survey", tmp_path, scene.survey.crs, photographs)
    survey.finish("orient", "1", built_on=(), parameters={}, result={})
    run(scene.request([], gnss=True))
    assert "The GNSS position of DJI_0004.JPG is off by 22" in scene.report()
    assert np.abs(scene.errors().mean(axis=0)).max() < 0.3  # least squares shifts the block by 2 m


def test_gnss_with_declared_sigmas_is_taken_at_its_word(tmp_path):
    scene = Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03)
    run(scene.request([], gnss=True))
    sigmas = np.sqrt(np.diag(np.reshape(Georef.read(Survey.open(tmp_path / "survey")).covariance, (10, 10))))
    assert sigmas[0] < 0.03
    assert np.abs(scene.errors().mean(axis=0)).max() < 0.1
    assert "may be shifted by metres" not in scene.report()


def test_gnss_apart_from_control(tmp_path):
    scene = Scene(tmp_path, gnss_shift=(0.4, 0.3, 48.0), mark_noise=0.0)
    result = run(scene.request(gnss=True, method="similarity"))
    assert np.abs(scene.errors()).max() < 1e-4  # GNSS did not enter
    assert result.plani_gnss == pytest.approx(0.5, abs=1e-3)
    assert result.alti_gnss is None  # heights of two kinds are not compared
    assert "GNSS heights lie 48.0 m above those of gcps, as heights above the ellipsoid do" in scene.report()
    assert "set GCP_HEIGHTS and GNSS_HEIGHTS to what they are" in scene.report()


def test_a_geoid_brings_gnss_to_the_control(tmp_path):
    scene = Scene(tmp_path, gnss_shift=(0, 0, 48.0), mark_noise=0.0)
    kinds = {"gcp_heights": "orthometric", "gnss_heights": "ellipsoidal"}
    assert run(scene.request(gnss=True, **kinds)).alti_gnss is None
    assert run(scene.request(gnss=True, geoid="48", **kinds)).alti_gnss == pytest.approx(0.0, abs=1e-3)
    assert Georef.read(Survey.open(tmp_path / "survey")).heights == "orthometric"


@pytest.mark.parametrize("names", [["middle"], ["north west", "south east"]])
def test_few_control_points_set_the_level_of_gnss(tmp_path, names):
    scene = Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03, gnss_shift=(2.0, 3.0, 45.0))
    run(scene.request(names, gnss=True, gcp_heights="orthometric", gnss_heights="ellipsoidal"))
    assert "GCPs the level" in scene.report()
    at = np.hypot(*(scene.points[:, :2] - np.array(GCPS[names[0]])[:2]).T) < 10
    assert np.abs(scene.errors()[at]).max() < 0.1


def test_lever_arm(tmp_path):
    # The antenna sits 0.5 m behind, 0.2 m to the right and 0.3 m above the camera; its strips fly against each other.
    scene = Scene(tmp_path, mark_noise=0.0)
    offsets = []
    for view in scene.views:
        forward = view.rotation.T @ [0.0, -1.0, 0.0]
        forward = np.array([*forward[:2], 0.0]) / np.hypot(*forward[:2])
        offsets.append(-0.5 * forward + 0.2 * np.cross(forward, [0, 0, 1]) + [0, 0, 0.3])
    to_wgs84 = transformer(UTM, "EPSG:4326")
    photographs = []
    for photo, view, offset in zip(scene.survey.photographs, scene.views, offsets, strict=True):
        at = FRAME.to_crs((view.centre + offset)[None])[0]
        photographs.append(replace(photo, position=Position(*to_wgs84.transform(*at[:2]), float(at[2]), 0.02, 0.02)))
    survey = Survey.create(tmp_path / "survey", tmp_path, scene.survey.crs, photographs)
    survey.finish("orient", "1", built_on=(), parameters={}, result={})
    assert run(scene.request([], gnss=True)).plani_gnss > 0.3
    assert run(scene.request([], gnss=True, lever_arm="0.2 -0.5 0.3")).plani_gnss < 0.002
    assert np.abs(scene.errors()).max() < 0.01
    with pytest.raises(InputError, match="LEVER_ARM"):
        run(scene.request([], gnss=True, lever_arm="0.2 up"))


def test_a_single_strip_is_refused(tmp_path):
    scene = Scene(tmp_path, strips=1, gnss_noise=0.3)
    with pytest.raises(NotEnoughData, match="tilt about it is not determined"):
        run(scene.request([], gnss=True))


def test_a_single_strip_with_one_point_beside_it_is_placed(tmp_path):
    scene = Scene(tmp_path, strips=1, gnss_noise=0.02, gnss_sigma=0.02)
    run(scene.request(["north west", "south east"], gnss=True))
    assert np.abs(scene.errors()).max() < 0.3


def test_control_on_a_line_is_refused_and_helped_by_gnss(tmp_path):
    scene = Scene(tmp_path, gnss_noise=0.02, gnss_sigma=0.02)
    line = {"a": (0, -20, 1), "b": (0, 0, 1), "c": (0, 15, 1)}
    scene.gcps = {n: FRAME.to_crs(np.array([p], float))[0] for n, p in line.items()}
    scene.marks = [[n, v.name, *v.project(np.array([p], float))[0]] for n, p in line.items() for v in scene.views[:4]]
    scene.marks = [m for m in scene.marks if within(np.array(m[2:]))]
    with pytest.raises(NotEnoughData, match="on one line"):
        run(scene.request())
    run(scene.request(gnss=True))
    assert np.abs(scene.errors()).max() < 0.3


def test_a_long_narrow_beach_is_not_refused(tmp_path):
    scene = Scene(tmp_path)
    narrow = {"a": (0, -20, 1), "b": (1.5, 0, 1), "c": (0, 15, 1), "d": (1.5, -10, 1)}
    scene.gcps = {n: FRAME.to_crs(np.array([p], float))[0] for n, p in narrow.items()}
    scene.marks = [[n, v.name, *v.project(np.array([p], float))[0]] for n, p in narrow.items() for v in scene.views]
    scene.marks = [m for m in scene.marks if within(np.array(m[2:]))]
    run(scene.request())
    assert "weak away from its points" in scene.report()


def test_swapped_coordinates_are_refused(tmp_path):
    scene = Scene(tmp_path)
    middle = np.mean(list(scene.gcps.values()), axis=0)
    scene.gcps = {n: middle + (p - middle)[[1, 0, 2]] for n, p in scene.gcps.items()}
    with pytest.raises(InputError, match="look up"):
        run(scene.request())


def test_too_few_points_are_refused(tmp_path):
    scene = Scene(tmp_path)
    with pytest.raises(NotEnoughData, match="2 control points"):
        run(scene.request(["middle", "west"]))
    scene.marks = scene.marks[:1]
    with pytest.raises(NotEnoughData, match="None of the 6 control points"):
        run(scene.request())


def test_a_point_with_one_mark_is_reported(tmp_path):
    scene = Scene(tmp_path)
    middle = [m for m in scene.marks if m[0] == "middle"]
    scene.marks = [m for m in scene.marks if m[0] != "middle"] + middle[:1]
    result = run(scene.request())
    assert result.control_count == 5
    assert "middle is not used: it has 1 mark in oriented photographs" in scene.report()
    residuals = read_layer(VectorSource(str(tmp_path / "residuals.gpkg"), "residuals"))
    at = residuals.text("name").index("middle")
    assert np.isnan(residuals.numbers("dU")[at])
    assert residuals.numbers("marks")[at] == 1


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"marks": None}, "belong together"),
        ({"gcp_file": "x.txt"}, "takes the place"),
        ({"sigma_h": 0.0}, "SIGMA_H"),
        ({"check": "nobody"}, "'nobody' of CHECK"),
        ({"name_field": None}, "NAME_FIELD"),
        ({"name_field": "label"}, "no field 'label'"),
        ({"crs": "EPSG:4326"}, "not projected"),
        ({"residuals": "residuals.shp"}, "GeoPackage"),
        ({"survey": "nowhere"}, "not a survey"),
    ],
)
def test_bad_input_is_one_sentence_and_costs_nothing(tmp_path, options, why):
    scene = Scene(tmp_path)
    run(scene.request())
    before = Survey.open(tmp_path / "survey").record("georeference")
    with pytest.raises(InputError, match=why) as told:
        run(replace(scene.request(), **options))
    assert str(told.value).count(". ") == 0
    assert Survey.open(tmp_path / "survey").record("georeference") == before


def test_orient_must_stand(tmp_path):
    scene = Scene(tmp_path)
    scene.survey.forget("orient")
    with pytest.raises(InputError, match="run strandline:orient first"):
        run(scene.request())


def test_again_is_the_same_and_leaves_the_model_alone(tmp_path):
    scene = Scene(tmp_path)
    first = run(scene.request())
    record = Survey.open(tmp_path / "survey").record("georeference")
    written = (tmp_path / "survey" / FOLDER / "images.bin").stat().st_mtime_ns
    assert run(scene.request()) == first
    again = Survey.open(tmp_path / "survey").record("georeference")
    assert again.fingerprint == record.fingerprint
    assert (tmp_path / "survey" / FOLDER / "images.bin").stat().st_mtime_ns == written
    run(scene.request(sigma_h=0.02))
    assert Survey.open(tmp_path / "survey").record("georeference").fingerprint != record.fingerprint


def test_a_kill_leaves_no_record_that_its_files_belie(tmp_path, monkeypatch):
    scene = Scene(tmp_path)
    run(scene.request())

    def die(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Georef, "write", die)
    with pytest.raises(KeyboardInterrupt):
        run(scene.request(sigma_v=0.5))
    with pytest.raises(InputError, match="run strandline:georeference first"):
        Survey.open(tmp_path / "survey").require("georeference")
    monkeypatch.undo()
    run(scene.request())
    assert Survey.open(tmp_path / "survey").require("georeference")
    assert not [p for p in (tmp_path / "survey").iterdir() if p.name.startswith(".part")]


def test_half_a_pixel_of_odm(tmp_path):
    """An ODM list of the same marks, counted from pixel centres, gives the same block."""
    scene = Scene(tmp_path, mark_noise=0.0)
    lines = ["WGS84 UTM 31N"]
    lines += [
        "\t".join([*map(repr, map(float, scene.gcps[g])), repr(float(x) - 0.5), repr(float(y) - 0.5), i.lower(), g, "extra"])
        for g, i, x, y in scene.marks
    ]
    path = tmp_path / "gcp_list.txt"
    path.write_text("\n".join(lines), encoding="utf-8")
    result = run(scene.request([], gcp_file=str(path)))
    assert result.control_count == 6
    assert np.abs(scene.errors()).max() < 1e-4


def test_report_is_one_page_with_its_map(tmp_path):
    scene = Scene(tmp_path)
    copy = tmp_path / "copy.html"
    run(scene.request(output_html_file=str(copy)))
    assert copy.read_text(encoding="utf-8") == scene.report()
    assert "data:image/png" in scene.report()
    assert "://" not in scene.report()
    assert json.loads((tmp_path / "survey" / "georef.json").read_text())["method"] == "similarity"


def test_ground_points_of_another_crs_are_far_from_the_photographs(tmp_path):
    scene = Scene(tmp_path)
    request = scene.request(gnss=True)
    wrong = replace(request, gcps=replace(request.gcps, crs="EPSG:32632"))  # the zone next to it
    with pytest.raises(InputError, match=r"put the block \d+ km from the GNSS positions"):
        run(wrong)
    assert Survey.open(tmp_path / "survey").record("georeference") is None
    assert run(replace(wrong, use_gnss=False)).control_count == 6  # it may be the positions that are wrong


# What the analyst is told


def bent(scene, rise, count=12):
    """Give the scene ``count`` points on rings, whose surveyed heights see the block rise by ``rise`` at the outermost."""
    angle = np.arange(count) * 2.4
    reach = np.sqrt((np.arange(count) + 0.5) / (count - 0.5))
    places = np.stack([19 * reach * np.cos(angle), 22 * reach * np.sin(angle), np.sin(3 * angle)], axis=1)
    lower = np.outer(rise * reach**2, [0, 0, 1])
    scene.gcps = {f"P{n}": p for n, p in enumerate(FRAME.to_crs(places) - lower)}
    rng = np.random.default_rng(7)
    scene.marks = []
    for n, place in enumerate(places):
        for view in scene.views:
            pixels = view.project(place[None])[0]
            if within(pixels):
                scene.marks.append([f"P{n}", view.name, *(pixels + rng.normal(size=2) * 0.3)])
    scene.survey_gcps(0.01, 0.02)


def test_a_dome_is_told_with_its_size(tmp_path):
    scene = Scene(tmp_path)
    bent(scene, 0.3)
    result = run(scene.request(check="P3, P7"))
    # Its sigma is 3 cm: rings of twelve points, of 2 cm and marks of 0.5 px.
    assert result.doming == pytest.approx(0.3, abs=0.09)
    assert "Height errors form a dome of +0.3" in scene.report() or "Height errors form a dome of +0.2" in scene.report()
    assert "beyond chance" in scene.report()


def test_without_a_dome_the_number_stands_and_nobody_is_warned(tmp_path):
    scene = Scene(tmp_path)
    bent(scene, 0.0)
    result = run(scene.request(check="P3, P7"))
    assert result.doming is not None
    assert abs(result.doming) < 0.09
    assert "form a dome" not in scene.report()
    assert "no more than chance" in scene.report()


def test_control_in_the_corners_of_the_beach_is_near_enough_to_the_edges(tmp_path):
    """Tie points reach 10 m beyond the control; there the georeferencing is still known to a pixel or two."""
    scene = Scene(tmp_path)
    scene.survey_gcps(0.005, 0.005)
    run(scene.request(sigma_h=0.005, sigma_v=0.005, sigma_mark=0.2))
    assert "weak away from its points" not in scene.report()


def test_control_in_one_corner_is_told(tmp_path):
    scene = Scene(tmp_path)
    corner = {"a": (-18, -22, 0), "b": (-12, -22, 0), "c": (-18, -15, 0), "d": (-12, -15, 0.5)}
    scene.gcps = {n: FRAME.to_crs(np.array([p], float))[0] for n, p in corner.items()}
    scene.marks = [[n, v.name, *v.project(np.array([p], float))[0]] for n, p in corner.items() for v in scene.views]
    scene.marks = [m for m in scene.marks if within(np.array(m[2:]))]
    run(scene.request())
    assert "weak away from its points: sigma at the edge of the ground that 3 photographs see" in scene.report()


def test_another_datum_is_suspected(tmp_path):
    scene = Scene(tmp_path, gnss_shift=(90.0, 60.0, 0.0))
    run(scene.request(gnss=True))
    assert "GNSS positions are 108 m off the block" in scene.report()


# Ground control of other makes, and heights that cannot be right


def test_micmacs_files_give_the_same_block(tmp_path):
    scene = Scene(tmp_path, mark_noise=0.0)
    files = tmp_path / "micmac"
    files.mkdir()
    points = "".join(
        f"<OneAppuisDAF><Pt>{' '.join(map(repr, map(float, p)))}</Pt><NamePt>{n}</NamePt><Incertitude>1 1 "
        "1</Incertitude></OneAppuisDAF>"
        for n, p in scene.gcps.items()
    )
    marks = "".join(
        f"<MesureAppuiFlottant1Im><NameIm>{i}</NameIm><OneMesureAF1I><NamePt>{g}</NamePt><PtIm>{float(x)!r} {float(y)!r}</PtIm>"
        "</OneMesureAF1I></MesureAppuiFlottant1Im>"
        for g, i, x, y in scene.marks
    )
    (files / "gcps.xml").write_text(f"<DicoAppuisFlottant>{points}</DicoAppuisFlottant>", encoding="utf-8")
    measures = f"<SetOfMesureAppuisFlottants>{marks}</SetOfMesureAppuisFlottants>"
    (files / "measures-S2D.xml").write_text(measures, encoding="utf-8")
    result = run(scene.request([], gcp_file=str(files / "gcps.xml")))
    assert result.control_count == 6
    assert np.abs(scene.errors()).max() < 1e-4
    assert "the marks are those of measures-S2D.xml in the same folder" in scene.report()
    assert "gcps.xml names no CRS: its coordinates are taken as those of WGS 84 / UTM zone 31N" in scene.report()
    survey = Survey.create(tmp_path / "survey", tmp_path, None, [replace(p, position=None) for p in scene.survey.photographs])
    survey.finish("orient", "1", built_on=(), parameters={}, result={})
    with pytest.raises(InputError, match=r"gcps\.xml names no CRS, and the survey has none, .* give CRS\."):
        run(scene.request([], gcp_file=str(files / "gcps.xml")))


@pytest.mark.parametrize(("unit", "factor"), [("millimetres", 1000.0), ("feet", 1 / 0.3048)])
def test_heights_in_another_unit_are_refused_by_name(tmp_path, unit, factor):
    scene = Scene(tmp_path)
    scene.gcps = {n: p * [1, 1, factor] for n, p in scene.gcps.items()}
    with pytest.raises(InputError, match=f"The heights of gcps fit the photographs as {unit}"):
        run(scene.request(gnss=True))


def test_one_point_on_another_level_than_gnss_does_not_bend_the_block(tmp_path):
    """Nothing was said of the heights: the mismatch is found, told, and GNSS used for differences only."""
    scene = Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03, gnss_shift=(0.0, 0.0, 45.0))
    result = run(scene.request(["middle"], gnss=True))
    at = np.hypot(*(scene.points[:, :2] - np.array(GCPS["middle"])[:2]).T) < 10
    assert np.abs(scene.errors()[at]).max() < 0.1
    assert result.alti_gnss is None
    assert "GNSS heights lie 45" in scene.report()


def test_check_points_alone_tell_the_mismatch_as_their_error(tmp_path):
    scene = Scene(tmp_path, gnss_noise=0.03, gnss_sigma=0.03, gnss_shift=(0.0, 0.0, 45.0))
    result = run(scene.request(["middle", "west"], gnss=True, check="middle, west"))
    assert result.alti_check == pytest.approx(45.0, abs=0.5)
    assert "GNSS heights lie 45" in scene.report()


def test_a_geoid_with_the_wrong_sign_is_told(tmp_path):
    scene = Scene(tmp_path, gnss_shift=(0, 0, 48.0), mark_noise=0.0)
    kinds = {"gcp_heights": "orthometric", "gnss_heights": "ellipsoidal"}
    assert run(scene.request(gnss=True, geoid="-48", **kinds)).alti_gnss is None
    assert "GNSS heights lie 96.0 m above those of gcps, although GEOID has been applied: check its values" in scene.report()


def test_a_vertical_crs_without_its_grid_leaves_gnss_heights_out_and_says_why(tmp_path):
    scene = Scene(tmp_path, gnss_shift=(0, 0, 48.0), mark_noise=0.0)
    request = scene.request(gnss=True, gnss_heights="ellipsoidal", method="similarity")
    request = replace(request, gcps=replace(request.gcps, crs="EPSG:32631+5773"))  # EGM96 heights
    assert run(request).alti_gnss is None
    assert np.abs(scene.errors()).max() < 1e-4
    assert Georef.read(Survey.open(tmp_path / "survey")).heights == "orthometric"
    assert "The heights of gcps are taken as orthometric, as its CRS WGS 84 / UTM zone 31N + EGM96 height says" in scene.report()
    assert (
        "there is no GEOID (PROJ has no grid installed for EGM96 height at the survey): GNSS heights are used for"
        in scene.report()
    )
    assert run(replace(request, geoid="48")).alti_gnss == pytest.approx(0.0, abs=1e-3)
    assert "PROJ's grid" not in scene.report()
    with pytest.raises(InputError, match="GCP_HEIGHTS is ellipsoidal but the CRS of gcps"):
        run(replace(request, gcp_heights="ellipsoidal"))


def test_the_grid_of_a_vertical_crs_brings_gnss_to_the_control(tmp_path, monkeypatch):
    """What PROJ makes of a real grid is tested with the heights; here one of 48 m stands in for it."""
    scene = Scene(tmp_path, gnss_shift=(0, 0, 48.0), mark_noise=0.0)
    monkeypatch.setattr(
        "strandline.core.orientation.inputs.undulation_of_crs", lambda _crs, points, _of: np.full(len(points), 48.0)
    )
    request = scene.request(gnss=True, gnss_heights="ellipsoidal", method="similarity")
    request = replace(request, gcps=replace(request.gcps, crs="EPSG:32631+5773"))
    assert run(request).alti_gnss == pytest.approx(0.0, abs=1e-3)
    assert "GNSS heights were brought to those of gcps by PROJ" in scene.report()
