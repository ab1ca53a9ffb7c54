"""What is set once: parameter before environment before option; and the page that asks for it."""

import json

import pytest


@pytest.fixture
def stored(qgis):
    from strandline.bridge import settings

    def clear():
        for key in settings.VARIABLES:
            settings.write(key, "")

    clear()
    yield settings
    clear()


@pytest.fixture
def asked(algorithm, fake_engine, tmp_path, stored, monkeypatch):
    """Run 'Enhance' with some parameters; return the request that reached the engine."""
    monkeypatch.syspath_prepend("/usr/share/qgis/python/plugins")
    from processing.core.Processing import Processing

    Processing.initialize()
    import processing

    survey = tmp_path / "survey"
    survey.mkdir()
    (survey / "survey.json").write_text("{}")

    def run(**parameters):
        said = tmp_path / "said"
        keep = f"Path({str(said)!r}).write_text(json.dumps(request))"
        fake_engine(f"{keep}\nsay(type='result', result={{'output': request['survey']}})")
        processing.run("strandline:enhance", {"SURVEY": str(survey), **parameters})
        return json.loads(said.read_text())

    return run


def test_parameter_before_environment_before_option(asked, stored, monkeypatch):
    first = asked()
    assert (first["workers"], first["scheduler"]) == (0, None)
    stored.write(stored.WORKERS, "3")
    stored.write(stored.SCHEDULER, "tcp://option:1")
    option = asked()
    assert (option["workers"], option["scheduler"]) == (3, "tcp://option:1")
    monkeypatch.setenv("STRANDLINE_WORKERS", "5")
    monkeypatch.setenv("STRANDLINE_SCHEDULER", "tcp://environment:1")
    environment = asked()
    assert (environment["workers"], environment["scheduler"]) == (5, "tcp://environment:1")
    given = asked(WORKERS=7, SCHEDULER="tcp://parameter:1")
    assert (given["workers"], given["scheduler"]) == (7, "tcp://parameter:1")


def test_a_number_of_processes_that_is_none_is_refused(asked, monkeypatch):
    from qgis.core import QgsProcessingException

    monkeypatch.setenv("STRANDLINE_WORKERS", "many")
    with pytest.raises(QgsProcessingException, match="STRANDLINE_WORKERS is 'many'"):
        asked()


def test_the_page_stores_what_is_entered(stored, monkeypatch):
    from qgis.PyQt.QtWidgets import QLabel
    from strandline.provider.options import OptionsPage

    monkeypatch.setenv("STRANDLINE_SCHEDULER", "tcp://environment:1")
    page = OptionsPage(None)
    page.workers.setValue(4)
    page.scheduler.setText(" tcp://host:8786 ")
    page.wheels.setFilePath("/somewhere/wheels")
    page.apply()
    again = OptionsPage(None)
    assert (again.workers.value(), again.scheduler.text(), again.wheels.filePath()) == (4, "tcp://host:8786", "/somewhere/wheels")
    assert "Dask scheduler (STRANDLINE_SCHEDULER says tcp://environment:1)" in [v.text() for v in again.findChildren(QLabel)]
    again.workers.setValue(0)
    again.apply()
    assert stored.read(stored.WORKERS) == ""


@pytest.mark.parametrize(
    ("state", "needs", "button"), [("missing", "install", "Install"), ("outdated", "update", "Update"), ("ready", "", "Install")]
)
def test_the_page_offers_what_the_engine_needs(stored, tmp_path, monkeypatch, state, needs, button):
    from strandline.bridge import engine, install
    from strandline.provider.options import OptionsPage

    monkeypatch.delenv("STRANDLINE_PYTHON", raising=False)
    monkeypatch.setattr(engine, "clone_folder", lambda: tmp_path / "clone")
    folder = tmp_path / "profile"
    monkeypatch.setattr(engine, "profile_folder", lambda: folder)
    if state != "missing":
        python = install.python_of(folder)
        python.parent.mkdir(parents=True)
        python.write_text("")
        (folder / "strandline-ready").write_text(install.fingerprint() if state == "ready" else "another")
    page = OptionsPage(None)
    assert (page._keeper.needs(), page.install.text()) == (needs, button)
    assert page.install.isEnabled() == bool(needs)
    assert page.state.text().startswith("Ready") == (state == "ready")
    assert page.remove.isEnabled() == (state != "missing")
    page._keeper.remove()
    assert not folder.exists()
    assert not page.remove.isEnabled()
    assert page._keeper.needs() == "install"


def test_install_runs_the_ordinary_algorithm(stored, tmp_path, monkeypatch):
    """It asks checkengine, with the folder of wheels that was entered."""
    from strandline.provider.options import OptionsPage

    page, asked = OptionsPage(None), []
    monkeypatch.setattr(page._keeper.background, "run", lambda name, parameters, *more: asked.append((name, parameters)))
    page.wheels.setFilePath(str(tmp_path))
    page.run_install()
    page.run_check()
    assert asked == [("checkengine", {"INSTALL": True, "WHEELS": str(tmp_path)}), ("checkengine", {"INSTALL": False})]
