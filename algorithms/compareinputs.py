"""Compare inputs: JPG, RAW and both enhanced, of the same flight side by side."""

from collections.abc import Iterable
from typing import Any, Dict, Tuple

from qgis.core import QgsProcessingContext, QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import groundcontrol
from . import parameters as ask
from .base import About, StepAlgorithm


class CompareInputs(StepAlgorithm):
    """The algorithm ``strandline:compareinputs``."""

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "compareinputs",
            "tools",
            tr("Compare inputs"),
            tr(
                "Takes the same flight four times through tie points, orientation and georeferencing, with the same settings: as "
                "JPG, as RAW, and both enhanced (CeJPG, CeRAW); as JPG alone it makes two cases. The report says which gives the "
                "most tie points, the best coverage and the smallest errors on check points on your ground, and whether "
                "enhancement and RAW were worth it. It takes as long as all the cases together: try it on a part of a flight."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.folder(
            "JPG", tr("Folder of JPG photographs"), tr("Photographs of one flight (JPG, TIFF, PNG); sub-folders count.")
        )
        yield ask.folder(
            "RAW",
            tr("Folder of RAW photographs"),
            tr("The same exposures as RAW, under the same names; it may be the same folder. Empty: JPG alone, two cases."),
            optional=True,
        )
        yield from groundcontrol.ground_points()
        yield from groundcontrol.marks()
        yield ask.table(
            "MARKS_RAW",
            tr("Marks in the RAW photographs"),
            tr(
                "Only where the camera straightens its JPG, so that the RAW shows a point elsewhere by more than a shift; a JPG "
                "that is merely cut out of the RAW is recognised."
            ),
        )
        yield from groundcontrol.positions_and_heights()
        yield ask.crs("CRS", tr("CRS of the surveys"), tr("Projected CRS of the results; empty: the UTM zone of the positions."))
        yield ask.choice(
            "METHOD",
            tr("Enhancement"),
            tr("How the enhanced cases are enhanced, as in 'Enhance photographs'; the others are only reduced to 8 bits."),
            ("arctan", "micmac", "equalize", "bandpass"),
            default="bandpass",
        )
        yield ask.integer(
            "WINDOW", tr("Window"), tr("Side of the enhancement's square window in pixels, an odd number."), default=101, least=3
        )
        yield ask.integer(
            "MAX_SIZE",
            tr("Longest side"),
            tr("Photographs are reduced to this many pixels on their longer side before features are sought; 0 is full size."),
            default=0,
        )
        yield ask.choice(
            "CAMERA_MODEL",
            tr("Camera model"),
            tr("The lens distortion that is estimated, as in 'Orient photographs'."),
            ("brown", "radial", "simple_radial", "full"),
            default="brown",
        )
        yield ask.table_output(
            "TABLE", tr("Comparison"), tr("A row for each case: tie points, their residual, coverage, errors on ground points.")
        )
        yield ask.folder_output(
            "SURVEYS",
            tr("Folder to keep the surveys in"),
            tr("The survey of each case is kept there, and an interrupted comparison goes on. Empty: they go at the end."),
            optional=True,
        )
        yield ask.threshold()
        yield ask.workers()
        yield ask.scheduler()
        yield ask.report(kept=False)

    def checkParameterValues(self, parameters: Dict[str, Any], context: QgsProcessingContext) -> Tuple[bool, str]:
        """Refuse ground points without names or marks."""
        fine, told = super().checkParameterValues(parameters, context)
        if fine and (wrong := groundcontrol.what_is_wrong(parameters)):
            return False, wrong
        return fine, told

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the tie points of each case."""
        yield ask.result("IMAGE_COUNT", tr("Exposures compared"))
        yield ask.result("MTP_JPG", tr("Tie points per photograph, JPG"))
        yield ask.result("MTP_RAW", tr("Tie points per photograph, RAW"))
        yield ask.result("MTP_CEJPG", tr("Tie points per photograph, enhanced JPG"))
        yield ask.result("MTP_CERAW", tr("Tie points per photograph, enhanced RAW"))
        yield ask.result("MTP_RATIO", tr("Most tie points over those of the JPG"))
