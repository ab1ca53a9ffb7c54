"""Beach profiles: heights along transects at several dates, and the sand above a datum."""

from collections.abc import Iterable

from qgis.core import QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from . import series
from .base import About, StepAlgorithm
from .styles import PROFILE_POINTS, PROFILES


class Profiles(StepAlgorithm):
    """The algorithm ``strandline:profiles``."""

    STYLES = {"OUTPUT": PROFILES, "POINTS": PROFILE_POINTS}

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "profiles",
            "change",
            tr("Beach profiles"),
            tr(
                "Draws the heights along transects at any number of dates and sums the sand above a datum in m3 per metre "
                "of beach, its change since the first and the previous date, and the width of the beach, each with its "
                "standard deviation. Errors that neighbours or a whole surface share are counted. Gaps are told, never filled."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield from series.surfaces()
        yield from series.transects(optional=False)
        yield series.datum()
        yield ask.number(
            "SPACING",
            tr("Spacing of points (m)"),
            tr("Along each transect; finer cells are averaged along the line. 0: the coarsest surface's cell."),
            default=0.0,
        )
        yield ask.number("START", tr("From distance (m)"), tr("Sand counts from here on, from the landward end."), default=0.0)
        yield ask.number("END", tr("To distance (m)"), tr("Sand counts up to here; empty: to the end of each transect."))
        yield series.slope_scale()
        yield from series.uncertainty()
        yield ask.line_output(
            "OUTPUT",
            tr("Profiles"),
            tr("Each transect once per date, with sand, change and width, their deviations and intervals."),
            optional=False,
        )
        yield ask.point_output(
            "POINTS", tr("Profile points"), tr("Transect, date, distance, height and its deviation; gaps are empty.")
        )
        yield ask.report(kept=False)

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the means over the transects."""
        yield ask.result("TRANSECT_COUNT", tr("Transects"))
        yield ask.result("DATE_COUNT", tr("Dates"))
        yield ask.result("MEAN_CHANGE", tr("Mean change from first to last date (m3 per m)"))
        yield ask.result("MEAN_CHANGE_SIGMA", tr("Deviation of the mean change (m3 per m)"))
        yield ask.result("MEAN_WIDTH_CHANGE", tr("Mean change of width from first to last date (m)"))
        yield ask.result("COVERED_PERCENT", tr("Mean share of the transects with heights (%)"))
