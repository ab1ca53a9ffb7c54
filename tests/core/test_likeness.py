"""Pairs by likeness."""

import cv2
import numpy as np
from strandline.core.progress import SILENT
from strandline.core.survey import Photograph
from strandline.core.tiepoints import tiepoints
from strandline.core.tiepoints.features import Features, write_features
from strandline.core.tiepoints.likeness import alike_pairs, largest

UNIT = 512.0  # norm of a descriptor


def strangers(random, count):
    """Descriptors of norm 512 that have nothing to do with each other."""
    drawn = random.gamma(0.5, size=(count, 128))
    return np.rint(drawn * UNIT / np.linalg.norm(drawn, axis=1)[:, None]).clip(0, 255).astype(np.uint8)


def seen_again(random, descriptors):
    """Return descriptors with noise of 3 in each bin."""
    return (descriptors + random.normal(0, 3, descriptors.shape)).clip(0, 255).astype(np.uint8)


def strip(random, count, step, length):
    """Photographs of one row of ground: ``length`` features each, of which ``step`` are new in the next."""
    ground = strangers(random, step * (count - 1) + length)
    return [seen_again(random, ground[i * step : i * step + length]) for i in range(count)]


def test_photographs_that_share_features_are_pairs():
    random = np.random.default_rng(1)
    ground = strangers(random, 60)
    # 0 and 2 share forty, 1 and 3 twenty; nothing else is shared.
    photographs = [ground[:40], ground[40:], seen_again(random, ground[:40]), seen_again(random, ground[40:])]
    assert alike_pairs(photographs, set(), 1) == {(0, 2), (1, 3)}


def test_the_k_most_alike_are_those_that_share_most():
    random = np.random.default_rng(2)
    photographs = strip(random, 12, 20, 100)  # 80, 60, 40 and 20 shared with the next four
    pairs = alike_pairs(photographs, set(), 2)
    inner = {(i, j) for i, j in pairs if i >= 2 and j < 10}
    assert inner == {(i, i + 1) for i in range(2, 9)}
    # At the two ends both of the most alike lie on one side.
    assert pairs - {(i, i + 1) for i in range(11)} == {(0, 2), (9, 11)}


def test_known_pairs_are_passed_over_and_do_not_count():
    random = np.random.default_rng(3)
    photographs = strip(random, 12, 20, 100)
    known = {(i, i + 1) for i in range(11)}
    pairs = alike_pairs(photographs, known, 2)
    assert not pairs & known
    assert {(i, i + 2) for i in range(10)} <= pairs


def test_strips_without_order_are_found_among_strangers():
    random = np.random.default_rng(4)
    width, step = 10, 5  # half of each photograph is seen in the next, both ways
    ground = strangers(random, 30 * 50).reshape(30, 50, 128)
    photographs, place = [], []
    for row in range(5):
        for column in range(9):
            seen = ground[row * step : row * step + width, column * step : column * step + width].reshape(-1, 128)
            photographs.append(np.concatenate([seen_again(random, seen), strangers(random, 100)]))
            place.append((row, column))
    shuffled = random.permutation(len(place))
    pairs = alike_pairs([photographs[i] for i in shuffled], set(), 8)
    found = {frozenset((place[shuffled[i]], place[shuffled[j]])) for i, j in pairs}
    beside = {frozenset((a, b)) for a in place for b in place if abs(a[0] - b[0]) + abs(a[1] - b[1]) == 1}
    assert beside <= found
    assert len(pairs) < len(place) * 8


def test_the_answer_is_the_same_again_whatever_ran_before():
    random = np.random.default_rng(5)
    photographs = [np.concatenate([p, strangers(random, 200)]) for p in strip(random, 20, 20, 60)]
    first = alike_pairs(photographs, set(), 6)
    cv2.randu(np.zeros((50, 50), np.uint8), 0, 255)  # moves OpenCV's generator on
    threads = cv2.getNumThreads()
    try:
        cv2.setNumThreads(1)
        assert alike_pairs(photographs, set(), 6) == first
    finally:
        cv2.setNumThreads(threads)


def test_a_photograph_without_features_is_like_none():
    random = np.random.default_rng(6)
    none = np.zeros((0, 128), np.uint8)
    photographs = strip(random, 3, 20, 60)
    assert alike_pairs([none, *photographs, none], set(), 1) == {(1, 2), (2, 3)}
    assert alike_pairs([none, none], set(), 4) == set()
    assert alike_pairs([], set(), 4) == set()
    assert alike_pairs([strangers(random, 1), none], set(), 4) == set()


def test_equal_features_everywhere_tell_nothing():
    same = np.repeat(strangers(np.random.default_rng(7), 1), 300, axis=0)
    assert alike_pairs([same, same, same], set(), 2) == set()


def test_the_largest_features_are_those_searched():
    random = np.random.default_rng(8)
    x, y = np.meshgrid(np.arange(16) * 62.5 + 30, np.arange(16) * 62.5 + 30)
    xy = np.concatenate([np.column_stack([x.ravel(), y.ravel()]), random.uniform(0, 1000, (1744, 2))]).astype(np.float32)
    scale = np.where(np.arange(2000) < 256, 9.0, 1.0).astype(np.float32)
    found = Features(xy, scale, np.zeros(2000, np.float32), strangers(random, 2000))
    chosen = largest(found, (1000, 1000))
    assert chosen.shape == (400, 128)
    # No two of the 256 large ones lie in one of the 32 x 32 cells that give theirs in turn.
    assert {row.tobytes() for row in found.descriptors[:256]} <= {row.tobytes() for row in chosen}


def test_a_survey_without_positions_is_matched_where_it_is_alike(tmp_path):
    random = np.random.default_rng(9)
    ground = strangers(random, 60)
    place = random.uniform(50, 900, (60, 2)).astype(np.float32)
    photographs, found = [], []
    for i in range(64):
        # Only 0 and 50 see the same, 60 pixels apart.
        same = i in (0, 50)
        xy = place + np.float32(i * 1.2) if same else random.uniform(0, 1000, (60, 2)).astype(np.float32)
        descriptors = seen_again(random, ground) if same else strangers(random, 60)
        path = tmp_path / f"{i}.npz"
        write_features(path, Features(xy, np.full(60, 3, np.float32), np.zeros(60, np.float32), descriptors))
        photographs.append(Photograph(f"{i:03d}.jpg", 1, "", 1000, 1000, "camera"))
        found.append(path)
    request = tiepoints.Request(str(tmp_path), workers=1)
    pairs, rule, keys = tiepoints._pairs(request, photographs, found, tmp_path / "matches", SILENT)
    assert {pair: len(m.matches) for pair, m in pairs.items()} == {(0, 50): 60}
    assert "the next 4 in the order of flight and the 16 most alike" in rule
    made = {path: path.stat().st_mtime_ns for path in (tmp_path / "matches").iterdir()}
    assert {path.stem for path in made} == set(keys)
    # Again, the same pairs are chosen, and all of them stand.
    assert tiepoints._pairs(request, photographs, found, tmp_path / "matches", SILENT)[2] == keys
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "matches").iterdir()} == made
