"""The step enhance: files, resuming, refusals; the filter itself is tested in test_enhancement."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from strandline.core.contract import VectorSource
from strandline.core.errors import InputError
from strandline.core.photographs import createsurvey
from strandline.core.photographs.bandpass import band_of
from strandline.core.photographs.enhance import Request, enhanced_path, run
from strandline.core.photographs.enhancedimage import read_note
from strandline.core.photographs.enhancement import enhance_photograph
from strandline.core.photographs.reading import channel_sum, decode_pixels
from strandline.core.progress import Progress, Silent
from strandline.core.survey import Survey


class Listener(Silent):
    def __init__(self):
        self.told = []

    def message(self, text, *, warning):
        self.told.append(text)


def write(path, size=(90, 70), seed=0):
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.random.default_rng(seed).normal(120.0, 4.0, (size[1], size[0], 3)).round().astype(np.uint8)
    Image.fromarray(pixels).save(path, quality=95) if path.suffix == ".jpg" else Image.fromarray(pixels).save(path)


def make_survey(folder, count=3, size=(90, 70)):
    for i in range(count):
        write(folder / "images" / f"{i:03d}.jpg", size, i)
    createsurvey.run(createsurvey.Request(str(folder / "images"), str(folder / "survey")))
    return folder / "survey"


def enhance(folder, **more):
    listener = Listener()
    run(Request(str(folder), **{"window": 11, "workers": 1, **more}), Progress(listener))
    return Survey.open(folder), listener


def contents(survey):
    return {p.name: enhanced_path(survey, p).read_bytes() for p in survey.photographs}


@pytest.fixture
def folder(tmp_path):
    return make_survey(tmp_path)


@pytest.mark.parametrize("method", ["arctan", "micmac", "equalize", "none"])
def test_every_photograph_has_its_image(folder, tmp_path, method):
    survey, _ = enhance(folder, method=method, output_html_file=str(tmp_path / "r.html"))
    for photograph in survey.photographs:
        image = cv2.imread(str(enhanced_path(survey, photograph)), cv2.IMREAD_UNCHANGED)
        expected, _ = enhance_photograph(channel_sum(decode_pixels(survey.path(photograph).read_bytes())), method, 11)
        assert image.dtype == np.uint8
        assert (image == expected).all()
    page = (tmp_path / "r.html").read_text()
    assert page == survey.report_path("enhance").read_text()
    assert "tie points only" in page
    assert "src=" in page
    assert not re.search(r'(src|href)="https?:', page)


def test_names_of_photographs_do_not_meet(tmp_path):
    write(tmp_path / "images" / "a" / "x.jpg", seed=1)
    write(tmp_path / "images" / "b" / "x.jpg", seed=2)
    write(tmp_path / "images" / "x.png", seed=3)
    createsurvey.run(createsurvey.Request(str(tmp_path / "images"), str(tmp_path / "survey")))
    survey, _ = enhance(tmp_path / "survey")
    assert len(set(contents(survey).values())) == 3


def test_the_same_bits_for_any_number_of_workers(tmp_path):
    one, two = (make_survey(tmp_path / name, 5) for name in ("one", "two"))
    assert contents(enhance(one, workers=1)[0]) == contents(enhance(two, workers=2)[0])
    records = [Survey.open(f).record("enhance") for f in (one, two)]
    assert records[0].fingerprint == records[1].fingerprint


def test_what_stands_is_kept(folder):
    survey, _ = enhance(folder)
    paths = [enhanced_path(survey, p) for p in survey.photographs]
    before = [p.stat().st_mtime_ns for p in paths]
    fingerprint = survey.record("enhance").fingerprint
    survey, listener = enhance(folder)
    assert [p.stat().st_mtime_ns for p in paths] == before
    assert survey.record("enhance").fingerprint == fingerprint
    assert "3 of 3 images stand already." in listener.told


def test_a_damaged_image_is_made_anew(folder):
    survey, _ = enhance(folder)
    whole = contents(survey)
    paths = [enhanced_path(survey, p) for p in survey.photographs]
    paths[0].write_bytes(paths[0].read_bytes()[:3000])
    paths[1].write_bytes(bytes(20_000))
    paths[2].unlink()
    with pytest.raises(InputError, match="is gone: run strandline:enhance"):
        enhanced_path(survey, survey.photographs[2])
    assert contents(enhance(folder)[0]) == whole


def test_only_what_changed_is_made_again(folder):
    survey, _ = enhance(folder)
    before = contents(survey)
    write(folder.parent / "images" / "001.jpg", seed=77)
    write(folder.parent / "images" / "new.jpg", seed=78)
    (folder.parent / "images" / "002.jpg").unlink()
    with pytest.raises(InputError, match=r"001.jpg has changed|002.jpg is gone"):
        enhance(folder)
    createsurvey.run(createsurvey.Request(str(folder.parent / "images"), str(folder)))
    with pytest.raises(InputError, match="'enhance' .* is stale"):
        enhanced_path(Survey.open(folder), Survey.open(folder).photographs[0])
    survey, listener = enhance(folder)
    after = contents(survey)
    assert "1 of 3 images stand already." in listener.told
    assert after["000.jpg"] == before["000.jpg"]
    assert after["001.jpg"] != before["001.jpg"]
    assert sorted(p.name for p in (folder / "enhanced").rglob("*.tif")) == ["000.jpg.tif", "001.jpg.tif", "new.jpg.tif"]


def test_other_parameters_replace_only_when_complete(folder):
    survey, _ = enhance(folder)
    before = contents(survey)
    path = survey.path(survey.photographs[2])
    data = path.read_bytes()
    path.write_bytes(bytes(len(data)))  # the third photograph cannot be done
    with pytest.raises(InputError, match=r"002.jpg has changed"):
        enhance(folder, window=21)
    assert contents(Survey.open(folder)) == before
    assert not Survey.open(folder).is_stale("enhance")
    path.write_bytes(data)
    survey, listener = enhance(folder, window=21)
    assert "2 of 3 images stand already." in listener.told
    assert contents(survey) != before
    assert [p.name for p in (folder / "enhanced").iterdir()] == ["bandpass-21"]


def test_a_killed_run_resumes(tmp_path):
    count = 24
    folder, other = (make_survey(tmp_path / name, count, (900, 700)) for name in ("killed", "whole"))
    undisturbed, _ = enhance(other)
    program = "import sys\nfrom strandline.core.photographs.enhance import *\nrun(Request(sys.argv[1], window=11, workers=1))\n"
    with subprocess.Popen([sys.executable, "-c", program, str(folder)]) as process:
        end = time.monotonic() + 60
        while len(list((folder / "enhanced").rglob("[0-9]*.tif"))) < 3 and time.monotonic() < end:
            time.sleep(0.001)
        os.kill(process.pid, signal.SIGKILL)
    stood = len(list((folder / "enhanced").rglob("[0-9]*.tif")))
    assert 3 <= stood < count
    assert Survey.open(folder).record("enhance") is None
    survey, listener = enhance(folder)
    assert f"{stood} of {count} images stand already." in listener.told
    assert contents(survey) == contents(undisturbed)
    assert len(list((folder / "enhanced").rglob("*.*"))) == count  # nothing unfinished is left


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"window": 100}, "WINDOW=100 is not an odd number from 3 on: take 101"),
        ({"window": 1}, "take 3"),
        ({"window": -5}, "take 3"),
        ({"window": 71}, "WINDOW=71 is larger than 000.jpg, 001.jpg, 002.jpg"),
        ({"ignore": VectorSource("sea.gpkg", "sea")}, "IGNORE"),
    ],
)
def test_what_cannot_be_done_is_refused_at_once(folder, more, message):
    with pytest.raises(InputError, match=message):
        enhance(folder, **more)
    assert not (folder / "enhanced").exists()


def test_no_survey(tmp_path):
    with pytest.raises(InputError, match="not a survey folder"):
        enhance(tmp_path / "nowhere")
    assert not (tmp_path / "nowhere").exists()


def test_raw_photographs(shared_data, tmp_path):
    createsurvey.run(createsurvey.Request(str(shared_data / "raw"), str(tmp_path / "survey")))
    survey, _ = enhance(tmp_path / "survey", window=31)
    for photograph in survey.photographs:
        with Image.open(enhanced_path(survey, photograph)) as image:
            assert image.size == (photograph.width, photograph.height)


def test_real_sand_gains_contrast(shared_data, tmp_path):
    """Local contrast of sand spreads over the grey levels; the photograph's own takes a few of them."""
    source = cv2.imread(str(shared_data / "copr" / "images" / "IMG_0022.jpg"), cv2.IMREAD_COLOR)
    (tmp_path / "images").mkdir()
    cv2.imwrite(str(tmp_path / "images" / "sand.jpg"), source[::4, ::4])
    createsurvey.run(createsurvey.Request(str(tmp_path / "images"), str(tmp_path / "survey")))
    survey, _ = enhance(tmp_path / "survey", window=101)
    image = cv2.imread(str(enhanced_path(survey, survey.photographs[0])), cv2.IMREAD_UNCHANGED)
    assert image.shape == source[::4, ::4].shape[:2]

    def spread(pixels):
        tiles = pixels[: pixels.shape[0] // 32 * 32, : pixels.shape[1] // 32 * 32].astype(float)
        return np.median(tiles.reshape(tiles.shape[0] // 32, 32, -1, 32).std(axis=(1, 3)))

    assert spread(cv2.cvtColor(source[::4, ::4], cv2.COLOR_BGR2GRAY)) < 12.0
    assert 27.0 < spread(image) < 50.0  # a normal distribution through the arctangent of its half has 35
    assert abs(float(image.mean()) - 127.5) < 3.0
    # The step looks at the colours: of one photograph every fourth pixel of which was taken, hardly any noise is shared.
    told = read_note(enhanced_path(survey, survey.photographs[0])).contrast
    assert 0.08 < told.crossover < 0.8
    assert told.low_pass == band_of(told.crossover).fine


def test_nothing_but_tie_points_uses_enhanced_images(root):
    """The surface, its colours and the marks come from the photographs: only these rooms may ask for an enhanced image."""
    allowed = {"photographs", "tiepoints", "comparison"}  # the last runs the steps and shows the images searched
    users = {
        path.relative_to(root / "core").parts[0]
        for path in (root / "core").rglob("*.py")
        if re.search(r"enhanced_path|enhanced/|photographs(\.| import )enhance\b", path.read_text(encoding="utf-8"))
    }
    assert users - {"steps.py"} <= allowed
    assert Path(root / "core" / "photographs" / "enhance.py").is_file()
