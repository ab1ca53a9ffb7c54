"""What the steps on several dated surface models ask alike."""

from collections.abc import Iterable

from qgis.core import QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask


def surfaces() -> Iterable[QgsProcessingParameterDefinition]:
    """Return the surfaces and how they are dated."""
    yield ask.rasters("DSMS", tr("DSMs"), tr("Surfaces of several dates, in any order; grids and CRS may differ."))
    yield ask.words(
        "DATES",
        tr("Dates"),
        tr(
            "One date for each DSM in their order, separated by commas (2018-06-06, 2018-07-13), or some by name "
            "(beach.tif=2018-06-06). Empty: the temporal range of the layer, the file's tags, or a date in its name such as "
            "20180606 or 2018-06-06. Two surveys of one day need a time: 2018-06-06T09:30."
        ),
    )
    yield ask.table(
        "DATE_TABLE",
        tr("Table of dates"),
        tr("Fields file (its name) and date, and sigma in metres where it is known. DATES wins over it, it wins over the names."),
    )
    yield ask.advanced(
        ask.number(
            "NODATA",
            tr("Nodata value"),
            tr("The value of empty cells in all surfaces, where their files do not say it."),
            least=None,
        )
    )


def uncertainty() -> Iterable[QgsProcessingParameterDefinition]:
    """Return what is known of the errors."""
    yield ask.rasters(
        "PRECISIONS",
        tr("Precision rasters"),
        tr("Standard deviation of each height in metres, from 'Export DSM': one for each DSM, in the same order."),
        optional=True,
    )
    yield ask.number(
        "SIGMA",
        tr("Deviation of a height (m)"),
        tr("Standard deviation of the heights of each surface, one number, where there are no precision rasters."),
    )
    yield ask.polygons(
        "STABLE",
        tr("Stable ground"),
        tr("Polygons where nothing changed, such as rock or road: they tell how each date errs against the others."),
    )
    yield ask.choice(
        "COREGISTER",
        tr("Co-registration"),
        tr(
            "What of its departure from all dates together, on stable ground, is taken off each date: the level (vertical), a "
            "tilted plane (plane), the plane only where chance does not explain it (auto), or nothing (none). Needs STABLE."
        ),
        ("auto", "none", "vertical", "plane"),
        default="auto",
    )
    yield ask.advanced(
        ask.number(
            "REGISTRATION_SIGMA",
            tr("Deviation of the registration (m)"),
            tr("Of each surface as a whole; used where neither stable ground nor the DSM's georeferencing can tell."),
        )
    )
    yield ask.advanced(
        ask.number(
            "CORRELATION_RANGE",
            tr("Range of shared errors (m)"),
            tr("Up to which distance neighbouring cells err alike; used where the stable ground cannot tell."),
        )
    )
    yield ask.polygons("IGNORE", tr("Areas to ignore"), tr("Polygons left out of everything, such as water or people."))
    yield ask.number(
        "CONFIDENCE",
        tr("Confidence"),
        tr("Of intervals and of significance, between 0 and 1."),
        default=0.95,
        most=0.9999,
    )


def transects(*, optional: bool) -> Iterable[QgsProcessingParameterDefinition]:
    """Return lines across the beach."""
    yield ask.lines(
        "TRANSECTS",
        tr("Transects"),
        tr("Lines across the beach. Each starts at its landward end and runs to the sea."),
        optional=optional,
    )
    yield ask.field(
        "TRANSECT_FIELD",
        tr("Field of transect names"),
        tr("Empty: the field 'name' if there is one, else the feature id."),
        of="TRANSECTS",
    )
    yield ask.switch(
        "FLIP", tr("Transects start at the sea"), tr("Takes the end of each line as its landward end."), default=False
    )


def datum() -> QgsProcessingParameterDefinition:
    """Return the height that the shore is measured at."""
    return ask.number(
        "DATUM",
        tr("Datum (m)"),
        tr("Height in metres above the DSMs' own zero, also where these are in feet; above the water of every date."),
        default=0.0,
        least=None,
    )


def slope_scale() -> QgsProcessingParameterDefinition:
    """Return the scale of slopes."""
    return ask.advanced(
        ask.number(
            "SLOPE_SCALE",
            tr("Scale of slopes (m)"),
            tr("The slope by which heights become distances, of a robust plane over this length. 0: 5 cells, 5 m at least."),
            default=0.0,
        )
    )


def resolution() -> QgsProcessingParameterDefinition:
    """Return the cells of the common grid."""
    return ask.number(
        "RESOLUTION",
        tr("Cell size (m)"),
        tr("All surfaces are brought to cells of this size, finer ones by their mean. 0: the coarsest surface's own cells."),
        default=0.0,
    )
