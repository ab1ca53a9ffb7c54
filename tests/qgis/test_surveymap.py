"""A survey in the map: what is loaded, in which order, and how it is drawn."""

import json

import pytest
from marking_world import make_survey


@pytest.fixture
def project(qgis):
    from qgis.core import QgsProject

    yield QgsProject.instance()
    QgsProject.instance().clear()


def make_layer(path, kind, fields, rows):
    """Write a layer in metres; a row is its geometry as WKT and the values of ``fields``."""
    from osgeo import ogr, osr

    reference = osr.SpatialReference()
    reference.ImportFromEPSG(32631)
    path.parent.mkdir(exist_ok=True)
    data = ogr.GetDriverByName("GPKG").CreateDataSource(str(path))
    layer = data.CreateLayer(path.stem, reference, kind)
    for field, value in zip(fields, rows[0][1:], strict=True):
        layer.CreateField(ogr.FieldDefn(field, ogr.OFTString if isinstance(value, str) else ogr.OFTReal))
    for wkt, *values in rows:
        feature = ogr.Feature(layer.GetLayerDefn())
        for field, value in zip(fields, values, strict=True):
            if value is not None:
                feature.SetField(field, value)
        feature.SetGeometry(ogr.CreateGeometryFromWkt(wkt))
        layer.CreateFeature(feature)
    return path


def make_residuals(path, longest=0.02):
    from osgeo import ogr

    # An extent of 300 x 400 m: its diagonal is 500 m.
    rows = [
        ("POINT Z (0 0 1)", "A", 0.6 * longest, 0.8 * longest, 0.01),
        ("POINT Z (300 400 1)", "B", 0.0, 0.5 * longest, None),
        ("POINT Z (300 0 1)", "C", None, None, None),
    ]
    return make_layer(path, ogr.wkbPoint25D, ["name", "dE", "dN", "dU"], rows)


@pytest.mark.parametrize(
    # 8 % of 500 m is 40 m: a residual of 2 cm may be 2000 times enlarged, one of 3 cm 1333 times, of 70 m not at all.
    ("longest", "factor"),
    [(0.02, 2000.0), (0.03, 1000.0), (0.007, 5000.0), (70.0, 1.0), (0.0, 100.0)],
)
def test_residuals_are_enlarged_by_a_round_number(qgis, tmp_path, longest, factor):
    from qgis.core import QgsVectorLayer
    from strandline.provider.mapstyles import draw_residuals

    layer = QgsVectorLayer(str(make_residuals(tmp_path / "r.gpkg", longest)), "r", "ogr")
    assert draw_residuals(layer) == factor
    arrow = layer.renderer().symbol().symbolLayer(1)
    assert (arrow.layerType(), arrow.scale()) == ("VectorField", factor)


def test_a_group_holds_what_there_is(project, tmp_path):
    from osgeo import gdal, ogr
    from qgis.core import QgsHillshadeRenderer
    from strandline.bridge.survey import SurveyView
    from strandline.provider import surveymap

    folder = make_survey(tmp_path, steps=("georeference", "exportdsm"))
    content = json.loads((folder / "survey.json").read_text())
    content["steps"]["georeference"]["finished"] = "2024-01-01T00:00:00+00:00"
    content["steps"]["exportdsm"]["parameters"] = {"output": str(tmp_path / "dsm.tif"), "ortho": str(tmp_path / "gone.tif")}
    (folder / "survey.json").write_text(json.dumps(content))
    gdal.GetDriverByName("GTiff").Create(str(tmp_path / "dsm.tif"), 10, 10, 1, gdal.GDT_Float32)
    layers = folder / "layers"
    layers.mkdir()
    files = {
        "photos": make_layer(layers / "photos.gpkg", ogr.wkbPoint25D, ["name", "thumbnail"], [("POINT Z (1 2 3)", "a", "t.jpg")]),
        "tie_points": make_layer(
            layers / "tie_points.gpkg", ogr.wkbPoint25D, ["height"], [(f"POINT Z (1 2 {z})", float(z)) for z in range(20)]
        ),
    }
    surveymap.keep_residuals(SurveyView.read(str(folder)), str(make_residuals(tmp_path / "r.gpkg")))
    for _ in range(2):  # a second time it takes the place of the first
        group = surveymap.load(SurveyView.read(str(folder)), files, project)
    names = [leaf.name() for leaf in group.findLayers()]
    assert names == ["Residuals, 2000 times enlarged", "Photographs", "Tie points", "Hillshade", "Surface"]
    assert len(project.mapLayers()) == 5
    by_name = {leaf.name(): leaf for leaf in group.findLayers()}
    assert "thumbnail" in by_name["Photographs"].layer().mapTipTemplate()
    assert len(by_name["Tie points"].layer().renderer().ranges()) == 7
    assert not by_name["Tie points"].itemVisibilityChecked()
    assert isinstance(by_name["Hillshade"].layer().renderer(), QgsHillshadeRenderer)


def test_residuals_of_an_earlier_georeferencing_are_not_shown(project, tmp_path):
    from strandline.bridge.survey import SurveyView
    from strandline.provider import surveymap

    folder = make_survey(tmp_path, steps=("georeference",))
    content = json.loads((folder / "survey.json").read_text())
    content["steps"]["georeference"]["finished"] = "2999-01-01T00:00:00+00:00"
    (folder / "survey.json").write_text(json.dumps(content))
    surveymap.keep_residuals(SurveyView.read(str(folder)), str(make_residuals(tmp_path / "r.gpkg")))
    assert surveymap.load(SurveyView.read(str(folder)), {}, project).findLayers() == []


def test_the_engine_is_asked_for_what_the_survey_can_give(project, tmp_path, fake_engine):
    """Before a georeferencing there are no footprints or tie points to ask for."""
    import time

    from qgis.PyQt.QtCore import QCoreApplication
    from strandline.bridge.survey import SurveyView
    from strandline.provider.background import Background
    from strandline.provider.surveymap import add_survey

    fake_engine(
        f"Path({str(tmp_path / 'said')!r}).write_text(json.dumps(request))\nsay(type='error', kind='InputError', text='No.')"
    )
    told = []
    background = Background()
    assert add_survey(SurveyView.read(str(make_survey(tmp_path))), background, told.append, told.append)
    end = time.monotonic() + 20
    while not told and time.monotonic() < end:
        QCoreApplication.processEvents()
    assert told == ["No."]
    request = json.loads((tmp_path / "said").read_text())
    assert [key for key in ("photos", "footprints", "tie_points") if request[key]] == ["photos"]
