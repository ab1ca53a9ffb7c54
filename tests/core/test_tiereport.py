"""The report of tie points: its numbers against ones counted by hand, and why a photograph is called weak."""

import re
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from strandline.core.files import bytes_digest
from strandline.core.survey import Photograph, Position, Survey
from strandline.core.tiepoints.features import Features, write_features
from strandline.core.tiepoints.tiereport import write_report
from strandline.core.tiepoints.ties import count_ties, name_weak

WIDTH, HEIGHT = 400, 300


@dataclass(frozen=True)
class Matches:
    """All that the report asks of a pair."""

    matches: np.ndarray


def grid(count, columns=20):
    """Places of ``count`` features, 20 in a row, 20 pixels apart across and 15 down: 2 x 2 in each cell of the coverage."""
    k = np.arange(count)
    return np.column_stack([10.0 + 20.0 * (k % columns), 7.5 + 15.0 * (k // columns)]).astype(np.float32)


@pytest.fixture
def report(tmp_path):
    """Write the report of photographs with the given numbers of features and pairs, and return the page."""

    def make(counts, pairs, *, positions=(), enhanced=False):
        folder = tmp_path / "images"
        folder.mkdir()
        photographs, features, searched = [], [], []
        for i, count in enumerate(counts):
            path = folder / f"{'abcdefgh'[i]}.png"
            cv2.imwrite(str(path), np.full((HEIGHT, WIDTH), 90 + i, np.uint8))
            data = path.read_bytes()
            photograph = Photograph(path.name, len(data), bytes_digest(data), WIDTH, HEIGHT, "camera")
            photographs.append(replace(photograph, position=positions[i]) if positions else photograph)
            xy, ones = grid(count), np.full(count, 2.0, np.float32)
            features.append(tmp_path / f"{i}.npz")
            write_features(features[-1], Features(xy, ones, ones, np.zeros((count, 128), np.uint8)))
            searched.append(path)
        survey = Survey.create(tmp_path / "survey", folder, None, photographs)
        found = {pair: Matches(np.repeat(np.arange(first, first + n)[:, None], 2, axis=1)) for pair, (first, n) in pairs.items()}
        ties = count_ties(survey.photographs, features, found)
        notes = ["Apart.", name_weak(survey.photographs, ties)]
        images = searched if enhanced else None
        write_report(survey, survey.photographs, images, features, found, ties, rule="All", notes=notes, copy=None)
        return survey.report_path("tiepoints").read_text(encoding="utf-8")

    return make


def rows(page):
    """The cells of every table row, without markup."""
    return [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(<td.*?)</tr>", page)]


def test_each_photograph_is_counted(report):
    # a and b share the first 250 features; b and c the features 200 to 399: b has all its 400 matched.
    page = report([400, 400, 400], {(0, 1): (0, 250), (1, 2): (200, 200)})
    assert "3 photographs with 400 features each on average; 2 pairs share 450 verified matches" in page
    table = [row for row in rows(page) if len(row) == 7]
    # 250 features are 12 rows and a half: 60 cells, and five more in the seventh row of cells; 200 are 50 cells.
    assert table == [
        ["a.png", "400", "250", "1", "b.png", "250", "65"],
        ["b.png", "400", "400", "2", "a.png", "250", "100"],
        ["c.png", "400", "200", "1", "b.png", "200", "50"],
    ]
    assert "Apart." in page


def test_a_weak_photograph_is_named_with_why(report):
    page = report([400, 400, 400, 0, 40], {(0, 1): (0, 400), (0, 2): (0, 20), (1, 2): (0, 20)})
    why = dict(row for row in rows(page) if len(row) == 2)
    assert why == {
        "c.png": "20 matches with its best partner (fewer than 200); matches on 10 % of it (less than 30 %)",
        "d.png": "no features were found in it",
        "e.png": "it shares verified matches with no other",
    }
    assert "Weakly tied: c.png, d.png, e.png." in page


def test_one_partner_among_many_is_weak_but_not_in_a_pair(report):
    page = report([400, 400, 400], {(0, 1): (0, 400), (1, 2): (0, 400)})
    assert dict(row for row in rows(page) if len(row) == 2) == {
        "a.png": "tied to one other only",
        "c.png": "tied to one other only",
    }


def test_two_photographs_need_no_third(report):
    assert "No photograph is weakly tied." in report([400, 400], {(0, 1): (0, 400)})


def test_the_enhanced_image_stands_beside_the_photograph(report):
    # Coverage, matrix, histograms, three photographs and a detail.
    assert report([400, 400], {(0, 1): (0, 400)}, enhanced=True).count("<img") == 7


def test_pairs_are_drawn_between_positions(report):
    positions = [Position(3.0, 43.0), Position(3.0002, 43.0), None]
    page = report([400, 400, 400], {(0, 1): (0, 400), (1, 2): (0, 400)}, positions=positions)
    assert "Pairs between the photographs&#x27; GNSS positions" in page
    assert "Not drawn, for want of a position: 1." in page
