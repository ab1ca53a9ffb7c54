"""Survey layers: photographs, footprints and tie points of a survey, to draw on a map."""

from collections.abc import Iterable

from qgis.core import QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from .base import About, StepAlgorithm


class SurveyLayers(StepAlgorithm):
    """The algorithm ``strandline:surveylayers``."""

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "surveylayers",
            "survey",
            tr("Survey layers"),
            tr(
                "Writes where the photographs of a survey were taken, what ground each shows, and its tie points as layers. A "
                "survey that is not georeferenced yet gives the GNSS positions alone."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.survey()
        yield ask.integer(
            "MAX_POINTS",
            tr("Most tie points"),
            tr("So many tie points are written at most, evenly chosen among all; 0 writes all of them."),
            default=50000,
        )
        yield ask.point_output(
            "PHOTOS", tr("Photographs"), tr("Where each photograph was taken, with its file and a small picture of it.")
        )
        yield ask.polygon_output(
            "FOOTPRINTS",
            tr("Footprints"),
            tr("What each photograph shows of a level at the median height of its tie points."),
        )
        yield ask.point_output(
            "TIE_POINTS",
            tr("Tie points"),
            tr("Tie points with their height (m), the number of photographs that show each, and its residual (px)."),
        )

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the counts."""
        yield ask.result("PHOTO_COUNT", tr("Photographs"))
        yield ask.result("POINT_COUNT", tr("Tie points written"))
        yield ask.result("TIE_POINT_COUNT", tr("Tie points of the survey"))
