"""The step createsurvey: what it finds, what it refuses, what running it again changes."""

import csv
import io
import json
import shutil

import numpy as np
import pytest
import shapely
from PIL import Image
from pyproj import CRS, Transformer
from strandline.core.contract import VectorSource
from strandline.core.errors import Cancelled, InputError
from strandline.core.photographs.createsurvey import Request, run
from strandline.core.photographs.positions import utm_zone
from strandline.core.progress import Progress, Silent
from strandline.core.survey import Survey, held
from strandline.core.vector import read_layer, write_layer

RNG = np.random.default_rng(8)


class Listener(Silent):
    def __init__(self):
        self.warnings, self.infos = [], []

    def message(self, text, *, warning):
        (self.warnings if warning else self.infos).append(text)


def write(path, place=None, size=(48, 32), height=None, kind="JPEG", taken=None):
    """Write a photograph; ``place`` is longitude and latitude."""
    exif = Image.Exif()
    exif[0x0110] = "Testcam"
    if taken:
        exif.get_ifd(0x8769)[0x9003] = taken
    if place:

        def degrees(value):
            return (float(int(abs(value))), 0.0, (abs(value) % 1) * 3600)

        longitude, latitude = place
        gps = {1: "S" if latitude < 0 else "N", 2: degrees(latitude), 3: "W" if longitude < 0 else "E", 4: degrees(longitude)}
        exif.get_ifd(0x8825).update(gps if height is None else {**gps, 5: b"\x00", 6: height})
    path.parent.mkdir(parents=True, exist_ok=True)
    stream = io.BytesIO()
    pixels = RNG.integers(0, 255, (size[1], size[0], 3)).astype(np.uint8)
    Image.fromarray(pixels).save(stream, kind, exif=exif)
    path.write_bytes(stream.getvalue())


def table(path, rows, columns=("image", "x", "y", "z", "sigma_h", "sigma_v")):
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(rows)
    return VectorSource(str(path), path.stem)


@pytest.fixture
def images(tmp_path):
    folder = tmp_path / "images"
    for i in range(4):
        write(folder / f"DJI_{i:04d}.JPG", (5.0 + i * 1e-4, 43.0), height=50.0 + i)
    return folder


def create(images, tmp_path, **more):
    listener = Listener()
    result = run(Request(str(images), str(tmp_path / "survey"), **more), Progress(listener))
    return result, Survey.open(tmp_path / "survey"), listener


def test_a_flight(images, tmp_path):
    write(images / "more" / "b.png", None, (20, 30), kind="PNG")
    write(images / "more" / "c.tif", (5.0, 43.0), kind="TIFF")
    photos = tmp_path / "photos.gpkg"
    result, survey, listener = create(images, tmp_path, photos=str(photos), output_html_file=str(tmp_path / "r.html"))
    assert (result.image_count, result.position_count) == (6, 4)  # a TIFF written here has no GNSS
    assert [p.name for p in survey.photographs] == [f"DJI_{i:04d}.JPG" for i in range(4)] + ["more/b.png", "more/c.tif"]
    assert survey.crs == CRS.from_epsg(32631).to_wkt()
    first = survey.photographs[0]
    assert (first.width, first.height, first.camera) == (48, 32, "Testcam, 48 x 32")
    assert first.position.height == 50.0
    assert any("2 of 6 photographs have no position: more/b.png, more/c.tif" in w for w in listener.warnings)
    assert any("5 photographs: Testcam, 48 x 32" in i for i in listener.infos)
    assert "6 photographs of 2 cameras, 4 with a position" in (tmp_path / "r.html").read_text()
    layer = read_layer(VectorSource(str(photos), "photos"))
    assert layer.text("name") == [f"DJI_{i:04d}.JPG" for i in range(4)]
    assert layer.numbers("height").tolist() == [50.0, 51.0, 52.0, 53.0]
    assert list(layer.fields) == ["name", "height", "time", "sigma_h", "sigma_v", "camera"]
    assert CRS(layer.crs).to_epsg() == 4326
    assert layer.geometry[1].x == pytest.approx(5.0001, abs=1e-9)


def test_without_positions(tmp_path):
    write(tmp_path / "images" / "a.jpg")
    write(tmp_path / "images" / "b.jpg")
    result, survey, listener = create(tmp_path / "images", tmp_path, photos=str(tmp_path / "p.gpkg"))
    assert result.position_count == 0
    assert survey.crs is None
    assert not (tmp_path / "p.gpkg").exists()
    assert any("ground control points" in w for w in listener.warnings)


def test_one_photograph_is_warned_about(tmp_path):
    write(tmp_path / "images" / "a.jpg")
    assert any("at least two" in w for w in create(tmp_path / "images", tmp_path)[2].warnings)


def test_twice_the_same_photograph_is_warned_about(images, tmp_path):
    shutil.copy(images / "DJI_0000.JPG", images / "copy.jpg")
    assert any("DJI_0000.JPG = copy.jpg" in w for w in create(images, tmp_path)[2].warnings)


def test_hidden_files_surveys_and_the_output_are_passed_over(images, tmp_path):
    (images / "._DJI_0000.JPG").write_bytes(b"apple")
    (images / ".thumbnails").mkdir()
    (images / ".thumbnails" / "x.jpg").write_bytes(b"")
    run(Request(str(images), str(images / "survey")))
    (images / "survey" / "enhanced").mkdir()
    write(images / "survey" / "enhanced" / "DJI_0000.JPG")
    assert run(Request(str(images), str(images / "survey"))).image_count == 4
    assert run(Request(str(images), str(tmp_path / "other"))).image_count == 4
    with pytest.raises(InputError, match="IMAGES is a survey folder"):
        run(Request(str(images / "survey"), str(tmp_path / "third")))


def test_a_ring_of_links_ends(images, tmp_path):
    (images / "round").symlink_to(images)
    assert create(images, tmp_path)[0].image_count == 4


def test_raw_files_are_listed(shared_data, tmp_path):
    _, survey, _ = create(shared_data / "raw", tmp_path)
    assert [(p.name, p.width, p.height) for p in survey.photographs] == [
        ("colorchart.dng", 1734, 1156),
        ("copr_0136_quarter_simulated.dng", 1494, 996),
        ("kodak_dc50.kdc", 768, 512),
    ]


def test_one_file_per_exposure(images, tmp_path):
    (images / "dji_0002.dng").write_bytes(b"raw")
    with pytest.raises(InputError, match=r"1 exposures \(DJI_0002.JPG and dji_0002.dng\).*FILTER"):
        create(images, tmp_path)
    assert not (tmp_path / "survey").exists()
    assert create(images, tmp_path, filter="*.jpg")[0].image_count == 4
    write(images / "sub" / "DJI_0002.png", kind="PNG")  # another folder, another exposure
    assert create(images, tmp_path, filter="*.[jp][pn]g")[0].image_count == 5
    (images / "dji_0002.dng").unlink()
    (images / "raw").mkdir()
    (images / "raw" / "dji_0002.dng").write_bytes(b"raw")  # a folder for the other kind: the same exposure
    with pytest.raises(InputError, match=r"1 exposures \(DJI_0002.JPG and raw/dji_0002.dng and sub/DJI_0002.png\).*FILTER"):
        create(images, tmp_path)


def test_filter(images, tmp_path):
    write(images / "sub" / "a.jpg")
    assert create(images, tmp_path, filter="SUB/*")[0].image_count == 1
    assert create(images, tmp_path, filter="dji_000[12].jpg")[0].image_count == 2
    with pytest.raises(InputError, match=r"None of the 5 photographs .* matches FILTER='\*.nef'"):
        create(images, tmp_path, filter="*.nef")


def test_broken_photographs_are_named_in_one_sentence(images, tmp_path):
    data = (images / "DJI_0001.JPG").read_bytes()
    (images / "DJI_0001.JPG").write_bytes(data[:-40])
    (images / "empty.jpg").write_bytes(b"")
    (images / "text.tif").write_text("sand")
    with pytest.raises(InputError) as caught:
        create(images, tmp_path)
    assert str(caught.value).startswith(
        "3 of 6 photographs cannot be read: DJI_0001.JPG (truncated), empty.jpg (empty), text.tif (truncated or not an image); "
    )
    assert not (tmp_path / "survey").exists()


def test_no_photographs(tmp_path):
    with pytest.raises(InputError, match="IMAGES is not a folder"):
        create(tmp_path / "nowhere", tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="There is no photograph"):
        create(tmp_path / "empty", tmp_path)


def test_a_folder_with_other_things_is_left_alone(images, tmp_path):
    (tmp_path / "survey").mkdir()
    (tmp_path / "survey" / "thesis.txt").touch()
    with pytest.raises(InputError, match=r"not empty and no survey.*thesis.txt"):
        create(images, tmp_path)
    assert [p.name for p in (tmp_path / "survey").iterdir()] == ["thesis.txt"]
    with pytest.raises(InputError, match="OUTPUT is a file"):
        run(Request(str(images), str(tmp_path / "survey" / "thesis.txt")))


def test_what_a_killed_first_run_leaves_is_no_obstacle(images, tmp_path):
    (tmp_path / "survey" / "report").mkdir(parents=True)
    (tmp_path / "survey" / "survey.lock").touch()
    (tmp_path / "survey" / ".part-1-survey.json").touch()
    create(images, tmp_path)
    assert not (tmp_path / "survey" / ".part-1-survey.json").exists()


def test_a_survey_in_use_is_left_alone(images, tmp_path):
    create(images, tmp_path)
    with held(tmp_path / "survey", "tiepoints"), pytest.raises(InputError, match="in use by tiepoints"):
        create(images, tmp_path)


def test_cancel_leaves_nothing(images, tmp_path):
    class Impatient(Silent):
        def cancelled(self):
            return True

    with pytest.raises(Cancelled):
        run(Request(str(images), str(tmp_path / "survey")), Progress(Impatient()))
    assert not (tmp_path / "survey").exists()


def later_step(survey):
    survey.finish("enhance", "e", built_on=("createsurvey",), parameters={}, result={})


def test_running_again_keeps_later_steps_until_something_changes(images, tmp_path):
    _, survey, _ = create(images, tmp_path)
    later_step(survey)
    images.rename(tmp_path / "moved")
    moved = tmp_path / "moved"
    _, survey, _ = create(moved, tmp_path)
    assert survey.images == moved
    assert not survey.is_stale("enhance")
    write(moved / "DJI_0009.JPG", (5.0, 43.0))
    _, survey, _ = create(moved, tmp_path)
    assert survey.is_stale("enhance")
    (moved / "DJI_0009.JPG").unlink()
    _, survey, _ = create(moved, tmp_path)
    assert not survey.is_stale("enhance")
    _, survey, _ = create(moved, tmp_path, crs="EPSG:2154")
    assert survey.is_stale("enhance")


def test_the_same_request_writes_the_same_survey(images, tmp_path):
    def content():
        data = json.loads((tmp_path / "survey" / "survey.json").read_text())
        del data["steps"]["createsurvey"]["finished"]
        return data

    create(images, tmp_path)
    first = content()
    create(images, tmp_path)
    assert content() == first


def test_positions_replace_exif(images, tmp_path):
    to_utm = Transformer.from_crs(4326, 32631, always_xy=True)
    rows = [(f"dji_{i:04d}", *to_utm.transform(5.0 + i * 1e-4, 43.0), f"{10.5 + i}", "0.02", "0.04") for i in range(3)]
    rows.append(("DJI_0077.JPG", *to_utm.transform(5.0, 43.0), 1, "", ""))
    result, survey, listener = create(images, tmp_path, positions=table(tmp_path / "p.csv", rows), positions_crs="EPSG:32631")
    assert result.position_count == 3
    place = survey.photographs[2].position
    assert (place.longitude, place.latitude) == (pytest.approx(5.0002, abs=1e-10), pytest.approx(43.0, abs=1e-10))
    assert (place.height, place.sigma_h, place.sigma_v) == (12.5, 0.02, 0.04)
    assert survey.photographs[3].position is None
    assert any("DJI_0077.JPG" in w for w in listener.warnings)
    assert any("1 of 4 photographs have no position" in w for w in listener.warnings)


@pytest.mark.parametrize("form", ["a/x.jpg", "A\\X.JPG", "a/x", "x.jpg", "x.dng", "X"])
def test_names_match_with_or_without_folder_and_extension(tmp_path, form):
    write(tmp_path / "images" / "a" / "x.jpg")
    _, survey, _ = create(tmp_path / "images", tmp_path, positions=table(tmp_path / "p.csv", [(form, 5, 43, 1, "", "")]))
    assert survey.photographs[0].position.longitude == 5.0


def test_ambiguous_names_and_double_rows_are_refused(tmp_path):
    for folder in "ab":
        write(tmp_path / "images" / folder / "x.jpg")
    with pytest.raises(InputError, match=r"x could be a/x.jpg or b/x.jpg"):
        create(tmp_path / "images", tmp_path, positions=table(tmp_path / "p.csv", [("x", 5, 43, 1, "", "")]))
    both = table(tmp_path / "p.csv", [("a/x", 5, 43, 1, "", ""), ("b/x", 5, 43, 1, "", "")])
    assert create(tmp_path / "images", tmp_path, positions=both)[0].position_count == 2
    with pytest.raises(InputError, match="two rows for a/x.jpg"):
        create(tmp_path / "images", tmp_path, positions=table(tmp_path / "p.csv", [("a/x", 5, 43, 1, "", "")] * 2))


@pytest.mark.parametrize(
    ("row", "crs", "message"),
    [
        ((43.0, 125.0, 1, "", ""), None, "x and y look swapped"),
        ((500000.0, 4700000.0, 1, "", ""), None, "not in the area of WGS 84"),
        ((4700000.0, 500000.0, 1, "", ""), "EPSG:32631", "x and y look swapped"),
        ((5.0, 43.0, 1, "", ""), "EPSG:32631", "not in the area"),
        ((43.0, 5.0, 1, "", ""), None, "swapped, says the photographs' EXIF"),
        ((5.0, "", 1, "", ""), None, "only one of x and y"),
        ((5.0, "north", 1, "", ""), None, "'north' in the field y is not a number"),
        ((5.0, 43.0, 1, 0, ""), None, "sigma_h of DJI_0000.JPG is not above zero"),
        ((5.0, 43.0, 1e6, "", ""), None, "heights"),
        ((5.0, 43.0, 1, "", ""), "EPSG:99999", "POSITIONS_CRS 'EPSG:99999' is not understood"),
        ((5.0, 43.0, 1, "", ""), "EPSG:4978", "neither projected nor geographic"),
        ((1e6, 1e6, 1, "", ""), "EPSG:2225", "does not say what z is in"),
    ],
)
def test_coordinates_that_cannot_be_are_refused(images, tmp_path, row, crs, message):
    with pytest.raises(InputError, match=message):
        create(images, tmp_path, positions=table(tmp_path / "p.csv", [("DJI_0000.JPG", *row)]), positions_crs=crs)
    assert not (tmp_path / "survey").exists()


def test_a_table_for_another_flight_is_refused(images, tmp_path):
    with pytest.raises(InputError, match="names none of the photographs"):
        create(images, tmp_path, positions=table(tmp_path / "p.csv", [("IMG_1", 5, 43, 1, "", "")]))
    with pytest.raises(InputError, match="has no field 'image'"):
        create(images, tmp_path, positions=table(tmp_path / "q.csv", [("a", 1, 2)], ("name", "x", "y")))


def test_a_row_without_coordinates_is_no_position(images, tmp_path):
    rows = [("DJI_0000", 5, 43, "", "", ""), ("DJI_0001", "", "", "", "", "")]
    result, survey, _ = create(images, tmp_path, positions=table(tmp_path / "p.csv", rows))
    assert result.position_count == 1
    assert survey.photographs[0].position.height is None


def test_a_point_layer_can_be_the_positions(images, tmp_path):
    to_utm = Transformer.from_crs(4326, 32631, always_xy=True)
    points = [shapely.Point(*to_utm.transform(5.0, 43.0), 7.5), shapely.Point(*to_utm.transform(5.1, 43.0), 8.5)]
    path = str(tmp_path / "points.gpkg")
    write_layer(path, "points", "EPSG:32631", {"Image": ["DJI_0001", "DJI_0003"]}, points, "Point Z")
    _, survey, _ = create(images, tmp_path, positions=VectorSource(path, "points"))
    assert [p.position and p.position.height for p in survey.photographs] == [None, 7.5, None, 8.5]
    assert survey.photographs[3].position.longitude == pytest.approx(5.1, abs=1e-10)


def test_positions_far_from_exif_are_warned_about(images, tmp_path):
    _, _, listener = create(images, tmp_path, positions=table(tmp_path / "p.csv", [("DJI_0000", 5.5, 43, 1, "", "")]))
    assert any("41 km from the positions in EXIF" in w for w in listener.warnings)


@pytest.mark.parametrize(
    ("longitude", "latitude", "code"),
    [(-180.0, 10.0, 32601), (179.9, -10.0, 32760), (2.9, 0.0, 32631), (-0.1, -0.1, 32730), (180.0, 10.0, 32660)],
)
def test_utm_zone(longitude, latitude, code):
    assert utm_zone(longitude, latitude).to_epsg() == code


def test_no_utm_zone_at_the_poles():
    with pytest.raises(InputError, match="choose a CRS"):
        utm_zone(0.0, 85.0)


def test_a_crs_that_is_given(images, tmp_path):
    assert CRS(create(images, tmp_path, crs="EPSG:2154")[1].crs).to_epsg() == 2154
    for wrong, message in (("EPSG:4326", "not projected"), ("EPSG:2225", "foot"), ("sand", "not understood")):
        with pytest.raises(InputError, match=message):
            create(images, tmp_path, crs=wrong)
    assert any("outside the area of WGS 84 / UTM zone 55S" in w for w in create(images, tmp_path, crs="EPSG:32755")[2].warnings)


def test_real_photographs(shared_data, tmp_path):
    result, survey, _ = create(shared_data / "brighton" / "images", tmp_path)
    assert (result.image_count, result.position_count) == (8, 8)
    assert CRS(survey.crs).to_epsg() == 32615
    assert {(p.width, p.height, p.camera) for p in survey.photographs} == {(4000, 2250, "DJI FC300S, 3.61 mm, 4000 x 2250")}
    heights = np.array([p.position.height for p in survey.photographs])
    assert np.ptp(heights) < 0.3  # flown at one height
