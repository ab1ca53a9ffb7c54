"""The door: the engine's environment and process, and what becomes of everything that can go wrong."""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROMPT = 3.0  # seconds within which all must be gone; a busy machine needs most of it


@pytest.fixture
def door(qgis):
    from strandline.bridge import door

    return door


def alive(pid):
    """Tell whether a process runs; a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def wait_until(true, seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if true():
            return True
        time.sleep(0.02)
    return False


def children():
    """The children of this process, zombies included: their ids."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = path.read_text().rpartition(")")[2].split()[1]
        except OSError:  # it ended meanwhile
            continue
        if int(parent) == os.getpid():
            found.append(int(path.parent.name))
    return sorted(found)


def test_the_environment_is_cleaned_of_what_qgis_set():
    from strandline.bridge.environment import cleaned

    given = {
        "PROJ_LIB": "/qgis/proj", "PROJ_DATA": "/qgis/proj", "GDAL_DATA": "/qgis/gdal", "GDAL_DRIVER_PATH": "/qgis",
        "PYTHONPATH": "/qgis/python", "PYTHONHOME": "/qgis", "LD_LIBRARY_PATH": "/qgis/lib", "QT_PLUGIN_PATH": "/qgis/qt",
        "QT_QPA_PLATFORM": "offscreen", "SSL_CERT_FILE": "/qgis/cert.pem", "OSGEO4W_ROOT": "C:\\QGIS",
        "HTTPS_PROXY": "http://proxy:3128", "no_proxy": "localhost", "HOME": "/home/anna", "TMPDIR": "/big", "LANG": "fr",
        "PATH": "/usr/local/bin:/usr/bin",
    }  # fmt: skip
    assert cleaned(given) == {
        "HTTPS_PROXY": "http://proxy:3128", "no_proxy": "localhost", "HOME": "/home/anna", "TMPDIR": "/big", "LANG": "fr",
        "PATH": "/usr/local/bin:/usr/bin",
    }  # fmt: skip


def test_osgeo4w_leaves_the_path_and_windows_stays(monkeypatch):
    from strandline.bridge.environment import cleaned

    monkeypatch.setattr(os, "pathsep", ";")
    given = {
        "OSGEO4W_ROOT": "C:\\Program Files\\QGIS 3.40",
        "Path": "C:\\PROGRA~1\\QGIS 3.40;C:\\Program Files\\QGIS 3.40\\bin;c:/program files/qgis 3.40/apps/Qt5/bin;"
        "D:\\OSGeo4W\\bin;C:\\Windows\\system32;C:\\Program Files\\QGIS 3.40 tools",
    }
    kept = "C:\\PROGRA~1\\QGIS 3.40;C:\\Windows\\system32;C:\\Program Files\\QGIS 3.40 tools"
    assert cleaned(given) == {"Path": kept}


def test_the_engine_gets_the_request_and_its_result_comes_back(door, fake_engine, feedback):
    python = fake_engine(
        """
        say(type="progress", fraction=0.25)
        say(type="message", level="info", text="reading")
        say(type="message", level="warning", text="dark photograph")
        print("not a line of ours")
        assert not [k for k in os.environ if k.startswith(("PROJ_", "GDAL_", "PYTHON", "QT_"))]
        say(type="result", result={"step": step, "request": request})
        """
    )
    assert door.run_step(str(python), "enhance", {"window": 101, "ignore": None}, feedback) == {
        "step": "enhance",
        "request": {"window": 101, "ignore": None},
    }
    assert feedback.progress == [25.0]
    assert feedback.infos == ["reading", "not a line of ours"]
    assert feedback.warnings == ["dark photograph"]
    assert feedback.errors == []


def test_nothing_is_left_behind(door, fake_engine, feedback):
    temporary = Path(tempfile.gettempdir())
    before = children()
    python = fake_engine("say(type='result', result={})")
    door.run_step(str(python), "enhance", {}, feedback)
    python = fake_engine("say(type='error', kind='InputError', text='No photographs in /x.')\nsys.exit(1)")
    with pytest.raises(door.EngineError, match=r"^No photographs in /x\.$"):
        door.run_step(str(python), "enhance", {}, feedback)
    assert list(temporary.iterdir()) == []
    assert children() == before


def test_a_result_stands_whatever_the_engine_does_on_its_way_out(door, fake_engine, feedback):
    start = time.monotonic()
    python = fake_engine("say(type='result', result={'output': '/x'})\ntime.sleep(60)")
    assert door.run_step(str(python), "orient", {}, feedback) == {"output": "/x"}
    assert time.monotonic() - start < PROMPT
    python = fake_engine("say(type='result', result={'output': '/x'})\nos.kill(os.getpid(), signal.SIGSEGV)")
    assert door.run_step(str(python), "orient", {}, feedback) == {"output": "/x"}


def test_a_bug_keeps_its_traceback(door, fake_engine, feedback):
    python = fake_engine("say(type='error', kind='Bug', text='KeyError: 7', traceback='Traceback: here')\nsys.exit(2)")
    with pytest.raises(door.EngineError, match=r"fault of Strandline in 'orient': KeyError: 7") as error:
        door.run_step(str(python), "orient", {}, feedback)
    assert feedback.errors == ["Traceback: here"]
    log = Path(str(error.value).rpartition("also in ")[2].rstrip(")."))
    assert "Traceback: here" in log.read_text()


def test_a_crash_of_native_code_is_one_sentence_with_the_logs_tail(door, fake_engine, feedback):
    python = fake_engine(
        """
        for i in range(40):
            print(f"line {i}", file=sys.stderr, flush=True)
        say(type="progress", fraction=0.5)
        os.kill(os.getpid(), signal.SIGSEGV)
        """
    )
    with pytest.raises(door.EngineError) as error:
        door.run_step(str(python), "orient", {}, feedback)
    told = str(error.value)
    assert told.startswith("The engine crashed (SIGSEGV) during 'orient'")
    assert "\n" not in told
    assert feedback.errors == [f"line {i}" for i in range(25, 40)]
    assert "line 0" in Path(told.rpartition(" is ")[2].rstrip(".")).read_text()


def test_a_real_interpreter_that_crashes_is_told_too(door, feedback, tmp_path, monkeypatch):
    """The engine's own entry, killed inside native code."""
    crash = "import ctypes; ctypes.string_at(0)"
    script = tmp_path / "python"
    script.write_text(f"#!/bin/sh\nexec {sys.executable} -X faulthandler -c '{crash}'\n")
    script.chmod(0o755)
    with pytest.raises(door.EngineError, match="SIGSEGV"):
        door.run_step(str(script), "orient", {}, feedback)
    assert any("Segmentation fault" in line for line in feedback.errors)


def test_memory_is_named_when_the_system_kills(door, fake_engine, feedback):
    python = fake_engine("os.kill(os.getpid(), signal.SIGKILL)")
    with pytest.raises(door.EngineError, match=r"SIGKILL.*want of memory: use fewer WORKERS"):
        door.run_step(str(python), "exportdsm", {}, feedback)


def test_an_exit_without_a_result_is_an_error(door, fake_engine, feedback):
    python = fake_engine("sys.exit(0)")
    with pytest.raises(door.EngineError, match=r"exit status 0"):
        door.run_step(str(python), "exportdsm", {}, feedback)


def test_a_python_that_does_not_start_is_named(door, feedback, tmp_path):
    (tmp_path / "python").write_text("not a program")
    with pytest.raises(door.EngineError, match=r"python cannot be started"):
        door.run_step(str(tmp_path / "python"), "orient", {}, feedback)


FAMILY = """
    grandchild = subprocess.Popen([sys.executable, "-c",
        "import signal, time; signal.signal(15, signal.SIG_IGN); time.sleep(600)"])
    say(type="message", level="info", text=f"{os.getpid()} {grandchild.pid}")
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    time.sleep(600)
"""


def test_cancel_ends_the_engine_with_its_children_at_once(door, fake_engine, feedback):
    python = fake_engine(FAMILY)
    before = children()
    threading.Thread(target=lambda: wait_until(lambda: feedback.infos, 20) and setattr(feedback, "cancelled", True)).start()
    with pytest.raises(door.Cancelled):
        door.run_step(str(python), "orient", {}, feedback)
    pids = [int(p) for p in feedback.infos[0].split()]
    assert wait_until(lambda: not any(map(alive, pids)), PROMPT)
    assert children() == before


def test_what_a_crashed_engine_started_ends_too(door, fake_engine, feedback):
    python = fake_engine(FAMILY.rpartition("    time.sleep")[0] + "    os.abort()\n")
    with pytest.raises(door.EngineError, match="SIGABRT"):
        door.run_step(str(python), "orient", {}, feedback)
    pids = [int(p) for p in feedback.infos[0].split()]
    assert wait_until(lambda: not any(map(alive, pids)), PROMPT)


def test_a_missing_engine_is_one_sentence_that_says_what_to_run(qgis, algorithm, monkeypatch):
    from strandline.bridge import engine

    monkeypatch.delenv("STRANDLINE_PYTHON", raising=False)
    monkeypatch.setattr(engine, "clone_folder", lambda: Path("/nowhere"))
    fine, told = algorithm("orient").canExecute()
    assert not fine
    assert "not installed" in told
    assert "make setup" in told
    assert "strandline:checkengine" in told
    assert "INSTALL=true" in told
    assert algorithm("checkengine").canExecute() == (True, "")


def test_a_named_python_that_is_not_there_is_named(qgis, algorithm, monkeypatch):
    monkeypatch.setenv("STRANDLINE_PYTHON", "/no/such/python")
    fine, told = algorithm("orient").canExecute()
    assert not fine
    assert told == "STRANDLINE_PYTHON names /no/such/python, which is not there: correct or remove it."


def test_the_setting_names_the_python(qgis, monkeypatch, tmp_path):
    from strandline.bridge import engine, settings

    monkeypatch.delenv("STRANDLINE_PYTHON", raising=False)
    settings.write(settings.PYTHON, sys.executable)
    try:
        assert engine.find_python() == sys.executable
    finally:
        settings.write(settings.PYTHON, "")
    assert engine.find_python() != sys.executable


def test_a_half_made_or_outdated_engine_is_not_taken_for_ready(qgis, tmp_path):
    from strandline.bridge import install

    python = install.python_of(tmp_path)
    python.parent.mkdir(parents=True)
    python.touch()
    assert install.state(tmp_path) == "missing"
    (tmp_path / "strandline-ready").write_text("made for other versions")
    assert install.state(tmp_path) == "outdated"
    (tmp_path / "strandline-ready").write_text(install.fingerprint())
    assert install.state(tmp_path) == "ready"


def test_comments_do_not_outdate_an_engine(tmp_path):
    from strandline.bridge import install

    first, second = tmp_path / "a.txt", tmp_path / "b.txt"
    first.write_text("# versions\nnumpy==2.4.6   # arrays\nscipy==1.17.1\n")
    second.write_text("scipy==1.17.1\nnumpy==2.4.6\n")
    assert install.fingerprint(first) == install.fingerprint(second)
    second.write_text("scipy==1.17.1\nnumpy==2.4.7\n")
    assert install.fingerprint(first) != install.fingerprint(second)


@pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_qgis_takes_engine_and_workers_along(qgis_process, tmp_path, ending):
    """Through qgis_process itself, with the real entry of the engine and its real pool of workers."""
    pids = tmp_path / "pids"
    busy = tmp_path / "busy.py"
    busy.write_text(BUSY.format(plugins=str(ROOT / ".build" / "plugins"), pids=str(pids)))
    script = tmp_path / "python"
    script.write_text(f'#!/bin/sh\nexec "{ROOT}/.engine/bin/python" -s "{busy}"\n')
    script.chmod(0o755)
    process = subprocess.Popen(
        [qgis_process.command, "run", "strandline:checkengine"],
        env={**qgis_process.env, "STRANDLINE_PYTHON": str(script), "TMPDIR": tempfile.gettempdir()},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        assert wait_until(lambda: pids.is_file() and len(pids.read_text().split()) == 3, 60)
        family = [int(p) for p in pids.read_text().split()]
        assert all(map(alive, family))
    finally:
        process.send_signal(ending)
        process.wait(timeout=10)
    assert wait_until(lambda: not any(map(alive, family)), PROMPT)


BUSY = """
import os, sys, time
sys.path.insert(0, {plugins!r})

def work(n):
    with open({pids!r}, "a") as stream:
        stream.write(f"{{os.getpid()}} ")
    end = time.monotonic() + 600
    while time.monotonic() < end:
        sum(range(100000))
    return n

if __name__ == "__main__":
    from strandline.core.entry import _end_with_stdin
    from strandline.core.parallel import run_calls
    from strandline.core.progress import SILENT

    _end_with_stdin()
    with open({pids!r}, "a") as stream:
        stream.write(f"{{os.getpid()}} ")
    list(run_calls(work, [(1,), (2,)], workers=2, progress=SILENT, total=2))
"""
