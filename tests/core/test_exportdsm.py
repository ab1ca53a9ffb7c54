"""The surface of a rendered scene with known truth, through the whole step."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import laspy
import numpy as np
import pytest
import rasterio
import shapely
from scipy.spatial.transform import Rotation
from strandline.core.block import View
from strandline.core.camera import Camera
from strandline.core.contract import VectorSource, encode
from strandline.core.errors import InputError
from strandline.core.files import file_digest
from strandline.core.frames import LocalFrame
from strandline.core.georef import FOLDER, Georef
from strandline.core.progress import Progress, Silent
from strandline.core.surface import exportdsm, mosaic, work
from strandline.core.surface.exportdsm import Request, run
from strandline.core.survey import Photograph, Survey
from strandline.core.vector import write_layer

CRS = "EPSG:32630"
HEIGHT, BASE = 20.0, 4.0  # m
CAMERA = Camera("OPENCV", 360, 300, (400.0, 400.0, 183.0, 147.0, -0.04, 0.02, 5e-4, -5e-4))
GSD = HEIGHT / 400.0  # 5 cm
NOISE = 1.2  # grey levels
EASTING, NORTHING, DATUM = 500_000.0, 4_650_000.0, 30.0


def ground(x, y):
    """Return the true height: a slope, a mound of half a metre, and a platform one metre high with straight edges."""
    mound = 0.5 * np.exp(-((x + 2.5) ** 2 + (y - 1) ** 2) / 4.0)
    platform = ((x > 2.5) & (x < 5.5) & (y > -3.0) & (y < 0.0)).astype(float)
    return 0.03 * x + mound + platform


def texture():
    """Return grey sand: noise of all sizes from 3 cm on, 6 grey levels strong, over 40 x 40 m at 2.5 cm."""
    rng = np.random.default_rng(5)
    total = np.zeros((1600, 1600))
    for size in (1.2, 2.5, 5.0, 12.0):
        layer = cv2.GaussianBlur(rng.normal(size=total.shape), (0, 0), size)
        total += layer / layer.std()
    return (128 + 6 * total / total.std()).astype(np.float32)


def views():
    """Return seven cameras in two strips, a little tilted."""
    out = []
    places = [(-6, -1.5), (-2, -1.5), (2, -1.5), (6, -1.5), (-4, 2.0), (0, 2.0), (4, 2.0)]
    for n, (x, y) in enumerate(places):
        turn = Rotation.from_euler("xyz", [180 + 1.5 * (-1) ** n, 2.0 * np.sin(n), 90 * (n % 2)], degrees=True).as_matrix().T
        out.append(View(f"photo_{n}.png", CAMERA, turn, -turn @ np.array([x, y, HEIGHT])))
    return out


def render(view, sand, seed):
    """Return what a camera sees of the ground: four rays a pixel, followed down until they are below it."""
    scale = 2
    v, u = np.mgrid[0 : CAMERA.height * scale, 0 : CAMERA.width * scale]
    pixels = np.column_stack([(u.ravel() + 0.5) / scale, (v.ravel() + 0.5) / scale])
    rays = CAMERA.unproject(pixels) @ view.rotation
    rays /= -rays[:, 2:]
    high, low = np.full(len(rays), HEIGHT - 2.5), np.full(len(rays), HEIGHT + 1.0)

    def below(depth):
        point = view.centre + rays * depth[:, None]
        return point[:, 2] < ground(point[:, 0], point[:, 1])

    steps = np.linspace(HEIGHT - 2.5, HEIGHT + 1.0, 40)
    found = np.zeros(len(rays), bool)
    for near, far in zip(steps[:-1], steps[1:], strict=True):
        hit = ~found & below(np.full(len(rays), far))
        high[hit], low[hit] = near, far
        found |= hit
    for _ in range(12):
        middle = (high + low) / 2
        under = below(middle)
        low, high = np.where(under, middle, low), np.where(under, high, middle)
    point = view.centre + rays * high[:, None]
    column, row = ((point[:, 0] + 20) / 0.025 - 0.5).astype(np.float32), ((20 - point[:, 1]) / 0.025 - 0.5).astype(np.float32)
    grey = cv2.remap(sand, column.reshape(v.shape), row.reshape(v.shape), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    grey = grey.reshape(CAMERA.height, scale, CAMERA.width, scale).mean(axis=(1, 3))
    # A camera interpolates its colours, so its noise is alike in neighbours and in all channels.
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1.0, grey.shape), (0, 0), 0.55)
    noisy = grey + NOISE * noise / noise.std()
    return np.repeat(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def write_model(folder, block_views):
    """Write COLMAP's text model with true poses and tie points on the true ground."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(6)
    x, y = rng.uniform(-9, 9, 400), rng.uniform(-6, 6, 400)
    points = np.column_stack([x, y, ground(x, y)])
    camera = " ".join(map(repr, CAMERA.params))
    (folder / "cameras.txt").write_text(f"1 {CAMERA.model} {CAMERA.width} {CAMERA.height} {camera}\n")
    lines, tracks = [], [[] for _ in points]
    for n, view in enumerate(block_views, start=1):
        uv = view.project(points)
        seen = np.flatnonzero(((uv > 0) & (uv < (CAMERA.width, CAMERA.height))).all(axis=1))
        qx, qy, qz, qw = (float(q) for q in Rotation.from_matrix(view.rotation).as_quat())
        lines.append(" ".join(map(repr, (n, qw, qx, qy, qz, *map(float, view.translation), 1))) + f" {view.name}")
        lines.append(" ".join(f"{uv[i, 0]:.3f} {uv[i, 1]:.3f} {i + 1}" for i in seen))
        for k, i in enumerate(seen):
            tracks[i].append(f"{n} {k}")
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    rows = [
        f"{i + 1} {p[0]} {p[1]} {p[2]} 128 128 128 0.3 {' '.join(t)}"
        for i, (p, t) in enumerate(zip(points.tolist(), tracks, strict=True))
        if len(t) >= 2
    ]
    (folder / "points3D.txt").write_text("\n".join(rows) + "\n")


@dataclass(frozen=True)
class Scene:
    folder: Path
    frame: LocalFrame
    views: list


def make_survey(folder, images, frame, block_views):
    write_model(folder / FOLDER, block_views)
    listed = []
    for view in block_views:
        path = images / view.name
        listed.append(
            Photograph(
                view.name,
                path.stat().st_size,
                file_digest(path),
                CAMERA.width,
                CAMERA.height,
                "camera",
                time=f"2020-06-06T09:3{len(listed)}:00",
            )
        )
    survey = Survey.create(folder, images, frame.crs, listed)
    pivot, covariance = (0.0, 0.0, 0.0), tuple(float(v) for v in np.diag([1e-4] * 3 + [1e-8] * 4).ravel())
    Georef(frame, "similarity", (1.0, *np.eye(3).ravel().tolist(), 0.0, 0.0, 0.0), pivot, covariance).write(survey)
    for step in ("createsurvey", "tiepoints", "orient", "georeference"):
        survey.finish(step, f"{step} of the test", built_on=(), parameters={}, result={})
    return survey


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Return a survey of the scene, georeferenced with the truth."""
    base = tmp_path_factory.mktemp("scene")
    images = base / "images"
    images.mkdir()
    block_views = views()
    sand = texture()
    for n, view in enumerate(block_views):
        cv2.imwrite(str(images / view.name), render(view, sand, n))
    frame = LocalFrame.at(CRS, EASTING, NORTHING, DATUM)
    make_survey(base / "survey", images, frame, block_views)
    return Scene(base / "survey", frame, block_views)


@pytest.fixture
def fresh(scene, tmp_path):
    """Return a survey of the scene that no run has touched."""
    make_survey(tmp_path / "survey", Survey.open(scene.folder).images, scene.frame, scene.views)
    return tmp_path / "survey"


NAMES = ("precision", "correlation", "views", "filled", "ortho")


def request(folder, out, **options):
    out.mkdir(exist_ok=True)
    rasters = {name: str(out / f"{name}.tif") for name in NAMES}
    return Request(str(folder), str(out / "dsm.tif"), **{"workers": 1, **rasters, "points": str(out / "points.laz"), **options})


@pytest.fixture(scope="module")
def surface(scene, tmp_path_factory):
    """Return the result of the step and the folder of its files."""
    out = tmp_path_factory.mktemp("out")
    return run(request(scene.folder, out, output_html_file=str(out / "report.html"))), out


def read(path):
    with rasterio.open(path) as file:
        return file.read(1, masked=True).filled(np.nan) if file.dtypes[0] == "float32" else file.read(1)


def truth_at(path, frame, shrink=0.0):
    """Return the true height of a raster's cells, and how many photographs' frames (less ``shrink`` pixels) hold them."""
    with rasterio.open(path) as file:
        c, r = np.meshgrid(np.arange(file.width) + 0.5, np.arange(file.height) + 0.5)
        easting, northing = file.transform * (c.ravel(), r.ravel())
    flat = frame.from_crs(np.column_stack([easting, northing, np.full(easting.shape, DATUM)]))
    z = ground(flat[:, 0], flat[:, 1])
    local = np.column_stack([flat[:, :2], z])
    inside = np.zeros(len(local), int)
    for view in views():
        uv = view.project(local)
        inside += ((uv > shrink) & (uv < np.array([CAMERA.width, CAMERA.height]) - shrink)).all(axis=1)
    return (frame.to_crs(local)[:, 2]).reshape(c.shape), inside.reshape(c.shape), local.reshape(*c.shape, 3)


def flat_ground(local):
    """Tell which cells are away from the platform's edges, by more than a window."""
    x, y = local[..., 0], local[..., 1]
    near = (x > 1.5) & (x < 6.5) & (y > -4.0) & (y < 1.0)
    on = (x > 3.5) & (x < 4.5) & (y > -2.0) & (y < -1.0)
    return ~near | on


def test_heights_are_as_good_as_geometry_allows(scene, surface):
    result, out = surface
    assert result.gsd == pytest.approx(GSD, rel=0.05)
    height, (truth, _, local) = read(result.output), truth_at(result.output, scene.frame)
    with rasterio.open(result.output) as file:
        assert file.transform.a == pytest.approx(2 * result.gsd)
        assert file.crs.to_epsg() == 32630
        # Snapped to multiples of the cell.
        assert (file.transform.c / file.transform.a) % 1 == pytest.approx(0, abs=1e-6)
    number = read(out / "views.tif")
    known = np.isfinite(height) & flat_ground(local) & (number >= 4)
    assert known.sum() > 5000
    error = (height - truth)[known]
    # sigma_px = 0.1 px between views 4 m apart at 20 m: sqrt(2) 0.1 GSD H / B for a pair; several views do better.
    limit = np.sqrt(2) * 0.1 * GSD * HEIGHT / BASE
    assert np.sqrt(np.mean(error**2)) < limit
    assert abs(np.median(error)) < 0.2 * limit


def test_precision_tells_the_truth(scene, surface):
    result, out = surface
    height, sigma = read(result.output), read(out / "precision.tif")
    truth, _, local = truth_at(result.output, scene.frame)
    known = np.isfinite(height) & flat_ground(local)
    assert np.isfinite(sigma[known]).all()
    ratio = np.abs(height - truth)[known] / sigma[known]
    # 68.3 % for a perfect sigma; how far neighbouring pixels share noise makes 20 % more or less of it, 58 to 77 %.
    assert 0.58 < np.mean(ratio < 1) < 0.77
    assert np.mean(ratio < 2) > 0.88
    assert result.median_precision == pytest.approx(float(np.nanmedian(sigma)), rel=0.01)


def test_the_platform_keeps_its_edges(scene, surface):
    result, _ = surface
    height, (truth, _, local) = read(result.output), truth_at(result.output, scene.frame)
    x, y = local[..., 0], local[..., 1]
    cell = 2 * GSD
    # A window of nine cells must not smear the edge by more than two cells to either side.
    for side in (2.5, 5.5):
        row = (y > -2.5) & (y < -0.5)
        away = np.abs(x - side) > 2.5 * cell
        close = row & away & (np.abs(x - side) < 1.0) & np.isfinite(height)
        assert close.sum() > 50
        assert np.mean(np.abs(height - truth)[close] < 0.15) > 0.9


def test_nothing_is_invented(scene, surface):
    result, out = surface
    height, number = read(result.output), read(out / "views.tif")
    _, inside, _ = truth_at(result.output, scene.frame)
    assert np.isnan(height[inside < 2]).all()
    assert np.isnan(height[number < 2]).all()
    # Nearly all that two frames hold well is found: the sand has texture everywhere.
    _, well, _ = truth_at(result.output, scene.frame, shrink=25.0)
    assert np.isfinite(height[well >= 3]).mean() > 0.97
    known, covered = np.isfinite(height).sum(), (inside >= 2).sum()
    assert result.coverage_percent == pytest.approx(100 * known / covered, abs=2.0)


def test_the_orthophoto_shows_the_sand(scene, surface):
    result, out = surface
    with rasterio.open(out / "ortho.tif") as file:
        ortho = file.read()
        assert file.count == 4
    _, inside, local = truth_at(result.output, scene.frame)
    painted = ortho[3] == 255
    assert painted[inside >= 2].mean() > 0.95
    sand = cv2.GaussianBlur(texture(), (0, 0), 1.5)
    column, row = ((local[..., 0] + 20) / 0.025 - 0.5).astype(np.float32), ((20 - local[..., 1]) / 0.025 - 0.5).astype(np.float32)
    expected = cv2.remap(sand, column, row, cv2.INTER_LINEAR)
    here = painted & flat_ground(local) & (inside >= 3)
    assert np.corrcoef(ortho[1][here], expected[here])[0, 1] > 0.9


def test_points_are_the_cells(surface):
    result, out = surface
    height = read(result.output)
    cloud = laspy.read(out / "points.laz")
    assert len(cloud.x) == np.isfinite(height).sum()
    assert np.sort(cloud.z)[[0, -1]] == pytest.approx([np.nanmin(height), np.nanmax(height)], abs=1e-3)
    assert cloud.header.parse_crs().to_epsg() == 32630


def test_the_points_left_out_confirm_the_surface(scene, surface):
    """Tie points on the true ground: the surface lies on them as well as on the truth, and the report says so."""
    page = (scene.folder / "report" / "exportdsm.html").read_text()
    median, nmad = (
        float(re.search(rf"tie points, {name} \(m\)</td><td class=\"n\">([^<]*)<", page)[1]) for name in ("median", "NMAD")
    )
    limit = np.sqrt(2) * 0.1 * GSD * HEIGHT / BASE
    assert abs(median) < 0.3 * limit
    assert 0.0 < nmad < limit


def test_tags_carry_the_georeferencing(scene, surface):
    result, _ = surface
    with rasterio.open(result.output) as file:
        tags = file.tags()
        assert file.units == ("m",)
    assert tags["VERTICAL_DATUM"] == "unknown"
    data = json.loads(tags["STRANDLINE_GEOREFERENCING"])
    assert data["pivot"] == [0.0, 0.0, 0.0]
    assert len(data["covariance"]) == 49
    assert data["frame"]["longitude"] == pytest.approx(scene.frame.longitude)
    assert json.loads(tags["STRANDLINE_PARAMETERS"])["regularity"] == 1.0
    assert tags["STRANDLINE_DATE"] == "2020-06-06T09:30:00"  # the first photograph's


def test_the_report_stands_and_is_self_contained(scene, surface):
    _, out = surface
    page = (scene.folder / "report" / "exportdsm.html").read_text()
    assert page == (out / "report.html").read_text()
    assert page.count("data:image") >= 5
    assert "://" not in page.split("<body>")[1].replace("http://www.w3.org", "")


def test_a_second_run_under_the_same_parameters_is_at_once(scene, surface, monkeypatch):
    result, out = surface

    def refuse(*_):
        raise AssertionError("matched again")

    monkeypatch.setattr(exportdsm, "compute_levels", refuse)
    assert run(request(scene.folder, out)) == result


class StopsAt(Silent):
    """Cancels when a share of the work is done."""

    def __init__(self, share):
        self._share, self._now = share, 0.0

    def fraction(self, value):
        self._now = value

    def cancelled(self):
        return self._now >= self._share


def small_tiles(monkeypatch, core=64, overlap=24):
    """Cut into small tiles, so that a small area has many."""
    monkeypatch.setattr(exportdsm, "tiles", lambda level: mosaic.tiles(level, core, overlap))


def test_tiles_leave_no_seams(scene, surface, fresh, tmp_path, monkeypatch):
    result, _ = surface
    small_tiles(monkeypatch)
    again = run(request(fresh, tmp_path / "tiled"))
    one, many = read(result.output), read(again.output)
    both = np.isfinite(one) & np.isfinite(many)
    assert both.sum() > 0.97 * np.isfinite(one).sum()
    sigma = again.median_precision
    difference = (many - one)[both]
    # Other views and other paths of regularisation: the same within the noise of matching.
    assert np.sqrt(np.mean(np.minimum(np.abs(difference), 0.3) ** 2)) < 1.5 * sigma
    assert abs(np.median(difference)) < 0.1 * sigma
    # From one tile to the next heights jump no more than inside a tile.
    truth, _, local = truth_at(result.output, scene.frame)
    error = np.where(flat_ground(local), many - truth, np.nan)
    jumps = np.abs(np.diff(error, axis=1))
    seams = jumps[:, 63::64]
    assert np.nanmedian(seams) < 1.3 * np.nanmedian(jumps) + 1e-4


def test_workers_make_no_difference(fresh, tmp_path, monkeypatch):
    """Pools start fresh processes, so the small area gets its tiles from the step's own cutting at a fine resolution."""
    square = shapely.box(EASTING - 6.4, NORTHING - 0.6, EASTING + 6.4, NORTHING + 0.6)
    write_layer(str(tmp_path / "area.gpkg"), "area", CRS, {}, [square], "Polygon")
    area = VectorSource(str(tmp_path / "area.gpkg"), "area", CRS)
    monkeypatch.setattr(work, "_POOL", 2)
    monkeypatch.setattr(exportdsm, "_POOL", 2)
    files = []
    for workers in (1, 2):
        result = run(request(fresh, tmp_path / f"out{workers}", area=area, resolution=0.0125, workers=workers))
        files.append(read(result.output).tobytes())
    assert files[0] == files[1]


def test_a_stopped_run_goes_on_where_it_was(surface, fresh, tmp_path, monkeypatch):
    from strandline.core.errors import Cancelled

    small_tiles(monkeypatch)
    with pytest.raises(Cancelled):
        run(request(fresh, tmp_path / "out"), Progress(StopsAt(0.5)))
    assert not (tmp_path / "out" / "dsm.tif").exists()
    assert Survey.open(fresh).record("exportdsm") is None
    kept = {path: path.stat().st_mtime_ns for path in (fresh / "dense").rglob("level*/*.npz")}
    assert len(kept) > 5
    done = []
    original = work.match_tile

    def watched(plan, tile):
        standing = tile.path(plan.scratch).is_file()
        done.append(standing)
        original(plan, tile)
        if standing:
            assert tile.path(plan.scratch).stat().st_mtime_ns == kept[tile.path(plan.scratch)]

    monkeypatch.setattr(work, "match_tile", watched)
    result = run(request(fresh, tmp_path / "out"))
    assert sum(done) == len(kept)
    assert not (fresh / "dense").exists()
    # As if it had never been stopped.
    monkeypatch.setattr(work, "match_tile", original)
    other = run(request(fresh, tmp_path / "other"))
    assert read(result.output).tobytes() == read(other.output).tobytes()


def test_a_killed_run_leaves_nothing_half_written(fresh, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    asked = tmp_path / "request.json"
    asked.write_text(json.dumps(encode(Request(str(fresh), str(out / "dsm.tif"), resolution=0.05, workers=1))))
    process = subprocess.Popen(
        [sys.executable, "-m", "strandline", "exportdsm", str(asked)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        for _ in range(600):
            if list((fresh / "dense").glob("*/level1/*.npz")):
                break
            time.sleep(0.1)
        os.kill(process.pid, signal.SIGKILL)
    finally:
        process.wait()
    assert not (out / "dsm.tif").exists()
    result = run(Request(str(fresh), str(out / "dsm.tif"), resolution=0.05, workers=1))
    assert np.isfinite(read(result.output)).any()
    assert [p.name for p in out.iterdir()] == ["dsm.tif"]


def test_area_ignore_and_fill(scene, fresh, tmp_path):
    crs = scene.frame.crs
    area_box = shapely.box(EASTING - 4, NORTHING - 4, EASTING + 2, NORTHING + 3)
    hole = shapely.Point(EASTING - 2, NORTHING).buffer(1.0)
    for name, shape in (("area", area_box), ("ignore", hole)):
        write_layer(str(tmp_path / f"{name}.gpkg"), name, crs, {}, [shape], "Polygon")
    area, ignore = (VectorSource(str(tmp_path / f"{n}.gpkg"), n, crs) for n in ("area", "ignore"))
    result = run(request(fresh, tmp_path / "out", area=area, ignore=ignore, fill=0.5))
    height = read(result.output)
    with rasterio.open(result.output) as file:
        c, r = np.meshgrid(np.arange(file.width) + 0.5, np.arange(file.height) + 0.5)
        x, y = file.transform.c + file.transform.a * c, file.transform.f + file.transform.e * r
        cell = file.transform.a
    wanted = shapely.contains_xy(area_box, x, y) & ~shapely.contains_xy(hole, x, y)
    assert np.isnan(height[~wanted]).all()
    assert np.isfinite(height[wanted]).mean() > 0.98
    # Cells count by their centres, so the edges of the polygons make up to a cell's width of difference.
    expected = min(100.0, 100 * np.isfinite(height).sum() * cell**2 / (area_box.area - hole.area))
    assert result.coverage_percent == pytest.approx(expected, abs=0.1)
    # A surface without a single height is none: it is told, and what stood stays.
    write_layer(str(tmp_path / "all.gpkg"), "all", crs, {}, [area_box.buffer(1)], "Polygon")
    standing = Path(result.output).read_bytes()
    with pytest.raises(InputError, match="IGNORE covers all"):
        run(request(fresh, tmp_path / "out", area=area, ignore=VectorSource(str(tmp_path / "all.gpkg"), "all", crs)))
    assert Path(result.output).read_bytes() == standing
    assert not list(Path(result.output).parent.glob(".part-*"))


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"window": 4}, "WINDOW=4"),
        ({"window": 33}, "WINDOW=33"),
        ({"resolution": -1.0}, "RESOLUTION=-1"),
        ({"regularity": -0.1}, "REGULARITY"),
        ({"fill": -1.0}, "FILL"),
        ({"resolution": 1e-5}, "RESOLUTION"),
        ({"resolution": 5.0}, "RESOLUTION"),
        ({"output": "dsm.png"}, ".tif"),
        ({"points": "points.txt"}, ".laz"),
        ({"ortho_depth": "12"}, "ORTHO_DEPTH=12"),
        ({"fill": 5000.0}, "FILL=5000"),
        ({"fill": float("nan")}, "FILL=nan"),
    ],
)
def test_bad_parameters_cost_nothing(scene, surface, tmp_path, options, told):
    before = (scene.folder / "survey.json").read_bytes()
    with pytest.raises(InputError, match=told):
        run(replace(request(scene.folder, tmp_path / "out"), **options))
    assert (scene.folder / "survey.json").read_bytes() == before
    assert list((tmp_path / "out").iterdir()) == []


def test_a_photograph_of_another_size_is_named(fresh, tmp_path, scene):
    survey = Survey.open(fresh)
    first, *others = survey.photographs
    Survey.create(fresh, survey.images, scene.frame.crs, [replace(first, width=720), *others])
    with pytest.raises(InputError, match=rf"{first.name} has 720 x 300 pixels but was oriented with 360 x 300"):
        run(request(fresh, tmp_path / "out"))
    assert list((tmp_path / "out").iterdir()) == []


def test_an_area_elsewhere_is_refused(scene, tmp_path):
    far = shapely.box(EASTING + 900, NORTHING, EASTING + 950, NORTHING + 20)
    write_layer(str(tmp_path / "far.gpkg"), "far", CRS, {}, [far], "Polygon")
    with pytest.raises(InputError, match="AREA"):
        run(request(scene.folder, tmp_path / "out", area=VectorSource(str(tmp_path / "far.gpkg"), "far", CRS)))


def test_a_missing_photograph_is_named(fresh, tmp_path, scene):
    survey = Survey.open(fresh)
    moved = tmp_path / "moved"
    moved.mkdir()
    for photograph in survey.photographs[1:]:
        (moved / photograph.name).write_bytes((survey.images / photograph.name).read_bytes())
    Survey.create(fresh, moved, scene.frame.crs, list(survey.photographs))
    with pytest.raises(InputError, match=survey.photographs[0].name):
        run(request(fresh, tmp_path / "out"))


def test_a_window_of_the_user(fresh, scene, tmp_path):
    result = run(request(fresh, tmp_path / "out", window=7, regularity=2.0))
    height, (truth, _, local) = read(result.output), truth_at(result.output, scene.frame)
    known = np.isfinite(height) & flat_ground(local)
    assert np.median(np.abs(height - truth)[known]) < 0.5 * GSD
