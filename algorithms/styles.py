"""How results look when QGIS loads them.

The post-processors are made once, when this module is imported in the main thread, and live as long as it does:
QGIS keeps no reference to them.
"""

import math
from collections.abc import Iterator
from typing import Any, Callable, List, Tuple

from qgis.core import (
    Qgis,
    QgsArrowSymbolLayer,
    QgsCategorizedSymbolRenderer,
    QgsColorRampShader,
    QgsContrastEnhancement,
    QgsFillSymbol,
    QgsGraduatedSymbolRenderer,
    QgsLineSymbol,
    QgsMarkerSymbol,
    QgsMultiBandColorRenderer,
    QgsPalettedRasterRenderer,
    QgsPalLayerSettings,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingLayerPostProcessorInterface,
    QgsRasterLayer,
    QgsRasterShader,
    QgsRendererCategory,
    QgsRendererRange,
    QgsSingleBandPseudoColorRenderer,
    QgsSingleSymbolRenderer,
    QgsTextBufferSettings,
    QgsTextFormat,
    QgsVectorFieldSymbolLayer,
    QgsVectorLayer,
    QgsVectorLayerSimpleLabeling,
)
from qgis.PyQt.QtGui import QColor

from ..i18n import tr

_SAMPLES = 250_000  # cells looked at for a range: enough for percentiles, quick on any raster
_NET = "format_number(\"net\", 1) || coalesce(' ± ' || format_number(\"sigma\", 1), '') || ' m³'"
_RATE = (
    "coalesce(format_number(\"rate\", 1) || coalesce(' ± ' || format_number(\"rate_sigma\", 1), '') || ' m³/a', "
    "format_number(\"net\", 1) || ' m³')"
)
_LONGEST = 10.0  # millimetres on the map, the symbol's unit
_TERRAIN = ("#22577a", "#e9d8a6", "#d9b26f", "#a9b665", "#6a994e", "#9c7a4d", "#f2efe9")
_DIVERGING = ("#b2182b", "#ef8a62", "#fddbc7", "#f7f7f7", "#d1e5f0", "#67a9cf", "#2166ac")
_WHITE, _VISIBLE = "#f7f7f7", "#bbbbbb"  # of a line, white is not seen on a white map
_TIME = ("#fde725", "#5ec962", "#21918c", "#3b528b", "#440154")
_PLAIN = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")
_DOUBT = ("#fcfdbf", "#fc8961", "#b73779", "#51127c", "#000004")
_COUNT = ("#ffffd9", "#c7e9b4", "#41b6c4", "#225ea8", "#081d58")
_FILLED = "#e7298a"


class Style(QgsProcessingLayerPostProcessorInterface):
    """A post-processor that draws a layer with a function."""

    def __init__(self, draw: Callable[[Any], None]) -> None:
        super().__init__()
        self._draw = draw

    def postProcessLayer(self, layer: Any, context: QgsProcessingContext, feedback: QgsProcessingFeedback) -> None:
        """Style ``layer``; QGIS calls this in the main thread."""
        if layer is not None and layer.isValid():
            self._draw(layer)
            layer.triggerRepaint()


def _between(layer: QgsRasterLayer, low: float, high: float, colours: Tuple[str, ...], decimals: int = 2) -> None:
    """Draw band 1 with ``colours`` spread evenly from ``low`` to ``high``, labelled with so many ``decimals``."""
    if not high > low:
        high = low + 1.0
    step = (high - low) / (len(colours) - 1)
    ramp = QgsColorRampShader(low, high)
    ramp.setColorRampType(QgsColorRampShader.Type.Interpolated)
    ramp.setColorRampItemList(
        [
            QgsColorRampShader.ColorRampItem(low + i * step, QColor(colour), f"{low + i * step:.{decimals}f}")
            for i, colour in enumerate(colours)
        ]
    )
    shader = QgsRasterShader()
    shader.setRasterShaderFunction(ramp)
    renderer = QgsSingleBandPseudoColorRenderer(layer.dataProvider(), 1, shader)
    renderer.setClassificationMin(low)
    renderer.setClassificationMax(high)
    layer.setRenderer(renderer)


def _range(layer: QgsRasterLayer) -> Tuple[float, float]:
    """Return the 2nd and 98th percentile; of a flat raster its value, of an empty one zero."""
    provider = layer.dataProvider()
    low, high = provider.cumulativeCut(1, 0.02, 0.98, layer.extent(), _SAMPLES)
    if math.isfinite(low) and math.isfinite(high):
        return low, high
    statistics = provider.bandStatistics(1)
    value = statistics.mean if statistics.elementCount else 0.0
    return value, value


def _terrain(layer: QgsRasterLayer) -> None:
    low, high = _range(layer)
    _between(layer, low, high, _TERRAIN)


def _sequential(layer: QgsRasterLayer) -> None:
    low, high = _range(layer)
    _between(layer, low, high, _PLAIN)


def _precision(layer: QgsRasterLayer) -> None:
    """Light where heights are sure, dark where they are not, from zero on."""
    _between(layer, 0.0, _range(layer)[1], _DOUBT, 3)


def _correlation(layer: QgsRasterLayer) -> None:
    """Give the same correlation the same colour in every survey."""
    _between(layer, 0.0, 1.0, _PLAIN)


def _views(layer: QgsRasterLayer) -> None:
    """Draw each number of photographs in a colour of its own, up to eight."""
    classes = [
        QgsPalettedRasterRenderer.Class(n, _blend(_COUNT, (n - 1) / 7), tr("{} and more").format(n) if n == 8 else str(n))
        for n in range(1, 9)
    ]
    _classes(layer, [*classes, *(QgsPalettedRasterRenderer.Class(n, QColor(_COUNT[-1]), str(n)) for n in range(9, 256))])


def _filled(layer: QgsRasterLayer) -> None:
    """Draw what was interpolated alone, over whatever lies below."""
    seen, unseen = QColor(_FILLED), QColor(0, 0, 0, 0)
    found = [(0, unseen, tr("measured")), (1, seen, tr("interpolated"))]
    _classes(layer, [QgsPalettedRasterRenderer.Class(value, colour, label) for value, colour, label in found])


def _classes(layer: QgsRasterLayer, classes: List[Any]) -> None:
    layer.setRenderer(QgsPalettedRasterRenderer(layer.dataProvider(), 1, classes))


def _blend(colours: Tuple[str, ...], place: float) -> QColor:
    """Return the colour at ``place`` (0..1) of evenly spread ``colours``."""
    at = min(max(place, 0.0), 1.0) * (len(colours) - 1)
    first = min(int(at), len(colours) - 2)
    low, high, share = QColor(colours[first]), QColor(colours[first + 1]), at - first
    ends = [(c.red(), c.green(), c.blue()) for c in (low, high)]
    return QColor(*(round((1 - share) * ends[0][k] + share * ends[1][k]) for k in range(3)))


def _picture(layer: QgsRasterLayer) -> None:
    """Draw colours as they are, of 8 bits or 16, and not at all where there are none."""
    provider = layer.dataProvider()
    white = 65535.0 if provider.dataType(1) == Qgis.DataType.UInt16 else 255.0
    renderer = QgsMultiBandColorRenderer(provider, 1, 2, 3)
    for band, put in ((1, renderer.setRedContrastEnhancement), (2, renderer.setGreenContrastEnhancement),
                      (3, renderer.setBlueContrastEnhancement)):  # fmt: skip
        stretch = QgsContrastEnhancement(provider.dataType(band))
        stretch.setContrastEnhancementAlgorithm(QgsContrastEnhancement.ContrastEnhancementAlgorithm.StretchToMinimumMaximum)
        stretch.setMinimumValue(0.0)
        stretch.setMaximumValue(white)
        put(stretch)
    if layer.bandCount() >= 4:
        renderer.setAlphaBand(4)
    layer.setRenderer(renderer)


def _difference(layer: QgsRasterLayer) -> None:
    """Red where sand was lost, blue where it was gained, white at zero."""
    low, high = _range(layer)
    reach = max(abs(low), abs(high)) or 1.0
    _between(layer, -reach, reach, _DIVERGING)


def _arrows(layer: QgsVectorLayer) -> None:
    """Draw a dot per point and an arrow for its residual in plan (fields dE, dN), the longest a centimetre long."""
    places = [layer.fields().lookupField(name) for name in ("dE", "dN")]
    if min(places) < 0:
        return
    longest = max((math.hypot(*lengths) for lengths in _pairs(layer, places)), default=0.0)
    arrow = QgsVectorFieldSymbolLayer()
    arrow.setXAttribute("dE")
    arrow.setYAttribute("dN")
    arrow.setScale(_LONGEST / longest if longest > 0.0 else 1.0)
    shaft = {"color": "#b2182b", "arrow_width": "0.4", "arrow_start_width": "0.4", "head_length": "1.6", "head_thickness": "1.0"}
    line = QgsLineSymbol()
    line.changeSymbolLayer(0, QgsArrowSymbolLayer.create({**shaft, "is_curved": "0", "outline_style": "no"}))
    line.setColor(QColor("#b2182b"))
    arrow.setSubSymbol(line)
    symbol = QgsMarkerSymbol.createSimple({"name": "circle", "color": "#222222", "size": "1.6"})
    symbol.appendSymbolLayer(arrow)
    layer.setRenderer(QgsSingleSymbolRenderer(symbol))


def _pairs(layer: QgsVectorLayer, places: List[int]) -> Iterator[List[float]]:
    for feature in layer.getFeatures():
        pair = [feature.attributes()[i] for i in places]
        if all(isinstance(value, (int, float)) for value in pair):
            yield pair


def _zones(layer: QgsVectorLayer) -> None:
    """Draw outlines that leave the difference visible, each with its net volume and deviation."""
    fill = {"color": "0,0,0,0", "outline_color": "#222222", "outline_width": "0.4"}
    layer.setRenderer(QgsSingleSymbolRenderer(QgsFillSymbol.createSimple(fill)))
    label = QgsPalLayerSettings()
    label.isExpression = True
    label.fieldName = _NET
    style = QgsTextFormat()
    halo = QgsTextBufferSettings()
    halo.setEnabled(True)
    style.setBuffer(halo)
    label.setFormat(style)
    layer.setLabeling(QgsVectorLayerSimpleLabeling(label))
    layer.setLabelsEnabled(True)


def _by_date(layer: QgsVectorLayer, symbol: Callable[[str], Any]) -> None:
    """Give each date a colour, the first light, the last dark."""
    place = layer.fields().lookupField("date")
    if place < 0:
        return
    dates = sorted({value for value in layer.uniqueValues(place) if isinstance(value, str)})
    steps = max(1, len(dates) - 1)
    categories = [
        QgsRendererCategory(date, symbol(_mixed(_TIME, 1.0 if len(dates) == 1 else i / steps)), date)
        for i, date in enumerate(dates)
    ]
    layer.setRenderer(QgsCategorizedSymbolRenderer("date", categories))


def _mixed(colours: Tuple[str, ...], share: float) -> str:
    """Return the colour at ``share`` (0..1) of a ramp."""
    place = share * (len(colours) - 1)
    first = min(int(place), len(colours) - 2)
    low, high = QColor(colours[first]), QColor(colours[first + 1])
    part = place - first
    mixed = [round(low.getRgb()[i] + part * (high.getRgb()[i] - low.getRgb()[i])) for i in range(3)]
    return QColor(*mixed).name()


def _dated_lines(layer: QgsVectorLayer) -> None:
    """Draw lines in the colours of their dates."""
    _by_date(layer, lambda colour: QgsLineSymbol.createSimple({"color": colour, "width": "0.6"}))


def _heights(layer: QgsVectorLayer) -> None:
    """Draw points in the colours of a terrain by their height: points of several dates lie one on the other."""
    place = layer.fields().lookupField("height")
    if place < 0:
        return
    values = sorted(v[0] for v in _pairs(layer, [place]))
    if not values:
        return
    count = len(_TERRAIN)
    bounds = [values[round(i / count * (len(values) - 1))] for i in range(count + 1)]
    shape = {"name": "circle", "size": "1.6", "outline_style": "no"}
    ranges = []
    for i, colour in enumerate(_TERRAIN):
        symbol = QgsMarkerSymbol.createSimple({**shape, "color": colour})
        ranges.append(QgsRendererRange(bounds[i], bounds[i + 1], symbol, f"{bounds[i]:.2f} to {bounds[i + 1]:.2f} m"))
    layer.setRenderer(QgsGraduatedSymbolRenderer("height", ranges))


def _dated_points(layer: QgsVectorLayer) -> None:
    """Draw points in the colours of their dates."""
    shape = {"name": "circle", "size": "1.6", "outline_style": "no"}
    _by_date(layer, lambda colour: QgsMarkerSymbol.createSimple({**shape, "color": colour}))


def _diverging(layer: QgsVectorLayer, field: str, symbol: Callable[[str], Any]) -> None:
    """Draw red where ``field`` is negative, blue where positive, in classes even about zero."""
    place = layer.fields().lookupField(field)
    if place < 0:
        return
    sizes = sorted(abs(v[0]) for v in _pairs(layer, [place]))
    limit = sizes[int(0.95 * (len(sizes) - 1))] if sizes else 0.0
    limit = limit or 1.0
    count = len(_DIVERGING)
    edges = [-limit + 2.0 * limit * i / count for i in range(1, count)]
    low, high = min([-limit, *(-v for v in sizes)]), max([limit, *sizes])
    bounds = [low, *edges, high]
    ranges = []
    for i, colour in enumerate(_DIVERGING):
        told = f"{bounds[i]:.2f} to {bounds[i + 1]:.2f}"
        ranges.append(QgsRendererRange(bounds[i], bounds[i + 1], symbol(_VISIBLE if colour == _WHITE else colour), told))
    layer.setRenderer(QgsGraduatedSymbolRenderer(field, ranges))


def _thick(colour: str) -> QgsLineSymbol:
    return QgsLineSymbol.createSimple({"color": colour, "width": "1.0"})


def _rates(layer: QgsVectorLayer) -> None:
    """Draw transects by their rate; by their net movement where two dates give no rate."""
    place = layer.fields().lookupField("wlr")
    known = place >= 0 and any(True for _ in _pairs(layer, [place]))
    _diverging(layer, "wlr" if known else "nsm", _thick)


def _profiles(layer: QgsVectorLayer) -> None:
    """Draw transects by the change of sand since the first date; the last date lies on top."""
    _diverging(layer, "change_first", _thick)


def _zone_rates(layer: QgsVectorLayer) -> None:
    """Draw the zones as for volumes, labelled with their rate."""
    _zones(layer)
    settings = layer.labeling().settings()
    settings.fieldName = _RATE
    layer.setLabeling(QgsVectorLayerSimpleLabeling(settings))


TERRAIN = Style(_terrain)
SEQUENTIAL = Style(_sequential)
PRECISION = Style(_precision)
CORRELATION = Style(_correlation)
VIEWS = Style(_views)
FILLED = Style(_filled)
PICTURE = Style(_picture)
DIFFERENCE = Style(_difference)
RESIDUALS = Style(_arrows)
ZONES = Style(_zones)
PROFILES = Style(_profiles)
PROFILE_POINTS = Style(_heights)
SHORELINES = Style(_dated_lines)
SHORE_POSITIONS = Style(_dated_points)
SHORE_RATES = Style(_rates)
ZONE_RATES = Style(_zone_rates)
