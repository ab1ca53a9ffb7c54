"""The words are collected, and translated."""

import importlib.util
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def strings():
    spec = importlib.util.spec_from_file_location("strings", ROOT / "scripts" / "strings.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def french():
    messages = ET.parse(ROOT / "i18n" / "strandline_fr.ts").iter("message")
    return {m.findtext("source"): m.findtext("translation") for m in messages}


def test_every_text_is_collected(strings):
    assert set(strings.collect()) == set(french()), "run `make strings` and translate what is new"


def test_translations_keep_their_places():
    told = [
        t for t, words in french().items() if words and sorted(re.findall(r"{\d?}", t)) != sorted(re.findall(r"{\d?}", words))
    ]
    assert told == []


def test_a_translation_that_stands_is_kept(strings, tmp_path):
    path = tmp_path / "x.ts"
    assert strings.merge(path, "fr", ["Area", "Zones"]) == 2
    path.write_text(path.read_text().replace('type="unfinished" />', ">Aire</translation>", 1))
    assert strings.merge(path, "fr", ["Zones", "Area"]) == 1
    assert "Aire" in path.read_text()


def test_the_plugin_speaks_french(qgis, tmp_path):
    import shutil
    import subprocess

    from qgis.PyQt.QtCore import QCoreApplication, QTranslator

    tool = shutil.which("lrelease")
    assert tool, "qttools5-dev-tools is missing: run make setup"
    subprocess.run([tool, "-silent", str(ROOT / "i18n" / "strandline_fr.ts"), "-qm", str(tmp_path / "fr.qm")], check=True)
    translator = QTranslator()
    assert translator.load(str(tmp_path / "fr.qm"))
    QCoreApplication.installTranslator(translator)
    try:
        made = qgis.createAlgorithmById("strandline:exportdsm")
        assert made.displayName() == "Exporter le MNS"
        assert made.parameterDefinition("FILL").description() == "Combler les trous jusqu'à (m2)"
    finally:
        QCoreApplication.removeTranslator(translator)
    assert qgis.createAlgorithmById("strandline:exportdsm").displayName() == "Export DSM"
