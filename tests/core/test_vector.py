"""Layers and tables there and back."""

import numpy as np
import pytest
import shapely
from pyproj import Transformer
from strandline.core.contract import VectorSource
from strandline.core.errors import InputError
from strandline.core.vector import check_destination, in_crs, polygons, read_layer, write_layer

UTM = "EPSG:32631"


def written(path, fields, geometry, kind="Point", crs=UTM):
    write_layer(str(path), "points", crs, fields, geometry, kind)
    return VectorSource(str(path), "points")


def test_round_trip_with_nulls(tmp_path):
    fields = {
        "name": ["a", None, "c"],
        "count": [1, None, 3],
        "size": [0.5, np.nan, None],
        "good": [True, None, False],
        "nothing": [None, None, None],
    }
    shapes = [shapely.Point(1, 2, 3), shapely.Point(4, 5, 6), shapely.Point(7, 8, 9)]
    layer = read_layer(written(tmp_path / "a.gpkg", fields, shapes, "Point Z"))
    assert layer.text("name") == ["a", "", "c"]
    assert layer.text("count") == ["1", "", "3"]
    assert layer.numbers("COUNT") == pytest.approx([1, np.nan, 3], nan_ok=True)
    assert layer.numbers("size") == pytest.approx([0.5, np.nan, np.nan], nan_ok=True)
    assert np.isnan(layer.numbers("nothing")).all()
    assert [g.wkt for g in layer.geometry] == [g.wkt for g in shapes]
    assert [g.z for g in layer.geometry] == [3, 6, 9]


@pytest.mark.parametrize("kind", ["Point Z", "MultiPolygon"])
def test_an_empty_layer_is_a_layer(tmp_path, kind):
    layer = read_layer(written(tmp_path / "a.gpkg", {"name": [], "net": []}, [], kind))
    assert len(layer) == 0
    assert list(layer.fields) == ["name", "net"]


def test_a_table_has_no_geometry(tmp_path):
    layer = read_layer(written(tmp_path / "a.gpkg", {"x": [1.0]}, None, crs=None))
    assert layer.geometry is None
    with pytest.raises(InputError, match="without geometry"):
        in_crs(layer, UTM)


def test_numbers_as_text_from_csv(tmp_path):
    path = tmp_path / "marks.csv"
    path.write_text('GCP,Image,X,Y\n1,a.jpg,"12.5"," 7 "\n2,b.jpg,,3\n', encoding="utf-8")
    layer = read_layer(VectorSource(str(path), ""))
    assert layer.text("gcp") == ["1", "2"]
    assert layer.numbers("x") == pytest.approx([12.5, np.nan], nan_ok=True)
    assert layer.numbers("y") == pytest.approx([7, 3])


def test_what_is_no_number_is_named(tmp_path):
    path = tmp_path / "marks.csv"
    path.write_text("x\n12 m\n", encoding="utf-8")
    with pytest.raises(InputError, match="'12 m' in the field x"):
        read_layer(VectorSource(str(path), "marks")).numbers("x")


def test_a_missing_field_names_those_that_exist(tmp_path):
    layer = read_layer(written(tmp_path / "a.gpkg", {"name": ["a"]}, [shapely.Point(0, 0)]))
    with pytest.raises(InputError, match="no field 'height'; it has name"):
        layer.numbers("height")


def test_a_missing_file_or_layer_is_one_sentence(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_layer(VectorSource(str(tmp_path / "none.gpkg"), "points"))
    source = written(tmp_path / "a.gpkg", {"name": ["a"]}, [shapely.Point(0, 0)])
    with pytest.raises(InputError, match="cannot be read"):
        read_layer(VectorSource(source.path, "other"))


def test_coordinates_follow_the_crs_and_z_stays(tmp_path):
    source = written(tmp_path / "a.gpkg", {"n": [1]}, [shapely.Point(3.0, 45.0, 12.5)], "Point Z", "EPSG:4326")
    (moved,) = in_crs(read_layer(source), UTM)
    assert (moved.x, moved.y) == pytest.approx(Transformer.from_crs(4326, 32631, always_xy=True).transform(3.0, 45.0))
    assert moved.z == 12.5


def test_the_crs_the_user_set_counts(tmp_path):
    source = written(tmp_path / "a.gpkg", {"n": [1]}, [shapely.Point(500000, 4982950)])
    (moved,) = in_crs(read_layer(VectorSource(source.path, "points", "EPSG:32632")), "EPSG:4326")
    assert moved.x == pytest.approx(9.0)  # the central meridian of zone 32, not of 31


@pytest.mark.filterwarnings("ignore:'crs' was not provided")
def test_a_layer_without_crs_is_refused(tmp_path):
    with pytest.raises(InputError, match="no CRS"):
        in_crs(read_layer(written(tmp_path / "a.gpkg", {"n": [1]}, [shapely.Point(0, 0)], crs=None)), UTM)


def test_polygons_are_made_valid_and_points_refused(tmp_path):
    bow = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
    source = written(tmp_path / "a.gpkg", {"n": [1, 2]}, [bow, shapely.Polygon()], "Polygon")
    (shape,) = polygons(source, UTM)
    assert shape.is_valid
    assert shape.area == pytest.approx(2.0)
    with pytest.raises(InputError, match="not polygons"):
        polygons(written(tmp_path / "b.gpkg", {"n": [1]}, [shapely.Point(0, 0)]), UTM)


def test_a_place_that_cannot_be_written_is_refused_before_work(tmp_path):
    check_destination(str(tmp_path / "new" / "deep" / "a.gpkg"))
    with pytest.raises(InputError, match="GeoPackage"):
        check_destination(str(tmp_path / "a.shp"))
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        check_destination(str(tmp_path / "file" / "a.gpkg"))
