"""DSM difference: erosion and deposition, with their uncertainty."""

from collections.abc import Iterable
from typing import Any, Dict, Tuple

from qgis.core import QgsProcessingContext, QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from .base import About, StepAlgorithm
from .styles import DIFFERENCE, ZONES


class DsmDifference(StepAlgorithm):
    """The algorithm ``strandline:dsmdifference``."""

    STYLES = {"OUTPUT": DIFFERENCE, "SIGNIFICANT": DIFFERENCE, "VOLUMES": ZONES}

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "dsmdifference",
            "change",
            tr("DSM difference"),
            tr(
                "Subtracts two surfaces (after minus before) and sums erosion, deposition and the net volume per zone, each with "
                "its standard deviation. That deviation counts noise, errors that neighbours share, and errors common to the "
                "whole surface separately. What no surface covers is not extrapolated: the share covered is told."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.raster("BEFORE", tr("DSM before"), tr("The earlier surface."))
        yield ask.raster("AFTER", tr("DSM after"), tr("The later surface; another grid or CRS is resampled to the coarser one."))
        yield ask.number(
            "NODATA",
            tr("Nodata value"),
            tr("The value of empty cells in both surfaces, where their files do not say it."),
            least=None,
        )
        yield from self._uncertainty()
        yield ask.polygons(
            "STABLE",
            tr("Stable ground"),
            tr("Polygons where nothing changed, such as rock or road: they tell the error of the difference."),
        )
        yield ask.polygons("ZONES", tr("Zones"), tr("Polygons to sum volumes in; empty: the overlap of both surfaces."))
        yield ask.field(
            "ZONE_FIELD",
            tr("Field of zone names"),
            tr("Empty: the field 'name' if there is one, else the feature id."),
            of="ZONES",
        )
        yield ask.polygons("IGNORE", tr("Areas to ignore"), tr("Polygons left out of everything, such as water or people."))
        yield ask.choice(
            "COREGISTER",
            tr("Co-registration"),
            tr(
                "What is taken off the difference: nothing (none), the median of stable ground (vertical), its tilted plane "
                "(plane), or what stable ground and the georeferencing of both surfaces tell together (auto), with a shift in "
                "plan where the relief of stable ground shows one for sure (auto) or in any case (horizontal). What is left in "
                "is counted in the deviations."
            ),
            ("auto", "none", "vertical", "plane", "horizontal"),
            default="auto",
        )
        yield ask.choice(
            "LOD",
            tr("Level of detection"),
            tr(
                "What counts as significant: each cell against its own deviation (cell), one threshold for all (uniform), or "
                "cells that agree with their neighbours (coherent)."
            ),
            ("cell", "uniform", "coherent"),
            default="cell",
        )
        yield ask.number(
            "CONFIDENCE",
            tr("Confidence"),
            tr("Of significance and of the interval of the net volume, between 0 and 1."),
            default=0.95,
            most=0.9999,
        )
        yield ask.raster_output("OUTPUT", tr("Difference"), tr("After minus before in metres."), optional=False)
        yield ask.raster_output("SIGNIFICANT", tr("Significant difference"), tr("The difference where it is significant."))
        yield ask.polygon_output("VOLUMES", tr("Volumes"), tr("The zones with their volumes in m3 and their deviations."))
        yield ask.report(kept=False)

    def _uncertainty(self) -> Iterable[QgsProcessingParameterDefinition]:
        text = tr("Standard deviation of each height in metres, from 'Export DSM'.")
        yield ask.raster("BEFORE_PRECISION", tr("Precision before"), text, optional=True)
        yield ask.raster("AFTER_PRECISION", tr("Precision after"), text, optional=True)
        text = tr("Standard deviation of the heights in metres, one number, where there is no precision raster.")
        yield ask.number("BEFORE_SIGMA", tr("Deviation before (m)"), text)
        yield ask.number("AFTER_SIGMA", tr("Deviation after (m)"), text)
        yield ask.number(
            "REGISTRATION_SIGMA",
            tr("Deviation of the registration (m)"),
            tr("Of one surface against the other as a whole; used where the stable ground cannot tell."),
        )
        yield ask.number(
            "HORIZONTAL_SIGMA",
            tr("Deviation of the registration in plan (m)"),
            tr("Of one surface against the other, east and north; used where the relief of stable ground cannot tell."),
        )
        yield ask.number(
            "CORRELATION_RANGE",
            tr("Range of shared errors (m)"),
            tr("Up to which distance neighbouring cells err alike; used where the stable ground cannot tell."),
        )

    def checkParameterValues(self, parameters: Dict[str, Any], context: QgsProcessingContext) -> Tuple[bool, str]:
        """Refuse two statements about one precision."""
        fine, told = super().checkParameterValues(parameters, context)
        for date in ("BEFORE", "AFTER"):
            both = (parameters.get(f"{date}_PRECISION"), parameters.get(f"{date}_SIGMA"))
            if fine and all(value not in (None, "") for value in both):
                return False, tr("{0}_PRECISION and {0}_SIGMA exclude each other: give one of them.").format(date)
        return fine, told

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the volumes over all zones."""
        yield ask.result("NET", tr("Net volume (m3)"))
        yield ask.result("NET_SIGMA", tr("Deviation of the net volume (m3)"))
        yield ask.result("NET_RANDOM", tr("Its part from noise (m3)"))
        yield ask.result("NET_CORRELATED", tr("Its part from errors that neighbours share (m3)"))
        yield ask.result("NET_SYSTEMATIC", tr("Its part from errors common to the surface (m3)"))
        yield ask.result("EROSION", tr("Erosion (m3)"))
        yield ask.result("EROSION_SIGMA", tr("Deviation of the erosion (m3)"))
        yield ask.result("DEPOSITION", tr("Deposition (m3)"))
        yield ask.result("DEPOSITION_SIGMA", tr("Deviation of the deposition (m3)"))
        yield ask.result("EROSION_SIGNIFICANT", tr("Significant erosion (m3)"))
        yield ask.result("DEPOSITION_SIGNIFICANT", tr("Significant deposition (m3)"))
        yield ask.result("NET_SIGNIFICANT", tr("Significant net volume (m3)"))
        yield ask.result("AREA", tr("Area (m2)"))
        yield ask.result("COVERED_PERCENT", tr("Area covered by both surfaces (%)"))
