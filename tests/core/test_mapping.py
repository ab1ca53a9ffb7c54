"""From a database to a sparse model: simulated tracks whose truth is known."""

import cv2  # noqa: F401 - before pycolmap
import laspy
import numpy as np
import pycolmap
import pytest
from strandline.core.camera import Camera
from strandline.core.orientation.focal import FocalPrior, far_off
from strandline.core.orientation.mapping import map_photographs, read_network, triangulate
from strandline.core.orientation.merging import join
from strandline.core.orientation.orientpictures import residual_field
from strandline.core.orientation.pointcloud import write_points
from strandline.core.orientation.selfcalibration import (
    MODELS,
    Observations,
    adjust,
    among,
    camera_sigmas,
    convert_camera,
    drop_observations,
    indexed,
    observations,
    principal_point_is_adjusted,
    robust_sigma,
    self_calibrate,
    set_camera,
)
from strandline.core.orientation.similarity import umeyama
from strandline.core.progress import SILENT
from strandline.core.survey import Photograph
from strandline.core.tiepoints.database import provisional_camera, write_database
from strandline.core.tiepoints.matching import PairMatches

TRUE = Camera("OPENCV", 1600, 1200, (1500.0, 1500.0, 800.0, 600.0, -0.08, 0.03, 0.0005, -0.0003))
NOISE = 0.3  # px per axis


def rotation(omega, phi, kappa):
    """Return the rotation of a camera that looks down, turned by small angles (radians) and by kappa about its axis."""
    down = np.diag([1.0, -1.0, -1.0])
    cx, sx, cy, sy, cz, sz = np.cos(omega), np.sin(omega), np.cos(phi), np.sin(phi), np.cos(kappa), np.sin(kappa)
    return (
        np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        @ down
    )


def simulate(folder, strips=3, length=4, points=1500, seed=0, outliers=0.02):
    """Write a database of a flight 30 m above dunes; return its path and the true centres."""
    rng = np.random.default_rng(seed)
    centres = np.array([[8.0 * c, 10.0 * r, 30 + rng.normal(0, 1.5)] for r in range(strips) for c in range(length)])
    ground = rng.uniform([-15, -12, 0], [8 * length + 7, 10 * strips + 2, 0], (points, 3))
    ground[:, 2] = 1.5 * np.sin(ground[:, 0] / 5) * np.cos(ground[:, 1] / 7)
    photographs, keypoints, index = [], [], []
    for i, centre in enumerate(centres):
        turn = rotation(*rng.normal(0, 0.05, 2), np.pi * (i // length % 2))
        xy = TRUE.project((ground - centre) @ turn.T)
        seen = np.flatnonzero(np.all((xy > 5) & (xy < [1595, 1195]), axis=1))
        xy = xy[seen] + rng.normal(0, NOISE, (len(seen), 2))
        bad = rng.random(len(seen)) < outliers
        xy[bad] += rng.normal(0, 20, (int(bad.sum()), 2))
        photographs.append(Photograph(f"{i:02d}.jpg", 1, "", 1600, 1200, "camera", focal=1450.0))
        keypoints.append(np.column_stack([xy, np.full(len(xy), 2.0), np.zeros(len(xy))]).astype(np.float32))
        index.append({int(p): n for n, p in enumerate(seen)})
    pairs = {}
    for i in range(len(centres)):
        for j in range(i + 1, len(centres)):
            both = sorted(set(index[i]) & set(index[j]))
            if len(both) >= 15:
                matches = np.array([[index[i][p], index[j][p]] for p in both], np.int32)
                config = int(pycolmap.TwoViewGeometryConfiguration.UNCALIBRATED)
                pairs[i, j] = PairMatches(matches, config, np.zeros((3, 3)), np.zeros((3, 3)), np.eye(3))
    write_database(folder / "features.db", photographs, keypoints, pairs, count=sum(map(len, keypoints)))
    return folder / "features.db", centres


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return simulate(tmp_path_factory.mktemp("flight"))


@pytest.fixture(scope="module")
def mapped(flight):
    database, _ = flight
    network = read_network(database)
    return database, map_photographs(database, network, mapper="incremental", given={}, progress=SILENT)[0]


def start(model):
    """Return a copy of a model with Brown's camera."""
    copy = pycolmap.Reconstruction(model)
    for key, camera in copy.cameras.items():
        set_camera(copy, key, convert_camera(Camera(camera.model.name, 1600, 1200, tuple(camera.params)), MODELS["brown"]))
    return copy


def test_the_database_opens_and_groups_cameras(tmp_path):
    photographs = [
        Photograph("a/1.jpg", 1, "", 400, 300, "one", focal=350.0),
        Photograph("b/2.jpg", 1, "", 400, 300, "two"),
        Photograph("b/3.jpg", 1, "", 400, 300, "one", focal=350.0),
    ]
    points = [np.array([[1.5, 2.5, 3.0, 0.1], [5.0, 6.0, 2.0, 0.0]], np.float32)] * 3
    pair = PairMatches(np.array([[1, 0]], np.int32), 3, np.zeros((3, 3)), np.eye(3), np.eye(3))
    write_database(tmp_path / "f.db", photographs, points, {(0, 2): pair}, count=sum(map(len, points)))
    database = pycolmap.Database.open(tmp_path / "f.db")
    assert (database.num_images(), database.num_cameras(), database.num_rigs(), database.num_frames()) == (3, 2, 2, 3)
    image = database.read_image_with_name("b/3.jpg")
    assert image.image_id == 3
    assert image.camera_id == database.read_image_with_name("a/1.jpg").camera_id
    assert database.read_camera(image.camera_id).has_prior_focal_length
    guessed = database.read_camera(database.read_image_with_name("b/2.jpg").camera_id)
    assert not guessed.has_prior_focal_length
    assert guessed.params.tolist() == [480.0, 200.0, 150.0, 0.0]
    assert np.array_equal(database.read_two_view_geometry(1, 3).inlier_matches, [[1, 0]])
    assert np.array_equal(np.asarray(database.read_keypoints(2)), points[1])
    database.close()
    assert not list(tmp_path.glob(".part*"))
    network = read_network(tmp_path / "f.db")
    assert network.names == {1: "a/1.jpg", 2: "b/2.jpg", 3: "b/3.jpg"}
    assert network.matches[1, 3].tolist() == [[1, 0]]
    assert network.cameras[1] == provisional_camera(photographs[0])


def test_a_simulated_flight_is_oriented_and_its_camera_found(flight, mapped):
    database, first = mapped
    _, centres = flight
    model = start(first)
    assert model.num_reg_images() == len(centres)
    self_calibrate(model, "brown", (), rounds=2, iterations=50)
    model = triangulate(database, model)
    self_calibrate(model, "brown", (), rounds=2, iterations=50)
    found = observations(model)
    # Two numbers per observation determine three unknowns per point, so residuals are smaller than the noise; those of
    # points of few rays are the smallest, which draws the median below the mean.
    left = np.sqrt(1 - 3 * model.num_points3D() / (2 * len(found.image)))
    assert robust_sigma(found.length) == pytest.approx(NOISE * left, rel=0.12)
    assert len(found.image) / len(centres) > 200
    images = sorted((model.images[i] for i in model.reg_image_ids()), key=lambda image: image.name)
    estimated = np.array([image.projection_center() for image in images])
    fit = umeyama(estimated, centres)
    # 3 strips, 1 px is 2 cm on the ground: poses are good to a few centimetres, heights worse for the free focal length.
    assert np.abs(fit.apply(estimated) - centres).max() < 0.15
    fx, fy, cx, cy, k1, *_ = model.cameras[1].params
    assert [fx, fy] == pytest.approx([1500, 1500], rel=0.01)
    assert [cx, cy] == pytest.approx([800, 600], abs=10)
    assert k1 == pytest.approx(-0.08, abs=0.01)


def test_the_sigmas_of_the_camera_cover_its_errors(mapped):
    _, first = mapped
    model = start(first)
    self_calibrate(model, "brown", (), rounds=2, iterations=50)
    sigmas = camera_sigmas(model, "brown", ())
    error = np.array(model.cameras[1].params) - TRUE.params
    assert np.all(sigmas[1] > 0)
    assert np.all(np.abs(error) < 4.5 * sigmas[1])  # eight parameters, correlated; 4.5 sigma is one in 10^5 for each
    assert camera_sigmas(model, "brown", (1,)) == {}


def test_a_focal_length_known_beforehand_weighs_as_much_as_the_independent_part_of_the_tie_points(mapped):
    _, first = mapped
    free = start(first)
    self_calibrate(free, "radial", (), rounds=2, iterations=50)
    adjust(free, "radial", (), robust=1e6, iterations=50)
    found, alone = observations(free), free.cameras[1].params[0]
    overstated = len(found.image) / free.num_reg_images() / 100
    assert overstated > 1
    sigma = camera_sigmas(free, "radial", ())[1][0] * np.sqrt(overstated)
    held = pycolmap.Reconstruction(free)
    prior = {1: FocalPrior(alone + 2 * sigma, sigma)}  # as certain as the tie points are: the result lies half way
    adjust(held, "radial", (), robust=1e6, iterations=50, priors=prior)
    assert held.cameras[1].params[0] == pytest.approx(alone + sigma, abs=0.15 * sigma)
    assert far_off(held, prior, ()) == []
    [sentence] = far_off(held, {1: FocalPrior(1.1 * alone, 0.01 * alone)}, ())
    assert "check that the photographs are not cropped" in sentence
    # A camera that is held takes no prior.
    adjust(free, "radial", {1}, robust=1e6, iterations=5, priors=prior)
    assert free.cameras[1].params[0] == alone


def part(model, names, change=None):
    """Return a copy of a model with only the photographs of these names, in another frame."""
    copy = pycolmap.Reconstruction(model)
    for image_id in sorted(copy.reg_image_ids()):
        if copy.images[image_id].name not in names:
            copy.deregister_frame(copy.images[image_id].frame_id)
    if change is not None:
        copy.transform(change)
    return copy


def test_models_that_share_a_photograph_are_joined(flight, mapped):
    database, whole = mapped
    names = [f"{i:02d}.jpg" for i in range(12)]
    turned = pycolmap.Rotation3d(np.array([1.0, 3.0, 3.0, 9.0]) / 10.0)  # a unit quaternion: 1 + 9 + 9 + 81 = 100
    change = pycolmap.Sim3d(2.5, turned, np.array([3.0, -2.0, 7.0]))
    block, rest, joined = join([part(whole, names[:8]), part(whole, names[6:11], change), part(whole, names[11:], change)])
    assert joined
    assert [m.num_reg_images() for m in rest] == [1]  # the last shares no photograph
    assert block.num_reg_images() == 11
    # The two parts are exact copies but for the frame, so the join is exact.
    for image in (block.images[i] for i in block.reg_image_ids()):
        assert np.allclose(image.projection_center(), whole.images[image.image_id].projection_center(), atol=1e-9)
    assert triangulate(database, block).num_points3D() > 500


def test_models_that_do_not_fit_are_left_apart(mapped):
    _, whole = mapped
    names = [f"{i:02d}.jpg" for i in range(12)]
    other = part(whole, names[6:])
    rng = np.random.default_rng(0)
    for point in other.points3D.values():
        point.xyz = point.xyz + rng.normal(0, 2, 3)
    block, rest, joined = join([part(whole, names[:8]), other])
    assert not joined
    assert block.num_reg_images() == 8
    assert len(rest) == 1


def test_the_same_input_gives_the_same_to_the_bit(flight, mapped):
    database, first = mapped
    again = map_photographs(database, read_network(database), mapper="incremental", given={}, progress=SILENT)[0]
    models = [start(m) for m in (first, again)]
    for model in models:
        adjust(model, "brown", (), robust=1.0, iterations=10)
    assert np.array_equal(models[0].cameras[1].params, models[1].cameras[1].params)
    for i in models[0].reg_image_ids():
        assert np.array_equal(models[0].images[i].projection_center(), models[1].images[i].projection_center())


def test_a_given_camera_is_held(flight):
    database, _ = flight
    network = read_network(database)
    model = map_photographs(database, network, mapper="incremental", given={1: TRUE}, progress=SILENT)[0]
    assert model.num_reg_images() == 12
    adjust(model, "brown", {1}, robust=1.0, iterations=20)
    assert model.cameras[1].params.tolist() == list(TRUE.params)
    assert triangulate(database, model).cameras[1].params.tolist() == list(TRUE.params)


def test_the_global_mapper_orients_too(flight):
    database, centres = flight
    model = map_photographs(database, read_network(database), mapper="global", given={}, progress=SILENT)[0]
    assert model.num_reg_images() == len(centres)


def test_outliers_are_dropped_and_only_they(mapped):
    _, first = mapped
    model = pycolmap.Reconstruction(first)
    before = observations(model)
    limit = float(np.quantile(before.length, 0.9))
    drop_observations(model, before, limit)
    after = observations(model)
    assert after.length.max() <= limit
    assert len(after.image) == pytest.approx(0.9 * len(before.image), rel=0.05)


def test_cameras_convert_by_name():
    simple = Camera("SIMPLE_RADIAL", 100, 80, (90.0, 50.0, 40.0, 0.1))
    assert convert_camera(simple, "OPENCV").params == (90.0, 90.0, 50.0, 40.0, 0.1, 0.0, 0.0, 0.0)
    assert convert_camera(simple, "RADIAL").params == (90.0, 50.0, 40.0, 0.1, 0.0)
    assert convert_camera(simple, "SIMPLE_RADIAL") == simple
    full = convert_camera(TRUE, "FULL_OPENCV")
    points = np.array([[0.2, 0.1, 1.0], [-0.3, 0.2, 1.0]])
    assert np.allclose(full.project(points), TRUE.project(points))


def test_the_principal_point_is_held_in_small_blocks():
    assert principal_point_is_adjusted({1: 10}, "brown", ())
    assert not principal_point_is_adjusted({1: 9}, "brown", ())
    assert not principal_point_is_adjusted({1: 30}, "radial", ())
    assert not principal_point_is_adjusted({1: 30, 2: 3}, "full", ())
    assert principal_point_is_adjusted({1: 30, 2: 3}, "full", (2,))


def test_the_cloud_keeps_six_digits_of_any_unit(tmp_path):
    rng = np.random.default_rng(0)
    for size in (1e-3, 1.0, 1e4):
        xyz = rng.normal(0, size, (200, 3)) + 5 * size
        write_points(tmp_path / "p.laz", xyz, rays=np.arange(200) + 100, errors=np.full(200, 0.25))
        cloud = laspy.read(tmp_path / "p.laz")
        assert np.abs(np.asarray(cloud.xyz) - xyz).max() < 1e-6 * size
        assert cloud.user_data.max() == 255
        assert np.asarray(cloud.residual)[0] == 0.25
    write_points(tmp_path / "none.laz", np.zeros((0, 3)), rays=np.zeros(0, int), errors=np.zeros(0))
    assert len(laspy.read(tmp_path / "none.laz").points) == 0


def test_the_residual_field_is_the_mean_of_each_cell():
    xy = np.concatenate(
        [np.full((10, 2), 5.0), np.full((9, 2), 100.0), np.full((20, 2), [155.0, 75.0]), np.full((10, 2), [160.0, 5.0])]
    )
    mixed = np.tile([[2.0, 0.0], [0.0, 0.0]], (5, 1))  # mean 1, variance 1 in x: ten of them leave a third by chance
    residual = np.concatenate([np.full((10, 2), [1.0, -1.0]), np.ones((9, 2)), np.full((20, 2), [0.5, 0.0]), mixed])
    field = residual_field(xy, residual, 160, 80)
    assert field[:, :4].tolist() == [[5.0, 5.0, 1.0, -1.0], [155.0, 5.0, 1.0, 0.0], [155.0, 75.0, 0.5, 0.0]]
    assert field[:, 4] == pytest.approx([0.0, 1 / 3, 0.0])


def test_observations_are_indexed_by_photograph_and_track():
    none = np.zeros((4, 2))
    found = Observations(np.array([2, 2, 7, 9]), np.array([5, 8, 5, 0]), np.array([40, 30, 40, 30]), none)
    photograph, track = indexed(found, [9, 2, 7])
    assert photograph.tolist() == [1, 1, 2, 0]
    assert track.tolist() == [1, 0, 1, 0]
    kept = Observations(np.array([2, 9]), np.array([8, 5]), np.array([30, 30]), none[:2])
    assert among(found, kept).tolist() == [False, True, False, False]
