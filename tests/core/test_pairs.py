"""The choice of pairs."""

import numpy as np
import pytest
from strandline.core.survey import Photograph, Position
from strandline.core.tiepoints.pairs import blocks, flight_order, followers, neighbours, pairs_through_others
from strandline.core.tiepoints.pairs import choose_pairs as choose_pairs_with


def photograph(i, position=None, time=None, **more):
    return Photograph(f"{i:05d}.jpg", 1, "", 4000, 3000, "camera", focal=3000.0, position=position, time=time, **more)


def choose_pairs(photographs, mode):
    """Choose pairs where likeness must not be asked for."""
    return choose_pairs_with(photographs, mode, lambda known, count: pytest.fail("likeness was asked for"))


def flight(strips, length, spacing=8.0, **more):
    """Return photographs of a serpentine flight, ``spacing`` metres apart both ways, near the equator."""
    result = []
    for row in range(strips):
        for column in range(length) if row % 2 == 0 else reversed(range(length)):
            place = Position(column * spacing / 111_320.0, row * spacing / 111_320.0, 30.0)
            result.append(photograph(len(result), place, **more))
    return result


def test_few_photographs_are_compared_all_with_all():
    pairs, _ = choose_pairs(flight(2, 3), "auto")
    assert len(pairs) == 15
    assert pairs[0] == (0, 1)


def test_the_number_of_pairs_grows_with_the_photographs_and_neighbouring_strips_are_tied():
    per_photograph = {}
    for length in (20, 200):
        photographs = flight(5, length)
        pairs, _ = choose_pairs(photographs, "auto")
        per_photograph[length] = len(pairs) / len(photographs)
        assert all(i < j for i, j in pairs)
        assert len(set(pairs)) == len(pairs)
        # The photograph above the middle of the first strip is on the way back.
        middle = length // 2
        assert (middle, 2 * length - 1 - middle) in pairs
        assert len(blocks(len(photographs), pairs)) == 1
    assert per_photograph[200] == pytest.approx(per_photograph[20], rel=0.1)
    assert per_photograph[200] < 12


def test_far_neighbours_are_left_out_where_the_height_is_known():
    # 30 m above ground, 4000 px at f = 3000 px: 40 m wide, so pairs beyond 60 m are left out, but never the nearest four.
    low = flight(1, 40, spacing=25.0, relative_height=30.0, pitch=-90.0)
    assert {j - i for i, j in neighbours(low)} == {1, 2, 3, 4}  # at the ends the nearest four lie on one side
    inner = {(i, j) for i, j in neighbours(low) if 10 <= i < 30 and 10 <= j < 30}
    assert {j - i for i, j in inner} == {1, 2}
    oblique = flight(1, 40, spacing=25.0, relative_height=30.0, pitch=-45.0)
    assert max(j - i for i, j in neighbours(oblique)) > 4


def test_photographs_of_one_place_do_not_hide_their_neighbours():
    here = [photograph(i, Position(0.0, 0.0, 10.0)) for i in range(30)]
    assert all(i != j for i, j in neighbours(here))
    assert len(blocks(30, choose_pairs(here, "auto")[0])) == 1


def test_a_photograph_without_position_is_found_by_its_place_in_flight():
    photographs = flight(1, 60)
    photographs[30] = photograph(30)
    pairs, _ = choose_pairs(photographs, "auto")
    assert {(20, 30), (29, 30), (30, 40)} <= set(pairs)
    assert (30, 41) not in pairs


def test_without_positions_all_up_to_sixty_then_the_most_alike_beside_the_order_of_flight():
    assert len(choose_pairs([photograph(i) for i in range(60)], "auto")[0]) == 60 * 59 // 2
    asked = []

    def alike(known, count):
        asked.append((known, count))
        return {(0, 250), (3, 90)}

    pairs, rule = choose_pairs_with([photograph(i) for i in range(300)], "auto", alike)
    following = followers(range(300), (1, 2, 3, 4))
    assert asked == [(following, 16)]
    assert pairs == sorted({*following, (0, 250), (3, 90)})
    assert rule == "the next 4 in the order of flight and the 16 most alike, as there are no positions to choose by"
    assert len(choose_pairs([photograph(i) for i in range(70)], "exhaustive")[0]) == 70 * 69 // 2


def test_a_few_positions_are_as_good_as_none():
    photographs = [*flight(1, 30), *(photograph(i) for i in range(30, 70))]
    assert (0, 69) in choose_pairs_with(photographs, "auto", lambda known, count: {(0, 69)})[0]


def test_a_sequence_ties_neighbouring_strips_at_some_places():
    pairs, rule = choose_pairs([photograph(i) for i in range(300)], "sequential")
    assert len(pairs) < 300 * 16
    assert (0, 256) in pairs
    assert (0, 11) not in pairs
    assert "flight" in rule


def test_flight_order_is_by_time_when_all_have_one():
    timed = [photograph(0, time="2024-01-01T10:00:02"), photograph(1, time="2024-01-01T10:00:01")]
    assert flight_order(timed) == [1, 0]
    assert flight_order([timed[0], photograph(1)]) == [0, 1]
    assert followers([2, 0, 1], [1]) == {(0, 2), (0, 1)}


def test_a_third_photograph_tells_of_a_small_common_corner():
    def shift(x, y):
        return np.array([[1.0, 0, x], [0, 1.0, y], [0, 0, 1.0]])

    sizes = [(100, 100)] * 4
    verified = {
        (0, 1): (500, shift(-60, 0)),
        (1, 2): (500, shift(-30, -5)),
        (2, 3): (500, shift(-60, 0)),
        (1, 3): (60, shift(-89, 0)),
    }
    found = pairs_through_others(verified, sizes, 50)
    # 0 to 2 leaves 10 columns; 0 to 3 goes beyond the frame.
    assert [(i, j) for i, j, _ in found] == [(0, 2)]
    assert np.allclose(found[0][2], shift(-90, -5))
    assert pairs_through_others(verified, sizes, 600) == []


def test_blocks_are_the_largest_first():
    assert blocks(6, [(4, 5), (0, 1), (1, 3)]) == [[0, 1, 3], [4, 5], [2]]
    assert blocks(2, []) == [[0], [1]]
