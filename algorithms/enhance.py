"""Enhance photographs: 8-bit images in which tie points can be found."""

from collections.abc import Iterable

from qgis.core import QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from .base import About, StepAlgorithm


class Enhance(StepAlgorithm):
    """The algorithm ``strandline:enhance``."""

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "enhance",
            "survey",
            tr("Enhance photographs"),
            tr(
                "Raises the local contrast of bare sand so that tie points can be found on it. The enhanced images serve tie "
                "points only: the surface and the orthophoto are always made from the original photographs."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.survey()
        yield ask.choice(
            "METHOD",
            tr("Method"),
            tr(
                "bandpass: takes off as much fine noise as each photograph has and lifts its fine texture, then as arctan; it "
                "gives the most tie points on sand. arctan: each pixel against the mean and deviation of its window, through an "
                "arc tangent (Rosu et al. 2015). micmac: MicMac's variant. equalize: the image's whole histogram. none: only "
                "reduced to 8 bits."
            ),
            ("arctan", "micmac", "equalize", "none", "bandpass"),
            default="bandpass",
        )
        yield ask.integer(
            "WINDOW",
            tr("Window"),
            tr("Side of the square window in pixels, an odd number. Larger windows keep more of the broad shapes."),
            default=101,
            least=3,
        )
        yield ask.polygons(
            "IGNORE",
            tr("Areas to ignore"),
            tr(
                "Polygons of water, people or vehicles; no tie points are sought there. It needs to know where the photographs "
                "look: a georeferenced survey, or positions with yaw and height in the photographs."
            ),
        )
        yield ask.workers()
        yield ask.scheduler()
        yield ask.report()

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the survey."""
        yield ask.survey_result()
