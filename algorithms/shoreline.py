"""Shorelines: contours at a datum for several dates, and how they moved."""

from collections.abc import Iterable

from qgis.core import QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from . import series
from .base import About, StepAlgorithm
from .styles import SHORE_POSITIONS, SHORE_RATES, SHORELINES


class Shoreline(StepAlgorithm):
    """The algorithm ``strandline:shoreline``."""

    STYLES = {"OUTPUT": SHORELINES, "POSITIONS": SHORE_POSITIONS, "RATES": SHORE_RATES}

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "shoreline",
            "change",
            tr("Shorelines"),
            tr(
                "Traces the contour of each date's surface at a datum. How far it may lie beside is the deviation of the height "
                "divided by the slope. Along transects it gives the positions, their movement with its interval, and rates "
                "as DSAS names them: NSM net movement, SCE envelope, EPR end point rate, LRR and WLR linear regression, "
                "plain and weighted. Seaward is positive."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield from series.surfaces()
        yield series.datum()
        yield from series.transects(optional=True)
        yield series.resolution()
        yield ask.number(
            "MIN_LENGTH",
            tr("Least length (m)"),
            tr("Shorter pieces of contour, such as puddles and stones, are left out."),
            default=20.0,
        )
        yield ask.choice(
            "KEEP",
            tr("Pieces to keep"),
            tr(
                "All that are long enough (all), one per date (longest), or those that a transect meets most seaward (seaward). "
                "Positions are always the most seaward ones on what is kept."
            ),
            ("all", "longest", "seaward"),
            default="all",
        )
        yield series.slope_scale()
        yield from series.uncertainty()
        yield ask.line_output(
            "OUTPUT", tr("Shorelines"), tr("One line per date, with its slope and how far it may lie beside."), optional=False
        )
        yield ask.point_output(
            "POSITIONS",
            tr("Shore positions"),
            tr("Where each transect meets each date's shoreline, with movement and deviations."),
        )
        yield ask.line_output(
            "RATES", tr("Shoreline rates"), tr("The transects with NSM, SCE, EPR, LRR and WLR, their deviations and intervals.")
        )
        yield ask.report(kept=False)

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the means over the transects."""
        yield ask.result("DATE_COUNT", tr("Dates"))
        yield ask.result("TRANSECT_COUNT", tr("Transects"))
        yield ask.result("MEAN_NSM", tr("Mean net movement (m)"))
        yield ask.result("MEAN_RATE", tr("Mean weighted rate (m per year)"))
        yield ask.result("MEDIAN_SIGMA", tr("Median deviation across the shore (m)"))
