"""Export DSM: the surface and the orthophoto."""

from collections.abc import Iterable

from qgis.core import QgsProcessingOutputDefinition, QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask
from .base import About, StepAlgorithm
from .styles import CORRELATION, FILLED, PICTURE, PRECISION, TERRAIN, VIEWS


class ExportDsm(StepAlgorithm):
    """The algorithm ``strandline:exportdsm``."""

    STYLES = {
        "OUTPUT": TERRAIN,
        "PRECISION": PRECISION,
        "CORRELATION": CORRELATION,
        "VIEWS": VIEWS,
        "FILLED": FILLED,
        "ORTHO": PICTURE,
    }

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "exportdsm",
            "surface",
            tr("Export DSM"),
            tr(
                "Computes the surface of a georeferenced survey by correlating the original photographs, cell by cell, with the "
                "precision of each height. Cells that cannot be measured stay empty."
            ),
        )

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.survey()
        yield ask.number(
            "RESOLUTION", tr("Cell size (m)"), tr("Side of a cell on the ground; 0 is twice the photographs' pixel."), default=0.0
        )
        yield ask.polygons("AREA", tr("Area"), tr("Only inside these polygons; empty: wherever enough photographs look."))
        yield ask.polygons("IGNORE", tr("Areas to ignore"), tr("Polygons left empty, such as water or vegetation."))
        yield ask.integer(
            "WINDOW",
            tr("Correlation window"),
            tr("Side of the window in cells, an odd number; 0 adapts it to the contrast: larger on plain sand."),
            default=0,
        )
        yield ask.number(
            "REGULARITY",
            tr("Regularity"),
            tr("How much the surface resists to jump from cell to cell: higher is smoother, 0 lets every cell speak for itself."),
            default=1.0,
        )
        yield ask.number(
            "FILL",
            tr("Fill gaps up to (m2)"),
            tr(
                "Gaps up to this area are closed by interpolation and marked in 'Filled cells', but never where they touch an "
                "area to ignore or the surface's edge; 0 leaves them empty."
            ),
            default=0.0,
        )
        yield ask.raster_output("OUTPUT", tr("DSM"), tr("Heights in metres, in the survey's CRS."), optional=False)
        yield ask.raster_output(
            "PRECISION",
            tr("Precision"),
            tr("Standard deviation of each height in metres, from matching alone; 'DSM difference' uses it."),
            by_default=True,
        )
        yield ask.raster_output("CORRELATION", tr("Correlation"), tr("How alike the photographs are at each cell, up to 1."))
        yield ask.raster_output("VIEWS", tr("Views"), tr("How many photographs measured each cell."))
        yield ask.raster_output(
            "FILLED",
            tr("Filled cells"),
            tr("1 where the height was interpolated, 0 where it was measured, nodata where there is none."),
        )
        yield ask.raster_output(
            "ORTHO",
            tr("Orthophoto"),
            tr("The photographs' colours on the surface, brought to one brightness, from those that look down most steeply."),
        )
        yield ask.advanced(
            ask.choice(
                "ORTHO_DEPTH",
                tr("Bits of the orthophoto"),
                tr("8: for maps and screens; 16: keeps the fine shades of RAW and 16-bit photographs, at twice the size."),
                ("8", "16"),
                default="8",
            )
        )
        yield ask.file_output(
            "POINTS",
            tr("Point cloud"),
            tr("The surface as points in a LAZ file, with colour, standard deviation (sigma) and number of photographs (views)."),
            filters=tr("LAZ files (*.laz)"),
        )
        yield ask.workers()
        yield ask.scheduler()
        yield ask.report()

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the numbers."""
        yield ask.result("GSD", tr("Ground pixel (m)"))
        yield ask.result("COVERAGE_PERCENT", tr("Cells with a height (%)"))
        yield ask.result("MEDIAN_PRECISION", tr("Median precision (m)"))
