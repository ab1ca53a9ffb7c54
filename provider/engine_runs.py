"""What the dock asks of the engine: its parameters, and how its answers are read."""

import tempfile
from pathlib import Path
from typing import Any, Dict, Tuple

from qgis.core import QgsCoordinateReferenceSystem, QgsProject, QgsVectorLayer

from ..bridge.survey import SurveyView
from ..i18n import tr
from .groundpoints import Fields
from .judgement import Prediction
from .marks import Key, Mark, Marks, number

#: What a georeferencing from the dock takes over from the last one of the survey, by the names in its record.
_REPEATED = ("sigma_h", "sigma_v", "sigma_mark", "method", "use_gnss", "lever_arm", "gcp_heights", "gnss_heights", "geoid")


def prediction_parameters(survey: SurveyView, points: QgsVectorLayer, fields: Fields, refine: str) -> Dict[str, Any]:
    """Return the parameters of 'Predict marks'; sigmas of points without one as in the last georeferencing."""
    standing = survey.parameters("georeference")
    return {
        "SURVEY": str(survey.folder),
        "GCPS": points,
        **_fields(fields, roles=False),
        **{k.upper(): standing[k] for k in ("sigma_h", "sigma_v") if standing.get(k)},
        "REFINE": refine,
        "OUTPUT": _temporary("predicted.gpkg"),
    }


def adjustment_parameters(
    survey: SurveyView, points: QgsVectorLayer, fields: Fields, marks: QgsVectorLayer
) -> Tuple[Dict[str, Any], bool]:
    """Return the parameters of 'Georeference', and whether areas that the last one ignored are missing from them.

    Everything but points and marks is as in the last georeferencing of the survey.
    """
    standing = survey.parameters("georeference")
    repeated = {k.upper(): standing[k] for k in _REPEATED if standing.get(k) is not None}
    if standing.get("crs"):
        repeated["CRS"] = QgsCoordinateReferenceSystem.fromWkt(standing["crs"])
    parameters = {
        **repeated,
        "SURVEY": str(survey.folder),
        "GCPS": points,
        **_fields(fields, roles=True),
        "MARKS": marks,
        "RESIDUALS": _temporary("residuals.gpkg"),
    }
    return parameters, bool(standing.get("ignore"))


def gnss_parameters(survey: SurveyView) -> Dict[str, Any]:
    """Return the parameters of 'Georeference' by the photographs' positions alone."""
    return {"SURVEY": str(survey.folder), "USE_GNSS": True}


def read_predictions(layer: QgsVectorLayer) -> Dict[Key, Prediction]:
    """Return the predictions in the order of the rows."""
    return {(str(f["gcp"]), str(f["image"])): Prediction(f["x"], f["y"], number(f["sigma"])) for f in layer.getFeatures()}


def read_measured(layer: QgsVectorLayer) -> Marks:
    """Return the targets that were measured."""
    return {(str(f["gcp"]), str(f["image"])): Mark(f["x"], f["y"], number(f["score"])) for f in layer.getFeatures()}


def opened(place: Any) -> QgsVectorLayer:
    """Return a layer that an algorithm wrote: named by its file, or by its id when its dialog loaded it."""
    layer = QgsProject.instance().mapLayer(str(place))
    return layer if layer is not None else QgsVectorLayer(str(place), Path(str(place)).stem, "ogr")


def centimetres(value: Any) -> str:
    """Return metres in words."""
    return tr("none") if value is None else f"{100.0 * value:.1f} cm"


def _fields(fields: Fields, *, roles: bool) -> Dict[str, Any]:
    given = {"NAME_FIELD": fields.name, "HEIGHT_FIELD": fields.height}
    given.update({"SIGMA_H_FIELD": fields.sigma_h, "SIGMA_V_FIELD": fields.sigma_v})
    if roles:
        given["ROLE_FIELD"] = fields.role
    return {key: field for key, field in given.items() if field}


def _temporary(name: str) -> str:
    return str(Path(tempfile.mkdtemp(prefix="strandline-dock-")) / name)
