"""Orient: where the cameras stood, from tie points alone."""

from collections.abc import Iterable

from qgis.core import QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from .base import About, StepAlgorithm


class Orient(StepAlgorithm):
    """The algorithm ``strandline:orient``."""

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "orient",
            "survey",
            tr("Orient photographs"),
            tr(
                "Finds from the tie points where each photograph was taken and how the camera draws, in a free frame without "
                "scale. 'Georeference' brings the result to the ground."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.survey()
        yield ask.choice(
            "CAMERA_MODEL",
            tr("Camera model"),
            tr(
                "brown: focal length, principal point, two radial and two tangential terms; radial: focal length, principal "
                "point, two radial terms; simple_radial: one radial term; full: with rational radial terms, for wide lenses "
                "and many photographs."
            ),
            ("brown", "radial", "simple_radial", "full"),
            default="brown",
        )
        yield ask.folder(
            "CALIBRATION",
            tr("Calibration from the survey"),
            tr("Another survey, already oriented, flown with the same camera and focus: its calibration is used."),
            optional=True,
        )
        yield ask.choice(
            "CALIBRATION_USE",
            tr("Use of that calibration"),
            tr("prior: a start that may be refined; fixed: kept as it is."),
            ("prior", "fixed"),
            default="prior",
        )
        yield ask.choice(
            "MAPPER",
            tr("Mapper"),
            tr("incremental: photograph by photograph; global: all at once, quicker on large blocks; auto chooses."),
            ("auto", "incremental", "global"),
            default="auto",
        )
        yield ask.file_output(
            "TIE_POINTS",
            tr("Tie points (point cloud)"),
            tr("The oriented tie points as a LAZ file, in the free frame."),
            filters=tr("LAZ files (*.laz)"),
        )
        yield ask.workers()
        yield ask.scheduler()
        yield ask.report()

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the survey and MicMac's statistics."""
        yield ask.survey_result()
        yield ask.result("ORIENTED_COUNT", tr("Oriented photographs"))
        yield ask.result("MTP", tr("Mean tie points per photograph"))
        yield ask.result("MTP_PERCENT", tr("Tie points kept (%)"))
        yield ask.result("MMTP", tr("Mean multiple tie points per photograph"))
        yield ask.result("MMTP_PERCENT", tr("Multiple tie points (%)"))
        yield ask.result("MSE", tr("Mean residual (px)"))
