"""The survey folder: records, staleness, its lock, strangers' surveys."""

import json
import os
import signal
import subprocess
import sys

import pytest
from strandline.core.errors import InputError
from strandline.core.files import PART
from strandline.core.photographs.reading import read_channel_sum
from strandline.core.survey import Photograph, Position, Survey, held


def photograph(name="a.jpg", content=b"sand", **more):
    from strandline.core.files import bytes_digest

    return Photograph(name, len(content), bytes_digest(content), 40, 30, "camera", **more)


@pytest.fixture
def survey(tmp_path):
    images = tmp_path / "images"
    images.mkdir()
    (images / "a.jpg").write_bytes(b"sand")
    made = Survey.create(tmp_path / "survey", images, None, [photograph()])
    finish(made, "createsurvey", "c1", ())
    return made


def finish(survey, step, fingerprint, built_on):
    survey.finish(step, fingerprint, built_on=built_on, parameters={}, result={})


def test_what_is_written_is_read(tmp_path):
    place = Position(-5.5, 36.25, 12.0, 0.01, 0.02)
    listed = [photograph("z/b.jpg", focal=2000.5, time="2024-05-01T10:00:00", position=place, yaw=-132.0), photograph("A.jpg")]
    Survey.create(tmp_path / "s", tmp_path, 'PROJCRS["x"]', listed)
    again = Survey.open(tmp_path / "s")
    assert again.photographs == (listed[1], listed[0])  # sorted by name
    assert again.crs == 'PROJCRS["x"]'
    assert again.images == tmp_path


def test_records_hold_json(survey):
    survey.finish("enhance", "e1", built_on=("createsurvey",), parameters={"size": (1, 2), "x": float("nan")}, result={})
    assert survey.record("enhance") == Survey.open(survey.folder).record("enhance")
    assert survey.record("enhance").parameters == {"size": [1, 2], "x": None}


def test_staleness_follows_the_chain(survey):
    finish(survey, "enhance", "e1", ("createsurvey",))
    finish(survey, "tiepoints", "t1", ("createsurvey", "enhance"))
    finish(survey, "orient", "o1", ("tiepoints",))
    steps = ("createsurvey", "enhance", "tiepoints", "orient")
    assert [survey.is_stale(s) for s in steps] == [False] * 4
    finish(survey, "enhance", "e1", ("createsurvey",))  # again, with the same outcome
    assert [survey.is_stale(s) for s in steps] == [False] * 4
    finish(survey, "enhance", "e2", ("createsurvey",))
    assert [survey.is_stale(s) for s in steps] == [False, False, True, True]
    finish(survey, "enhance", "e1", ("createsurvey",))
    assert [survey.is_stale(s) for s in steps] == [False] * 4
    finish(survey, "createsurvey", "c2", ())
    assert [survey.is_stale(s) for s in steps] == [False, True, True, True]
    survey.forget("enhance")
    assert survey.record("enhance") is None
    assert survey.is_stale("tiepoints")


def test_a_step_that_did_not_use_another_does_not_mind_it(survey):
    finish(survey, "tiepoints", "t1", ("createsurvey", "enhance"))  # there is no enhance
    assert survey.record("tiepoints").built_on == {"createsurvey": "c1"}
    finish(survey, "enhance", "e1", ("createsurvey",))
    assert not survey.is_stale("tiepoints")


def test_a_missing_or_stale_predecessor_is_named(survey):
    with pytest.raises(InputError, match="has no 'orient' yet: run strandline:orient"):
        survey.require("orient")
    finish(survey, "enhance", "e1", ("createsurvey",))
    finish(survey, "createsurvey", "c2", ())
    with pytest.raises(InputError, match="'enhance' .* is stale"):
        survey.require("enhance")


def test_creating_again_keeps_steps_until_something_changes(survey):
    finish(survey, "enhance", "e1", ("createsurvey",))
    again = Survey.create(survey.folder, survey.images, None, [photograph()])
    assert not again.is_stale("enhance")
    # A kill right after this must not leave the old record with the new photographs.
    more = Survey.create(survey.folder, survey.images, None, [photograph(), photograph("b.jpg")])
    assert more.record("createsurvey") is None
    assert Survey.open(survey.folder).is_stale("enhance")


def test_what_another_step_finished_is_kept(survey):
    early = Survey.open(survey.folder)
    finish(survey, "enhance", "e1", ("createsurvey",))
    finish(early, "tiepoints", "t1", ("createsurvey",))
    assert Survey.open(survey.folder).record("enhance").fingerprint == "e1"


def test_a_moved_pair_of_folders_is_found(tmp_path, survey):
    (tmp_path / "elsewhere").mkdir()
    survey.images.rename(tmp_path / "elsewhere" / "images")
    survey.folder.rename(tmp_path / "elsewhere" / "survey")
    moved = Survey.open(tmp_path / "elsewhere" / "survey")
    assert moved.path(moved.photographs[0]).read_bytes() == b"sand"


def test_a_survey_behind_a_link_finds_its_photographs(tmp_path, survey):
    (tmp_path / "deep" / "er").mkdir(parents=True)
    link = tmp_path / "deep" / "er" / "link"
    link.symlink_to(survey.folder)
    linked = Survey.open(link)
    assert linked.path(linked.photographs[0]).read_bytes() == b"sand"


def test_photographs_that_went_or_changed_are_named(survey):
    listed = survey.photographs[0]
    path = survey.path(listed)
    path.write_bytes(b"gone")  # as long as before
    with pytest.raises(InputError, match="a.jpg has changed"):
        read_channel_sum(survey.path(listed), listed)
    path.write_bytes(b"longer than before")
    with pytest.raises(InputError, match="a.jpg has changed"):
        survey.path(listed)
    path.unlink()
    with pytest.raises(InputError, match="a.jpg is gone"):
        survey.path(listed)


@pytest.mark.parametrize("name", ["../a.jpg", "/etc/a.jpg", "b/../../a.jpg", ""])
def test_a_stranger_cannot_lead_out_of_the_folder(survey, name):
    path = survey.folder / "survey.json"
    data = json.loads(path.read_text())
    data["photographs"][0]["name"] = name
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match="outside its folder"):
        Survey.open(survey.folder)


@pytest.mark.parametrize(
    ("content", "message"),
    [("{", "damaged"), ("[]", "damaged"), ('{"version": 99}', "version 99"), ('{"version": 1, "images": 3}', "images")],
)
def test_what_is_no_survey_is_refused(survey, content, message):
    (survey.folder / "survey.json").write_text(content)
    with pytest.raises(InputError, match=message):
        Survey.open(survey.folder)


def test_no_survey(tmp_path):
    with pytest.raises(InputError, match="is not a survey folder"):
        Survey.open(tmp_path)


HOLD = """
import sys, time
from strandline.core.survey import held
with held(sys.argv[1], "tiepoints"):
    print("held", flush=True)
    time.sleep(60)
"""


def holder(folder):
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    return process


def test_one_writer_at_a_time(survey):
    with holder(survey.folder) as process:
        with pytest.raises(InputError, match=rf"in use by tiepoints \(process {process.pid} on "), held(survey.folder, "enhance"):
            pass
        os.kill(process.pid, signal.SIGKILL)
    # The system lets go of the lock of a process that was killed.
    with held(survey.folder, "enhance"):
        assert "enhance" in (survey.folder / "survey.lock").read_text()
    assert (survey.folder / "survey.lock").read_text() == ""


def test_whoever_holds_clears_what_killed_runs_left(survey):
    (survey.folder / "model").mkdir()
    for place in (survey.folder, survey.folder / "model"):
        (place / f"{PART}77-x.bin").touch()
    with held(survey.folder, "orient"):
        pass
    assert not list(survey.folder.rglob(f"{PART}*"))


def test_reading_needs_no_lock(survey):
    with held(survey.folder, "orient"):
        assert Survey.open(survey.folder).photographs
