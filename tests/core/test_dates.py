"""When a surface model was flown, and sentences where that cannot be told."""

from datetime import datetime

import pytest
from strandline.core.change.dates import date_in_name, date_models, parse_date, written, years_between
from strandline.core.contract import RasterSource
from strandline.core.errors import InputError

SOURCES = [RasterSource("/data/beach_20180606.tif"), RasterSource("/data/beach_20180713.tif"), RasterSource("/data/b.tif")]


def dates(sources=SOURCES, tags=None, text=None, table=None):
    return [(written(d.date), d.told_by) for d in date_models(sources, tags or [{}] * len(sources), text, table)]


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("leo_20180606_dsm_resampled_1m", {"2018-06-06"}),
        ("2018-06-06", {"2018-06-06"}),
        ("dsm_2018_06_06_5cm", {"2018-06-06"}),
        ("survey 2018.06.06T0930", {"2018-06-06T09:30"}),
        ("12018060699", set()),
        ("20180231", set()),
        ("20181306", set()),
        ("2018-0606", set()),
        ("20180606_1030", {"2018-06-06"}),
        ("from_20180606_to_20180713", {"2018-06-06", "2018-07-13"}),
    ],
)
def test_dates_in_names(name, found):
    assert {written(d) for d in date_in_name(name)} == found


def test_iso_with_zone_and_seconds():
    assert parse_date("2018-06-06T09:30:15+10:00") == datetime(2018, 6, 6, 9, 30, 15)
    assert parse_date("6.6.2018") is None


def test_years():
    assert years_between(datetime(2018, 1, 1), datetime(2018, 7, 2, 15)) == pytest.approx(0.5)


def test_what_wins():
    """DATES before the table, that before the layer's time, that before tags, these before the file's and the layer's name."""
    layer = RasterSource("/data/b.tif", name="flight of 2019-01-02", date="2019-01-03")
    sources = [*SOURCES[:2], layer]
    assert dates(sources)[2] == ("2019-01-03", "the layer's temporal range")
    sources[2] = RasterSource("/data/b.tif", name="flight of 2019-01-02")
    assert dates(sources)[2] == ("2019-01-02", "the layer's name")
    assert dates(sources, [{}, {}, {"STRANDLINE_DATE": "2019-01-04T10:00:00"}])[2] == (
        "2019-01-04T10:00",
        "the tag STRANDLINE_DATE",
    )
    assert dates(sources, table={"b": "2019-01-05"})[2] == ("2019-01-05", "DATE_TABLE")
    assert dates(sources, table={"b": "2019-01-05"}, text="B.TIF=2019-01-06")[2] == ("2019-01-06", "DATES")
    assert [d for d, _ in dates(text="2001-01-01; 2002-01-01, 2003-01-01")] == ["2001-01-01", "2002-01-01", "2003-01-01"]
    # A tag of when the file was made is not a date of flight.
    with pytest.raises(InputError, match=r"b\.tif is not known"):
        dates(tags=[{}, {}, {"TIFFTAG_DATETIME": "2019:01:04 10:00:00"}])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, r"The date of b\.tif is not known"),
        ("2018-06-06, 2018-07-13", "holds 2 dates and DSMS 3"),
        ("b.tif=2018-06-06, 2018-07-13", "mixes dates"),
        ("nothing.tif=2018-06-06", r"nothing\.tif, which is no raster of DSMS"),
        ("b.tif=June", "'June' is not a date"),
        ("b.tif=2018-06-06", r"beach_20180606\.tif and b\.tif have the same date"),
    ],
)
def test_refused(text, told):
    with pytest.raises(InputError, match=told):
        dates(text=text)


def test_two_of_one_day_are_told_apart_by_time():
    assert len(dates(text="b.tif=2018-06-06T09:30")) == 3


def test_a_name_with_two_dates_is_refused():
    with pytest.raises(InputError, match="more than one date"):
        dates([RasterSource("/data/20180606_minus_20180713.tif")])
