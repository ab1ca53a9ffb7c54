"""Polygons on the ground as masks in photographs: by hand, against every pixel's ray, and through the step enhance."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pycolmap
import pytest
import shapely
from PIL import Image
from scipy.spatial.transform import Rotation
from strandline.core.block import View
from strandline.core.camera import Camera
from strandline.core.contract import VectorSource
from strandline.core.errors import InputError
from strandline.core.frames import LocalFrame, transformer
from strandline.core.georef import FOLDER, Georef
from strandline.core.photographs import createsurvey
from strandline.core.photographs.enhance import Request, enhanced_mask, enhanced_mask_path, enhanced_path, run
from strandline.core.photographs.masking import outline_in, unmasked
from strandline.core.photographs.poses import Noted, camera_from_east_north_up
from strandline.core.survey import Photograph, Position, Survey
from strandline.core.vector import write_layer

UTM = "EPSG:32631"
CENTRE = np.array([512000.0, 4983000.0, 3.0])
FRAME = LocalFrame.at(UTM, *CENTRE)
SIZE = 400, 300
LENS = Camera("OPENCV", *SIZE, (300.0, 300.0, 203.0, 148.0, -0.08, 0.03, 0.001, -0.001))
HEIGHT = 30.0
NADIR = np.diag([1.0, -1.0, -1.0])  # the image's top to the north


def level(xy):
    return np.zeros(len(xy))


def hill(xy):
    return 2.0 * np.sin(xy[:, 0] / 6.0) + 0.1 * xy[:, 1]


def pose(camera, centre, rotation):
    return View("a.jpg", camera, rotation, -rotation @ np.asarray(centre, float))


def by_rays(view, polygon, heights):
    """Tell of every pixel's centre whether its ray meets the ground inside the polygon, by bisection along the ray."""
    width, height = view.camera.width, view.camera.height
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = view.camera.unproject(np.column_stack([x.ravel(), y.ravel()])) @ view.rotation
    down = rays[:, 2] < -0.05
    low, high = np.zeros(len(rays)), np.full(len(rays), 40 * HEIGHT)
    for _ in range(50):
        middle = (low + high) / 2
        points = view.centre + middle[:, None] * rays
        above = points[:, 2] > heights(points[:, :2])
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    points = view.centre + low[:, None] * rays
    return (down & shapely.contains_xy(polygon, *points[:, :2].T)).reshape(height, width), down.reshape(height, width)


def test_a_square_by_hand():
    # 10 m above level ground, f = 100 px: 10 px a metre. East is right, north is up in the image.
    view = pose(Camera("SIMPLE_PINHOLE", 200, 100, (100.0, 100.0, 50.0)), [0, 0, 10], NADIR)
    outline = outline_in(view, shapely.box(1, 1, 3, 2), level)
    assert shapely.bounds(outline) == pytest.approx([110, 30, 130, 40])
    mask = unmasked(outline, 200, 100)
    assert not mask[30:40, 110:130].any()
    assert 200 <= (~mask).sum() <= 22 * 12  # the pixels the edge runs along may be masked too
    # The ground is at half the height there: 20 px a metre, from the principal point.
    outline = outline_in(view, shapely.box(1, 1, 3, 2), lambda xy: np.full(len(xy), 5.0))
    assert shapely.bounds(outline) == pytest.approx([120, 10, 160, 30])
    # A margin of 0.05 is 0.5 m from 10 m: 5 px.
    outline = outline_in(view, shapely.box(1, 1, 3, 2), level, 0.05)
    assert shapely.bounds(outline) == pytest.approx([105, 25, 135, 45], abs=0.2)


def test_partly_outside_covering_elsewhere_and_with_a_hole():
    view = pose(Camera("SIMPLE_PINHOLE", 200, 100, (100.0, 100.0, 50.0)), [0, 0, 10], NADIR)
    assert shapely.bounds(outline_in(view, shapely.box(5, -100, 300, 100), level)) == pytest.approx([150, 0, 200, 100])
    assert not unmasked(outline_in(view, shapely.box(-1e5, -1e5, 1e5, 1e5), level), 200, 100).any()
    assert outline_in(view, shapely.box(300, 0, 310, 10), level).is_empty
    assert unmasked(outline_in(view, shapely.box(300, 0, 310, 10), level), 200, 100).all()
    ring = shapely.box(-4, -4, 4, 4).difference(shapely.box(-1, -1, 1, 1))
    mask = unmasked(outline_in(view, ring, level), 200, 100)
    assert mask[42:58, 92:108].all()
    assert not mask[42:58, 62:88].any()


@pytest.mark.parametrize("heights", [level, hill])
@pytest.mark.parametrize("tilt", [0.0, 25.0, 60.0, 85.0])
def test_against_every_pixels_ray(tilt, heights):
    """A shore with a bay, an islet in it, and the photographer's own ground behind the camera."""
    rotation = Rotation.from_euler("x", tilt, degrees=True).as_matrix() @ NADIR
    rotation = rotation @ Rotation.from_euler("z", 20.0, degrees=True).as_matrix()
    view = pose(LENS, [1.0, -2.0, HEIGHT], rotation)
    sea = shapely.Polygon([(2, -900), (6, -3), (-8, 4), (7, 9), (3, 900), (900, 900), (900, -900)])
    sea = sea.difference(shapely.Point(4, 4).buffer(2.5))
    expected, down = by_rays(view, sea, heights)
    masked = ~unmasked(outline_in(view, sea, heights), *SIZE)
    # What differs is a pixel's width of edges; where hills hide ground, edges behind them are drawn too.
    kernel = np.ones((5, 5), np.uint8)
    edges = cv2.morphologyEx(expected.astype(np.uint8), cv2.MORPH_GRADIENT, kernel).astype(bool)
    edges |= cv2.dilate((~down).astype(np.uint8), np.ones((9, 9), np.uint8)).astype(bool)
    wrong = (masked != expected) & ~edges
    assert expected[down].any()
    assert not expected[down].all()
    hidden = 0.02 if heights is hill and tilt > 30 else 1e-4  # a few pixels at sharp corners
    assert wrong.mean() <= hidden


@pytest.mark.parametrize("k1", [-0.1, 0.25])
def test_a_wholly_covered_photograph_with_a_strong_lens(k1):
    camera = Camera("SIMPLE_RADIAL", *SIZE, (250.0, 200.0, 150.0, k1))
    view = pose(camera, [0, 0, HEIGHT], NADIR)
    assert not unmasked(outline_in(view, shapely.box(-5000, -5000, 5000, 5000), level), *SIZE).any()


def test_gimbal_angles_by_hand():
    assert camera_from_east_north_up(0.0, -math.pi / 2, 0.0) == pytest.approx(NADIR, abs=1e-12)
    east = camera_from_east_north_up(math.pi / 2, -math.pi / 2, 0.0)
    assert -east[1] == pytest.approx([1, 0, 0], abs=1e-12)  # the image's top to the east
    assert east[2] == pytest.approx([0, 0, -1], abs=1e-12)
    north = camera_from_east_north_up(0.0, 0.0, 0.0)
    assert north == pytest.approx(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), abs=1e-12)
    # Rolled clockwise by a right angle, the camera's right is down.
    assert camera_from_east_north_up(0.0, 0.0, math.pi / 2)[0] == pytest.approx([0, 0, -1], abs=1e-12)
    tilted = camera_from_east_north_up(0.3, -1.1, 0.2)
    assert tilted @ tilted.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(tilted) == pytest.approx(1.0)


def test_the_margin_by_hand():
    # f = 500 px, half diagonal 250 px: 0.5 from the axis. Heading 5 degrees: 0.0436; tilt 2 degrees: 1.25 * 0.0349 = 0.0436;
    # twice 0.5 m from 20 m: 0.05; a tenth of the height: 0.05. Their squares' sum: 0.00881.
    noted = Noted("a", Position(3.0, 45.0, sigma_h=0.5), 20.0, (0.0, -math.pi / 2, 0.0), 500.0, (400, 300))
    assert noted.margin() == pytest.approx(0.0938, abs=1e-4)
    photograph = Photograph("a", 1, "x", 400, 300, "c", 500.0, position=noted.position, relative_height=20.0, yaw=0.0)
    assert Noted.of(photograph) == noted
    for lacking in ("focal", "position", "relative_height", "yaw"):
        assert Noted.of(replace(photograph, **{lacking: None})) is None


class Scene:
    """Two photographs side by side of level ground, and the layer of what is to be ignored."""

    def __init__(self, folder, *, told=True):
        self.folder, self.views = folder, {}
        (folder / "images").mkdir()
        rng = np.random.default_rng(0)
        photographs = []
        for number, east in enumerate((0.0, 30.0)):
            name = f"{number}.jpg"
            pixels = rng.normal(120, 5, (SIZE[1], SIZE[0], 3)).clip(0, 255).astype(np.uint8)
            Image.fromarray(pixels).save(folder / "images" / name, quality=95)
            rotation = camera_from_east_north_up(math.radians(10.0), -math.pi / 2, 0.0)
            self.views[name] = View(name, LENS, rotation, -rotation @ np.array([east, 0.0, HEIGHT]))
        createsurvey.run(createsurvey.Request(str(folder / "images"), str(folder / "survey")))
        to_wgs84 = transformer(UTM, "EPSG:4326")
        for photograph in Survey.open(folder / "survey").photographs:
            centre = FRAME.to_crs(self.views[photograph.name].centre[None])[0]
            position = Position(*to_wgs84.transform(*centre[:2]), float(centre[2]), 0.02, 0.03)
            more = {"position": position, "relative_height": HEIGHT, "yaw": 10.0, "pitch": -90.0, "focal": 300.0} if told else {}
            photographs.append(replace(photograph, **more))
        self.survey = Survey.create(folder / "survey", folder / "images", FRAME.crs, photographs)
        self.survey.finish("createsurvey", "1", built_on=(), parameters={}, result={})

    def georeference(self, shift=0.0, names=("0.jpg", "1.jpg")):
        """Leave what ``georeference`` leaves, with everything ``shift`` metres too far east."""
        rng = np.random.default_rng(1)
        points = rng.uniform([-40, -40, -0.01], [70, 40, 0.01], (300, 3))
        model = pycolmap.Reconstruction()
        model.add_camera_with_trivial_rig(
            pycolmap.Camera(model="OPENCV", width=SIZE[0], height=SIZE[1], params=list(LENS.params), camera_id=1)
        )
        tracks = [pycolmap.Track() for _ in points]
        for number, name in enumerate(names, start=1):
            view = self.views[name]
            pose = pycolmap.Rigid3d(
                pycolmap.Rotation3d(view.rotation), -view.rotation @ (view.centre + np.array([shift, 0.0, 0.0]))
            )
            image = pycolmap.Image(name=name, camera_id=1, image_id=number, keypoints=np.zeros((len(points), 2)))
            model.add_image_with_trivial_frame(image, pose)
            for index, track in enumerate(tracks):
                track.add_element(number, index)
        for place, track in zip(points, tracks, strict=True):
            model.add_point3D(place, track)
        folder = self.folder / "survey" / FOLDER
        folder.mkdir(exist_ok=True)
        model.write(folder)
        accuracy = {"plani_check": 0.031}
        Georef(FRAME, "adjustment", (1.0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0), accuracy=accuracy).write(self.survey)
        standing = Survey.open(self.folder / "survey")
        standing.finish("georeference", "1", built_on=("createsurvey",), parameters={}, result={})

    def layer(self, *shapes, crs=UTM):
        """Write polygons given in the local frame's metres as a layer in ``crs``."""
        if not shapes:
            write_layer(str(self.folder / "ignore.gpkg"), "ignore", crs, {"n": []}, [], "MultiPolygon")
            return VectorSource(str(self.folder / "ignore.gpkg"), "ignore")
        moved = [shapely.transform(s, lambda xy: FRAME.to_crs(np.column_stack([xy, np.zeros(len(xy))]))[:, :2]) for s in shapes]
        if crs != UTM:
            change = transformer(UTM, crs)
            moved = [shapely.transform(s, lambda xy: np.column_stack(change.transform(*xy.T))) for s in moved]
        path = str(self.folder / "ignore.gpkg")
        write_layer(path, "ignore", crs, {"n": list(range(len(moved)))}, [_multi(s) for s in moved], "MultiPolygon")
        return VectorSource(path, "ignore")

    def enhance(self, progress, ignore, **more):
        run(Request(str(self.folder / "survey"), window=21, ignore=ignore, workers=1, **more), progress)
        return Survey.open(self.folder / "survey")


def _multi(shape):
    return shapely.multipolygons(shapely.get_parts(shape))


def masked_share(survey, number):
    mask = enhanced_mask(survey, survey.photographs[number])
    return 0.0 if mask is None else float((~mask).mean())


@pytest.fixture
def scene(tmp_path):
    return Scene(tmp_path)


def test_the_georeferenced_photographs_are_masked(scene, progress, listener):
    scene.georeference()
    sea = shapely.box(-4000, -4000, -3, 4000)
    survey = scene.enhance(progress, scene.layer(sea))
    first, second = survey.photographs
    mask = enhanced_mask(survey, first)
    expected, _ = by_rays(scene.views["0.jpg"], sea, level)
    kernel = np.ones((5, 5), np.uint8)
    edges = cv2.morphologyEx(expected.astype(np.uint8), cv2.MORPH_GRADIENT, kernel).astype(bool)
    assert not (mask == expected)[~edges].any()
    image = np.asarray(Image.open(enhanced_path(survey, first)))
    assert (image[~mask] == 128).all()
    assert image[mask].std() == pytest.approx(34.4, abs=3)  # arctan(z / 2) of a normal z, on half the range of 8 bits
    assert enhanced_mask(survey, second) is None  # 30 m away: the sea is out of its frame
    assert enhanced_mask_path(survey, second) is None
    assert Image.open(enhanced_mask_path(survey, first)).mode == "1"
    assert not listener.warnings
    page = survey.report_path("enhance").read_text()
    assert "placed by the georeferencing, without a margin; ground points were 0.031 m off in it" in page
    assert "Red: masked" in page


def test_polygons_of_another_crs_are_where_they_are(scene, progress):
    scene.georeference()
    sea = shapely.segmentize(shapely.box(-4000, -4000, -3, 4000), 20.0)
    shares = [masked_share(scene.enhance(progress, scene.layer(sea, crs=crs)), 0) for crs in (UTM, "EPSG:4326", "EPSG:2154")]
    assert shares[0] > 0.3
    assert shares == pytest.approx([shares[0]] * 3, abs=2e-3)


def test_a_stale_georeferencing_is_used_and_said_so(scene, progress):
    scene.georeference(shift=2.0)
    survey = Survey.open(scene.folder / "survey")
    survey.finish("createsurvey", "2", built_on=(), parameters={}, result={})
    assert survey.is_stale("georeference")
    survey = scene.enhance(progress, scene.layer(shapely.box(-4000, -4000, -3, 4000)))
    page = survey.report_path("enhance").read_text()
    assert "by the stale georeferencing" in page
    assert "its poses lie 2.00 m from the GNSS positions" in page


def test_a_changed_georeferencing_makes_new_masks_and_keeps_the_rest(scene, progress, listener):
    scene.georeference()
    ignore = scene.layer(shapely.box(-4000, -4000, -3, 4000))
    survey = scene.enhance(progress, ignore)
    before, fingerprint = masked_share(survey, 0), survey.record("enhance").fingerprint
    scene.enhance(progress, ignore)
    assert "2 of 2 images stand already." in listener.infos
    times = [enhanced_path(survey, p).stat().st_mtime_ns for p in survey.photographs]
    scene.georeference(shift=1.0)
    listener.infos.clear()
    survey = scene.enhance(progress, ignore)
    assert "1 of 2 images stand already." in listener.infos
    after = [enhanced_path(survey, p).stat().st_mtime_ns for p in survey.photographs]
    assert after[1] == times[1]
    assert after[0] != times[0]
    # Cameras that are 1 m further east see the shore 1 m further left, in a frame of 40 m.
    assert masked_share(survey, 0) == pytest.approx(before - 1.0 / 40.0, abs=5e-3)
    assert survey.record("enhance").fingerprint != fingerprint
    assert len(list((scene.folder / "survey" / "enhanced").iterdir())) == 1


def test_a_mask_that_is_gone_or_damaged_is_made_anew(scene, progress, listener):
    scene.georeference()
    ignore = scene.layer(shapely.box(-4000, -4000, -3, 4000))
    survey = scene.enhance(progress, ignore)
    share, path = masked_share(survey, 0), enhanced_mask_path(survey, survey.photographs[0])
    for damage in (path.unlink, lambda: path.write_bytes(b"nothing")):
        damage()
        with pytest.raises(InputError, match="run strandline:enhance again"):
            enhanced_mask(survey, survey.photographs[0])
        survey = scene.enhance(progress, ignore)
        assert masked_share(survey, 0) == share
    assert "1 of 2 images stand already." in listener.infos


def test_without_ignore_masks_go(scene, progress):
    scene.georeference()
    scene.enhance(progress, scene.layer(shapely.box(-4000, -4000, -3, 4000)))
    survey = scene.enhance(progress, None)
    assert enhanced_mask(survey, survey.photographs[0]) is None
    assert not list((scene.folder / "survey").rglob("*.png"))


def test_gnss_and_heading_with_a_margin(scene, progress):
    survey = scene.enhance(progress, scene.layer(shapely.box(-4000, -4000, -3, 4000)))
    noted = Noted.of(survey.photographs[0])
    assert 0.08 < noted.margin() < 0.15
    mask = enhanced_mask(survey, survey.photographs[0])
    expected, _ = by_rays(scene.views["0.jpg"], shapely.box(-4000, -4000, -3, 4000), level)
    assert not (mask & expected).any()  # all that is sea is masked, whatever the lens
    # And as much ground more as the margin says: 30 m times 0.1 along a shore of 30 m, of a frame of 40 x 30 m.
    assert (~mask).mean() - expected.mean() == pytest.approx(noted.margin() * 300 / 400, abs=0.02)
    page = survey.report_path("enhance").read_text()
    assert f"widened by {noted.margin() * HEIGHT:.1f} m" in page


def test_a_photograph_that_is_not_georeferenced_goes_by_gnss(scene, progress):
    scene.georeference(names=("0.jpg",))
    survey = scene.enhance(progress, scene.layer(shapely.box(29, -2, 31, 2)))
    assert enhanced_mask(survey, survey.photographs[0]) is None
    assert 0.05 < masked_share(survey, 1) < 0.2


def test_a_pose_of_something_else_is_not_used(scene, progress):
    # The model's photographs are 500 m from those of the survey that have their names now.
    scene.georeference(shift=500.0)
    survey = scene.enhance(progress, scene.layer(shapely.box(-4000, -4000, -3, 4000)))
    page = survey.report_path("enhance").read_text()
    assert "2 photographs are placed by GNSS" in page


def test_what_is_wholly_covered_is_named(scene, progress, listener):
    scene.georeference()
    survey = scene.enhance(progress, scene.layer(shapely.box(-4000, -4000, 10, 4000).union(shapely.box(9, -400, 14, 400))))
    assert not enhanced_mask(survey, survey.photographs[0])[:, :300].any()
    survey = scene.enhance(progress, scene.layer(shapely.box(-4000, -4000, 25, 4000)))
    assert not enhanced_mask(survey, survey.photographs[0]).any()
    assert (np.asarray(Image.open(enhanced_path(survey, survey.photographs[0]))) == 128).all()
    assert listener.warnings[-1] == "IGNORE covers the whole of 0.jpg: no tie points will be found there."
    assert listener.warnings[-1] in survey.report_path("enhance").read_text()


def test_polygons_that_lie_elsewhere_are_warned_of(scene, progress, listener):
    scene.georeference()
    survey = scene.enhance(progress, scene.layer(shapely.box(9000, 9000, 9100, 9100)))
    assert [p for p in survey.photographs if enhanced_mask(survey, p) is not None] == []
    assert "No photograph shows anything of IGNORE" in listener.warnings[0]


def test_a_bow_tie_is_mended(scene, progress):
    scene.georeference()
    tie = shapely.Polygon([(-5, -5), (5, 5), (5, -5), (-5, 5)])
    survey = scene.enhance(progress, scene.layer(tie))
    # 50 m2 from 30 m at 10 px a metre.
    assert masked_share(survey, 0) == pytest.approx(50 * 100 / (400 * 300), rel=0.1)


def test_an_empty_layer_is_refused(scene, progress):
    scene.georeference()
    with pytest.raises(InputError, match="has no polygons"):
        scene.enhance(progress, scene.layer())
    assert not (scene.folder / "survey" / "enhanced").exists()


def test_without_any_pose_it_is_refused(tmp_path, progress):
    scene = Scene(tmp_path, told=False)
    with pytest.raises(InputError, match=r"IGNORE needs to know where the photographs .* look.*run the steps up to 'georef") as e:
        scene.enhance(progress, scene.layer(shapely.box(-4000, -4000, -3, 4000)))
    assert str(e.value).count(". ") == 0  # one sentence
    assert not (tmp_path / "survey" / "enhanced").exists()


def test_photographs_of_which_nothing_is_known_are_named(tmp_path, progress, listener):
    scene = Scene(tmp_path, told=False)
    scene.georeference(names=("0.jpg",))
    survey = scene.enhance(progress, scene.layer(shapely.box(-4000, -4000, 4000, 4000)))
    assert "It is not known where 1.jpg look: nothing of IGNORE is masked there." in listener.warnings
    assert enhanced_mask(survey, survey.photographs[1]) is None
