"""Create survey: list the photographs of a flight."""

from pathlib import Path
from typing import Any, Dict, Iterable

from qgis.core import (
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingOutputDefinition,
    QgsProcessingParameterDefinition,
    QgsProcessingUtils,
)

from ..bridge.request import Values
from ..i18n import tr
from . import parameters as ask
from .base import About, StepAlgorithm


class CreateSurvey(StepAlgorithm):
    """The algorithm ``strandline:createsurvey``."""

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "createsurvey",
            "survey",
            tr("Create survey"),
            tr(
                "Makes a survey folder for the photographs of one flight: reads size, camera, time and GNSS position from each "
                "file, and chooses the CRS. The photographs stay where they are and are never changed. Every later step takes "
                "this folder and adds its own files to it."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.folder("IMAGES", tr("Folder of photographs"), tr("Photographs of one flight (JPG, TIFF); sub-folders count."))
        yield ask.words(
            "FILTER",
            tr("Only files named"),
            tr("A pattern such as *.JPG. Needed when a JPG and a RAW of the same name lie side by side: it picks one kind."),
        )
        yield ask.table(
            "POSITIONS",
            tr("Positions of the photographs"),
            tr(
                "A table (a CSV will do) with the fields image, x, y, z and, if known, sigma_h and sigma_v in metres. "
                "It replaces the positions in the photographs, for example after PPK processing."
            ),
        )
        yield ask.crs(
            "POSITIONS_CRS",
            tr("CRS of these positions"),
            tr("CRS of x and y in the table; WGS 84 (longitude, latitude) when left empty."),
        )
        yield ask.crs(
            "CRS",
            tr("CRS of the survey"),
            tr("Projected CRS of everything made from this survey. Empty: the UTM zone of the positions, if there are any."),
        )
        yield ask.folder_output("OUTPUT", tr("Survey folder"), tr("Folder to make. Choose a permanent place: it is the survey."))
        yield ask.point_output("PHOTOS", tr("Photograph positions"), tr("A point for every photograph with a position."))
        yield ask.report()

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the numbers."""
        yield ask.result("IMAGE_COUNT", tr("Photographs"))
        yield ask.result("POSITION_COUNT", tr("Photographs with a position"))

    def processAlgorithm(
        self, parameters: Values, context: QgsProcessingContext, feedback: QgsProcessingFeedback
    ) -> Dict[str, Any]:
        """Make the survey; warn when QGIS will delete it."""
        target = Path(self.parameterAsFileOutput(parameters, "OUTPUT", context)).resolve()
        if Path(QgsProcessingUtils.tempFolder()).resolve() in target.parents:
            told = tr("The survey is made in QGIS's temporary folder and will be gone when QGIS closes: {}.")
            feedback.pushWarning(told.format(target))
        return super().processAlgorithm(parameters, context, feedback)
