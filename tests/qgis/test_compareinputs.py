"""Two cases of a simulated flight through qgis_process, and what QGIS refuses itself."""

import csv
import json

import pytest

FLIGHT = {
    "DATES": "one", "LENGTH": 26, "WIDTH": 22, "HEIGHT": 36, "FORWARD_OVERLAP": 65, "SIDE_OVERLAP": 60, "CAMERA_WIDTH": 480,
    "CAMERA_HEIGHT": 360, "FOCAL": 390, "CONTRAST": 0.08, "GCP_COUNT": 4, "CHECK_COUNT": 3,
}  # fmt: skip


def run(qgis_process, algorithm, **parameters):
    words = [f"{name}={value}" for name, value in parameters.items()]
    status, told, errors = qgis_process.run("--json", "run", algorithm, "--", *words)
    assert status == 0, errors[-3000:]
    return json.loads(told)["results"]


def test_jpg_against_enhanced_jpg(qgis_process, tmp_path):
    simulation, table, page = tmp_path / "simulation", tmp_path / "table.csv", tmp_path / "report.html"
    run(qgis_process, "strandline:simulatesurvey", OUTPUT=simulation, **FLIGHT)
    (day,) = (path.parent for path in simulation.glob("*/jpg"))
    for i, path in enumerate(sorted((day / "jpg").iterdir())):
        if i not in (1, 2, 3, 6, 7, 8):
            path.unlink()
    found = run(
        qgis_process, "strandline:compareinputs", JPG=day / "jpg", GCPS=day / "gcps.gpkg", NAME_FIELD="name",
        ROLE_FIELD="role", MARKS=day / "marks.csv", TABLE=table, OUTPUT_HTML_FILE=page,
    )  # fmt: skip
    with table.open(newline="") as stream:
        cases = list(csv.DictReader(stream))
    assert [case["case"] for case in cases] == ["JPG", "CeJPG"]
    assert found["IMAGE_COUNT"] == 6
    assert found["MTP_JPG"] == pytest.approx(float(cases[0]["mtp"]))
    assert found["MTP_CEJPG"] == pytest.approx(float(cases[1]["mtp"]))
    assert found.get("MTP_RAW") is None
    assert [case["oriented"] for case in cases] == ["6", "6"]
    assert all(float(case["plani_check"]) < 0.1 for case in cases)  # a ground pixel is 9 cm
    assert cases[0]["note"] == ""
    assert "Tie points (table 1 of the paper)" in page.read_text()


def test_ground_points_need_names_and_marks(algorithm, tmp_path):
    from qgis.core import QgsProcessingContext, QgsVectorLayer

    made = algorithm("compareinputs")
    layer = QgsVectorLayer("PointZ?crs=EPSG:32631&field=name:string", "points", "memory")
    context = QgsProcessingContext()
    for more, told in (({}, "NAME_FIELD"), ({"NAME_FIELD": "name"}, "MARKS")):
        fine, why = made.checkParameterValues({"JPG": str(tmp_path), "GCPS": layer, **more}, context)
        assert not fine
        assert told in why
