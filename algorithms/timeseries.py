"""Volumes through time: zones at many dates, and the rate of each cell."""

from collections.abc import Iterable

from qgis.core import QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from . import series
from .base import About, StepAlgorithm
from .styles import DIFFERENCE, ZONE_RATES


class TimeSeries(StepAlgorithm):
    """The algorithm ``strandline:timeseries``."""

    STYLES = {"ZONE_RATES": ZONE_RATES, "RATE": DIFFERENCE, "SIGNIFICANT": DIFFERENCE}

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "timeseries",
            "change",
            tr("Volumes through time"),
            tr(
                "Sums the volume of each zone date by date, over the ground that has a height at every date, with the "
                "change since the first and since the previous date and their intervals. Errors are kept per date, so that "
                "changes which share a date are not taken for independent. Maps the linear rate of each cell and where it "
                "is significant; rates need three dates."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield from series.surfaces()
        yield ask.polygons("ZONES", tr("Zones"), tr("Polygons to sum volumes in; empty: the overlap of all surfaces."))
        yield ask.field(
            "ZONE_FIELD",
            tr("Field of zone names"),
            tr("Empty: the field 'name' if there is one, else the feature id."),
            of="ZONES",
        )
        yield series.resolution()
        yield from series.uncertainty()
        yield ask.table_output(
            "OUTPUT",
            tr("Volumes by date"),
            tr("One row per zone and date: volumes in m3, deviations, intervals."),
            optional=False,
        )
        yield ask.polygon_output(
            "ZONE_RATES",
            tr("Zone rates"),
            tr("The zones with their change from first to last date and their rate in m3 per year."),
        )
        yield ask.raster_output(
            "RATE", tr("Rate"), tr("Metres per year of each cell with heights at three dates or more."), by_default=True
        )
        yield ask.raster_output("SIGNIFICANT", tr("Significant rate"), tr("The rate where its interval leaves zero out."))
        yield ask.report(kept=False)

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the sums over all zones."""
        yield ask.result("DATE_COUNT", tr("Dates"))
        yield ask.result("ZONE_COUNT", tr("Zones"))
        yield ask.result("NET", tr("Net volume from first to last date (m3)"))
        yield ask.result("NET_SIGMA", tr("Deviation of the net volume (m3)"))
        yield ask.result("NET_RATE", tr("Rate (m3 per year)"))
        yield ask.result("NET_RATE_SIGMA", tr("Deviation of the rate (m3 per year)"))
        yield ask.result("AREA", tr("Area (m2)"))
        yield ask.result("COVERED_PERCENT", tr("Area with heights at every date (%)"))
