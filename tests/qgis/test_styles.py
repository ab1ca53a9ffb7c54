"""How results look when QGIS loads them."""

import math
import struct

import pytest


def make_raster(path, values):
    from osgeo import gdal, osr

    data = gdal.GetDriverByName("GTiff").Create(str(path), len(values[0]), len(values), 1, gdal.GDT_Float32)
    data.SetGeoTransform((500000, 1, 0, 5000000, 0, -1))
    reference = osr.SpatialReference()
    reference.ImportFromEPSG(32631)
    data.SetProjection(reference.ExportToWkt())
    band = data.GetRasterBand(1)
    band.SetNoDataValue(-9999)
    for row, line in enumerate(values):
        band.WriteRaster(0, row, len(line), 1, struct.pack(f"{len(line)}f", *line), buf_type=gdal.GDT_Float32)
    del band, data


def drawn(path, style):
    from qgis.core import QgsRasterLayer

    layer = QgsRasterLayer(str(path), "layer")
    style.postProcessLayer(layer, None, None)
    return layer


def ramp(layer):
    return layer.renderer().shader().rasterShaderFunction().colorRampItemList()


def test_a_difference_is_white_at_zero_red_below_blue_above(qgis, tmp_path):
    from strandline.algorithms import styles

    make_raster(tmp_path / "d.tif", [[-2.0] * 20, [0.5] * 20, [0.0] * 20, [-9999.0] * 20])
    items = ramp(drawn(tmp_path / "d.tif", styles.DIFFERENCE))
    values = [item.value for item in items]
    assert values == pytest.approx([-v for v in reversed(values)])
    assert values[0] == pytest.approx(-2.0, abs=0.02)  # the histogram's step
    middle = items[len(items) // 2]
    assert middle.value == pytest.approx(0.0, abs=1e-9)
    assert middle.color.red() == middle.color.green() == middle.color.blue() > 240
    assert items[0].color.red() > items[0].color.blue()
    assert items[-1].color.blue() > items[-1].color.red()


@pytest.mark.parametrize("values", [[[1.0, 1.0], [1.0, 1.0]], [[-9999.0, -9999.0], [-9999.0, -9999.0]]])
def test_a_flat_or_empty_raster_is_drawn_too(qgis, tmp_path, values):
    from strandline.algorithms import styles

    make_raster(tmp_path / "r.tif", values)
    for style in (styles.TERRAIN, styles.DIFFERENCE, styles.SEQUENTIAL):
        found = [item.value for item in ramp(drawn(tmp_path / "r.tif", style))]
        assert found == sorted(found)
        assert all(map(math.isfinite, found))
        assert found[0] < found[-1]


def test_correlation_and_precision_start_where_they_mean_something(qgis, tmp_path):
    from strandline.algorithms import styles

    make_raster(tmp_path / "c.tif", [[0.4] * 20, [0.8] * 20])
    assert [item.value for item in ramp(drawn(tmp_path / "c.tif", styles.CORRELATION))] == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    found = [item.value for item in ramp(drawn(tmp_path / "c.tif", styles.PRECISION))]
    assert found[0] == 0.0
    assert found[-1] == pytest.approx(0.8, abs=0.01)


def test_counts_and_filled_cells_are_classes(qgis, tmp_path):
    from strandline.algorithms import styles

    make_raster(tmp_path / "n.tif", [[1.0] * 4, [8.0] * 4, [200.0] * 4])
    layer = drawn(tmp_path / "n.tif", styles.VIEWS)  # owns its renderer
    classes = {c.value: c for c in layer.renderer().classes()}
    assert classes[8].label == "8 and more"
    assert classes[200].color == classes[8].color != classes[1].color
    layer = drawn(tmp_path / "n.tif", styles.FILLED)
    classes = {c.value: c for c in layer.renderer().classes()}
    assert classes[0].color.alpha() == 0
    assert classes[1].color.alpha() == 255


@pytest.mark.parametrize(("bits", "white"), [(8, 255.0), (16, 65535.0)])
def test_an_orthophoto_is_drawn_as_it_is(qgis, tmp_path, bits, white):
    from osgeo import gdal
    from qgis.core import QgsMultiBandColorRenderer
    from strandline.algorithms import styles

    kind = gdal.GDT_Byte if bits == 8 else gdal.GDT_UInt16
    data = gdal.GetDriverByName("GTiff").Create(str(tmp_path / "o.tif"), 4, 4, 4, kind, ["PHOTOMETRIC=RGB", "ALPHA=YES"])
    data.SetGeoTransform((500000, 1, 0, 5000000, 0, -1))
    for band in range(1, 5):
        data.GetRasterBand(band).Fill(white / 2)
    del data
    layer = drawn(tmp_path / "o.tif", styles.PICTURE)  # owns its renderer
    renderer = layer.renderer()
    assert isinstance(renderer, QgsMultiBandColorRenderer)
    assert (renderer.redBand(), renderer.greenBand(), renderer.blueBand(), renderer.alphaBand()) == (1, 2, 3, 4)
    assert renderer.blueContrastEnhancement().maximumValue() == white
    assert renderer.blueContrastEnhancement().minimumValue() == 0.0


def test_residuals_are_arrows_of_a_centimetre_at_most(qgis):
    from qgis.core import QgsFeature, QgsGeometry, QgsVectorLayer
    from strandline.algorithms import styles

    layer = QgsVectorLayer("Point?crs=EPSG:32631&field=name:string&field=dE:double&field=dN:double", "residuals", "memory")
    for name, east, north in (("G1", 0.03, -0.04), ("G2", 0.01, 0.0), ("G3", None, None)):
        feature = QgsFeature(layer.fields())
        feature.setAttributes([name, east, north])
        feature.setGeometry(QgsGeometry.fromWkt("POINT (1 2)"))
        layer.dataProvider().addFeature(feature)
    styles.RESIDUALS.postProcessLayer(layer, None, None)
    arrow = layer.renderer().symbol().symbolLayer(1)
    assert (arrow.xAttribute(), arrow.yAttribute()) == ("dE", "dN")
    assert arrow.scale() * 0.05 == pytest.approx(10.0)


def test_zones_are_outlines_labelled_with_their_net_volume(qgis):
    from qgis.core import QgsExpression, QgsExpressionContext, QgsFeature, QgsVectorLayer
    from strandline.algorithms import styles

    layer = QgsVectorLayer("Polygon?crs=EPSG:32631&field=net:double&field=sigma:double", "volumes", "memory")
    styles.ZONES.postProcessLayer(layer, None, None)
    assert layer.labelsEnabled()
    assert layer.renderer().symbol().color().alpha() == 0
    expression = QgsExpression(layer.labeling().settings().fieldName)
    context = QgsExpressionContext()
    told = []
    for row in ([-12.34, 1.5], [3.0, None]):
        feature = QgsFeature(layer.fields())
        feature.setAttributes(row)
        context.setFeature(feature)
        context.setFields(layer.fields())
        told.append(expression.evaluate(context))
    assert told == ["-12.3 ± 1.5 m³", "3.0 m³"]


def test_lines_of_dates_and_of_rates_are_told_apart_by_colour(qgis):
    from qgis.core import QgsFeature, QgsVectorLayer
    from strandline.algorithms import styles

    layer = QgsVectorLayer("LineString?crs=EPSG:32631&field=date:string&field=wlr:double", "lines", "memory")
    for row in (["2018-06-06", -2.0], ["2019-07-31", 0.0], ["2019-07-31", 0.5], ["2019-07-31", None]):
        feature = QgsFeature(layer.fields())
        feature.setAttributes(row)
        layer.dataProvider().addFeature(feature)
    styles.SHORELINES.postProcessLayer(layer, None, None)
    assert [c.value() for c in layer.renderer().categories()] == ["2018-06-06", "2019-07-31"]
    first, last = (c.symbol().color() for c in layer.renderer().categories())
    assert first.lightness() > last.lightness()
    styles.SHORE_RATES.postProcessLayer(layer, None, None)
    ranges = layer.renderer().ranges()
    assert ranges[0].lowerValue() == -ranges[-1].upperValue() == pytest.approx(-2.0)
    assert ranges[0].symbol().color().red() > ranges[0].symbol().color().blue()
    assert ranges[-1].symbol().color().blue() > ranges[-1].symbol().color().red()


def test_a_result_that_is_to_be_loaded_gets_its_style(algorithm, fake_engine, tmp_path):
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback, QgsProcessingOutputLayerDefinition, QgsProject
    from strandline.algorithms import styles

    (tmp_path / "survey.json").write_text("{}")
    fake_engine("say(type='result', result={'output': request['output'], 'precision': request['precision']})")
    dsm, precision = tmp_path / "dsm.tif", tmp_path / "precision.tif"
    context = QgsProcessingContext()
    context.setProject(QgsProject.instance())
    parameters = {
        "SURVEY": str(tmp_path),
        "OUTPUT": QgsProcessingOutputLayerDefinition(str(dsm), QgsProject.instance()),
        "PRECISION": QgsProcessingOutputLayerDefinition(str(precision), QgsProject.instance()),
    }
    results, fine = algorithm("exportdsm").run(parameters, context, QgsProcessingFeedback())
    assert fine
    assert results["OUTPUT"] == str(dsm)
    assert set(context.layersToLoadOnCompletion()) == {str(dsm), str(precision)}
    assert context.layerToLoadOnCompletionDetails(str(dsm)).postProcessor() is styles.TERRAIN
    assert context.layerToLoadOnCompletionDetails(str(precision)).postProcessor() is styles.PRECISION
