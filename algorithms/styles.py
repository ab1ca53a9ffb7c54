"""How results look when QGIS loads them.

The post-processors are made once, when this module is imported in the main thread, and live as long as it does:
QGIS keeps no reference to them.
"""

import math
from collections.abc import Iterator
from typing import Any, Callable, List

from qgis.core import (
    QgsColorRampShader,
    QgsMarkerSymbol,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingLayerPostProcessorInterface,
    QgsRasterLayer,
    QgsRasterShader,
    QgsSingleBandPseudoColorRenderer,
    QgsSingleSymbolRenderer,
    QgsVectorFieldSymbolLayer,
    QgsVectorLayer,
)
from qgis.PyQt.QtGui import QColor

_SAMPLES = 250_000  # cells looked at for a range: enough for percentiles, quick on any raster
_LONGEST = 10.0  # millimetres on the map, the symbol's unit
_TERRAIN = ("#22577a", "#e9d8a6", "#d9b26f", "#a9b665", "#6a994e", "#9c7a4d", "#f2efe9")
_DIVERGING = ("#b2182b", "#ef8a62", "#fddbc7", "#f7f7f7", "#d1e5f0", "#67a9cf", "#2166ac")
_PLAIN = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")


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


def _between(layer: QgsRasterLayer, low: float, high: float, colours: Any) -> None:
    """Draw band 1 with ``colours`` spread evenly from ``low`` to ``high``."""
    if not high > low:
        high = low + 1.0
    step = (high - low) / (len(colours) - 1)
    ramp = QgsColorRampShader(low, high)
    ramp.setColorRampType(QgsColorRampShader.Type.Interpolated)
    ramp.setColorRampItemList(
        [
            QgsColorRampShader.ColorRampItem(low + i * step, QColor(colour), f"{low + i * step:.2f}")
            for i, colour in enumerate(colours)
        ]
    )
    shader = QgsRasterShader()
    shader.setRasterShaderFunction(ramp)
    renderer = QgsSingleBandPseudoColorRenderer(layer.dataProvider(), 1, shader)
    renderer.setClassificationMin(low)
    renderer.setClassificationMax(high)
    layer.setRenderer(renderer)


def _percentiles(layer: QgsRasterLayer, low: float, high: float) -> Any:
    provider = layer.dataProvider()
    return provider.cumulativeCut(1, low, high, layer.extent(), _SAMPLES)


def _terrain(layer: QgsRasterLayer) -> None:
    low, high = _percentiles(layer, 0.02, 0.98)
    _between(layer, low, high, _TERRAIN)


def _sequential(layer: QgsRasterLayer) -> None:
    low, high = _percentiles(layer, 0.02, 0.98)
    _between(layer, low, high, _PLAIN)


def _difference(layer: QgsRasterLayer) -> None:
    """Red where sand was lost, blue where it was gained, white at zero."""
    low, high = _percentiles(layer, 0.02, 0.98)
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
    arrow.setColor(QColor("#b2182b"))
    symbol = QgsMarkerSymbol.createSimple({"name": "circle", "color": "#222222", "size": "1.6"})
    symbol.appendSymbolLayer(arrow)
    layer.setRenderer(QgsSingleSymbolRenderer(symbol))


def _pairs(layer: QgsVectorLayer, places: List[int]) -> Iterator[List[float]]:
    for feature in layer.getFeatures():
        pair = [feature.attributes()[i] for i in places]
        if all(isinstance(value, (int, float)) for value in pair):
            yield pair


TERRAIN = Style(_terrain)
SEQUENTIAL = Style(_sequential)
DIFFERENCE = Style(_difference)
RESIDUALS = Style(_arrows)
