"""Layers and parameters on their way to the engine and back, seen by an engine that only writes down what it gets."""

import json
import shutil
from pathlib import Path

import pytest


@pytest.fixture
def survey(tmp_path):
    folder = tmp_path / "survey"
    folder.mkdir()
    (folder / "survey.json").write_text("{}")
    return str(folder)


@pytest.fixture
def sent(fake_engine, tmp_path):
    """Run an algorithm with an engine that keeps the request and the layers it was given."""
    kept = tmp_path / "kept"
    kept.mkdir()
    fake_engine(
        f"""
        import shutil
        kept = Path({str(kept)!r})
        (kept / "request.json").write_text(json.dumps(request))
        for key, value in request.items():
            if isinstance(value, dict) and value["path"].endswith(".gpkg"):
                shutil.copy(value["path"], kept / f"{{key}}.gpkg")
        say(type="result", result={{"output": request.get("survey") or request.get("output")}})
        """
    )

    def run(name, parameters):
        import processing

        (kept / "request.json").unlink(missing_ok=True)
        processing.run(f"strandline:{name}", parameters)
        return json.loads((kept / "request.json").read_text())

    run.folder = kept
    return run


@pytest.fixture(autouse=True)
def _processing(qgis):
    import sys

    sys.path.append("/usr/share/qgis/python/plugins")
    from processing.core.Processing import Processing

    Processing.initialize()


def memory(kind, fields, rows, name="points"):
    """A memory layer: ``rows`` of (WKT or None, attributes)."""
    from qgis.core import QgsFeature, QgsGeometry, QgsVectorLayer

    layer = QgsVectorLayer(f"{kind}{'&' if '?' in kind else '?'}{'&'.join(f'field={f}' for f in fields)}", name, "memory")
    assert layer.isValid()
    features = []
    for wkt, attributes in rows:
        feature = QgsFeature(layer.fields())
        if wkt:
            feature.setGeometry(QgsGeometry.fromWkt(wkt))
        feature.setAttributes(attributes)
        features.append(feature)
    assert layer.dataProvider().addFeatures(features)[0]
    return layer


def read(path, layer=None):
    """Return what a GeoPackage holds: (fid, WKT or None, attributes) of each feature."""
    from osgeo import ogr

    data = ogr.Open(str(path))
    table = data.GetLayerByName(layer) if layer else data.GetLayer(0)
    assert table is not None
    rows = []
    for feature in table:
        shape = feature.GetGeometryRef()
        rows.append((feature.GetFID(), shape.ExportToIsoWkt() if shape else None, feature.items()))
    return rows


def test_what_is_not_given_is_null_and_defaults_are_sent(sent, survey):
    assert sent("tiepoints", {"SURVEY": survey}) == {
        "survey": survey,
        "source": "auto",
        "max_features": 20000,
        "max_size": 0,
        "threshold": "noise",
        "pairs": "auto",
        "workers": 0,
        "scheduler": None,
        "output_html_file": None,
    }


def test_none_is_the_default_as_a_model_passes_it(sent, survey):
    request = sent("enhance", {"SURVEY": survey, "METHOD": None, "WINDOW": None, "IGNORE": None, "OUTPUT_HTML_FILE": None})
    assert (request["method"], request["window"], request["ignore"], request["output_html_file"]) == ("bandpass", 101, None, None)


def test_values_arrive_by_type(sent, survey, tmp_path):
    request = sent(
        "georeference",
        {
            "SURVEY": survey, "SIGMA_H": 0.005, "METHOD": "adjustment", "USE_GNSS": True, "CHECK": " G1, G2 ", "GEOID": "47",
            "GCP_FILE": str(tmp_path / "gcp_list"), "CRS": "EPSG:2154", "GCP_HEIGHTS": "orthometric",
        },
    )  # fmt: skip
    assert request["sigma_h"] == 0.005
    assert request["sigma_v"] == 0.02
    assert request["method"] == "adjustment"
    assert request["use_gnss"] is True
    assert request["check"] == "G1, G2"
    assert request["geoid"] == "47"
    assert request["gcp_file"] == str(tmp_path / "gcp_list")
    assert request["gcp_heights"] == "orthometric"
    assert request["gnss_heights"] == "unknown"
    assert request["crs"].startswith("PROJCRS[")
    assert '"EPSG",2154]' in request["crs"]
    assert [request[k] for k in ("gcps", "marks", "name_field", "ignore", "residuals", "photos")] == [None] * 6


def test_a_pair_of_ground_control_files_arrives_as_it_was_given(sent, survey, tmp_path):
    pair = f"{tmp_path / 'points.xml'};{tmp_path / 'measures-S2D.xml'}"
    assert sent("georeference", {"SURVEY": survey, "GCP_FILE": pair})["gcp_file"] == pair


def test_points_keep_z_ids_types_and_nulls(sent, survey, tmp_path):
    gcps = memory(
        "PointZ?crs=EPSG:32631",
        ["name:string", "n:integer", "sigma:double", "fid:string", "geom:string", "ok:boolean", "day:date"],
        [
            ("POINT Z (500000 5000000 12.25)", ["G1", 7, 0.01, "a", "x", True, "2024-03-12"]),
            ("POINT Z (500010 5000020 13.5)", ["G2", None, None, "a", None, False, None]),
            (None, ["G3", 9, 0.5, "b", "z", None, None]),
        ],
    )
    marks = memory(
        "None", ["gcp:string", "image:string", "x:string", "y:string"], [(None, ["G1", "a.jpg", "10.5", "20"])], "marks"
    )
    request = sent("georeference", {"SURVEY": survey, "GCPS": gcps, "NAME_FIELD": "name", "MARKS": marks})
    assert request["gcps"]["layer"] == "points"
    assert request["gcps"]["crs"].startswith("PROJCRS[")
    assert '"EPSG",32631]' in request["gcps"]["crs"]
    rows = read(sent.folder / "gcps.gpkg", "points")
    assert [r[0] for r in rows] == [1, 2, 3]
    assert [r[1] for r in rows] == ["POINT Z (500000 5000000 12.25)", "POINT Z (500010 5000020 13.5)", None]
    assert rows[0][2] == {"name": "G1", "n": 7, "sigma": 0.01, "fid": "a", "geom": "x", "ok": 1, "day": "2024-03-12"}
    assert rows[1][2] == {"name": "G2", "n": None, "sigma": None, "fid": "a", "geom": None, "ok": 0, "day": None}
    assert request["marks"]["crs"] is None
    assert read(sent.folder / "marks.gpkg") == [(1, None, {"gcp": "G1", "image": "a.jpg", "x": "10.5", "y": "20"})]


def test_marks_are_a_table_that_georeference_takes_back(fake_engine, qgis, survey, tmp_path):
    import processing

    fake_engine(
        f"""
        from osgeo import ogr
        Path({str(tmp_path / "request.json")!r}).write_text(json.dumps(request))
        if step == "predictmarks":
            data = ogr.GetDriverByName("GPKG").CreateDataSource(request["output"])
            table = data.CreateLayer("marks", None, ogr.wkbNone)
            for name, kind in (("gcp", ogr.OFTString), ("image", ogr.OFTString), ("x", ogr.OFTReal), ("score", ogr.OFTReal)):
                table.CreateField(ogr.FieldDefn(name, kind))
            feature = ogr.Feature(table.GetLayerDefn())
            for name, value in (("gcp", "G1"), ("image", "a.jpg"), ("x", 10.5)):
                feature.SetField(name, value)
            table.CreateFeature(feature)
            del table, data
        else:
            data = ogr.Open(request["marks"]["path"])
            Path({str(tmp_path / "marks.json")!r}).write_text(json.dumps([f.items() for f in data.GetLayer(0)]))
        counts = {{k: 1 for k in ("gcp_count", "image_count", "mark_count", "missed_count")}}
        say(type="result", result=counts if step == "predictmarks" else {{"output": request["survey"], "control_count": 1}})
        """
    )
    gcps = memory("PointZ?crs=EPSG:32631", ["name:string"], [("POINT Z (500000 5000000 12.25)", ["G1"])])
    given = {"SURVEY": survey, "GCPS": gcps, "NAME_FIELD": "name"}
    made = processing.run("strandline:predictmarks", {**given, "REFINE": "target", "OUTPUT": "TEMPORARY_OUTPUT"})
    request = json.loads((tmp_path / "request.json").read_text())
    assert (request["refine"], request["sigma_h"], request["sigma_h_field"]) == ("target", 0.01, None)
    assert (made["MARK_COUNT"], made["MISSED_COUNT"]) == (1, 1)
    processing.run("strandline:georeference", {**given, "MARKS": made["OUTPUT"]})
    (mark,) = json.loads((tmp_path / "marks.json").read_text())
    assert {k: mark[k] for k in ("gcp", "image", "x", "score")} == {"gcp": "G1", "image": "a.jpg", "x": 10.5, "score": None}


def test_only_selected_features_when_asked_and_their_own_ids(sent, survey):
    from qgis.core import QgsProcessingFeatureSourceDefinition, QgsProject

    areas = memory(
        "Polygon?crs=EPSG:4326", ["name:string"], [(f"POLYGON (({i} 0, {i + 1} 0, {i} 1, {i} 0))", [str(i)]) for i in range(5)]
    )
    QgsProject.instance().addMapLayer(areas)
    areas.selectByIds([2, 4])
    sent("enhance", {"SURVEY": survey, "IGNORE": QgsProcessingFeatureSourceDefinition(areas.id(), True)})
    assert [(r[0], r[2]["name"]) for r in read(sent.folder / "ignore.gpkg")] == [(2, "1"), (4, "3")]
    sent("enhance", {"SURVEY": survey, "IGNORE": areas.id()})
    assert len(read(sent.folder / "ignore.gpkg")) == 5
    areas.setSubsetString("")
    QgsProject.instance().removeMapLayer(areas.id())


def test_joins_virtual_fields_and_unsaved_edits_are_seen(sent, survey):
    from qgis.core import QgsField, QgsProject, QgsVectorLayerJoinInfo
    from qgis.PyQt.QtCore import QVariant

    heights = memory("None", ["id:string", "z:double"], [(None, ["G1", 4.5])], "heights")
    gcps = memory("Point?crs=EPSG:32631", ["name:string"], [("POINT (1 2)", ["G1"])])
    QgsProject.instance().addMapLayers([heights, gcps])
    join = QgsVectorLayerJoinInfo()
    join.setJoinLayer(heights)
    join.setJoinFieldName("id")
    join.setTargetFieldName("name")
    join.setUsingMemoryCache(True)
    gcps.addJoin(join)
    gcps.addExpressionField("upper('check')", QgsField("role", QVariant.String))
    gcps.startEditing()
    gcps.changeAttributeValue(1, 0, "G1")
    sent("georeference", {"SURVEY": survey, "GCPS": gcps.id(), "NAME_FIELD": "name", "MARKS": heights.id()})
    assert read(sent.folder / "gcps.gpkg")[0][2] == {"name": "G1", "heights_z": 4.5, "role": "CHECK"}
    gcps.rollBack()
    QgsProject.instance().removeMapLayers([heights.id(), gcps.id()])


def test_fields_that_differ_in_case_alone_are_refused_by_name(sent, survey):
    from qgis.core import QgsProcessingException

    areas = memory(
        "Polygon?crs=EPSG:4326", ["name:string", "extra:string"], [("POLYGON ((0 0, 1 0, 0 1, 0 0))", ["a", "b"])], "zones"
    )
    areas.startEditing()
    areas.renameAttribute(1, "NAME")
    areas.commitChanges()
    with pytest.raises(QgsProcessingException, match=r"field NAME of zones .* rename it"):
        sent("enhance", {"SURVEY": survey, "IGNORE": areas})


def write_raster(path, crs):
    from osgeo import gdal, osr

    data = gdal.GetDriverByName("GTiff").Create(str(path), 4, 4, 1, gdal.GDT_Float32)
    data.SetGeoTransform((500000, 1, 0, 5000000, 0, -1))
    if crs:
        reference = osr.SpatialReference()
        reference.ImportFromEPSG(crs)
        data.SetProjection(reference.ExportToWkt())
    data.GetRasterBand(1).Fill(1.5)
    del data


def test_rasters_go_as_files_with_the_crs_the_user_gave(sent, tmp_path):
    from qgis.core import QgsCoordinateReferenceSystem, QgsRasterLayer

    write_raster(tmp_path / "before.tif", 32631)
    write_raster(tmp_path / "after.tif", None)
    before, after = (QgsRasterLayer(str(tmp_path / f"{n}.tif"), n) for n in ("before", "after"))
    after.setCrs(QgsCoordinateReferenceSystem("EPSG:2154"))
    request = sent(
        "dsmdifference", {"BEFORE": before, "AFTER": after, "OUTPUT": str(tmp_path / "difference.tif"), "NODATA": -9999}
    )
    assert request["before"] == {"path": str(tmp_path / "before.tif"), "crs": None}
    assert request["after"]["path"] == str(tmp_path / "after.tif")
    assert '"EPSG",2154]' in request["after"]["crs"]
    assert request["output"] == str(tmp_path / "difference.tif")
    assert request["nodata"] == -9999.0
    assert request["before_sigma"] is None
    assert request["confidence"] == 0.95
    by_path = sent(
        "dsmdifference",
        {"BEFORE": str(tmp_path / "before.tif"), "AFTER": str(tmp_path / "before.tif"), "OUTPUT": "TEMPORARY_OUTPUT"},
    )
    assert by_path["before"] == {"path": str(tmp_path / "before.tif"), "crs": None}
    assert by_path["output"].endswith(".tif")


def test_a_raster_that_is_no_file_is_refused(qgis, tmp_path):
    from qgis.core import QgsProcessingException, QgsRasterLayer
    from strandline.bridge.layers import LayerError, raster_source

    layer = QgsRasterLayer("type=xyz&url=http://localhost/{z}/{x}/{y}.png", "tiles", "wms")
    with pytest.raises(LayerError, match=r"tiles is not a file .* save it as a GeoTIFF"):
        raster_source(layer)
    assert QgsProcessingException


def test_the_scheduler_of_the_options_is_used(sent, survey):
    from strandline.bridge import settings

    settings.write(settings.SCHEDULER, "tcp://cluster:8786")
    try:
        assert sent("enhance", {"SURVEY": survey})["scheduler"] == "tcp://cluster:8786"
        assert sent("enhance", {"SURVEY": survey, "SCHEDULER": "tcp://other:1"})["scheduler"] == "tcp://other:1"
    finally:
        settings.write(settings.SCHEDULER, "")


def test_the_engines_layer_becomes_the_sink_with_fields_and_crs(fake_engine, qgis, tmp_path):
    import processing
    from qgis.core import QgsVectorLayer

    fake_engine(
        """
        from osgeo import ogr, osr
        reference = osr.SpatialReference()
        reference.ImportFromEPSG(32631)
        data = ogr.GetDriverByName("GPKG").CreateDataSource(request["photos"])
        table = data.CreateLayer("photos", reference, ogr.wkbPoint25D)
        for name, kind in (("name", ogr.OFTString), ("height", ogr.OFTReal), ("n", ogr.OFTInteger64)):
            table.CreateField(ogr.FieldDefn(name, kind))
        feature = ogr.Feature(table.GetLayerDefn())
        feature.SetField("name", "a.jpg")
        feature.SetField("n", 12)
        feature.SetGeometry(ogr.CreateGeometryFromWkt("POINT Z (500000 5000000 60.5)"))
        table.CreateFeature(feature)
        del table, data
        say(type="result", result={"output": request["output"], "image_count": 1, "position_count": 1})
        """
    )
    result = processing.run(
        "strandline:createsurvey",
        {"IMAGES": str(tmp_path), "OUTPUT": str(tmp_path / "s"), "PHOTOS": str(tmp_path / "photos.gpkg")},
    )
    assert {k: result[k] for k in ("OUTPUT", "IMAGE_COUNT", "POSITION_COUNT")} == {
        "OUTPUT": str(tmp_path / "s"),
        "IMAGE_COUNT": 1,
        "POSITION_COUNT": 1,
    }
    layer = QgsVectorLayer(result["PHOTOS"], "photos", "ogr")
    assert layer.crs().authid() == "EPSG:32631"
    assert [f.name() for f in layer.fields()] == ["fid", "name", "height", "n"]
    (feature,) = layer.getFeatures()
    assert feature["name"] == "a.jpg"
    assert feature["n"] == 12
    assert not feature["height"]
    point = feature.geometry().constGet()  # whose WKT differs between releases of QGIS
    assert point.is3D()
    assert (point.x(), point.y(), point.z()) == (500000, 5000000, 60.5)


def test_a_number_that_is_not_determined_is_none(fake_engine, qgis, survey):
    import processing

    fake_engine("say(type='result', result={'output': request['survey'], 'control_count': 0, 'plani_check': None})")
    result = processing.run("strandline:georeference", {"SURVEY": survey})
    assert result["PLANI_CHECK"] is None
    assert result["CONTROL_COUNT"] == 0
    assert "RESIDUALS" not in result


@pytest.mark.parametrize(
    ("name", "parameters", "told"),
    [
        ("enhance", {"SURVEY": "/nowhere"}, "/nowhere is not a survey folder"),
        ("enhance", {"SURVEY": "SURVEY", "METHOD": "magic"}, "METHOD"),
        ("georeference", {"SURVEY": "SURVEY", "GCPS": "layer"}, "GCPS need NAME_FIELD"),
        ("georeference", {"SURVEY": "SURVEY", "GCPS": "layer", "NAME_FIELD": "name"}, "GCPS need MARKS"),
        ("predictmarks", {"SURVEY": "SURVEY", "GCPS": "layer"}, "NAME_FIELD"),
        ("georeference", {"SURVEY": "SURVEY", "USE_GNSS": False}, "Nothing to georeference with"),
        ("georeference", {"SURVEY": "SURVEY", "GCPS": "layer", "GCP_FILE": "/x"}, "exclude each other"),
    ],
)
def test_what_can_be_seen_early_is_refused_early(algorithm, survey, name, parameters, told):
    from qgis.core import QgsProcessingContext

    given = {
        k: (survey if v == "SURVEY" else memory("Point?crs=EPSG:4326", ["name:string"], []) if v == "layer" else v)
        for k, v in parameters.items()
    }
    fine, text = algorithm(name).checkParameterValues(given, QgsProcessingContext())
    assert not fine
    assert told in text


def test_a_survey_in_the_temporary_folder_is_warned_about(sent, qgis, tmp_path):
    import processing
    from qgis.core import QgsProcessingFeedback

    class Heard(QgsProcessingFeedback):
        def __init__(self):
            super().__init__(False)
            self.warnings = []

        def pushWarning(self, text):  # noqa: N802
            self.warnings.append(text)

    heard = Heard()
    processing.run("strandline:createsurvey", {"IMAGES": str(tmp_path), "OUTPUT": "TEMPORARY_OUTPUT"}, feedback=heard)
    assert any("will be gone when QGIS closes" in text for text in heard.warnings)
    heard = Heard()
    processing.run("strandline:createsurvey", {"IMAGES": str(tmp_path), "OUTPUT": str(tmp_path / "s")}, feedback=heard)
    assert heard.warnings == []
    shutil.rmtree(Path(tmp_path / "s"), ignore_errors=True)


def test_cancel_from_processing_stops_the_engine(fake_engine, qgis, survey):
    import threading
    import time

    import processing
    from qgis.core import QgsProcessingException, QgsProcessingFeedback

    fake_engine("time.sleep(60)")
    feedback = QgsProcessingFeedback(False)
    threading.Timer(0.5, feedback.cancel).start()
    start = time.monotonic()
    with pytest.raises(QgsProcessingException, match="Cancelled"):
        processing.run("strandline:enhance", {"SURVEY": survey}, feedback=feedback)
    assert time.monotonic() - start < 5.0


def test_several_rasters_bring_their_names_and_dates(sent, qgis, tmp_path):
    from qgis.core import QgsDateTimeRange, QgsProcessingException, QgsRasterLayer
    from qgis.PyQt.QtCore import QDate, QDateTime, QTime

    for name in ("a", "b"):
        (tmp_path / f"{name}.asc").write_text("ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\n1.5 2.5\n")
    layers = [QgsRasterLayer(str(tmp_path / f"{name}.asc"), f"layer {name}") for name in ("a", "b")]
    day = QDate(2018, 6, 6)
    layers[1].temporalProperties().setFixedTemporalRange(
        QgsDateTimeRange(QDateTime(day, QTime(0, 0)), QDateTime(day, QTime(23, 59)))
    )
    layers[1].temporalProperties().setIsActive(True)
    given = {"DSMS": layers, "OUTPUT": str(tmp_path / "out.gpkg"), "PRECISIONS": []}
    request = sent("timeseries", given)
    assert request["dsms"] == [
        {"path": str(tmp_path / "a.asc"), "crs": None, "name": "layer a", "date": None},
        {"path": str(tmp_path / "b.asc"), "crs": None, "name": "layer b", "date": "2018-06-06"},
    ]
    assert request["precisions"] is None
    with pytest.raises(QgsProcessingException):
        sent("timeseries", {**given, "DSMS": [layers[0], str(tmp_path / "nowhere.tif")]})
