"""The simulated beach: terrain, frames, flight, rays, sensor. Exact numbers first."""

import math
import re

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from pyproj import CRS, Proj
from strandline.core.block import View
from strandline.core.camera import Camera
from strandline.core.errors import InputError
from strandline.core.simulation import flight, ground, rendering, sensor
from strandline.core.simulation.noise import averaged, noise, octaves
from strandline.core.simulation.placement import Placement
from strandline.core.simulation.terrain import GRAINS, Beach, grain_weights, reflectance_at
from strandline.core.simulation.truth import stable_polygon, surface_rows, truth_grid, zone_polygons

BEACH = Beach(length=60.0, width=40.0, contrast=0.04, seed=1)
NADIR = np.diag([1.0, -1.0, -1.0])


def test_noise_has_zero_mean_and_unit_variance() -> None:
    x, y = np.random.default_rng(0).uniform(0, 3000, (2, 60000))
    values = np.array([noise(u, v, 5) for u, v in zip(x, y, strict=True)])
    # 60,000 independent values: the mean's sigma is 0.004; the variance's, for this flat-topped noise, below 0.006.
    assert_allclose(values.mean(), 0.0, atol=0.02)
    assert_allclose(values.var(), 1.0, atol=0.03)
    assert noise(12.0, 7.0, 5) == 0.0  # gradient noise passes through 0 on its lattice


def test_neighbouring_seeds_share_nothing() -> None:
    a, c = np.meshgrid(np.linspace(0, 60, 200), np.linspace(22, 28, 60))
    first, second = (Beach(60, 40, 0.04, seed).heights(a, c, False) for seed in (1, 2))
    ripples = [z - cv2.blur(z, (9, 9)) for z in (first, second)]
    # The 12,000 heights hold about 12 x 60 independent ripples: correlations of noise alone stay below 0.12.
    assert abs(np.corrcoef(ripples[0].ravel(), ripples[1].ravel())[0, 1]) < 0.12


def test_changes_by_hand() -> None:
    changes = BEACH.changes()
    # 0.70 m x half of 2 x 0.26 x 60 m along x (2 + 5) / 2 m across.
    assert_allclose(changes["erosion"], 0.70 * 15.6 * 3.5)
    assert_allclose(changes["deposition"], 0.35 * 13.2 * 5.0)
    # Twice as wide: twice across, twice as high.
    assert_allclose(Beach(60, 80, 0.04, 1).changes()["erosion"], 4 * 0.70 * 15.6 * 3.5)


@pytest.mark.parametrize(("width", "length"), [(40.0, 60.0), (80.0, 30.0)])
def test_heights_change_by_those_volumes(width: float, length: float) -> None:
    beach = Beach(length, width, 0.04, 3)
    a, c = np.arange(0.05, length, 0.1), np.arange(0.05, 0.95 * width, 0.1)
    change = beach.heights(a[None], c[:, None], True) - beach.heights(a[None], c[:, None], False)
    changes = beach.changes()
    # Ripples of 6 mm that lie elsewhere: their sum over some 1,000 m2 wanders by 0.15 m3 or so.
    assert_allclose(change.sum() * 0.01, changes["deposition"] - changes["erosion"], atol=0.8)


def test_ground_behind_the_dune_is_the_same_to_the_bit() -> None:
    a, c = np.meshgrid(np.linspace(-5, 65, 300), np.linspace(-20, 7.5, 200))
    assert np.array_equal(BEACH.heights(a, c, False), BEACH.heights(a, c, True))
    weights = grain_weights(0.01)
    same = [reflectance_at(30.0, 5.5, 1.0, 9, after, 0.04, GRAINS, weights) for after in (False, True)]
    assert same[0] == same[1]
    other = [reflectance_at(30.0, 25.5, 1.0, 9, after, 0.04, GRAINS, weights) for after in (False, True)]
    assert other[0] != other[1]


def test_octaves_have_unit_variance() -> None:
    random = np.random.default_rng(1)
    a, c = random.uniform(0, 3000, 20000), random.uniform(0, 3000, 20000)
    values = np.array([octaves(u, v, 0.06, 7, 3) for u, v in zip(a, c, strict=True)])
    assert_allclose(values.std(), 1.0, atol=0.03)


def test_noise_averaged_over_squares() -> None:
    assert_allclose(averaged(0.0), 1.0, rtol=1e-5)
    inside = (np.arange(12) + 0.5) / 12 - 0.5
    places = np.random.default_rng(0).uniform(0, 3000, (3000, 2))
    for width in (0.5, 1.0, 2.0):
        means = [np.mean([noise(x + u * width, y + v * width, 3) for u in inside for v in inside]) for x, y in places]
        # 3,000 squares: 1.3 % sigma of a sigma.
        assert_allclose(np.std(means), averaged(width), rtol=0.04)


def test_grains_lie_from_2_cm_to_3_m() -> None:
    assert_allclose(GRAINS[[0, -1]], [0.02, 3.0])
    assert_allclose(np.diff(np.log2(GRAINS)), math.log2(150) / 7)
    assert_allclose((grain_weights(0.0) ** 2).sum(), 1.0, rtol=1e-5)
    # What is finer than the squares goes: of 2 cm little is left in 6 cm, of 3 m everything.
    weights = grain_weights(0.06) * math.sqrt(8)
    assert weights[0] < 0.15
    assert weights[-1] > 0.999


@pytest.mark.parametrize("gsd", [0.01, 0.04])
def test_albedo_in_the_photographs_has_the_contrast_asked_for(gsd: float) -> None:
    contrast = 0.012
    albedo = flat_sand(contrast, gsd)
    power, size = spectrum(albedo / albedo.mean() - 1.0, gsd)
    octaves_of_size = 0.02 * 2.0 ** np.arange(6)  # from 2 cm: up to 1.28 m, of which the picture shows enough
    rms = np.array([math.sqrt(power[(size >= s) & (size < 2 * s)].sum()) for s in octaves_of_size]) / contrast
    # Seven octaves and a quarter with equal power, 0.37 each, of which a little lies beyond the ends. The pixels average
    # what is finer than twice their size, and the coarsest octave varies by a tenth from place to place.
    assert_allclose(rms[octaves_of_size >= 2 * gsd], 0.345, rtol=0.12)
    assert rms[0] < (0.33 if gsd == 0.01 else 0.1)
    if gsd == 0.01:
        # The whole of it. Three metres fit four times into the picture: their octave alone adds or takes 5 %.
        assert_allclose(math.sqrt(power[(size >= 0.02) & (size <= 3.0)].sum()), contrast, rtol=0.1)


def flat_sand(contrast: float, gsd: float) -> np.ndarray:
    """Return the light of level sand under an even light, without path, wrack and wet sand, from straight above."""
    camera = Camera("PINHOLE", 1200, 1200, (1300.0, 1300.0, 600.0, 600.0))
    cells, far = 1210, 1200.0  # of a beach 4 km wide that is its berm: sand and nothing else
    field = rendering.Field(0.0, far, gsd, cells, cells)
    radiance = np.empty((2 * cells, 2 * cells), np.uint16)
    sand = (100.0, 3, False, contrast, GRAINS, grain_weights(gsd / rendering.FINE))
    plumb = np.array([0.0, 0.0, 1.0])
    rendering._radiance(np.zeros((cells + 3, cells)), radiance, 0.0, far - gsd, gsd, plumb, *sand)
    scene = rendering.Scene.of(field, np.zeros((cells, cells), np.float32) + 1, radiance, np.empty((0, 4)), 0.0)
    centre = np.array([605 * gsd, far + 605 * gsd, 1.0 + 1300.0 * gsd])
    return scene.render(View("v", camera, NADIR, -NADIR @ centre), 1)[0]


def spectrum(values: np.ndarray, gsd: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what each frequency adds to the variance, and its feature size: half a wavelength (m)."""
    window = np.hanning(values.shape[0])[:, None] * np.hanning(values.shape[1])
    power = np.abs(np.fft.fft2(values * window)) ** 2 / (window**2).sum() / values.size
    frequency = np.hypot(np.fft.fftfreq(values.shape[0], gsd)[:, None], np.fft.fftfreq(values.shape[1], gsd))
    frequency[0, 0] = 1e-9
    return power, 0.5 / frequency


def test_placement_there_and_back() -> None:
    placement = Placement.of(BEACH, None)
    points = np.array([[0.0, 0.0, 3.0], [60.0, 40.0, 0.5], [30.0, 20.0, 2.0]])
    assert_allclose(placement.from_local(placement.to_local(points)), points, atol=1e-12)
    assert_allclose(placement.to_local(points)[2], [0, 0, 2.0], atol=1e-12)  # the area's centre is the frame's origin
    # Along the shore is 8 degrees east of true north.
    along = placement.to_local(points + [1.0, 0, 0])[0] - placement.to_local(points)[0]
    assert_allclose(along, [math.sin(math.radians(8)), math.cos(math.radians(8)), 0], atol=1e-12)
    assert_allclose(np.linalg.det(placement.axes), 1.0)


def test_zones_have_their_area_in_the_crs() -> None:
    placement = Placement.of(BEACH, None)
    crs = CRS(placement.frame.crs)
    scale = Proj(crs).get_factors(placement.frame.longitude, placement.frame.latitude).areal_scale
    scale *= (1 - (placement.frame.height + 2.0) / 6.378e6) ** 2  # from 51 m up down to the ellipsoid
    areas = {name: polygon.area for name, polygon in zone_polygons(placement, BEACH).items()}
    assert_allclose(areas["dune"], 60 * 13 * scale, rtol=1e-6)
    assert_allclose(stable_polygon(placement, BEACH).area, 60 * 7.5 * scale, rtol=1e-6)
    assert scale < 0.9999  # or the test could not tell


def test_truth_on_the_grid_is_the_surface_the_cameras_see() -> None:
    placement = Placement.of(BEACH, None)
    grid = truth_grid(placement, BEACH)
    heights = surface_rows(placement, BEACH, grid, True, 300, 310)
    rows, columns = np.array([0, 4, 9]), np.array([100, 501, 907])
    places = np.column_stack(
        [grid.west + (columns + 0.5) * grid.cell, grid.north - (300 + rows + 0.5) * grid.cell, heights[rows, columns]]
    )
    beach = placement.from_local(placement.frame.from_crs(places))
    # Linear between exact places 3.2 m apart, and the heights' way through the frame: below 0.02 mm.
    assert_allclose(BEACH.heights(beach[:, 0], beach[:, 1], True), beach[:, 2], atol=2e-5)


def test_placement_of_another_crs_lies_where_that_applies() -> None:
    placement = Placement.of(BEACH, "EPSG:2154")
    assert CRS(placement.frame.crs).to_epsg() == 2154
    bare = re.sub(r",USAGE\[.*?\]\](?=,ID)", "", CRS("EPSG:2154").to_wkt(), flags=re.DOTALL)
    assert CRS(bare).area_of_use is None
    assert Placement.of(BEACH, bare).frame.longitude == placement.frame.longitude
    far = Placement.of(BEACH, "EPSG:28356")  # Australia
    assert 150 < far.frame.longitude < 156
    with pytest.raises(InputError, match="projected"):
        Placement.of(BEACH, "EPSG:4326")
    with pytest.raises(InputError, match="does not say where"):
        Placement.of(BEACH, "+proj=tmerc +lat_0=0 +lon_0=3 +ellps=GRS80 +units=m")


def test_plan_by_hand() -> None:
    # A footprint of 60 x 45 m with 70 and 80 %: strips 18 m apart, photographs 9 m apart. The sides (20 m from the
    # middle) are seen from 9 m on the other side (9 + 20 < 30): two strips. The ends (30 m) must be seen by the third
    # photograph from the end, with a reach of 22.5 m: the last at 7.5 + 18 = 25.5 or more from the middle, 27: seven.
    plan = flight.plan(60.0, 40.0, (60.0, 45.0), 0.8, 0.7)
    assert_allclose(plan.base, 9.0)
    assert_allclose(plan.spacing, 18.0)
    assert sorted(set(plan.places[:, 1])) == pytest.approx([11.0, 29.0])
    assert_allclose(plan.places[:7, 0], [3, 12, 21, 30, 39, 48, 57])
    assert_allclose(plan.places[7:, 0], [57, 48, 39, 30, 21, 12, 3])  # and back
    assert_allclose(plan.headings, [1] * 7 + [-1] * 7)


def test_photographs_look_down_with_their_top_forward() -> None:
    camera = flight.lens(1600, 1200, 1300.0)
    plan = flight.plan(60.0, 40.0, (60.0, 45.0), 0.8, 0.7)
    views = flight.fly(plan, camera, 50.0, 0.0, ["x"] * 14, np.random.default_rng(0))
    for view, heading in ((views[0], 1.0), (views[-1], -1.0)):
        ahead = view.centre + [heading * 5.0, 0.0, -50.0]
        (x, y), (u, v) = view.project(np.array([ahead, view.centre - [0, 0, 50.0]]))
        assert y < v - 100  # ahead is up in the photograph
        assert abs(x - u) < 25  # but for the yaw's 1.5 degrees
        assert_allclose(np.linalg.det(view.rotation), 1.0)


def test_tilt_has_the_sigma_asked_for() -> None:
    plan = flight.plan(2000.0, 40.0, (60.0, 45.0), 0.9, 0.7)
    camera, names = flight.lens(1600, 1200, 1300.0), ["x"] * len(plan.places)
    views = flight.fly(plan, camera, 50.0, math.radians(3), names, np.random.default_rng(0))
    down = np.array([view.rotation[2] for view in views])
    # About 900 photographs, two angles: the sigma's own is 2 %.
    assert_allclose(np.degrees(np.sqrt((down[:, :2] ** 2).mean())), 3.0, rtol=0.07)


def test_expected_precision_by_hand() -> None:
    camera = Camera("PINHOLE", 2000, 2000, (1000.0, 1000.0, 1000.0, 1000.0))
    centres = [(-3.0, 0.0, 50.0), (3.0, 0.0, 50.0)]
    views = [View("v", camera, NADIR, -NADIR @ np.array(c)) for c in centres]
    sigma, count = flight.expected_precision(views, np.array([[0.0, 0.0, 0.0], [-51.0, 0.0, 0.0]]), 0.5)
    # Two views: sqrt(2) sigma GSD H / B = 1.414 x 0.5 x 0.05 m x 50 / 6.
    assert_allclose(sigma[0], math.sqrt(2) * 0.5 * 0.05 * 50 / 6)
    assert count.tolist() == [2, 1]
    assert np.isnan(sigma[1])
    # Five in a line, base 1.5 m, H 60 m, GSD 1 cm, 0.5 px: the 1.6 cm every planner knows for 80 %.
    camera = Camera("PINHOLE", 4000, 3000, (6000.0, 6000.0, 2000.0, 1500.0))
    views = [View("v", camera, NADIR, -NADIR @ np.array([b, 0.0, 60.0])) for b in (-12.0, -6.0, 0.0, 6.0, 12.0)]
    sigma, count = flight.expected_precision(views, np.zeros((1, 3)), 0.5)
    assert count[0] == 5
    assert_allclose(sigma[0], 0.5 * 0.01 * 60 / math.sqrt(36 * 10), rtol=1e-12)


def plane_scene(targets: np.ndarray, half: float) -> rendering.Scene:
    """A tilted plane, which bilinear heights hold exactly (to float32), under even light."""
    field = rendering.Field(-40.0, -40.0, 0.5, 161, 161)
    a, c = np.meshgrid(field.a + 0.5 * np.arange(161), field.c + 0.5 * np.arange(161))
    radiance = np.full((322, 322), round(1 / rendering.RADIANCE_UNIT), np.uint16)
    return rendering.Scene.of(field, plane(a, c).astype(np.float32), radiance, targets, half)


def plane(a: np.ndarray, c: np.ndarray) -> np.ndarray:
    return 8.0 + 0.1 * a - 0.05 * c


def test_targets_are_rendered_where_the_camera_model_puts_them() -> None:
    spots = np.array([[0.0, 0.0], [12.3, 7.7], [-14.1, 9.2], [13.0, -9.0], [-11.0, -8.8]])
    turns = np.array([0.1, 0.4, 0.8, 1.2, 1.5])
    half = 0.7
    scene = plane_scene(np.column_stack([spots, np.cos(turns), np.sin(turns)]), half)
    camera = flight.lens(1600, 1200, 1300.0)
    tilt = flight._rotation(np.array([0.05, -0.04, 0.7]))
    rotation = tilt @ NADIR
    view = View("v", camera, rotation, -rotation @ np.array([1.0, -2.0, 55.0]))
    light = scene.render(view, 1).sum(axis=0)
    expected = view.project(np.column_stack([spots, plane(*spots.T)]))
    smooth = cv2.GaussianBlur(light, (0, 0), 1.5)  # keeps the symmetry, spares the interpolation
    for x, y in expected:
        found = saddle(smooth, x, y)
        # 0.02 px: what the rays' interpolation (0.001 px) and the finite samples of paint leave.
        assert_allclose(found, (x, y), atol=0.02)


def saddle(image: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Return the centre of symmetry near (x, y), corner-based: a checker is its own image turned by 180 degrees."""
    offsets = np.arange(-14.0, 15.0)
    dx, dy = (o.astype(np.float32) for o in np.meshgrid(offsets, offsets))

    def asymmetry(u: float, v: float) -> float:
        one = cv2.remap(image, dx + np.float32(u - 0.5), dy + np.float32(v - 0.5), cv2.INTER_LINEAR)
        return float(((one - one[::-1, ::-1]) ** 2).sum())

    for step in (0.3, 0.1):
        for axis in (0, 1):
            shift = np.eye(2)[axis] * step
            low, mid, high = (asymmetry(x + k * shift[0], y + k * shift[1]) for k in (-1, 0, 1))
            move = 0.5 * (low - high) / (low - 2 * mid + high)
            x, y = x + move * shift[0], y + move * shift[1]
    return x, y


def test_rays_meet_the_surface_where_they_first_can() -> None:
    field = rendering.Field(0.0, 5.0, 0.05, 400, 700)
    a, c = field.a + 0.05 * np.arange(400), field.c + 0.05 * np.arange(700)
    heights = BEACH.heights(a[None], c[:, None], True).astype(np.float32)
    scene = rendering.Scene.of(field, heights, np.zeros((1400, 800), np.uint16), np.empty((0, 4)), 0.0)
    camera = Camera("PINHOLE", 400, 400, (200.0, 200.0, 200.0, 200.0))
    # From low over the berm towards the dune, so that the crest hides what lies behind: |m| up to 3.
    rotation = flight._rotation(np.array([-0.9, 0.0, 0.0])) @ NADIR
    view = View("v", camera, rotation, -rotation @ np.array([10.0, 24.0, 9.0]))
    if view.rotation[2, 1] > 0:
        rotation = flight._rotation(np.array([0.9, 0.0, 0.0])) @ NADIR
        view = View("v", camera, rotation, -rotation @ np.array([10.0, 24.0, 9.0]))
    random = np.random.default_rng(2)
    pixels = random.uniform(100, 300, (60, 2))
    found = scene.hit(view, pixels)
    assert_allclose(view.project(found), pixels, atol=1e-6)
    rays = camera.unproject(pixels) @ rotation
    leaning = 0
    for point, ray in zip(found, rays, strict=True):
        m = ray[:2] / -ray[2]
        t = np.arange(0.0, 9.0, 0.001)
        track = view.centre + t[:, None] * np.array([*m, -1.0])
        inside = (track[:, 0] > 0.1) & (track[:, 0] < 19.8) & (track[:, 1] > 5.1) & (track[:, 1] < 39.8)
        below = np.zeros(len(t), bool)
        below[inside] = track[inside, 2] <= bilinear(heights, (track[inside, :2] - [field.a, field.c]) / 0.05)
        if not below.any() or not inside[: int(np.argmax(below))].all():
            continue
        leaning += np.hypot(*m) * scene.steepest > 1
        # A march in steps of 1 mm of height finds the same first hit, to that step.
        assert_allclose(view.centre[2] - point[2], t[np.argmax(below)], atol=0.0015)
    assert leaning > 15  # rays for which the surface could hide itself


def bilinear(heights: np.ndarray, at: np.ndarray) -> np.ndarray:
    j, i = at[:, 0].astype(int), at[:, 1].astype(int)
    u, v = at[:, 0] - j, at[:, 1] - i
    z = heights.astype(float)
    upper = (1 - u) * z[i, j] + u * z[i, j + 1]
    return (1 - v) * upper + v * ((1 - u) * z[i + 1, j] + u * z[i + 1, j + 1])


def even_light(level: float, rows: int = 300, columns: int = 302) -> np.ndarray:
    """Return the light of paint, which is white: the same of all colours."""
    light = np.zeros((3, rows, columns), np.float32)
    light[1] = level
    return light


def test_mosaic_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensor, "NEUTRAL", (0.5, 1.0, 0.8))
    assert_allclose(sensor.ELECTRONS, 9000 / 3839)
    light = np.zeros((3, 2, 2), np.float32)
    light[0] = 1.0  # dry sand: in green half of a full well, in red 1.1 x 0.5 of that, in blue 0.8 x 0.8
    mosaic = sensor.expose(light, 1.0, 0.0, np.random.default_rng(0))
    # The middle of these pixels lies halfway to the corners, where vignetting takes a quarter of its 12 %.
    lit = 0.97 * 0.5 * 3839
    assert mosaic.tolist() == [
        [round(256 + 0.55 * lit), round(256 + lit)],
        [round(256 + lit), round(256 + 0.64 * lit)],
    ]
    assert sensor.expose(0 * light, 1.0, 0.0, np.random.default_rng(0)).tolist() == [[256, 256], [256, 256]]
    assert sensor.expose(9 * light, 1.0, 0.0, np.random.default_rng(0)).max() == 4095


def test_sensor_has_the_noise_asked_for() -> None:
    light = even_light(0.8)
    still = sensor.expose(light, 1.0, 0.0, np.random.default_rng(1)).astype(float)
    for factor in (1.0, 2.0):
        error = sensor.expose(light, 1.0, factor, np.random.default_rng(1)) - still
        green = (error[::2, 1::2], still[::2, 1::2])
        electrons = (green[1].mean() - sensor.BLACK) * sensor.ELECTRONS
        # 22,650 pixels: 0.5 % sigma of a sigma; rounding twice adds another 1/12 of variance, and vignetting spreads the mean.
        assert_allclose(green[0].std(), sensor.noise_level(electrons, factor), rtol=0.02)
        assert abs(error.mean()) < 0.3
    # sqrt(4500 + 4^2) electrons at 2.344 a DN, and the rounding.
    assert_allclose(sensor.noise_level(4500.0, 1.0), math.sqrt((67.2012 / 2.344361) ** 2 + 1 / 12), rtol=1e-5)
    dark = sensor.expose(even_light(0.0), 1.0, 1.0, np.random.default_rng(2))
    assert_allclose(dark.std(), math.sqrt((4 / 2.344361) ** 2 + 1 / 12), rtol=0.02)
    assert_allclose(dark.mean(), sensor.BLACK, atol=0.03)  # noise below black is kept


def test_sand_does_not_saturate() -> None:
    red, green, blue = sensor.sand_electrons()
    assert max(red, green, blue) < 0.6 * sensor.FULL_WELL
    white = sensor.expose(even_light(1.9), 1.0, 0.0, np.random.default_rng(0))  # the targets' paint
    assert white.max() < sensor.WHITE


def test_camera_makes_white_of_white() -> None:
    mosaic = sensor.expose(even_light(1.0), 1.0, 0.0, np.random.default_rng(0))
    photograph = sensor.develop(mosaic)
    assert photograph.shape == (300, 302, 3)
    middle = photograph[149:151, 150:152]
    # 1.099 x 0.5^0.45 - 0.099 of 255: 179.9, the same in all colours.
    assert np.abs(middle.astype(int) - 180).max() <= 1
    # Even colour comes out even, at the border too.
    assert np.ptp(photograph.astype(int), axis=2).max() <= 1


def test_colours_stay_in_their_places() -> None:
    light = np.zeros((3, 40, 60), np.float32)
    light[1, :, :30], light[2, :, 30:] = 1.0, 1.0  # paint, and the bluer sea
    photograph = sensor.develop(sensor.expose(light, 1.0, 0.0, np.random.default_rng(0))).astype(int)
    red, green = photograph[:, :, 0], photograph[:, :, 1]
    assert np.abs(red - green)[:, :28].max() <= 1
    assert (green - red)[:, 32:].min() > 10
    edge = green.mean(axis=0)
    assert_allclose(np.interp(0.5 * (edge[20] + edge[40]), edge[40:20:-1], np.arange(40, 20, -1) + 0.5), 30, atol=0.3)


def test_development_is_monotonic_from_black_to_white() -> None:
    values = [int(sensor.develop(np.full((6, 6), dn, np.uint16))[2, 2, 1]) for dn in (0, 256, 300, 1000, 2000, 4000, 4095)]
    assert values == sorted(values)
    assert (values[0], values[1], values[-1]) == (0, 0, 255)
    # (1000 - 256) / 3839 = 0.1938: 1.099 x 0.4778 - 0.099 of 255.
    assert values[3] == 109
    assert_allclose(sensor.linear(np.array([0, 109, 255], np.uint8)), [0, 0.1938, 1], atol=0.002)
    assert_allclose(sensor.linear(np.array([10], np.uint8)), 10 / 255 / 4.5)  # in the toe


def test_targets_lie_apart_on_ground_that_can_hold_them() -> None:
    targets = ground.lay_targets(BEACH, False, 6, 4, 1.4, np.random.default_rng(3))
    assert targets.names == ["G1", "G2", "G3", "G4", "G5", "G6", "C1", "C2", "C3", "C4"]
    assert targets.roles == ["control"] * 6 + ["check"] * 4
    a, c, z = targets.points.T
    assert_allclose(z, BEACH.heights(a, c, False))
    assert ((a > 1.4) & (a < 58.6) & (c > 1.4) & (c < 38.6)).all()
    apart = np.hypot(a[:, None] - a, c[:, None] - c)[np.triu_indices(10, 1)]
    assert apart.min() > 2 * 1.4
    # The first four lie in the corners.
    assert np.hypot(a[:4] - [0, 60, 60, 0], c[:4] - [0, 40, 0, 40]).max() < 4
    assert np.ptp(a[:6]) > 45
    assert np.ptp(c[:6]) > 28
    with pytest.raises(InputError, match="no room"):
        ground.lay_targets(BEACH, False, 190, 10, 2.5, np.random.default_rng(3))
    with pytest.raises(InputError, match="too small"):
        ground.lay_targets(Beach(10, 10, 0.04, 1), False, 3, 0, 6.0, np.random.default_rng(3))
