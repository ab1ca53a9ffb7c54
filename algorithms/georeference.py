"""Georeference: from the free frame to the ground."""

from collections.abc import Iterable
from typing import Any, Dict, Tuple

from qgis.core import QgsProcessingContext, QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from .base import About, StepAlgorithm
from .styles import RESIDUALS


class Georeference(StepAlgorithm):
    """The algorithm ``strandline:georeference``."""

    STYLES = {"RESIDUALS": RESIDUALS}

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "georeference",
            "survey",
            tr("Georeference"),
            tr(
                "Brings an oriented survey to the ground with control points, with the positions of the photographs, or with "
                "both, and says how well: on control points, on check points that took no part, and by leaving each control "
                "point out in turn."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.survey()
        yield from self._ground_points()
        yield from self._marks()
        yield ask.choice(
            "METHOD",
            tr("Method"),
            tr(
                "similarity: shift, rotation and scale alone, the shape of the block stays; adjustment: a bundle adjustment in "
                "which the control points also mend the shape."
            ),
            ("adjustment", "similarity"),
            default="similarity",
        )
        yield ask.switch(
            "USE_GNSS",
            tr("Use the positions of the photographs"),
            tr("The photographs' GNSS positions take part, each with the accuracy it claims."),
            default=True,
        )
        yield ask.words(
            "LEVER_ARM",
            tr("Lever arm"),
            tr("From the camera to the GNSS antenna in metres, three numbers: right, forward, up, of the levelled aircraft."),
        )
        heights = ("ellipsoidal", "orthometric", "unknown")
        yield ask.choice(
            "GCP_HEIGHTS",
            tr("Heights of the ground points"),
            tr("What the ground points' heights refer to: the ellipsoid, or mean sea level (orthometric)."),
            heights,
            default="unknown",
        )
        yield ask.choice(
            "GNSS_HEIGHTS",
            tr("Heights of the photographs"),
            tr("What the heights of the photographs' positions refer to: the ellipsoid, or mean sea level (orthometric)."),
            heights,
            default="unknown",
        )
        yield ask.file(
            "GEOID",
            tr("Geoid"),
            tr("A raster of geoid heights, or one number in metres. Needed when the two kinds of heights differ."),
        )
        yield ask.polygons(
            "IGNORE",
            tr("Areas to ignore"),
            tr("Polygons of water, people or vehicles; tie points in them take no part."),
        )
        yield ask.crs("CRS", tr("CRS of the survey"), tr("Projected CRS of the results; empty: the survey's own."))
        yield ask.point_output(
            "RESIDUALS", tr("Residuals"), tr("The ground points with their residuals in metres, drawn as arrows.")
        )
        yield ask.point_output("PHOTOS", tr("Camera positions"), tr("Where each photograph was taken from, as computed."))
        yield ask.report()

    def _ground_points(self) -> Iterable[QgsProcessingParameterDefinition]:
        yield ask.points("GCPS", tr("Ground points"), tr("Points surveyed on the ground: control points and check points."))
        yield ask.field("NAME_FIELD", tr("Field of names"), tr("The field that names each ground point."), of="GCPS")
        yield ask.field(
            "HEIGHT_FIELD", tr("Field of heights"), tr("The field with the height; empty: the Z of the points."), of="GCPS"
        )
        yield ask.field(
            "ROLE_FIELD",
            tr("Field of roles"),
            tr("The field that says 'control' or 'check'. Check points take no part and tell the accuracy."),
            of="GCPS",
        )
        yield ask.number(
            "SIGMA_H", tr("Accuracy in plan (m)"), tr("Standard deviation of the ground points in plan."), default=0.01
        )
        yield ask.number(
            "SIGMA_V", tr("Accuracy in height (m)"), tr("Standard deviation of the ground points in height."), default=0.02
        )
        yield ask.field(
            "SIGMA_H_FIELD", tr("Field of accuracy in plan"), tr("Where the accuracy differs from point to point."), of="GCPS"
        )
        yield ask.field(
            "SIGMA_V_FIELD", tr("Field of accuracy in height"), tr("Where the accuracy differs from point to point."), of="GCPS"
        )

    def _marks(self) -> Iterable[QgsProcessingParameterDefinition]:
        yield ask.table(
            "MARKS",
            tr("Marks in the photographs"),
            tr("A table (a CSV will do) with the fields gcp, image, x, y: where each ground point is seen, in pixels."),
        )
        yield ask.file(
            "GCP_FILE",
            tr("File of ground points and marks"),
            tr("Instead of both: a gcp_list.txt of OpenDroneMap, or markers of Metashape as XML."),
        )
        yield ask.words("CHECK", tr("Check points"), tr("Names of ground points that shall only check, separated by commas."))
        yield ask.number("SIGMA_MARK", tr("Accuracy of the marks (px)"), tr("Standard deviation of a mark."), default=0.5)

    def checkParameterValues(self, parameters: Dict[str, Any], context: QgsProcessingContext) -> Tuple[bool, str]:
        """Refuse ground points without names or marks, and no reference at all."""
        fine, told = super().checkParameterValues(parameters, context)
        if not fine:
            return fine, told
        layer, file = parameters.get("GCPS"), parameters.get("GCP_FILE")
        if layer and file:
            return False, tr("GCPS and GCP_FILE exclude each other: give one of them.")
        if layer and not parameters.get("NAME_FIELD"):
            return False, tr("GCPS need NAME_FIELD: name the field with the points' names.")
        if layer and not parameters.get("MARKS"):
            return False, tr("GCPS need MARKS: give the table of their places in the photographs.")
        if not layer and not file and not self.parameterAsBool(parameters, "USE_GNSS", context):
            return False, tr("Nothing to georeference with: give GCPS with MARKS, GCP_FILE, or USE_GNSS.")
        return True, ""

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the survey, counts and root mean square errors."""
        yield ask.survey_result()
        yield ask.result("CONTROL_COUNT", tr("Control points"))
        yield ask.result("CHECK_COUNT", tr("Check points"))
        yield ask.result("PLANI_CONTROL", tr("Error on control points, plan (m)"))
        yield ask.result("ALTI_CONTROL", tr("Error on control points, height (m)"))
        yield ask.result("PLANI_CHECK", tr("Error on check points, plan (m)"))
        yield ask.result("ALTI_CHECK", tr("Error on check points, height (m)"))
        yield ask.result("PLANI_LOO", tr("Error on points left out, plan (m)"))
        yield ask.result("ALTI_LOO", tr("Error on points left out, height (m)"))
        yield ask.result("PLANI_GNSS", tr("Residual of the photographs' positions, plan (m)"))
        yield ask.result("ALTI_GNSS", tr("Residual of the photographs' positions, height (m)"))
        yield ask.result("DOMING", tr("Doming (m)"))
