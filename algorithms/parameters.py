"""Parameters and outputs that several algorithms share, and short ways to state the others.

Every parameter carries its help. ``choice`` holds static strings, so that a script writes ``METHOD=micmac``.
"""

from collections.abc import Sequence
from typing import Any, Optional

from qgis.core import (
    QgsProcessing,
    QgsProcessingOutputFolder,
    QgsProcessingOutputNumber,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterCrs,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterEnum,
    QgsProcessingParameterFeatureSink,
    QgsProcessingParameterFeatureSource,
    QgsProcessingParameterField,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterFolderDestination,
    QgsProcessingParameterMultipleLayers,
    QgsProcessingParameterNumber,
    QgsProcessingParameterRasterDestination,
    QgsProcessingParameterRasterLayer,
    QgsProcessingParameterString,
)

from ..i18n import tr

_Parameter = QgsProcessingParameterDefinition
_POLYGONS = QgsProcessing.SourceType.TypeVectorPolygon
_POINTS = QgsProcessing.SourceType.TypeVectorPoint
_LINES = QgsProcessing.SourceType.TypeVectorLine
_ANY = QgsProcessing.SourceType.TypeVector


def explained(parameter: _Parameter, text: str) -> _Parameter:
    """Return ``parameter`` with its help."""
    parameter.setHelp(text)
    return parameter


def advanced(parameter: _Parameter) -> _Parameter:
    """Return ``parameter`` folded away under "advanced"."""
    parameter.setFlags(parameter.flags() | QgsProcessingParameterDefinition.Flag.FlagAdvanced)
    return parameter


def switch(key: str, label: str, text: str, *, default: bool) -> _Parameter:
    """Return a yes or no."""
    return explained(QgsProcessingParameterBoolean(key, label, default), text)


def choice(key: str, label: str, text: str, options: Sequence[str], *, default: str) -> _Parameter:
    """Return a choice among static strings."""
    return explained(QgsProcessingParameterEnum(key, label, list(options), False, default, False, True), text)


def integer(key: str, label: str, text: str, *, default: int, least: int = 0) -> _Parameter:
    """Return a whole number."""
    kind = QgsProcessingParameterNumber.Type.Integer
    return explained(QgsProcessingParameterNumber(key, label, kind, default, False, least), text)


def number(
    key: str,
    label: str,
    text: str,
    *,
    default: Optional[float] = None,
    least: Optional[float] = 0.0,
    most: Optional[float] = None,
) -> _Parameter:
    """Return a number, optional when it has no default."""
    kind = QgsProcessingParameterNumber.Type.Double
    parameter = QgsProcessingParameterNumber(key, label, kind, default, default is None)
    if least is not None:
        parameter.setMinimum(least)
    if most is not None:
        parameter.setMaximum(most)
    return explained(parameter, text)


def words(key: str, label: str, text: str) -> _Parameter:
    """Return an optional text."""
    return explained(QgsProcessingParameterString(key, label, None, False, True), text)


def folder(key: str, label: str, text: str, *, optional: bool = False) -> _Parameter:
    """Return an existing folder."""
    kind = QgsProcessingParameterFile.Behavior.Folder
    return explained(QgsProcessingParameterFile(key, label, kind, "", None, optional), text)


def file(key: str, label: str, text: str) -> _Parameter:
    """Return an optional existing file."""
    kind = QgsProcessingParameterFile.Behavior.File
    # QGIS's own filter, *.*, refuses names without a dot, such as python3.
    return explained(QgsProcessingParameterFile(key, label, kind, "", None, True, tr("All files (*)")), text)


def crs(key: str, label: str, text: str) -> _Parameter:
    """Return an optional CRS."""
    return explained(QgsProcessingParameterCrs(key, label, None, True), text)


def points(key: str, label: str, text: str) -> _Parameter:
    """Return an optional point layer."""
    return explained(QgsProcessingParameterFeatureSource(key, label, [_POINTS], None, True), text)


def polygons(key: str, label: str, text: str) -> _Parameter:
    """Return an optional polygon layer."""
    return explained(QgsProcessingParameterFeatureSource(key, label, [_POLYGONS], None, True), text)


def table(key: str, label: str, text: str) -> _Parameter:
    """Return an optional layer or table, with or without geometry."""
    return explained(QgsProcessingParameterFeatureSource(key, label, [_ANY], None, True), text)


def field(key: str, label: str, text: str, *, of: str) -> _Parameter:
    """Return an optional field of the layer parameter ``of``."""
    return explained(QgsProcessingParameterField(key, label, None, of, optional=True), text)


def raster(key: str, label: str, text: str, *, optional: bool = False) -> _Parameter:
    """Return a raster layer."""
    return explained(QgsProcessingParameterRasterLayer(key, label, None, optional), text)


def rasters(key: str, label: str, text: str, *, optional: bool = False) -> _Parameter:
    """Return several raster layers."""
    kind = QgsProcessing.SourceType.TypeRaster
    return explained(QgsProcessingParameterMultipleLayers(key, label, kind, None, optional), text)


def lines(key: str, label: str, text: str, *, optional: bool = True) -> _Parameter:
    """Return a line layer."""
    return explained(QgsProcessingParameterFeatureSource(key, label, [_LINES], None, optional), text)


def survey() -> _Parameter:
    """Return the survey folder a step works in."""
    return folder("SURVEY", tr("Survey folder"), tr("The folder that 'Create survey' made. The step adds its files to it."))


def threshold() -> _Parameter:
    """Return what features must stand out of."""
    text = tr(
        "noise: features that stand out of each photograph's own noise; fixed: features above one contrast for all "
        "photographs, as other programs take them, to compare with."
    )
    return advanced(choice("THRESHOLD", tr("Threshold"), text, ("noise", "fixed"), default="noise"))


def workers() -> _Parameter:
    """Return the number of processes."""
    text = tr("How many processes work side by side; 0 is one per processor. Each takes memory: use fewer if it runs short.")
    return advanced(integer("WORKERS", tr("Processes"), text, default=0))


def scheduler() -> _Parameter:
    """Return the address of a Dask scheduler."""
    text = tr(
        "Address of a Dask scheduler (tcp://host:8786) to spread the work over several computers. "
        "The survey must lie where all of them can reach it. Empty: the one in the options, else this computer."
    )
    return advanced(words("SCHEDULER", tr("Dask scheduler"), text))


def folder_output(key: str, label: str, text: str, *, optional: bool = False) -> _Parameter:
    """Return a folder to make."""
    return explained(QgsProcessingParameterFolderDestination(key, label, None, optional, not optional), text)


def raster_output(key: str, label: str, text: str, *, optional: bool = True, by_default: bool = False) -> _Parameter:
    """Return a raster to write."""
    made = True if not optional else by_default
    return explained(QgsProcessingParameterRasterDestination(key, label, None, optional, made), text)


def file_output(key: str, label: str, text: str, *, filters: str, by_default: bool = False) -> _Parameter:
    """Return an optional file to write."""
    return explained(QgsProcessingParameterFileDestination(key, label, filters, None, True, by_default), text)


def point_output(key: str, label: str, text: str) -> _Parameter:
    """Return an optional point layer to write."""
    return explained(QgsProcessingParameterFeatureSink(key, label, _POINTS, None, True, True), text)


def line_output(key: str, label: str, text: str, *, optional: bool = True) -> _Parameter:
    """Return a line layer to write."""
    return explained(QgsProcessingParameterFeatureSink(key, label, _LINES, None, optional, True), text)


def table_output(key: str, label: str, text: str, *, optional: bool = True) -> _Parameter:
    """Return a table to write."""
    return explained(QgsProcessingParameterFeatureSink(key, label, _ANY, None, optional, True), text)


def polygon_output(key: str, label: str, text: str) -> _Parameter:
    """Return an optional polygon layer to write."""
    return explained(QgsProcessingParameterFeatureSink(key, label, _POLYGONS, None, True, True), text)


def report(*, kept: bool = True) -> _Parameter:
    """Return the step's report; ``kept`` tells that the survey keeps one in any case."""
    text = tr("A page with the step's numbers and pictures, to keep or send.")
    if kept:
        text = f"{text} {tr('One is always written to the report folder of the survey.')}"
    return file_output("OUTPUT_HTML_FILE", tr("Report"), text, filters=tr("HTML files (*.html)"), by_default=True)


def survey_result() -> Any:
    """Return the output of a step that works in a survey: the same folder, for the next step."""
    return QgsProcessingOutputFolder("OUTPUT", tr("Survey folder"))


def result(key: str, label: str) -> Any:
    """Return a number output."""
    return QgsProcessingOutputNumber(key, label)
