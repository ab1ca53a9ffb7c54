"""Layers on their way through the door: to a GeoPackage the engine reads, from one it wrote."""

from pathlib import Path
from typing import Any, Dict, List, Optional

from osgeo import ogr
from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsFeature,
    QgsFeatureRequest,
    QgsFeatureSink,
    QgsFields,
    QgsProcessingFeatureSource,
    QgsRasterLayer,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QDate, QDateTime, Qt, QTime

from ..i18n import tr
from .child import Cancelled

_DAY = 86400  # seconds
_ID = "strandline_fid"  # the GeoPackage's own key, named so that no user's field is in its way


class LayerError(Exception):
    """A layer cannot be handed over; the text is one sentence for the user."""


def wkt(crs: QgsCoordinateReferenceSystem) -> Optional[str]:
    """Return ``crs`` as WKT2, None when it is not valid."""
    return crs.toWkt(QgsCoordinateReferenceSystem.WktVariant.WKT_PREFERRED) if crs.isValid() else None


def write_source(source: QgsProcessingFeatureSource, path: Path, feedback: Any) -> Dict[str, Optional[str]]:
    """Write the features ``source`` gives (the selected, the filtered) to a GeoPackage; return how to name it.

    Feature ids and Z stay. The CRS goes beside the file, as the layer states it.

    Raises
    ------
    LayerError
        When a field or feature does not fit into a GeoPackage.
    """
    request = QgsFeatureRequest()
    flag = QgsProcessingFeatureSource.Flag.FlagSkipGeometryValidityChecks  # the engine mends polygons itself
    features = []
    for feature in source.getFeatures(request, flag):
        if feedback.isCanceled():
            raise Cancelled
        features.append((feature.id(), bytes(feature.geometry().asWkb()), [_plain(v) for v in feature.attributes()]))
    # The engine's messages name the layer by this.
    layer = source.sourceName().strip() or path.stem
    _write(path, layer, [field.name() for field in source.fields()], features)
    return {"path": str(path), "layer": layer, "crs": wkt(source.sourceCrs())}


def raster_source(layer: QgsRasterLayer) -> Dict[str, Optional[str]]:
    """Return how the engine finds a raster, with its CRS where the layer's differs from the file's.

    Raises
    ------
    LayerError
        When the layer is not a file that GDAL reads.
    """
    provider = layer.dataProvider()
    if layer.providerType() != "gdal":
        told = tr("The raster {} is not a file (it comes from '{}'): save it as a GeoTIFF first.")
        raise LayerError(told.format(layer.name(), layer.providerType()))
    own = provider is not None and provider.crs() == layer.crs()
    return {"path": layer.source().partition("|")[0], "crs": None if own else wkt(layer.crs())}


def dated_source(layer: QgsRasterLayer) -> Dict[str, Optional[str]]:
    """Return how the engine finds a raster among several: also by its name, and by its day where its temporal range is one.

    Raises
    ------
    LayerError
        When the layer is not a file that GDAL reads.
    """
    date = None
    temporal = layer.temporalProperties()
    if temporal is not None and temporal.isActive():
        span = temporal.fixedTemporalRange()
        first, last = span.begin(), span.end()
        if first.isValid() and last.isValid() and first.secsTo(last) <= _DAY:
            date = first.toString("yyyy-MM-ddTHH:mm") if first == last else first.toString("yyyy-MM-dd")
    return {**raster_source(layer), "name": layer.name(), "date": date}


def open_result(path: Path) -> QgsVectorLayer:
    """Open a GeoPackage that the engine wrote.

    Raises
    ------
    LayerError
        When it cannot be read.
    """
    layer = QgsVectorLayer(str(path), path.stem, "ogr")
    if not layer.isValid():
        raise LayerError(tr("The engine's layer {} cannot be read.").format(path))
    return layer


def result_fields(layer: QgsVectorLayer) -> QgsFields:
    """Return the fields of an engine's layer without the GeoPackage's own key."""
    fields = QgsFields()
    for index, field in enumerate(layer.fields()):
        if index not in layer.primaryKeyAttributes():
            fields.append(field)
    return fields


def copy_features(layer: QgsVectorLayer, sink: QgsFeatureSink, feedback: Any) -> None:
    """Copy the features of an engine's layer to ``sink``, whose fields are ``result_fields(layer)``.

    Raises
    ------
    LayerError
        When the sink refuses a feature.
    """
    keys = layer.primaryKeyAttributes()
    fields = result_fields(layer)
    for feature in layer.getFeatures():
        if feedback.isCanceled():
            raise Cancelled
        copy = QgsFeature(fields)
        copy.setGeometry(feature.geometry())
        copy.setAttributes([v for i, v in enumerate(feature.attributes()) if i not in keys])
        if not sink.addFeature(copy, QgsFeatureSink.Flag.FastInsert):
            raise LayerError(tr("The layer {} cannot be written: {}.").format(layer.name(), sink.lastError()))
    sink.flushBuffer()


def _write(path: Path, layer: str, names: List[str], features: List[Any]) -> None:
    """Write ``features`` (id, WKB, attributes) as one layer, a table without geometry when none has any."""
    for place, name in enumerate(names):
        if name.casefold() in {other.casefold() for other in (_ID, *names[:place])}:  # SQLite's names do not tell case
            raise LayerError(tr("The field {} of {} cannot be handed to the engine: rename it.").format(name, layer))
    data = ogr.GetDriverByName("GPKG").CreateDataSource(str(path))
    spatial = any(wkb for _, wkb, _ in features)
    options = [f"FID={_ID}", "GEOMETRY_NAME=strandline_geometry", "SPATIAL_INDEX=NO"]
    table = data.CreateLayer(layer, None, ogr.wkbUnknown if spatial else ogr.wkbNone, options)
    for column, name in enumerate(names):
        table.CreateField(_field(name, [row[column] for _, _, row in features]))
    definition = table.GetLayerDefn()
    data.StartTransaction()
    for identity, wkb, row in features:
        feature = ogr.Feature(definition)
        feature.SetFID(identity)
        if wkb:
            feature.SetGeometryDirectly(ogr.CreateGeometryFromWkb(wkb))
        for column, value in enumerate(row):
            if value is not None:
                feature.SetField(column, value)
        if table.CreateFeature(feature) != 0:
            raise LayerError(tr("The feature {} of {} cannot be handed to the engine.").format(identity, layer))
    data.CommitTransaction()


def _plain(value: Any) -> Any:
    """Return an attribute as a bool, int, float or text; None for NULL."""
    if value is None or (hasattr(value, "isNull") and value.isNull()):
        return None
    if isinstance(value, (QDate, QDateTime, QTime)):
        return value.toString(Qt.DateFormat.ISODate)
    return value if isinstance(value, (bool, int, float, str)) else str(value)


def _field(name: str, values: List[Any]) -> ogr.FieldDefn:
    kinds = {type(v) for v in values if v is not None}
    if kinds and kinds <= {bool, int}:
        return ogr.FieldDefn(name, ogr.OFTInteger64)
    return ogr.FieldDefn(name, ogr.OFTReal if kinds and kinds <= {bool, int, float} else ogr.OFTString)
