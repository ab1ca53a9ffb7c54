"""A shift in plan from the relief of stable ground: found on dunes, not invented on flat ground, counted where it stays in."""

import numpy as np
import pytest
import shapely
from strandline.core.change.alignment import Aligned, common_grid
from strandline.core.change.difference import Pair
from strandline.core.change.dsmdifference import Request, run
from strandline.core.change.heights import open_heights
from strandline.core.change.planshift import PlanShift, WithPlan, find_plan_shift
from strandline.core.change.terms import Moments
from strandline.core.change.uncertainty import Given
from strandline.core.errors import NotEnoughData
from strandline.core.progress import SILENT

WEST, NORTH = 300_000.0, 5_774_000.0
CELL, SIDE, NOISE = 0.2, 160, 0.03


def dunes(x, y):
    """Dunes of 0.8 m, crests in two directions."""
    return 5 + 0.4 * np.sin(2 * np.pi * (x + 0.3 * y) / 9.0) + 0.3 * np.sin(2 * np.pi * (y - 0.2 * x) / 13.0)


def ridges(x, y):
    return 5 + 0.05 * x + 0.4 * np.sin(2 * np.pi * x / 8.0) + 0 * y


def beach(x, y):
    return 5 + 0.05 * x + 0.01 * y


@pytest.fixture
def pair(make_raster):
    """Two models of white noise, AFTER shifted in plan and lifted by 0.1 m."""

    def make(terrain, plan, seed):
        random = np.random.default_rng(seed)
        rows, columns = np.mgrid[0:SIDE, 0:SIDE] + 0.5
        x, y = columns * CELL, -rows * CELL
        noise = random.normal(0, NOISE, (2, SIDE, SIDE))
        before = make_raster("before", terrain(x, y) + noise[0], cell=CELL)
        after = make_raster("after", terrain(x - plan[0], y - plan[1]) + 0.1 + noise[1], cell=CELL)
        return before, after

    return make


def found(sources):
    models = [open_heights(source, label, None, SILENT) for source, label in zip(sources, ("BEFORE", "AFTER"), strict=True)]
    grid, _ = common_grid(*models)
    half = shapely.box(WEST, NORTH - SIDE * CELL, WEST + SIDE * CELL, NORTH - SIDE * CELL / 2)
    return find_plan_shift(Pair(Aligned(models[0], grid), Aligned(models[1], grid), []), [half], np.eye(2), SILENT)


def test_half_a_metre_on_dunes(pair):
    """To 5 cm, and to what its own covariance says: 6 fields of two directions."""
    scores = []
    for seed in range(6):
        shift = found(pair(dunes, (0.4, -0.3), seed))
        assert shift.applied == pytest.approx((0.4, -0.3), abs=0.05)
        scores.append(np.subtract(shift.found, (0.4, -0.3)) / np.sqrt(np.diag(shift.covariance)))
    # Twelve numbers: their root mean square is that of sigma to 20 %.
    assert 0.4 < np.sqrt(np.mean(np.square(scores))) < 1.7


def test_flat_ground_and_a_sloping_plane_show_none(pair):
    for terrain in (lambda x, y: 5 + 0 * x, beach):
        for seed in range(4):
            shift = found(pair(terrain, (0.5, 0.0), seed))
            assert not shift.moved
            assert np.sqrt(np.diag(shift.covariance)) == pytest.approx((1.0, 1.0))


def test_ridges_tell_one_direction(pair):
    shift = found(pair(ridges, (0.5, 0.5), 1))
    assert shift.applied == pytest.approx((0.5, 0.0), abs=0.05)
    assert np.sqrt(np.diag(shift.covariance)) == pytest.approx((0.0, 1.0), abs=0.05)


def test_no_shift_is_not_found(pair):
    assert sum(found(pair(dunes, (0.0, 0.0), seed)).moved for seed in range(8)) == 0


def test_what_stays_in_counts_by_the_slopes():
    """A metre unknown to the east, 0.3 m left in to the north; a zone of 5 % and 10 %, stable ground of 2 % and 0 %."""
    plan = PlanShift((0.0, 0.0), (0.0, 0.3), np.diag([1.0, 0.0]), np.zeros((2, 0)), level=np.array([0.02, 0.0]))
    zone = Moments((0.0, 0.0, 0.0), slopes=(0.05, 0.10))
    assert WithPlan(Given(0.0), plan, 1).sigma(zone) == pytest.approx(np.hypot(0.03, 0.03))
    assert WithPlan(Given(0.04), plan, 0).sigma(zone) == pytest.approx(np.sqrt(0.04**2 + 0.05**2 + 0.03**2))
    assert WithPlan(Given(None), plan, 1).sigma(zone) is None


def test_the_step_takes_it_off(pair, make_polygons, listener, tmp_path):
    from strandline.core.progress import Progress

    stable = make_polygons("stable", [shapely.box(0, -32, 32, -16)])
    zone = make_polygons("zone", [shapely.box(3, -13, 29, -3)])
    options = {"stable": stable, "zones": zone}
    sources = pair(dunes, (0.4, -0.3), 3)
    progress = Progress(listener)
    results = {
        m: run(Request(*sources, str(tmp_path / "o.tif"), coregister=m, **options), progress) for m in ("auto", "vertical")
    }
    assert any("lies beside BEFORE" in text for text in listener.infos)
    assert any("leaves a shift in plan" in text for text in listener.warnings)
    for result in results.values():
        assert abs(result.net) < 3 * result.net_sigma
    assert results["auto"].net_sigma < 0.5 * results["vertical"].net_sigma
    flat = pair(beach, (0.0, 0.0), 0)
    with pytest.raises(NotEnoughData, match="too little relief"):
        run(Request(*flat, str(tmp_path / "o.tif"), coregister="horizontal", **options))
