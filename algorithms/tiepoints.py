"""Tie points: features, pairs and verified matches."""

from collections.abc import Iterable

from qgis.core import QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from .base import About, StepAlgorithm


class TiePoints(StepAlgorithm):
    """The algorithm ``strandline:tiepoints``."""

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "tiepoints",
            "survey",
            tr("Find tie points"),
            tr(
                "Finds features in the photographs and matches them between overlapping ones. What agrees with one geometry is "
                "laid on each other to a fraction of a pixel by least-squares matching, and kept in features.db, a COLMAP "
                "database."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.survey()
        yield ask.choice(
            "SOURCE",
            tr("Images"),
            tr("auto: the enhanced images if they exist, else the originals with a warning; enhanced; original."),
            ("auto", "enhanced", "original"),
            default="auto",
        )
        yield ask.integer(
            "MAX_FEATURES",
            tr("Most features per photograph"),
            tr("The strongest features are kept, this many of each photograph; 0 is no limit."),
            default=20000,
        )
        yield ask.integer(
            "MAX_SIZE",
            tr("Longest side"),
            tr("Photographs are reduced to this many pixels on their longer side before features are sought; 0 is full size."),
            default=0,
        )
        yield ask.choice(
            "PAIRS",
            tr("Pairs"),
            tr(
                "auto: neighbours by position; without positions every pair of up to 60 photographs, beyond these neighbours in "
                "the order of the flight and those that look most alike. exhaustive: every pair; sequential: neighbours in the "
                "order of the flight, which ties neighbouring strips in few places. Pairs that matched ones point to are added."
            ),
            ("auto", "exhaustive", "sequential"),
            default="auto",
        )
        yield ask.threshold()
        yield ask.workers()
        yield ask.scheduler()
        yield ask.report()

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the survey and the counts."""
        yield ask.survey_result()
        yield ask.result("MEAN_FEATURES", tr("Mean features per photograph"))
        yield ask.result("PAIR_COUNT", tr("Verified pairs"))
        yield ask.result("MATCH_COUNT", tr("Verified matches"))
