"""Steps as users run them: through qgis_process, with the real engine."""

import json
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def outputs(told):
    """Return the results that qgis_process printed."""
    return dict(re.findall(r"^([A-Z_:a-z]+):\t(.*)$", told.partition("Results")[2], re.MULTILINE))


def test_the_engine_is_ready(qgis_process):
    status, told, _ = qgis_process.run("run", "strandline:checkengine")
    assert status == 0
    assert outputs(told) == {"READY": "true"}
    assert "pycolmap" in told


def test_create_survey_from_real_photographs(qgis_process, shared_data, tmp_path):
    survey, photos, page = tmp_path / "survey", tmp_path / "photos.gpkg", tmp_path / "report.html"
    status, told, errors = qgis_process.run(
        "run", "strandline:createsurvey", "--", f"IMAGES={shared_data / 'brighton'}", f"OUTPUT={survey}", f"PHOTOS={photos}",
        f"OUTPUT_HTML_FILE={page}",
    )  # fmt: skip
    assert status == 0, errors
    found = outputs(told)
    assert found["IMAGE_COUNT"] == "8"
    assert found["POSITION_COUNT"] == "8"
    assert found["OUTPUT"] == str(survey)
    assert len(json.loads((survey / "survey.json").read_text())["photographs"]) == 8
    assert page.read_text().startswith("<!DOCTYPE html>")
    assert (survey / "report" / "createsurvey.html").is_file()

    from qgis.core import QgsVectorLayer

    layer = QgsVectorLayer(str(photos), "photos", "ogr")
    assert layer.featureCount() == 8
    assert layer.crs().authid() == "EPSG:4326"
    assert layer.fields().lookupField("name") >= 0


def test_a_mistake_is_one_sentence_and_exit_status_one(qgis_process, tmp_path):
    (tmp_path / "photos").mkdir()
    status, told, errors = qgis_process.run(
        "run", "strandline:createsurvey", "--", f"IMAGES={tmp_path / 'photos'}", f"OUTPUT={tmp_path / 'survey'}"
    )
    assert status == 1
    assert "Traceback" not in told + errors
    assert re.search(rf"ERROR:\t.*{re.escape(str(tmp_path / 'photos'))}.*\.$", errors, re.MULTILINE)
    assert not (tmp_path / "survey" / "survey.json").exists()


def test_a_missing_engine_is_told_by_qgis_process(qgis_process, tmp_path):
    status, told, errors = qgis_process.run(
        "run", "strandline:createsurvey", "--", f"IMAGES={tmp_path}", f"OUTPUT={tmp_path / 's'}",
        STRANDLINE_PYTHON="/no/such/python",
    )  # fmt: skip
    assert status != 0
    assert "STRANDLINE_PYTHON names /no/such/python, which is not there: correct or remove it." in told + errors
    status, told, errors = qgis_process.run("run", "strandline:checkengine", STRANDLINE_PYTHON="/no/such/python")
    assert status == 0
    assert outputs(told) == {"READY": "false"}
    assert "STRANDLINE_PYTHON names /no/such/python" in told + errors


def test_install_refuses_a_python_that_will_not_do(qgis_process, tmp_path):
    (tmp_path / "python").write_text("#!/bin/sh\nexit 1\n")
    (tmp_path / "python").chmod(0o755)
    status, _, errors = qgis_process.run("run", "strandline:checkengine", "--", "INSTALL=true", f"PYTHON={tmp_path / 'python'}")
    assert status == 1
    assert "must be a Python of at least 3.11" in errors


def test_a_failed_installation_is_told_and_not_taken_for_ready(qgis_process, tmp_path):
    """Without any wheel in the folder pip fails, after the environment itself was made."""
    package = tmp_path / "plugins" / "strandline"
    shutil.copytree(
        ROOT, package, ignore=lambda folder, names: [n for n in names if n.startswith(".") or n in ("tests", "dist", "demo")]
    )
    places = {"QGIS_PLUGINPATH": str(package.parent), "QGIS_CUSTOM_CONFIG_PATH": str(tmp_path / "profile")}
    assert qgis_process.run("plugins", "enable", "strandline", **places)[0] == 0
    (tmp_path / "wheels").mkdir()
    status, told, errors = qgis_process.run(
        "run", "strandline:checkengine", "--", "INSTALL=true", f"WHEELS={tmp_path / 'wheels'}", **places
    )
    assert status == 1
    assert "The engine could not be installed: ERROR: No matching distribution found for numpy" in errors
    assert [p.name for p in (tmp_path / "profile").rglob("pyvenv.cfg")] == ["pyvenv.cfg"]
    status, told, _ = qgis_process.run("run", "strandline:checkengine", **places)
    assert outputs(told) == {"READY": "false"}


def test_the_package_holds_what_a_user_needs_and_is_reproducible(qgis_process, tmp_path):
    made = []
    for name in ("first", "second"):
        told = subprocess.run(
            [sys.executable, str(ROOT / "scripts" / "package.py"), str(tmp_path / name)],
            capture_output=True,
            text=True,
            check=True,
        )
        made.append(Path(told.stdout.strip()))
    assert made[0].read_bytes() == made[1].read_bytes()
    version = re.search(r'__version__ = "(.+)"', (ROOT / "core" / "__init__.py").read_text()).group(1)
    assert made[0].name == f"strandline-{version}.zip"
    with zipfile.ZipFile(made[0]) as package:
        names = package.namelist()
        package.extractall(tmp_path / "plugins")
    assert {n.partition("/")[0] for n in names} == {"strandline"}
    assert not [n for n in names if re.search(r"tests|\.git|__pycache__|\.engine|\.build|Makefile", n)]
    for needed in (
        "metadata.txt",
        "__main__.py",
        "requirements.txt",
        "LICENSE",
        "icon.svg",
        "core/entry.py",
        "models/survey_to_dsm.model3",
    ):
        assert f"strandline/{needed}" in names
    # As installed from it, in a plain profile: the engine is missing, and the sentence fits a user without a clone.
    status, told, errors = qgis_process.run("run", "strandline:checkengine", QGIS_PLUGINPATH=str(tmp_path / "plugins"))
    assert status == 0
    assert "not installed: run strandline:checkengine ('Check engine') with INSTALL=true." in told + errors


def test_models_are_offered_and_start_their_first_step(qgis_process, tmp_path):
    (tmp_path / "photos").mkdir()
    for model in ("strandline:Survey to DSM", str(ROOT / "models" / "survey_to_dsm.model3")):
        status, told, errors = qgis_process.run("help", model)
        assert status == 0, errors
        # A model's results are called child:name in 3.22 and name in later versions.
        names = [re.search(rf"^((?:\w+:)?{name}):", told, re.MULTILINE).group(1) for name in ("SURVEY", "DSM")]
        status, told, errors = qgis_process.run(
            "run",
            model,
            "--",
            f"IMAGES={tmp_path / 'photos'}",
            f"{names[0]}={tmp_path / 's'}",
            f"{names[1]}={tmp_path / 'd.tif'}",
        )
        assert status == 1
        assert "Error encountered while running Create survey" in errors
        assert str(tmp_path / "photos") in errors


def test_models_are_up_to_date(qgis):
    """Each is whole: every mandatory parameter of every step has a source, and every output it names exists."""
    from qgis.core import QgsProcessingModelAlgorithm

    for path in sorted((ROOT / "models").glob("*.model3")):
        model = QgsProcessingModelAlgorithm()
        assert model.fromFile(str(path))
        assert model.validate() == (True, [])
        assert model.canExecute()[0]
        for child in model.childAlgorithms().values():
            known = {o.name() for o in child.algorithm().outputDefinitions()}
            assert {o.childOutputName() for o in child.modelOutputs().values()} <= known


def test_companions_on_real_surfaces(qgis_process, shared_data, tmp_path):
    """Six dates by repeating a key; layers, raster and reports as a user gets them."""
    leo = shared_data / "leo"
    dsms = [f"DSMS={path}" for path in sorted((leo / "dsm").glob("*.tif"))]
    transects = (f"TRANSECTS={leo / 'leo_transects.gpkg'}", "TRANSECT_FIELD=tr_id", "DATUM=0.5")
    page = tmp_path / "report.html"
    lines, points = tmp_path / "profiles.gpkg", tmp_path / "points.gpkg"
    status, told, errors = qgis_process.run(
        "run", "strandline:profiles", "--", *dsms, *transects, f"OUTPUT={lines}", f"POINTS={points}", f"OUTPUT_HTML_FILE={page}",
    )  # fmt: skip
    assert status == 0, errors
    found = outputs(told)
    assert (found["TRANSECT_COUNT"], found["DATE_COUNT"]) == ("59", "6")
    assert page.read_text().startswith("<!DOCTYPE html>")

    shores, rates = tmp_path / "shores.gpkg", tmp_path / "rates.gpkg"
    status, told, errors = qgis_process.run(
        "run", "strandline:shoreline", "--", *dsms, *transects, "KEEP=seaward", f"OUTPUT={shores}", f"RATES={rates}"
    )
    assert status == 0, errors
    table, rate = tmp_path / "table.gpkg", tmp_path / "rate.tif"
    status, told, errors = qgis_process.run(
        "run", "strandline:timeseries", "--", *dsms[:3], f"OUTPUT={table}", f"RATE={rate}", "SIGMA=0.1", "CORRELATION_RANGE=20",
        "REGISTRATION_SIGMA=0.05",
    )  # fmt: skip
    assert status == 0, errors
    assert float(outputs(told)["NET_SIGMA"]) > 0

    from qgis.core import QgsRasterLayer, QgsVectorLayer

    for path, count in ((lines, 6 * 59), (shores, 6), (rates, 59), (table, 3)):
        assert QgsVectorLayer(str(path), "layer", "ogr").featureCount() == count
    assert QgsRasterLayer(str(rate), "rate").isValid()

    status, told, errors = qgis_process.run("run", "strandline:timeseries", "--", dsms[0], f"OUTPUT={tmp_path / 'one.gpkg'}")
    assert status == 1
    assert "DSMS holds 1 raster" in errors
    assert not (tmp_path / "one.gpkg").exists()
