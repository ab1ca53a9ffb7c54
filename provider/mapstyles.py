"""How the layers of a survey are drawn in the map."""

import math

from qgis.core import (
    QgsArrowSymbolLayer,
    QgsClassificationQuantile,
    QgsFillSymbol,
    QgsGradientColorRamp,
    QgsGraduatedSymbolRenderer,
    QgsHillshadeRenderer,
    QgsLineSymbol,
    QgsMarkerSymbol,
    QgsPalLayerSettings,
    QgsRasterLayer,
    QgsSingleSymbolRenderer,
    QgsTextBufferSettings,
    QgsTextFormat,
    QgsUnitTypes,
    QgsVectorFieldSymbolLayer,
    QgsVectorLayer,
    QgsVectorLayerSimpleLabeling,
)
from qgis.PyQt.QtGui import QColor, QPainter

_SHARE = 0.08  # of the layer's extent: how long the longest residual is drawn
_TIP = (
    '<b>[% "name" %]</b><br>[% coalesce("time", \'\') %]'
    "<br><img width=\"320\" src=\"file:///[% ltrim(replace(\"thumbnail\", '\\\\', '/'), '/') %]\">"
)


def draw_photographs(layer: QgsVectorLayer) -> None:
    """Draw small triangles, with the picture in the map tip."""
    symbol = {"name": "triangle", "color": "#2166ac", "outline_color": "#ffffff", "outline_width": "0.2", "size": "2.4"}
    layer.setRenderer(QgsSingleSymbolRenderer(QgsMarkerSymbol.createSimple(symbol)))
    layer.setMapTipTemplate(_TIP)
    layer.setDisplayExpression('"name"')


def draw_footprints(layer: QgsVectorLayer) -> None:
    """Draw outlines, filled so faintly that overlap adds up to what one looks for."""
    fill = {"color": "33,102,172,12", "outline_color": "33,102,172,150", "outline_width": "0.2"}
    layer.setRenderer(QgsSingleSymbolRenderer(QgsFillSymbol.createSimple(fill)))
    layer.setDisplayExpression('"name"')


def draw_tie_points(layer: QgsVectorLayer) -> None:
    """Draw points by their height."""
    symbol = QgsMarkerSymbol.createSimple({"name": "circle", "size": "0.8", "outline_style": "no"})
    ramp = QgsGradientColorRamp(QColor("#22577a"), QColor("#f2e8b6"))
    renderer = QgsGraduatedSymbolRenderer("height")
    renderer.setSourceSymbol(symbol)
    renderer.setClassificationMethod(QgsClassificationQuantile())
    renderer.updateClasses(layer, 7)
    renderer.updateColorRamp(ramp)
    layer.setRenderer(renderer)


def draw_residuals(layer: QgsVectorLayer) -> float:
    """Draw arrows in plan, with name and height residual; return how many times they are enlarged."""
    factor = enlargement(layer)
    arrow = QgsVectorFieldSymbolLayer()
    arrow.setXAttribute("dE")
    arrow.setYAttribute("dN")
    arrow.setScale(factor)
    arrow.setDistanceUnit(QgsUnitTypes.RenderUnit.RenderMapUnits)
    line = QgsLineSymbol()
    shaft = {"arrow_width": "0.5", "arrow_start_width": "0.5", "head_length": "1.8", "head_thickness": "1.2", "is_curved": "0"}
    line.changeSymbolLayer(0, QgsArrowSymbolLayer.create({**shaft, "outline_style": "no"}))
    line.setColor(QColor("#b2182b"))
    arrow.setSubSymbol(line)
    symbol = QgsMarkerSymbol.createSimple({"name": "cross", "color": "#222222", "size": "2.4", "outline_width": "0.4"})
    symbol.appendSymbolLayer(arrow)
    layer.setRenderer(QgsSingleSymbolRenderer(symbol))
    label = QgsPalLayerSettings()
    label.isExpression = True
    label.fieldName = "\"name\" || coalesce(' ' || format_number(100 * \"dU\", 1) || ' cm', '')"
    style, halo = QgsTextFormat(), QgsTextBufferSettings()
    halo.setEnabled(True)
    style.setBuffer(halo)
    label.setFormat(style)
    layer.setLabeling(QgsVectorLayerSimpleLabeling(label))
    layer.setLabelsEnabled(True)
    return factor


def enlargement(layer: QgsVectorLayer) -> float:
    """Return a round number with which the longest residual is as long as a part of the layer's extent."""
    longest = 0.0
    for feature in layer.getFeatures():
        parts = [feature["dE"], feature["dN"]]
        if all(isinstance(part, (int, float)) for part in parts):
            longest = max(longest, math.hypot(*parts))
    reach = math.hypot(layer.extent().width(), layer.extent().height())
    wanted = _SHARE * reach / longest if longest > 0.0 and reach > 0.0 else 100.0
    power = 10.0 ** math.floor(math.log10(wanted))
    return max(1.0, power * max(step for step in (1, 2, 5) if step * power <= wanted * (1 + 1e-9)))


def draw_hillshade(layer: QgsRasterLayer) -> None:
    """Shade the surface, laid over its colours."""
    renderer = QgsHillshadeRenderer(layer.dataProvider(), 1, 315.0, 45.0)
    renderer.setMultiDirectional(True)
    renderer.setZFactor(2.0)  # beaches are flat
    layer.setRenderer(renderer)
    layer.setBlendMode(QPainter.CompositionMode.CompositionMode_Multiply)
