"""Predict marks: where each ground point appears in the photographs."""

from collections.abc import Iterable

from qgis.core import QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import groundcontrol
from . import parameters as ask
from .base import About, StepAlgorithm


class PredictMarks(StepAlgorithm):
    """The algorithm ``strandline:predictmarks``."""

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "predictmarks",
            "survey",
            tr("Predict marks"),
            tr(
                "Tells where each ground point appears in which photograph of a georeferenced survey, and how well that is "
                "known; painted and coded targets are measured there. The table is what 'Georeference' takes as marks: "
                "georeference with the positions of the photographs or with a few marks first, predict, and georeference again."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.survey()
        yield from groundcontrol.known_points()
        yield ask.choice(
            "REFINE",
            tr("Measure the targets"),
            tr(
                "none: predictions only, to be corrected by eye; target: black-and-white targets of four alternating quadrants, "
                "or crosses on a plain ground; code: ArUco and AprilTag codes whose number the point's name ends with. Only "
                "targets that are found enter the table, the others are named in the report."
            ),
            ("none", "target", "code"),
            default="none",
        )
        yield ask.table_output(
            "OUTPUT",
            tr("Marks"),
            tr(
                "A row for each mark: gcp, image, x and y in pixels from the top-left corner, sigma of an axis in pixels, and "
                "the score of a target that was found, from 0 to 1."
            ),
            optional=False,
        )
        yield ask.workers()
        yield ask.scheduler()
        yield ask.report()

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the counts."""
        yield ask.result("GCP_COUNT", tr("Ground points with a mark"))
        yield ask.result("IMAGE_COUNT", tr("Photographs with a mark"))
        yield ask.result("MARK_COUNT", tr("Marks"))
        yield ask.result("MISSED_COUNT", tr("Marks predicted but not found"))
