"""Simulate survey: photographs of a beach that never was, and the truth about it."""

from collections.abc import Iterable

from qgis.core import QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from .base import About, StepAlgorithm


class SimulateSurvey(StepAlgorithm):
    """The algorithm ``strandline:simulatesurvey``."""

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "simulatesurvey",
            "tools",
            tr("Simulate survey"),
            tr(
                "Renders the photographs of a flight over an invented beach, each as RAW and as JPG, with ground points, marks, "
                "zones, and the true surfaces and volumes: to learn the steps, to plan a flight, or to see what to expect of it."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.choice(
            "DATES",
            tr("Dates"),
            tr("two: the beach before and after a storm, with the true volumes; one: before only."),
            ("one", "two"),
            default="two",
        )
        yield ask.number("LENGTH", tr("Length (m)"), tr("Of the beach, along the shore."), default=60.0)
        yield ask.number("WIDTH", tr("Width (m)"), tr("Of the beach, across the shore."), default=40.0)
        yield ask.crs("CRS", tr("CRS"), tr("A projected CRS in metres; empty: one is chosen."))
        yield ask.number("HEIGHT", tr("Flying height (m)"), tr("Above the beach."), default=50.0)
        yield ask.number(
            "FORWARD_OVERLAP", tr("Forward overlap (%)"), tr("Of one photograph with the next."), default=80.0, most=98.0
        )
        yield ask.number("SIDE_OVERLAP", tr("Side overlap (%)"), tr("Of one strip with the next."), default=70.0, most=98.0)
        yield ask.number(
            "TILT",
            tr("Tilt (degrees)"),
            tr("Standard deviation of the camera's lean from plumb."),
            default=3.0,
            most=60.0,
        )
        yield ask.integer("CAMERA_WIDTH", tr("Image width (px)"), tr("Pixels across."), default=1600, least=64)
        yield ask.integer("CAMERA_HEIGHT", tr("Image height (px)"), tr("Pixels down."), default=1200, least=64)
        yield ask.number("FOCAL", tr("Focal length (px)"), tr("Of the camera, in pixels."), default=1300.0)
        yield ask.number(
            "CONTRAST",
            tr("Contrast"),
            tr(
                "Standard deviation of the sand's own brightness relative to its mean, over features from 2 cm to 3 m: 0.04 is "
                "common, 0.012 very bare. Slopes and ripples add their shading."
            ),
            default=0.04,
            most=1.0,
        )
        yield ask.number(
            "NOISE", tr("Noise"), tr("Of light and sensor: 1 is a small drone camera at its lowest ISO, 0 is none."), default=1.0
        )
        yield ask.number("GNSS_SIGMA_H", tr("GNSS accuracy in plan (m)"), tr("Of the photographs' positions."), default=0.03)
        yield ask.number("GNSS_SIGMA_V", tr("GNSS accuracy in height (m)"), tr("Of the photographs' positions."), default=0.05)
        yield ask.number("GCP_SIGMA_H", tr("Accuracy of ground points in plan (m)"), tr("Of their survey."), default=0.01)
        yield ask.number("GCP_SIGMA_V", tr("Accuracy of ground points in height (m)"), tr("Of their survey."), default=0.02)
        yield ask.number("MARK_SIGMA", tr("Accuracy of the marks (px)"), tr("Standard deviation of a mark."), default=0.3)
        yield ask.integer("GCP_COUNT", tr("Control points"), tr("Targets laid out as control points."), default=6)
        yield ask.integer("CHECK_COUNT", tr("Check points"), tr("Targets laid out as check points."), default=4)
        yield ask.integer("SEED", tr("Seed"), tr("The same number gives the same survey."), default=1)
        yield ask.folder_output(
            "OUTPUT", tr("Folder"), tr("Folder to make, with photographs (jpg, raw), ground points, marks, zones and truth.")
        )
        yield ask.workers()
        yield ask.scheduler()
        yield ask.report(kept=False)

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the truth in numbers."""
        yield ask.result("IMAGE_COUNT", tr("Photographs per date"))
        yield ask.result("GSD", tr("Ground pixel (m)"))
        yield ask.result("PRECISION", tr("Deviation of heights to expect (m)"))
        yield ask.result("EROSION", tr("True erosion (m3)"))
        yield ask.result("DEPOSITION", tr("True deposition (m3)"))
        yield ask.result("NET", tr("True net volume (m3)"))
