"""Pictures of the orientation: what they count, and that a lost photograph costs the picture and not the orientation."""

import cv2
import numpy as np
import pytest
from strandline.core.files import bytes_digest
from strandline.core.orientation.orientpictures import Sightings, draw_barest, draw_rays
from strandline.core.report.html import Report
from strandline.core.survey import Photograph, Survey
from strandline.core.tiepoints.statistics import MOST_RAYS, cell_counts, ray_histograms, rays_per_point


@pytest.fixture
def survey(tmp_path):
    """Two photographs of 400 x 300."""
    folder = tmp_path / "images"
    folder.mkdir()
    photographs = []
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(folder / name), np.full((300, 400), 90, np.uint8))
        data = (folder / name).read_bytes()
        photographs.append(Photograph(name, len(data), bytes_digest(data), 400, 300, "camera"))
    return Survey.create(tmp_path / "survey", folder, None, photographs)


def page(report, tmp_path):
    report.save(tmp_path / "page.html")
    return (tmp_path / "page.html").read_text(encoding="utf-8")


def sighted(name, kept):
    xy = np.column_stack([np.linspace(5, 395, len(kept)), np.full(len(kept), 150.0)])
    return Sightings(name, 400, 300, 1, xy, np.array(kept, bool))


def barest(survey, tmp_path):
    seen = [sighted("a.png", [True] * 8), sighted("b.png", [True, True, False, False, False, True] * 2)]
    report = Report("Orientation")
    draw_barest(report, survey, seen, np.stack([cell_counts(s.xy[s.kept], s.width, s.height) for s in seen]))
    return page(report, tmp_path)


def test_the_photograph_that_keeps_the_fewest_is_drawn(survey, tmp_path):
    text = barest(survey, tmp_path)
    assert "The barest photograph: b.png" in text
    assert "Tie points kept (blue, 6) and dropped by the final filter (orange, 6)." in text
    assert "left to right: b.png, 6 % covered; a.png, 8 % covered" in text
    assert text.count("<img") == 2


def test_a_lost_photograph_is_said_and_costs_no_more(survey, tmp_path):
    (survey.images / "b.png").unlink()
    text = barest(survey, tmp_path)
    assert "No picture: The photograph" in text
    assert "b.png is gone" in text


def test_rays_are_drawn_with_their_shares(tmp_path):
    # Three points of two rays, one of three.
    photograph, track = np.array([0, 1, 0, 1, 1, 2, 0, 1, 2]), np.array([0, 0, 1, 1, 2, 2, 3, 3, 3])
    report = Report("Orientation")
    per_point = rays_per_point(photograph, track)
    assert np.bincount(per_point, minlength=MOST_RAYS)[2:4].tolist() == [3, 1]
    draw_rays(report, per_point, ray_histograms(photograph, track, 3))
    assert page(report, tmp_path).count("<img") == 1
