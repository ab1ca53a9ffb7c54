"""The dock: a survey is chosen, a point is picked, a click in its photograph is a row of the table."""

import json
import time

import pytest
from marking_world import NAMES, make_points, make_survey, open_layer


@pytest.fixture
def project(qgis):
    from qgis.core import QgsProject

    yield QgsProject.instance()
    QgsProject.instance().clear()


@pytest.fixture
def dock(qgis, project, tmp_path):
    from strandline.provider.dock import MarkingDock

    project.addMapLayer(open_layer(make_points(tmp_path / "gcps.gpkg")))
    made = MarkingDock()
    made.resize(480, 900)
    made.show()
    yield made
    made.close()
    made.deleteLater()


def choose(dock, project, survey, tmp_path):
    points = project.mapLayersByName("gcps")[0]
    marks = dock.chooser.use_table(tmp_path / "marks.gpkg")
    dock.chooser.choose(str(survey), points, marks)
    assert dock.marking is not None, dock.message.text()
    return points, marks


def wait_for(condition, seconds=30):
    from qgis.PyQt.QtCore import QCoreApplication

    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        QCoreApplication.processEvents()
        time.sleep(0.005)
    assert condition()


def click(dock, x, y):
    """Click at (x, y) of the photograph."""
    from qgis.PyQt.QtCore import Qt
    from qgis.PyQt.QtTest import QTest

    viewer = dock.pane.viewer
    viewer.look_at(x, y, 4.0)
    place = viewer.to_widget(x, y)
    QTest.mouseClick(viewer, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, place.toPoint())


def key(dock, name, modifier="NoModifier"):
    from qgis.PyQt.QtCore import Qt
    from qgis.PyQt.QtTest import QTest

    QTest.keyClick(dock.pane.viewer, getattr(Qt.Key, f"Key_{name}"), getattr(Qt.KeyboardModifier, modifier))


def rows(layer):
    return sorted((f["gcp"], f["image"], f["x"], f["y"]) for f in layer.getFeatures())


def test_it_says_what_is_missing(dock, project, tmp_path):
    assert "survey folder" in dock.message.text()
    survey = make_survey(tmp_path)
    dock.chooser.survey.setFilePath(str(survey))
    assert "table of marks" in dock.message.text()
    dock.chooser.survey.setFilePath(str(tmp_path))
    assert "is not a survey folder" in dock.message.text()


def test_marking_by_mouse_and_keys(dock, project, tmp_path):
    _, marks = choose(dock, project, make_survey(tmp_path), tmp_path)
    dock.list.choose("A")
    assert dock.pane.key == ("A", NAMES[0])  # the photograph taken nearest to it
    click(dock, 320.0, 240.0)
    ((gcp, image, x, y),) = rows(marks)
    assert (gcp, image) == ("A", NAMES[0])
    assert (x, y) == (pytest.approx(320.0, abs=0.13), pytest.approx(240.0, abs=0.13))  # half a pixel of the screen
    click(dock, 100.0, 100.0)  # elsewhere: the mark goes there
    assert [row[:2] for row in rows(marks)] == [("A", NAMES[0])]
    assert rows(marks)[0][2] == pytest.approx(100.0, abs=0.13)
    key(dock, "Z", "ControlModifier")
    assert rows(marks)[0][2] == pytest.approx(320.0, abs=0.13)
    key(dock, "Delete")
    assert rows(marks) == []
    key(dock, "N")
    assert dock.pane.key == ("A", NAMES[1])
    key(dock, "S")
    assert dock.marking.sight(("A", NAMES[1])).skipped
    assert dock.pane.key == ("A", NAMES[2])
    key(dock, "P")
    assert dock.pane.key == ("A", NAMES[1])
    assert dock.list.current() == ("A", NAMES[1])


def test_the_selection_of_the_map_and_the_list_follow_each_other(dock, project, tmp_path):
    points, _ = choose(dock, project, make_survey(tmp_path), tmp_path)
    ids = {f["name"]: f.id() for f in points.getFeatures()}
    dock.list.choose("C")
    assert points.selectedFeatureIds() == [ids["C"]]
    points.selectByIds([ids["B"]])
    assert dock.list.current()[0] == "B"
    assert dock.pane.key == ("B", NAMES[1])


def test_layers_that_go_take_the_marking_along(dock, project, tmp_path):
    points, _ = choose(dock, project, make_survey(tmp_path), tmp_path)
    dock.list.choose("A")
    project.removeMapLayer(points.id())
    assert dock.marking is None
    assert dock.list.topLevelItemCount() == 0
    assert dock.pane.viewer.source is None


def test_a_photograph_that_gdal_cannot_show_is_shown_enhanced(dock, project, tmp_path):
    from marking_world import make_photograph

    survey = make_survey(tmp_path)
    (tmp_path / "images" / NAMES[0]).write_bytes(b"RAW")
    make_photograph(survey / "enhanced" / "bandpass-101" / f"{NAMES[0]}.tif", kind="GTiff")
    choose(dock, project, survey, tmp_path)
    dock.list.choose("A")
    wait_for(lambda: "enhanced image is shown" in dock.message.text())
    assert dock.pane.viewer.source.path.suffix == ".tif"


ENGINE = """
from osgeo import ogr
def table(path, name, fields, rows, kind=ogr.wkbNone):
    data = ogr.GetDriverByName("GPKG").CreateDataSource(path)
    layer = data.CreateLayer(name, None, kind)
    for field in fields:
        layer.CreateField(ogr.FieldDefn(field, ogr.OFTString if field in ("gcp", "image", "name", "role") else ogr.OFTReal))
    for row in rows:
        feature = ogr.Feature(layer.GetLayerDefn())
        for field, value in zip(fields, row):
            if value is not None:
                feature.SetField(field, value)
        if kind != ogr.wkbNone:
            feature.SetGeometry(ogr.CreateGeometryFromWkt("POINT Z (1 2 3)"))
        layer.CreateFeature(feature)
said = Path(os.environ["STRANDLINE_TEST_SAID"])
said.write_text(said.read_text() + json.dumps([step, request]) + "\\n")
names = ["flight/a.png", "flight/b.png", "flight/c.png"]
if step == "predictmarks":
    if request["refine"] == "none":
        rows = [("A", names[1], 100.0, 120.0, 2.0, None), ("A", names[0], 300.0, 200.0, 2.0, None)]
    else:
        rows = [("A", names[1], 101.5, 120.25, None, 0.93)]
    table(request["output"], "marks", ["gcp", "image", "x", "y", "sigma", "score"], rows)
    say(type="result", result={"gcp_count": 1, "image_count": 2, "mark_count": len(rows), "missed_count": 1})
else:
    fields = ["name", "role", "marks", "dE", "dN", "dU", "plani", "sigma_h", "sigma_v", "marks_px"]
    table(request["residuals"], "residuals", fields, [("A", "control", 2, 0.003, 0.004, -0.012, 0.005, 0.01, 0.02, 0.3)],
          ogr.wkbPoint25D)
    numbers = ["plani_control", "alti_control", "plani_check", "alti_check", "plani_loo", "alti_loo", "plani_gnss", "alti_gnss"]
    say(type="message", level="warning", text="Mind the gap.")
    say(type="result", result={"output": request["survey"], "control_count": 1, "check_count": 0, "doming": None,
                               **{k: None for k in numbers}, "plani_control": 0.005, "alti_control": 0.012})
"""


def test_predict_measure_adjust_run_the_ordinary_algorithms(dock, project, tmp_path, fake_engine, monkeypatch):
    fake_engine(ENGINE)
    said = tmp_path / "said"
    said.write_text("")
    monkeypatch.setenv("STRANDLINE_TEST_SAID", str(said))
    survey = make_survey(tmp_path, steps=("orient", "georeference"))
    content = json.loads((survey / "survey.json").read_text())
    content["steps"]["georeference"]["parameters"] = {"sigma_mark": 0.2, "gcp_heights": "orthometric", "ignore": None}
    (survey / "survey.json").write_text(json.dumps(content))
    _, marks = choose(dock, project, survey, tmp_path)
    wait_for(lambda: dock.marking.predictions and not dock.background.busy)  # at once, as the survey is georeferenced
    dock.list.choose("A")
    assert dock.pane.key == ("A", NAMES[1])  # nearest to its middle, says the engine
    viewer = dock.pane.viewer
    middle = viewer.to_photograph(viewer.rect().center() * 1.0)
    assert (middle.x(), middle.y()) == (pytest.approx(100.0, abs=1.0), pytest.approx(120.0, abs=1.0))

    dock.run_measure(False)
    wait_for(lambda: not dock.background.busy)
    assert rows(marks) == [("A", NAMES[1], 101.5, 120.25)]
    assert dock.marking.sight(("A", NAMES[1])).mark.score == 0.93  # though the table has no column for it
    assert "1 targets were measured, 1 were not found" in dock.message.text()

    dock.run_adjust()
    wait_for(lambda: dock.marking.residuals and not dock.background.busy)
    assert "0.5 cm in plan, 1.2 cm" in dock.verdict.text()
    assert "Mind the gap" in dock.verdict.text()
    head = dock.list.topLevelItem(1)
    assert (head.text(0), head.text(1), head.text(2)) == ("A", "1", "0.5 / -1.2 cm")
    steps = [json.loads(line) for line in said.read_text().splitlines()]
    assert [step for step, _ in steps] == ["predictmarks", "predictmarks", "georeference", "predictmarks"]
    adjusted = steps[2][1]
    assert (adjusted["sigma_mark"], adjusted["gcp_heights"], adjusted["name_field"]) == (0.2, "orthometric", "name")
    assert adjusted["role_field"] == "role"


def test_an_engine_that_fails_is_told_of(dock, project, tmp_path, fake_engine):
    fake_engine("say(type='error', kind='InputError', text='The survey is haunted: leave it.')")
    choose(dock, project, make_survey(tmp_path, steps=("orient", "georeference")), tmp_path)
    wait_for(lambda: "haunted" in dock.message.text())
    assert not dock.background.busy
    assert dock.predict.isEnabled()


def test_cancel_answers_within_a_second(dock, project, tmp_path, fake_engine):
    fake_engine("say(type='progress', fraction=0.1)\ntime.sleep(60)")
    choose(dock, project, make_survey(tmp_path, steps=("orient", "georeference")), tmp_path)
    wait_for(lambda: dock.bar.value() == 10)
    start = time.monotonic()
    dock.stop.click()
    wait_for(lambda: not dock.background.busy)
    assert time.monotonic() - start < 1.0
