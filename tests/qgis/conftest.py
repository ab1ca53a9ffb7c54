"""QGIS without a window, Strandline registered as a user has it, and engines that only pretend."""

import os
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PLUGINS = ROOT / ".build" / "plugins"
sys.path.insert(0, str(PLUGINS))


@pytest.fixture(scope="session")
def qgis():
    """A running QGIS with the native and Strandline's algorithms."""
    from qgis.analysis import QgsNativeAlgorithms
    from qgis.core import QgsApplication
    from qgis.testing import start_app
    from strandline import classFactory

    start_app()
    registry = QgsApplication.processingRegistry()
    if registry.providerById("native") is None:
        registry.addProvider(QgsNativeAlgorithms(registry))
    plugin = classFactory(None)
    plugin.initProcessing()
    yield registry
    plugin.unload()


@pytest.fixture(autouse=True)
def _own_temporary_folder(tmp_path, monkeypatch):
    """Keep the logs that crashes leave, on purpose, out of everybody's folder."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setenv("TMPDIR", str(folder))


@pytest.fixture
def algorithm(qgis):
    """Give an algorithm by its id, as the registry makes it."""

    def get(name):
        return qgis.createAlgorithmById(f"strandline:{name}")

    return get


@pytest.fixture
def fake_engine(tmp_path, monkeypatch):
    """Name another program as the engine's Python: a script that gets ``step``, ``request`` and ``say(**line)``."""

    def use(body):
        script = tmp_path / "engine"
        script.write_text(
            f"#!{sys.executable}\n"
            "import json, os, signal, subprocess, sys, time\n"
            "from pathlib import Path\n"
            "assert sys.argv[1] == '-s' and sys.argv[2].endswith('__main__.py') and sys.argv[5] == '--door', sys.argv\n"
            "step, request = sys.argv[3], json.loads(Path(sys.argv[4]).read_text())\n"
            "def say(**line):\n    print(json.dumps(line), flush=True)\n" + textwrap.dedent(body)
        )
        script.chmod(0o755)
        monkeypatch.setenv("STRANDLINE_PYTHON", str(script))
        return script

    return use


@pytest.fixture(scope="session")
def qgis_process(tmp_path_factory):
    """Run qgis_process as a user does, in a profile of its own; return its exit status and what it said."""
    profile = tmp_path_factory.mktemp("profile")
    program = next(p for p in ("/usr/bin/qgis_process.bin", "/usr/bin/qgis_process") if Path(p).is_file())
    environment = {
        **os.environ,
        "QT_QPA_PLATFORM": "offscreen",
        "QGIS_PLUGINPATH": str(PLUGINS),
        "QGIS_CUSTOM_CONFIG_PATH": str(profile),
    }

    class Process:
        command = program
        env = environment

        @staticmethod
        def run(*words, **more):
            told = subprocess.run(
                [program, *words],
                env={**environment, "TMPDIR": tempfile.gettempdir(), **more},
                capture_output=True,
                text=True,
                timeout=900,
                check=False,
            )
            return told.returncode, told.stdout, told.stderr

    assert Process.run("plugins", "enable", "strandline")[0] == 0
    return Process


class Feedback:
    """A QgsProcessingFeedback in all that the door asks of it, that remembers."""

    def __init__(self):
        self.infos, self.warnings, self.errors, self.progress = [], [], [], []
        self.cancelled = False

    def isCanceled(self):  # noqa: N802
        return self.cancelled

    def setProgress(self, value):  # noqa: N802
        self.progress.append(value)

    def pushInfo(self, text):  # noqa: N802
        self.infos.append(text)

    def pushWarning(self, text):  # noqa: N802
        self.warnings.append(text)

    def reportError(self, text, fatal=False):  # noqa: N802
        self.errors.append(text)


@pytest.fixture
def feedback():
    return Feedback()
