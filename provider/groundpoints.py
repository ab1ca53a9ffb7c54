"""Ground points of a layer, and which photographs may show them when only the photographs' positions are known."""

import math
from typing import Dict, List, NamedTuple, Optional, Sequence

from qgis.core import (
    NULL,
    QgsCoordinateReferenceSystem,
    QgsCoordinateTransform,
    QgsCsException,
    QgsFeature,
    QgsFeatureRequest,
    QgsFields,
    QgsPointXY,
    QgsProject,
    QgsVectorLayer,
)

from ..bridge.survey import Photograph

_DEGREE = 111_320.0  # metres of latitude: only the order of photographs hangs on it


class Fields(NamedTuple):
    """Which fields of the layer tell what; an empty text where none does."""

    name: str
    height: str = ""
    role: str = ""
    sigma_h: str = ""
    sigma_v: str = ""


class GroundPoint(NamedTuple):
    """A point's name, its feature, its place in the layer's CRS, and what it is for."""

    name: str
    feature: int
    place: QgsPointXY
    role: str


def likely_fields(fields: QgsFields) -> Fields:
    """Return the fields that are called as what they are most often."""
    names = {f.name().casefold(): f.name() for f in fields}

    def first(*words: str) -> str:
        return next((names[word] for word in words if word in names), "")

    name = first("name", "gcp", "label", "id", "nom", "point", "point_id")
    if not name:
        name = next((f.name() for f in fields if f.typeName().casefold().startswith(("string", "text", "varchar"))), "")
    return Fields(
        name or (fields[0].name() if len(fields) else ""),
        first("height", "z", "elevation", "altitude", "hauteur"),
        first("role", "type", "kind"),
        first("sigma_h", "sigma_xy"),
        first("sigma_v", "sigma_z"),
    )


def ground_points(layer: QgsVectorLayer, fields: Fields) -> List[GroundPoint]:
    """Return the points that have a name and a place, in the layer's order; of points with one name the first."""
    found: Dict[str, GroundPoint] = {}
    for feature in layer.getFeatures():
        name = _text(feature, fields.name)
        if name and feature.hasGeometry() and not feature.geometry().isEmpty():
            place = feature.geometry().centroid().asPoint()
            found.setdefault(name, GroundPoint(name, feature.id(), place, _text(feature, fields.role)))
    return list(found.values())


def one_point(layer: QgsVectorLayer, point: GroundPoint) -> QgsVectorLayer:
    """Return a layer in memory that holds ``point`` alone."""
    return layer.materialize(QgsFeatureRequest().setFilterFids([point.feature]))


def nearest(
    point: GroundPoint, crs: QgsCoordinateReferenceSystem, photographs: Sequence[Photograph], project: QgsProject
) -> Optional[List[Photograph]]:
    """Return the photographs with a position, those taken nearest to the point first; None when that cannot be told.

    Which of them show it depends on where they looked: nothing but the order is taken from this.
    """
    located = [(p, p.position) for p in photographs if p.position is not None]
    if not located or not crs.isValid():
        return None
    try:
        degrees = QgsCoordinateTransform(crs, QgsCoordinateReferenceSystem("EPSG:4326"), project).transform(point.place)
    except QgsCsException:
        return None
    shrink = math.cos(math.radians(degrees.y()))

    def distance(position: Sequence[Optional[float]]) -> float:
        longitude, latitude = float(position[0] or 0.0), float(position[1] or 0.0)
        return math.hypot((longitude - degrees.x()) * shrink * _DEGREE, (latitude - degrees.y()) * _DEGREE)

    return [p for p, _ in sorted(located, key=lambda pair: distance(pair[1]))]


def _text(feature: QgsFeature, field: str) -> str:
    if not field or feature.fields().lookupField(field) < 0:
        return ""
    value = feature[field]
    return "" if value is None or value == NULL else str(value).strip()
