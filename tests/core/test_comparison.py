"""JPG, RAW and their enhancement side by side: pairs of files, frames, the verdict, and a simulated flight from end to end."""

import json
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from strandline.core.comparison import cases, compareinputs
from strandline.core.comparison.cases import Outcome
from strandline.core.comparison.control import raw_request
from strandline.core.comparison.exposures import Exposures, Source, pair_names
from strandline.core.comparison.frames import frame_offset
from strandline.core.comparison.verdict import differs, ratio, rms, verdict
from strandline.core.contract import VectorSource
from strandline.core.errors import InputError, NotEnoughData
from strandline.core.georef import Georef
from strandline.core.orientation import georeference, orient
from strandline.core.orientation.sparse import read_block
from strandline.core.simulation import simulatesurvey
from strandline.core.survey import Photograph, Survey
from strandline.core.vector import read_layer

DAY = "2024-03-12"
FLIGHT = simulatesurvey.Request(
    "", dates="one", length=26, width=22, height=36, forward_overlap=65, side_overlap=60, camera_width=480, camera_height=360,
    focal=390, contrast=0.08, gcp_count=4, check_count=3, workers=1,
)  # fmt: skip
GSD = 36 / 390


# Which files are one exposure


def test_files_of_one_exposure_have_one_name():
    pairs, notes = pair_names(["a/DJI_1.JPG", "a/DJI_2.JPG", "b/DJI_1.JPG"], ["A/dji_1.dng", "a/DJI_2.DNG", "b/DJI_1.DNG"])
    assert pairs == [("a/DJI_1.JPG", "A/dji_1.dng"), ("a/DJI_2.JPG", "a/DJI_2.DNG"), ("b/DJI_1.JPG", "b/DJI_1.DNG")]
    assert notes == []


def test_folders_may_differ_where_names_do_not_repeat():
    pairs, notes = pair_names(["100/IMG_1.JPG", "100/IMG_2.JPG", "IMG_4.JPG"], ["IMG_1.CR2", "x/IMG_2.CR2", "IMG_3.CR2"])
    assert pairs == [("100/IMG_1.JPG", "IMG_1.CR2"), ("100/IMG_2.JPG", "x/IMG_2.CR2")]
    assert len(notes) == 2
    assert "1 photographs have a JPG but no RAW" in notes[0]
    assert "IMG_4.JPG" in notes[0]
    assert "IMG_3.CR2" in notes[1]


def test_the_same_name_in_two_folders_is_not_guessed():
    pairs, notes = pair_names(["a/1.jpg", "b/1.jpg", "2.jpg"], ["c/1.dng", "2.dng"])
    assert pairs == [("2.jpg", "2.dng")]
    assert "a/1.jpg, b/1.jpg" in notes[0]


def test_another_flight_is_refused():
    with pytest.raises(InputError, match=r"No photograph in JPG has a RAW of the same name: JPG has 1\.jpg, RAW has 2\.dng"):
        pair_names(["1.jpg"], ["2.dng"])


# Where the JPG's frame lies in the RAW


def scene(rows=600, columns=800):
    rng = np.random.default_rng(4)
    fine = sum(cv2.GaussianBlur(rng.normal(size=(rows, columns)), (0, 0), s) * s for s in (1.0, 3.0, 10.0))
    return 110 + 8 * fine / fine.std() + rng.normal(0, 2, (rows, columns))


def as_jpg(values):
    """Another tone curve, and what JPEG leaves."""
    shown = np.clip(255 * np.clip(values / 255, 0, 1) ** 0.6, 0, 255).astype(np.uint8)
    return cv2.imdecode(cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, 85])[1], cv2.IMREAD_GRAYSCALE)


@pytest.mark.parametrize(("left", "top", "right", "bottom"), [(0, 0, 0, 0), (8, 4, 8, 4), (16, 2, 0, 10)])
def test_a_frame_that_is_cut_out_is_found(left, top, right, bottom):
    raw = scene()
    jpg = as_jpg(raw)[top : 600 - bottom, left : 800 - right]
    found = frame_offset(jpg, raw.astype(np.uint8))
    # A tenth of a pixel is a fifth of what a mark is good for.
    assert (found.x, found.y) == pytest.approx((left, top), abs=0.1)
    assert found.spread < 0.2


def test_a_straightened_jpg_is_no_shift_and_another_scene_is_nothing():
    raw = scene()
    y, x = np.mgrid[:600, :800].astype(np.float32)
    u, v = (x - 400) / 500, (y - 300) / 500
    grow = 1 + 0.02 * (u**2 + v**2)  # 5 px in the corners
    jpg = as_jpg(cv2.remap(raw, 400 + 500 * u * grow, 300 + 500 * v * grow, cv2.INTER_CUBIC))
    assert frame_offset(jpg, raw.astype(np.uint8)).spread > 1.0
    assert frame_offset(as_jpg(scene().T.copy()), raw.T[::-1].copy().astype(np.uint8)) is None


# The verdict


def outcome(case, mtp=None, count=10, coverage=50.0, errors=None, note=""):
    names = [f"{i}.jpg" for i in range(10)]
    if mtp is None:
        return Outcome(case, Path(), names, note=note)
    oriented = orient.Result("", count, mtp, 99.0, 0.8 * mtp, 99.0, 0.4)
    checks = {} if errors is None else {f"c{i}": np.array([e, 0.0, e]) for i, e in enumerate(errors)}
    return Outcome(case, Path(), names, oriented=oriented, coverage=dict.fromkeys(names, coverage), checks=checks)


def test_numbers_behind_the_verdict():
    one = {"a": np.array([3.0, 4.0, 1.0]), "b": np.array([0.0, 0.0, 7.0])}
    assert rms(one) == (pytest.approx(np.sqrt(12.5)), pytest.approx(5.0))
    jpg, raw, lost = outcome("JPG", 1000.0), outcome("RAW", 1480.0), outcome("CeJPG")
    mtp = lambda o: o.oriented.mtp  # noqa: E731
    assert ratio(raw, jpg, mtp) == 1.48
    assert ratio(lost, jpg, mtp) is None
    assert ratio(jpg, lost, mtp) is None


def test_errors_differ_only_beyond_chance():
    near = {f"{i}": np.array([0.01, 0.0, 0.01 + 0.001 * i]) for i in range(8)}
    far = {k: 2 * e for k, e in near.items()}
    mixed = {k: (2 if i % 2 else 0.5) * e for i, (k, e) in enumerate(near.items())}
    middle = np.median([np.linalg.norm(e) for e in near.values()])
    assert differs(near, far) == pytest.approx(middle)
    assert differs(far, near) == pytest.approx(-middle)
    assert differs(near, mixed) is None
    assert differs(near, near) is None
    assert differs({k: near[k] for k in "01234"}, far) is None  # five points can never tell


def test_the_verdict_says_what_helped():
    errors = np.linspace(0.01, 0.02, 8)
    told = verdict(
        [
            outcome("JPG", 1000.0, errors=2 * errors),
            outcome("RAW", 1500.0, errors=2 * errors),
            outcome("CeJPG", 2300.0, coverage=90.0, errors=errors),
            outcome("CeRAW", 2900.0, coverage=80.0, errors=0.9 * errors),
        ]
    )
    assert told.startswith("CeRAW gives the most tie points (2,900 per photograph, 2.90 times those of the JPG), CeJPG covers")
    assert "CeRAW has the smallest errors on 8 check points (1.4 cm in plan, 1.4 cm in height)" in told
    assert "enhancement helped with the JPG (2.30 times the tie points, check points 2.1 cm better) and with the RAW" in told
    assert "RAW helped without enhancement (1.50 times the tie points) and with enhancement" in told


def test_the_verdict_is_honest_when_enhancement_does_not_help():
    told = verdict([outcome("JPG", 1000.0), outcome("CeJPG", 900.0)])
    assert told == (
        "JPG gives the most tie points (1,000 per photograph), JPG covers the photographs best (50 % of their cells); "
        "enhancement did harm with the JPG (0.90 times the tie points)."
    )
    same = verdict([outcome("JPG", 1000.0), outcome("CeJPG", 1020.0)])
    assert same.endswith("enhancement made no difference with the JPG (1.02 times the tie points).")
    fewer = verdict([outcome("JPG", 1000.0), outcome("CeJPG", 3000.0, count=4)])
    assert fewer.startswith("JPG gives the most tie points")
    assert "enhancement did harm with the JPG (3.00 times the tie points, 6 fewer photographs oriented)" in fewer


def test_the_verdict_divides_by_nothing():
    told = verdict([outcome("JPG"), outcome("RAW"), outcome("CeJPG", 772.0), outcome("CeRAW", 1932.0)])
    assert "1,932 per photograph, where the JPG cannot be oriented" in told
    assert "enhancement made orientation possible with the JPG (JPG cannot be oriented) and with the RAW" in told
    assert "RAW did not help without enhancement (RAW cannot be oriented), but helped with enhancement (2.50 times" in told
    assert verdict([outcome("JPG"), outcome("CeJPG", note="No pairs.")]) == "None of the 2 cases can be oriented: No pairs."


# From end to end


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """The middle of a simulated flight, three photographs of each strip, as JPG and as RAW from the same exposures."""
    folder = tmp_path_factory.mktemp("flight") / "simulation"
    simulatesurvey.run(replace(FLIGHT, output=str(folder)))
    for kind in ("jpg", "raw"):
        for i, path in enumerate(sorted((folder / DAY / kind).iterdir())):
            if i not in (1, 2, 3, 6, 7, 8):
                path.unlink()
    return folder / DAY


def request_for(flight, **more):
    given = {
        "jpg": str(flight / "jpg"),
        "raw": str(flight / "raw"),
        "gcps": VectorSource(str(flight / "gcps.gpkg"), "gcps"),
        "name_field": "name",
        "role_field": "role",
        "sigma_h_field": "sigma_h",
        "sigma_v_field": "sigma_v",
        "marks": VectorSource(str(flight / "marks.csv"), "marks"),
        "method": "arctan",
        "workers": 1,
    }
    return compareinputs.Request(**{**given, **more})


@pytest.fixture(scope="module")
def compared(flight, tmp_path_factory):
    """The flight compared, its surveys kept."""
    folder = tmp_path_factory.mktemp("compared")
    request = request_for(
        flight, surveys=str(folder / "surveys"), table=str(folder / "t.gpkg"), output_html_file=str(folder / "r.html")
    )
    return folder, request, compareinputs.run(request)


def rows_of(path):
    table = read_layer(VectorSource(str(path), "comparison"))
    assert table.geometry is None
    return table, dict(zip(table.text("case"), range(len(table)), strict=True))


def test_four_cases_in_the_papers_order(compared):
    folder, _, result = compared
    table, index = rows_of(folder / "t.gpkg")
    kept = ["mtp", "mtp_percent", "mmtp", "mmtp_percent", "mse", "plani", "alti"]
    more = ["coverage_percent", "plani_check", "alti_check", "features", "note"]
    assert list(table.fields) == ["case", "images", "oriented", *kept, *more]
    assert list(index) == ["JPG", "RAW", "CeJPG", "CeRAW"]
    assert result.image_count == 6
    assert table.numbers("oriented").tolist() == [6, 6, 6, 6]
    mtp = table.numbers("mtp").tolist()
    assert mtp == [result.mtp_jpg, result.mtp_raw, result.mtp_cejpg, result.mtp_ceraw]
    assert result.mtp_ratio == pytest.approx(max(mtp) / mtp[0])
    # The 12 bits of the RAW against the 8 of its JPG, on the same light and noise.
    assert result.mtp_raw > result.mtp_jpg
    assert result.mtp_ceraw > result.mtp_cejpg
    # Marks of half a pixel of 9 cm, from 36 m: a pixel in plan and two in height bound three points together.
    assert np.all(table.numbers("plani_check") < GSD)
    assert np.all(table.numbers("alti_check") < 2 * GSD)
    assert np.all((table.numbers("coverage_percent") > 40) & (table.numbers("coverage_percent") <= 100))
    assert np.all(table.numbers("mse") < 1.0)
    assert np.all(table.numbers("mtp_percent") > 95)


def test_the_same_positions_marks_and_settings_for_all(compared):
    folder, _, _ = compared
    surveys = [Survey.open(folder / "surveys" / f"survey-{case}") for case in ("JPG", "RAW", "CeJPG", "CeRAW")]
    assert len({s.crs for s in surveys}) == 1
    assert len({tuple(p.position for p in s.photographs) for s in surveys}) == 1
    searched = [s.record("tiepoints").parameters for s in surveys]
    assert searched[0]["max_features"] == 0
    assert all(p == searched[0] for p in searched)
    assert [s.record("enhance").parameters["method"] for s in surveys] == ["none", "none", "arctan", "arctan"]
    origins = [Georef.read(s).frame for s in surveys]
    marks = [read_layer(VectorSource(str(s.folder / "residuals.gpkg"), "residuals")).numbers("marks").tolist() for s in surveys]
    assert all(m == marks[0] for m in marks)
    assert len({o.crs for o in origins}) == 1


def test_points_are_seen_where_their_projections_lie(compared):
    block = read_block(compared[0] / "surveys" / "survey-CeRAW" / "model")
    seen = cases.places(block)
    assert {name: len(xy) for name, xy in seen.items()} == {
        v.name: int((block.observed_view == i).sum()) for i, v in enumerate(block.views)
    }
    some = block.observed_point[block.observed_view == 3]
    assert seen[block.views[3].name] == pytest.approx(block.views[3].project(block.points[some]))


def test_the_report_holds_tables_and_pictures(compared):
    folder, _, result = compared
    page = (folder / "r.html").read_text()
    assert page == (folder / "surveys" / "report" / "compareinputs.html").read_text()
    assert '<p class="verdict">' in page
    for text in ("30598", "2.95", f"{result.mtp_ceraw:.0f}", "table 1 of the paper", "figure 4"):
        assert text in page
    # Tie points, check points, coverage, two photographs of four cases, one by cell, two clouds.
    assert page.count("<img") >= 9
    assert "<script" not in page
    assert "://" not in page


def test_a_case_without_orientation_is_a_row_and_not_the_end(compared, tmp_path, monkeypatch):
    folder, request, _ = compared
    surveys = tmp_path / "surveys"
    shutil.copytree(folder / "surveys", surveys)

    def fails(asked, progress):
        if Path(asked.survey).name in ("survey-JPG", "survey-RAW"):
            raise NotEnoughData("No two photographs can be oriented to each other: they share too little.")
        return orient_run(asked, progress)

    orient_run = orient.run
    monkeypatch.setattr(orient, "run", fails)
    result = compareinputs.run(
        replace(request, surveys=str(surveys), table=str(tmp_path / "t.gpkg"), output_html_file=str(tmp_path / "r.html"))
    )
    table, index = rows_of(tmp_path / "t.gpkg")
    assert (result.mtp_jpg, result.mtp_ratio) == (None, None)
    assert result.mtp_ceraw == compared[2].mtp_ceraw
    row = {key: column[index["RAW"]] for key, column in table.fields.items()}
    assert row["oriented"] == 0
    assert row["features"] > 0
    assert np.isnan([row[k] for k in ("mtp", "mtp_percent", "mmtp", "mse", "plani", "alti", "coverage_percent")]).all()
    assert row["note"].startswith("No two photographs")
    page = (tmp_path / "r.html").read_text()
    assert "not oriented (0 of 6)" in page
    assert "JPG not oriented" in page


def test_what_stands_is_kept_and_the_numbers_stay(compared, tmp_path, listener, progress):
    folder, request, result = compared
    again = compareinputs.run(replace(request, table=str(tmp_path / "t.gpkg")), progress)
    assert again == result
    assert sum("stand already" in text for text in listener.infos) >= 8
    assert sum(text.startswith("CeRAW: ") for text in listener.infos) >= 2
    assert listener.fractions[-1] == 1.0
    assert listener.fractions == sorted(listener.fractions)


def test_jpg_alone_is_two_cases_and_leaves_nothing_behind(flight, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    few = tmp_path / "few"
    few.mkdir()
    for path in sorted((flight / "jpg").iterdir())[:3]:
        shutil.copy(path, few)
    result = compareinputs.run(compareinputs.Request(str(few), table=str(tmp_path / "t.gpkg"), max_size=400, workers=1))
    assert (result.image_count, result.mtp_raw, result.mtp_ceraw) == (3, None, None)
    table, index = rows_of(tmp_path / "t.gpkg")
    assert list(index) == ["JPG", "CeJPG"]
    assert np.isnan(table.numbers("plani")).all()
    assert list((tmp_path / "temporary").iterdir()) == []


# Marks in the RAW


def listed(marks, ending, size):
    """All photographs that are marked, as files of one kind."""
    stems = sorted({Path(name).stem for name in read_layer(marks).text("image")})
    return Source(Path(), tuple(Photograph(f"{stem}{ending}", 1, "", *size, "camera") for stem in stems))


def test_marks_move_with_the_frame(flight, tmp_path, monkeypatch):
    from strandline.core.comparison import control

    given = request_for(flight)
    jpg, raw = listed(given.marks, ".jpg", (480, 360)), listed(given.marks, ".dng", (496, 370))
    monkeypatch.setattr(control, "raw_offsets", lambda _: {p.name: (8.0, 4.0) for p in jpg.photographs})
    base = georeference.Request("", gcps=given.gcps, name_field="name", role_field="role", marks=given.marks)
    moved = raw_request(base, None, Exposures(jpg, raw), tmp_path)
    before, after = read_layer(given.marks), read_layer(moved.marks)
    assert after.numbers("x") == pytest.approx(before.numbers("x") + 8)
    assert after.numbers("y") == pytest.approx(before.numbers("y") + 4)
    assert after.text("image") == [f"{Path(n).stem}.dng" for n in before.text("image")]
    assert read_layer(moved.gcps).text("role") == read_layer(given.gcps).text("role")
    # A file of both becomes layers of both.
    from_file = raw_request(georeference.Request("", gcp_file=str(flight / "gcp_list.txt")), None, Exposures(jpg, raw), tmp_path)
    assert from_file.gcp_file is None
    assert sorted(read_layer(from_file.marks).numbers("x")) == pytest.approx(sorted(after.numbers("x")), abs=2e-3)
    # Tables name no CRS: the survey's is theirs.
    (tmp_path / "p.csv").write_text("name,x,y,z\nA,500000,4983000,3\n", encoding="utf-8")
    (tmp_path / "m.csv").write_text(f"gcp,image,x,y\nA,{jpg.photographs[0].name},1,2\n", encoding="utf-8")
    tables = georeference.Request("", gcp_file=str(tmp_path / "p.csv"))
    assert raw_request(tables, None, Exposures(jpg, raw), tmp_path, "EPSG:32631").gcps.crs == "EPSG:32631"
    elsewhere = replace(tables, crs="EPSG:2154")
    assert raw_request(elsewhere, None, Exposures(jpg, raw), tmp_path, "EPSG:32631").gcps.crs == "EPSG:2154"
    # Marks in the RAW are taken as they are.
    own = VectorSource(str(flight / "marks.csv"), "marks")
    assert raw_request(base, own, Exposures(jpg, raw), tmp_path).marks == own


# Bad input is one sentence before the work


@pytest.mark.parametrize(
    ("change", "kind", "told"),
    [
        ({"jpg": "{0}/nowhere"}, InputError, "JPG is not a folder"),
        ({"jpg": "{0}/empty"}, InputError, "There is no photograph in"),
        ({"raw": "{0}/jpg"}, InputError, r"There is no photograph in .* \(files ending in"),
        ({"raw": "{0}/others"}, InputError, "No photograph in JPG has a RAW of the same name"),
        ({"jpg": "{0}/one", "raw": None}, NotEnoughData, "There is one photograph to compare"),
        ({"marks": None}, InputError, "GCPS and MARKS belong together"),
        ({"gcps": None, "marks": None, "marks_raw": VectorSource("x", "x")}, InputError, "MARKS_RAW are marks of ground points"),
        ({"raw": None, "marks_raw": VectorSource("x", "x")}, InputError, "MARKS_RAW are marks in RAW"),
        ({"name_field": "nobody"}, InputError, "has no field 'nobody'"),
        ({"check": "nobody"}, InputError, "check point 'nobody'"),
        ({"crs": "EPSG:4326"}, InputError, "is not projected"),
        ({"gcps": "EPSG:32632"}, InputError, "lie .* km from the photographs: set their right CRS"),
        ({"window": 100}, InputError, "WINDOW=100 is not an odd number"),
        ({"max_size": 100}, InputError, "MAX_SIZE=100 is too small"),
        ({"window": 999}, InputError, "WINDOW=999 is larger than"),
        ({"table": "{0}/t.csv"}, InputError, "must be a GeoPackage"),
        ({"geoid": "45"}, InputError, "is unknown: say whether"),
    ],
)
def test_bad_input_costs_nothing(flight, tmp_path, monkeypatch, change, kind, told):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    for name in ("temporary", "empty", "one", "others"):
        (tmp_path / name).mkdir()
    (tmp_path / "jpg").symlink_to(flight / "jpg")
    first = sorted((flight / "jpg").iterdir())[0]
    shutil.copy(first, tmp_path / "one")
    shutil.copy(sorted((flight / "raw").iterdir())[0], tmp_path / "others" / "other.dng")
    if change.get("gcps"):
        change = {"gcps": VectorSource(str(flight / "gcps.gpkg"), "gcps", change["gcps"])}
    change = {k: v.format(tmp_path) if isinstance(v, str) else v for k, v in change.items()}
    monkeypatch.setattr(cases, "run_case", lambda *_: pytest.fail("the work began"))
    monkeypatch.setattr(compareinputs, "run_case", lambda *_: pytest.fail("the work began"))
    with pytest.raises(kind, match=told) as caught:
        compareinputs.run(request_for(flight, **{"table": str(tmp_path / "t.gpkg"), **change}))
    assert str(caught.value).count(". ") == 0
    assert list((tmp_path / "temporary").iterdir()) == []
    assert not (tmp_path / "t.gpkg").exists()


def test_the_same_names_of_another_flight_are_told_by_their_times(flight, tmp_path, monkeypatch):
    from strandline.core.comparison import exposures

    def later(images, names, progress):
        found = inspect_all(images, names, progress)
        return (
            [replace(i, photograph=replace(i.photograph, time="2019-01-01T10:00:00")) for i in found]
            if "raw" in str(images)
            else found
        )

    inspect_all = exposures.inspect_all
    monkeypatch.setattr(exposures, "inspect_all", later)
    with pytest.raises(InputError, match="taken at different times"):
        compareinputs.run(request_for(flight))


def test_a_result_is_told_in_json(compared):
    from strandline.core.contract import encode

    told = json.loads(json.dumps(encode(compared[2])))
    assert set(told) == {"image_count", "mtp_jpg", "mtp_raw", "mtp_cejpg", "mtp_ceraw", "mtp_ratio"}
