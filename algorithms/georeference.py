"""Georeference: from the free frame to the ground."""

from collections.abc import Iterable
from typing import Any, Dict, Tuple

from qgis.core import QgsProcessingContext, QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import groundcontrol
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
        yield from groundcontrol.ground_points()
        yield from groundcontrol.marks()
        yield ask.choice(
            "METHOD",
            tr("Method"),
            tr(
                "adjustment: tie points, control points and GNSS positions are adjusted together, the camera included, so that "
                "the control also mends the shape and every sigma is that of the whole; similarity: shift, rotation and scale "
                "alone, the shape that the photographs gave stays."
            ),
            ("adjustment", "similarity"),
            default="adjustment",
        )
        yield from groundcontrol.positions_and_heights()
        yield ask.polygons(
            "IGNORE",
            tr("Areas to ignore"),
            tr("Polygons of sea, swash, vegetation, people or vehicles: tie points on what moves take no part."),
        )
        yield ask.crs("CRS", tr("CRS of the survey"), tr("Projected CRS of the results; empty: the survey's own."))
        yield ask.point_output(
            "RESIDUALS", tr("Residuals"), tr("The ground points with their residuals in metres, drawn as arrows.")
        )
        yield ask.point_output("PHOTOS", tr("Camera positions"), tr("Where each photograph was taken from, as computed."))
        yield ask.file_output(
            "TIE_POINTS",
            tr("Tie points (point cloud)"),
            tr(
                "The tie points as a LAZ file in the survey's CRS. After an adjustment each has its own predicted sigma in east, "
                "north and height (sigma_e, sigma_n, sigma_u; m), georeferencing included."
            ),
            filters=tr("LAZ files (*.laz)"),
        )
        yield ask.report()

    def checkParameterValues(self, parameters: Dict[str, Any], context: QgsProcessingContext) -> Tuple[bool, str]:
        """Refuse ground points without names or marks, and no reference at all."""
        fine, told = super().checkParameterValues(parameters, context)
        if not fine:
            return fine, told
        if wrong := groundcontrol.what_is_wrong(parameters):
            return False, wrong
        given = parameters.get("GCPS") or parameters.get("GCP_FILE")
        if not given and not self.parameterAsBool(parameters, "USE_GNSS", context):
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
