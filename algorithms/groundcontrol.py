"""Parameters of ground control, marks and positions, which several algorithms share."""

from collections.abc import Iterable
from typing import Any, Dict

from qgis.core import QgsProcessingParameterDefinition

from ..i18n import tr
from . import parameters as ask


def ground_points() -> Iterable[QgsProcessingParameterDefinition]:
    """Return the layer of ground points, its fields and their accuracy."""
    yield ask.points("GCPS", tr("Ground points"), tr("Points surveyed on the ground: control points and check points."))
    yield ask.field("NAME_FIELD", tr("Field of names"), tr("The field that names each ground point."), of="GCPS")
    yield ask.field(
        "HEIGHT_FIELD", tr("Field of heights"), tr("The field with the height; empty: the Z of the points."), of="GCPS"
    )
    yield ask.field(
        "ROLE_FIELD",
        tr("Field of roles"),
        tr("The field that says 'control' (or 'GCP', or nothing) or 'check'. Check points take no part and tell the accuracy."),
        of="GCPS",
    )
    yield ask.number("SIGMA_H", tr("Accuracy in plan (m)"), tr("Standard deviation of the ground points in plan."), default=0.01)
    yield ask.number(
        "SIGMA_V", tr("Accuracy in height (m)"), tr("Standard deviation of the ground points in height."), default=0.02
    )
    yield ask.field(
        "SIGMA_H_FIELD", tr("Field of accuracy in plan"), tr("Where the accuracy differs from point to point."), of="GCPS"
    )
    yield ask.field(
        "SIGMA_V_FIELD", tr("Field of accuracy in height"), tr("Where the accuracy differs from point to point."), of="GCPS"
    )


def known_points() -> Iterable[QgsProcessingParameterDefinition]:
    """Return the layer of ground points to look for, without roles: it and its names are needed."""
    needed = ("GCPS", "NAME_FIELD")
    for parameter in ground_points():
        if parameter.name() in needed:
            parameter.setFlags(parameter.flags() & ~QgsProcessingParameterDefinition.Flag.FlagOptional)
        if parameter.name() != "ROLE_FIELD":
            yield parameter


def marks() -> Iterable[QgsProcessingParameterDefinition]:
    """Return the marks, the file that holds points and marks, and what is said of them."""
    yield ask.table(
        "MARKS",
        tr("Marks in the photographs"),
        tr(
            "A table (a CSV will do) with the fields gcp, image, x, y: where each ground point is seen, in pixels from the "
            "top-left corner of the photograph."
        ),
    )
    yield ask.file(
        "GCP_FILE",
        tr("File of ground points and marks"),
        tr(
            "Instead of both: OpenDroneMap's gcp_list.txt, Metashape's markers (XML), MicMac's points and image measures, or "
            "tables (CSV) of points and of marks. Where points and marks are two files give one, and the other is found in its "
            "folder by what it contains; or give both, separated by a semicolon. A file that names no CRS is taken in the "
            "survey's."
        ),
    )
    yield ask.words(
        "CHECK", tr("Check points"), tr("Names of ground points that shall only check, separated by commas or semicolons.")
    )
    yield ask.number("SIGMA_MARK", tr("Accuracy of the marks (px)"), tr("Standard deviation of a mark."), default=0.5)


def positions_and_heights() -> Iterable[QgsProcessingParameterDefinition]:
    """Return how the photographs' positions take part, and what heights refer to."""
    yield ask.switch(
        "USE_GNSS",
        tr("Use the positions of the photographs"),
        tr("The photographs' GNSS positions take part, each with the accuracy it claims."),
        default=True,
    )
    yield ask.words(
        "LEVER_ARM",
        tr("Lever arm"),
        tr("From the camera to the GNSS antenna in metres, three numbers: right, forward, up, of the levelled aircraft."),
    )
    heights = ("ellipsoidal", "orthometric", "unknown")
    yield ask.choice(
        "GCP_HEIGHTS",
        tr("Heights of the ground points"),
        tr(
            "What the ground points' heights refer to: the ellipsoid, or mean sea level (orthometric). A compound CRS of the "
            "points says it, too."
        ),
        heights,
        default="unknown",
    )
    yield ask.choice(
        "GNSS_HEIGHTS",
        tr("Heights of the photographs"),
        tr("What the heights of the photographs' positions refer to: the ellipsoid, or mean sea level (orthometric)."),
        heights,
        default="unknown",
    )
    yield ask.file(
        "GEOID",
        tr("Geoid"),
        tr(
            "How far the geoid lies above the ellipsoid: a raster, or one number in metres (about 50 in western France, about "
            "-33 in New York). Needed when the two kinds of heights differ."
        ),
    )


def what_is_wrong(parameters: Dict[str, Any]) -> str:
    """Return in a sentence why ground points, their names and their marks cannot be used together, or nothing."""
    layer, file = parameters.get("GCPS"), parameters.get("GCP_FILE")
    if layer and file:
        return tr("GCPS and GCP_FILE exclude each other: give one of them.")
    if layer and not parameters.get("NAME_FIELD"):
        return tr("GCPS need NAME_FIELD: name the field with the points' names.")
    if layer and not parameters.get("MARKS"):
        return tr("GCPS need MARKS: give the table of their places in the photographs.")
    return ""
