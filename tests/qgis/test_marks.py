"""The marks' table and the work of marking, without a window."""

import pytest
from marking_world import NAMES, make_points, make_survey, open_layer


@pytest.fixture(params=["marks.gpkg", "marks.csv"])
def table(qgis, tmp_path, request):
    from strandline.provider.marks import MarksTable, make_table

    make_table(tmp_path / request.param)
    return MarksTable(open_layer(tmp_path / request.param))


@pytest.fixture
def marking(qgis, tmp_path):
    from strandline.bridge.survey import SurveyView
    from strandline.provider.groundpoints import likely_fields
    from strandline.provider.marking import Marking
    from strandline.provider.marks import MarksTable, make_table

    survey = SurveyView.read(str(make_survey(tmp_path)))
    layer = open_layer(make_points(tmp_path / "gcps.gpkg"))
    make_table(tmp_path / "marks.gpkg")
    return Marking(survey, layer, likely_fields(layer.fields()), MarksTable(open_layer(tmp_path / "marks.gpkg")))


def rows(path):
    """Return what another program reads."""
    layer = open_layer(path)
    return sorted((str(f["gcp"]), str(f["image"]), float(f["x"]), float(f["y"])) for f in layer.getFeatures())


def test_marks_are_written_at_once_moved_and_removed(table, tmp_path):
    from strandline.provider.marks import Mark

    path = next(tmp_path.glob("marks.[gc]*[gv]"))
    table.write({("G1", "a.jpg"): Mark(10.25, 20.5), ("G1", "b.jpg"): Mark(1.0, 2.0)})
    assert rows(path) == [("G1", "a.jpg", 10.25, 20.5), ("G1", "b.jpg", 1.0, 2.0)]
    table.write({("G1", "a.jpg"): Mark(11.125, 20.5), ("G1", "b.jpg"): None})
    assert rows(path) == [("G1", "a.jpg", 11.125, 20.5)]
    assert table.get(("G1", "a.jpg")) == Mark(11.125, 20.5)
    assert not table.layer.isEditable()


def test_what_others_write_is_seen(table):
    from qgis.PyQt.QtCore import QCoreApplication
    from strandline.provider.marks import Mark

    table.write({("G1", "a.jpg"): Mark(10.0, 20.0)})
    (feature,) = table.layer.getFeatures()
    table.layer.startEditing()
    table.layer.changeAttributeValue(feature.id(), table.layer.fields().lookupField("x"), 33.5)
    QCoreApplication.processEvents()
    assert table.get(("G1", "a.jpg")).x == 33.5
    # While somebody else edits, marks join that session, and go with it.
    table.write({("G2", "a.jpg"): Mark(1.0, 1.0)})
    assert table.layer.isEditable()
    assert set(table.marks()) == {("G1", "a.jpg"), ("G2", "a.jpg")}
    table.layer.rollBack()
    QCoreApplication.processEvents()
    assert table.marks() == {("G1", "a.jpg"): Mark(10.0, 20.0)}


def test_a_table_without_the_fields_is_refused(qgis, tmp_path):
    from strandline.provider.marks import MarksError, MarksTable, make_table

    with pytest.raises(MarksError, match="no field image"):
        MarksTable(_table(tmp_path, "gcp,x,y\nA,1,2\n"))
    (tmp_path / "there.gpkg").write_text("")
    with pytest.raises(MarksError, match="there already"):
        make_table(tmp_path / "there.gpkg")
    with pytest.raises(MarksError, match="cannot be made"):
        make_table(tmp_path / "nowhere" / "marks.gpkg")


def _table(folder, text):
    (folder / "table.csv").write_text(text)
    return open_layer(folder / "table.csv")


def test_numbers_may_be_text_and_names_written_otherwise(marking, tmp_path):
    from strandline.provider.marks import Mark, MarksTable

    other = MarksTable(_table(tmp_path, "image;GCP;x;y\nA.PNG; a ;10,5;20\nb;B;1;2\nz.png;B;1;2\nc.png;C;;2\nb.png;B;5;2\n"))
    marking.table = other
    marking.read_points()
    assert other.marks() == {("A", NAMES[0]): Mark(10.5, 20.0), ("B", NAMES[1]): Mark(1.0, 2.0)}
    # A stranger, an incomplete row, and a second mark of B in b.
    assert [told.partition(",")[0] for told in other.unread] == ["B", "C", "B"]


def test_undo_puts_back_what_stood(marking):
    from strandline.provider.marks import Mark

    key = ("A", NAMES[0])
    marking.put(key, Mark(1.0, 2.0))
    marking.put(key, Mark(3.0, 4.0))
    marking.remove(key)
    seen = []
    for step in (marking.undo.undo,) * 3 + (marking.undo.redo,) * 3:
        step()
        seen.append(marking.table.get(key))
    assert seen == [Mark(3.0, 4.0), Mark(1.0, 2.0), None, Mark(1.0, 2.0), Mark(3.0, 4.0), None]


def test_measured_targets_better_marks_by_eye_but_do_not_contradict_them(marking):
    from strandline.provider.marks import Mark

    near, far, new = (("A", NAMES[0]), ("A", NAMES[1]), ("B", NAMES[1]))
    marking.put(near, Mark(100.0, 100.0))
    marking.put(far, Mark(200.0, 200.0))
    measured = {near: Mark(102.9, 100.0, 0.9), far: Mark(203.1, 200.0, 0.9), new: Mark(5.0, 5.0, 0.8)}
    assert marking.take_measured(measured) == (2, 1)
    assert places(marking) == {near: (102.9, 100.0), far: (200.0, 200.0), new: (5.0, 5.0)}
    marking.undo.undo()  # one step
    assert places(marking) == {near: (100.0, 100.0), far: (200.0, 200.0)}


def places(marking):
    return {key: (mark.x, mark.y) for key, mark in marking.table.marks().items()}


def test_without_predictions_photographs_come_by_distance(marking):
    assert [p.name for p in marking.points] == ["B", "A", "C"]
    assert [s.photograph.name for s in marking.sights("A")] == [NAMES[0], NAMES[1], NAMES[2]]
    assert [s.photograph.name for s in marking.sights("C")] == [NAMES[2], NAMES[1], NAMES[0]]


def test_without_positions_all_photographs_are_listed(qgis, tmp_path):
    from strandline.bridge.survey import SurveyView
    from strandline.provider.groundpoints import GroundPoint, nearest

    survey = SurveyView.read(str(make_survey(tmp_path, positions=False)))
    layer = open_layer(make_points(tmp_path / "gcps.gpkg"))
    feature = next(layer.getFeatures())
    point = GroundPoint("B", feature.id(), feature.geometry().asPoint(), "")
    from qgis.core import QgsProject

    assert nearest(point, layer.crs(), survey.photographs, QgsProject.instance()) is None


def test_predictions_say_which_photographs_and_in_what_order(marking):
    from strandline.provider.judgement import Prediction
    from strandline.provider.marks import Mark

    marking.put(("A", NAMES[0]), Mark(50.0, 50.0))
    marking.take_predictions({("A", NAMES[2]): Prediction(10, 10, 1.0), ("A", NAMES[1]): Prediction(20, 20, None)})
    sights = marking.sights("A")
    assert [s.photograph.name for s in sights] == [NAMES[2], NAMES[1], NAMES[0]]  # what is marked stays in the list
    assert marking.sights("B") == []
    assert sights[2].offset is None
    marking.put(("A", NAMES[2]), Mark(13.0, 14.0))
    assert marking.sights("A")[0].offset == pytest.approx(5.0)


def test_the_next_is_the_next_in_the_list_and_open_passes_over_what_is_done(marking):
    from strandline.provider.judgement import Prediction
    from strandline.provider.marks import Mark

    order = [("B", NAMES[1]), ("B", NAMES[0]), ("A", NAMES[0]), ("C", NAMES[2])]
    marking.take_predictions({key: Prediction(10, 10, 1.0) for key in order})
    assert [marking.step(key, 1) for key in order] == [*order[1:], None]
    assert [marking.step(key, -1) for key in order] == [None, *order[:-1]]
    assert marking.step(("A", ""), 1) == ("A", NAMES[0])  # a point is picked: its first photograph
    assert marking.step(None, 1) == order[0]
    marking.put(order[1], Mark(1.0, 1.0))
    marking.skip(order[2])
    assert marking.step(order[0], 1, open_only=True) == order[3]
    assert marking.sight(order[2]).skipped
    marking.put(order[2], Mark(1.0, 1.0))
    assert not marking.sight(order[2]).skipped


@pytest.mark.parametrize(
    ("off", "sigma", "verdict"),
    # sigma 1.2 joins the half pixel of marking to 1.3: 95 % lie within 3.185 px, 99.9 % within 4.81 px.
    [(3.1, 1.2, "good"), (3.3, 1.2, "doubtful"), (4.9, 1.2, "bad"), (50.0, None, "unknown")],
)
def test_a_mark_is_judged_by_its_prediction(off, sigma, verdict):
    from strandline.provider.judgement import Prediction, judge_mark
    from strandline.provider.marks import Mark

    assert judge_mark(Mark(100.0 + off, 100.0), Prediction(100.0, 100.0, sigma)) == verdict


def test_residuals_are_judged_by_what_was_predicted_for_them():
    from strandline.provider.judgement import _judge_point

    check = {"dE": 0.03, "dN": 0.0, "dU": 0.01, "sigma_dE": 0.01, "sigma_dN": 0.01, "sigma_dU": 0.02}
    assert _judge_point(check) == "doubtful"  # 0.03 / (0.01 sqrt 2) = 2.1
    assert _judge_point({**check, "dE": 0.02}) == "good"
    assert _judge_point({**check, "dU": 0.07}) == "bad"
    control = {"dE": 0.0, "dN": 0.0, "dU": 0.0, "sigma_h": 0.01, "sigma_v": 0.02}
    loo = {"loo_dE": 0.0, "loo_dN": 0.0, "loo_dU": 0.08, "loo_sigma_h": 0.01, "loo_sigma_v": 0.02}
    assert _judge_point(control) == "good"
    assert _judge_point({**control, **loo}) == "bad"  # left out it is four sigmas off, whatever the adjustment bent
    assert _judge_point({**control, "blunder": True}) == "bad"
    assert _judge_point({"dE": None}) == "unknown"


def test_a_survey_view_tells_what_is_stale(tmp_path, qgis):
    import json

    from strandline.bridge.survey import SurveyError, SurveyView

    folder = make_survey(tmp_path, steps=("orient", "georeference"))
    content = json.loads((folder / "survey.json").read_text())
    content["steps"]["georeference"]["built_on"] = {"orient": "orient"}
    (folder / "survey.json").write_text(json.dumps(content))
    assert SurveyView.read(str(folder)).state("georeference") == "ready"
    assert SurveyView.read(str(folder)).state("exportdsm") == "missing"
    content["steps"]["orient"]["fingerprint"] = "another"
    (folder / "survey.json").write_text(json.dumps(content))
    assert SurveyView.read(str(folder)).state("georeference") == "stale"
    (folder / "survey.json").write_text("{")
    with pytest.raises(SurveyError, match="cannot be read"):
        SurveyView.read(str(folder))
    with pytest.raises(SurveyError, match="not a survey folder"):
        SurveyView.read(str(tmp_path))
