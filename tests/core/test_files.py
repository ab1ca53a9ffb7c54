"""Files that are whole or absent, and fingerprints."""

import json
import os
import resource
import signal
import subprocess
import sys
import time

import pytest
from strandline.core import files
from strandline.core.errors import InputError


def test_a_file_replaces_and_keeps_its_suffix(tmp_path):
    target = tmp_path / "deep" / "a.txt"
    for text in ("one", "two"):
        with files.whole(target) as part:
            assert part.suffix == ".txt"
            part.write_text(text)
    assert target.read_text() == "two"
    assert [p.name for p in target.parent.iterdir()] == ["a.txt"]


def test_what_stood_stays_when_the_body_fails(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("before")

    def write():
        with files.whole(target) as part:
            part.write_text("half")
            raise ZeroDivisionError

    pytest.raises(ZeroDivisionError, write)
    assert target.read_text() == "before"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_replaces_a_folder(tmp_path):
    target = tmp_path / "model"
    for names in (("old",), ("new", "newer")):
        with files.whole(target) as part:
            part.mkdir()
            for name in names:
                (part / name).write_text(name)
    assert sorted(p.name for p in target.iterdir()) == ["new", "newer"]
    assert list(tmp_path.iterdir()) == [target]


def test_a_kill_leaves_what_stood(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("before")
    program = (
        "import sys, time\nfrom strandline.core.files import whole\n"
        f"with whole({str(target)!r}) as part:\n    part.write_text('half'); print('ready', flush=True); time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        os.kill(process.pid, signal.SIGKILL)
    assert target.read_text() == "before"
    assert len(list(tmp_path.iterdir())) == 2
    files.remove_parts(tmp_path)
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_caught_between_two_renames_is_put_back(tmp_path, monkeypatch):
    target = tmp_path / "model"
    target.mkdir()
    (target / "old").touch()

    def killed(path):
        raise SystemExit  # stands for a kill: nothing is cleaned up

    real, calls = type(target).rename, []

    def rename(self, to):
        calls.append(self)
        return killed(self) if len(calls) == 2 else real(self, to)

    with monkeypatch.context() as patch:
        patch.setattr(type(target), "rename", rename)
        patch.setattr(files, "remove", lambda path: None)
        with pytest.raises(SystemExit), files.whole(target) as part:
            part.mkdir()
    assert not target.exists()
    files.remove_parts(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["model"]
    assert [p.name for p in target.iterdir()] == ["old"]


def test_a_part_of_a_file_called_old_is_only_removed(tmp_path):
    (tmp_path / f"{files.PART}12-beach-old-dsm.tif").touch()
    (tmp_path / f"{files.PART}12-old-dsm.tif").touch()
    files.remove_parts(tmp_path)
    assert list(tmp_path.iterdir()) == []


def dead():
    """Return the id of a process that has ended."""
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        pass
    return process.pid


def test_what_a_kill_left_beside_a_target_goes_with_the_next_write(tmp_path):
    """As for a raster among a user's files: its part and what GDAL put beside it, of a process that lives no more."""
    target = tmp_path / "dsm [1].tif"
    program = (
        "import time\nfrom strandline.core.files import whole\n"
        f"with whole({str(target)!r}) as part:\n    part.write_text('half')\n"
        "    part.with_name(part.name + '.raw.tmp').touch(); part.with_name(part.name + '-journal').touch()\n"
        "    print('ready', flush=True); time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        files.remove_abandoned(target)
        assert len(list(tmp_path.iterdir())) == 3  # it lives
        process.kill()
    files.remove_abandoned(target)
    assert list(tmp_path.iterdir()) == []


def test_only_parts_of_this_target_and_of_dead_processes_here_are_abandoned(tmp_path):
    with files.whole(tmp_path / "dsm.tif") as part:
        here = part.name.partition("@")[2].partition("-")[0]
        part.touch()
        gone = dead()
        kept = [
            part.name,  # this process's own
            f"{files.PART}{gone}@{here}-a-dsm.tif",
            f"{files.PART}{gone}@{here}-dsm.tif.aux",
            f"{files.PART}{gone}@{here}-dsm.tiff",
            f"{files.PART}{gone}@{'0' * len(here)}-dsm.tif",  # of another machine
            f"{files.PART}1@{here}-dsm.tif",  # of a process that lives, and may be another user's
            f"{files.PART}{gone}-dsm.tif",
            f"{files.PART}x@{here}-dsm.tif",
            "dsm.tif-journal",
            "a.txt",
        ]
        for name in (*kept, f"{files.PART}{gone}@{here}-dsm.tif"):
            (tmp_path / name).touch()
        files.remove_abandoned(tmp_path / "dsm.tif")
        assert sorted(p.name for p in tmp_path.iterdir()) == sorted(kept)
    files.remove_abandoned(tmp_path / "nowhere" / "dsm.tif")


def test_what_cannot_be_written_is_refused_before_any_work(tmp_path):
    files.require_writable(tmp_path / "new" / "deep" / "a.tif", "raster")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "d.tif").mkdir()
    (tmp_path / "file").touch()
    for path in (tmp_path / "d.tif", tmp_path / "file" / "a.tif", "/proc/a.tif"):
        with pytest.raises(InputError, match=f"The raster {path} cannot be written"):
            files.require_writable(path, "raster")


def no_file_beyond(size):
    return {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))}


@pytest.mark.parametrize(
    ("body", "options"),
    [("part.write_bytes(bytes(200_000))", ""), ("raise AssertionError('there was no room')", ", room=200_000")],
)
def test_a_full_disk_is_told_and_leaves_what_stood(tmp_path, body, options):
    """No file may grow beyond 100 kB here, which fails as a full disk does."""
    target = tmp_path / "a.bin"
    target.write_bytes(b"before")
    program = (
        "from strandline.core.errors import InputError\nfrom strandline.core.files import whole\n"
        f"try:\n    with whole({str(target)!r}{options}) as part:\n        {body}\n"
        "except InputError as error:\n    print(error)\n"
    )
    words = [sys.executable, "-c", program]
    told = subprocess.run(words, capture_output=True, text=True, check=True, **no_file_beyond(100_000))
    assert told.stdout == f"{target} cannot be written, for the disk is full: free some space and run the step again.\n"
    assert target.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [target]


def test_a_record_is_dropped_before_what_it_tells_of_is_replaced(tmp_path):
    target, seen = tmp_path / "a", []
    target.write_text("before")
    with files.whole(target, before=lambda: seen.append(target.read_text())) as part:
        part.write_text("after")
        assert seen == []
    assert seen == ["before"]
    with pytest.raises(ZeroDivisionError), files.whole(target, before=lambda: seen.append("dropped")):
        raise ZeroDivisionError
    assert seen == ["before"]


def test_digests_are_of_content(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"sand")
    assert files.file_digest(path) == files.bytes_digest(b"sand")
    assert len(files.digest({"b": 1, "a": (1, 2)})) == 32
    assert files.digest({"b": 1, "a": (1, 2)}) == files.digest({"a": [1, 2], "b": 1})
    assert files.digest("a", "b") != files.digest("ab")
    assert files.digest(1) != files.digest("1")


def test_json_has_no_nan(tmp_path):
    files.write_json(tmp_path / "a.json", {"x": float("nan"), "y": [1.5, None]})
    assert json.loads((tmp_path / "a.json").read_text()) == {"x": None, "y": [1.5, None]}


def test_a_file_that_appears_is_complete(tmp_path):
    # A reader polling while a writer replaces 2 MB again and again never sees a short one.
    target = tmp_path / "a.bin"
    program = (
        "from strandline.core.files import whole\n"
        f"for k in range(30):\n    with whole({str(target)!r}) as part: part.write_bytes(bytes([k]) * 2_000_000)\n"
    )
    sizes = set()
    with subprocess.Popen([sys.executable, "-c", program]) as process:
        while process.poll() is None:
            if target.exists():
                sizes.add(len(target.read_bytes()))
            time.sleep(0.001)
    assert process.returncode == 0
    assert sizes <= {2_000_000}
    assert len(target.read_bytes()) == 2_000_000


def test_a_scratch_folder_goes_with_its_process(tmp_path):
    with files.scratch(tmp_path / "work") as folder:
        (folder / "file").write_text("x")
        assert list(tmp_path.iterdir()) == [folder]
    assert list(tmp_path.iterdir()) == []

    body = f"from strandline.core.files import scratch\nwith scratch({str(tmp_path / 'work')!r}) as f:\n"
    body += "    (f / 'file').write_text('x')\n    print(f, flush=True)\n    import time; time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", body], stdout=subprocess.PIPE, text=True, start_new_session=True) as process:
        assert os.path.isdir(process.stdout.readline().strip())  # noqa: PTH112
        os.killpg(process.pid, signal.SIGKILL)
    deadline = time.monotonic() + 10
    while list(tmp_path.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert list(tmp_path.iterdir()) == []
