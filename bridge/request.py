"""From an algorithm's parameter definitions to the engine's request, by type alone.

A request's field is the parameter's key in lower case; what is optional and not given is null.
"""

from pathlib import Path
from typing import Any, Dict, List, Optional

from qgis.core import (
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterNumber,
)

from ..i18n import tr
from .layers import LayerError, dated_source, raster_source, wkt, write_source

Values = Dict[str, Any]


def is_given(parameters: Values, definition: QgsProcessingParameterDefinition) -> bool:
    """Tell whether the user, or the default, gives a value; None stands for the default, as everywhere in Processing."""
    value = parameters.get(definition.name())
    return (definition.defaultValue() if value is None else value) not in (None, "")


def rasters(algorithm: QgsProcessingAlgorithm, parameters: Values, context: QgsProcessingContext) -> Values:
    """Return the request's raster fields; to be called where layers may be touched, in prepareAlgorithm.

    Raises
    ------
    QgsProcessingException
        When a raster cannot be loaded.
    LayerError
        When a raster is not a file.
    """
    fields: Values = {}
    for definition in algorithm.parameterDefinitions():
        if definition.type() == "raster":
            key = definition.name()
            fields[key.lower()] = None
            if is_given(parameters, definition):
                layer = algorithm.parameterAsRasterLayer(parameters, key, context)
                if layer is None:
                    raise QgsProcessingException(algorithm.invalidRasterError(parameters, key))
                fields[key.lower()] = raster_source(layer)
        elif definition.type() == "multilayer":
            key = definition.name()
            fields[key.lower()] = None
            if is_given(parameters, definition) and parameters.get(key) != []:
                fields[key.lower()] = _several(algorithm, parameters, key, context)
    return fields


def build(
    algorithm: QgsProcessingAlgorithm, parameters: Values, context: QgsProcessingContext, folder: Path, feedback: Any
) -> Values:
    """Return the request's other fields; feature sources are written to ``folder``, sinks are to be written there.

    Raises
    ------
    QgsProcessingException
        When a layer cannot be loaded.
    LayerError
        When a layer cannot be handed over.
    """
    fields: Values = {}
    for definition in algorithm.parameterDefinitions():
        if definition.type() not in ("raster", "multilayer"):
            value = None
            if is_given(parameters, definition):
                value = _value(algorithm, definition, parameters, context, folder, feedback)
            fields[definition.name().lower()] = value
    return fields


def sink_path(folder: Path, key: str) -> Path:
    """Return where the engine writes the features for the sink ``key``."""
    return folder / f"{key.lower()}.gpkg"


def _several(algorithm: QgsProcessingAlgorithm, parameters: Values, key: str, context: QgsProcessingContext) -> List[Any]:
    """Return the sources of several rasters, in their order."""
    given = parameters.get(key)
    layers = algorithm.parameterAsLayerList(parameters, key, context)
    # QGIS leaves out, without a word, what it cannot load.
    if isinstance(given, (list, tuple)) and len(layers) != len(given):
        found = {layer.source().partition("|")[0] for layer in layers}
        missing = [str(value) for value in given if isinstance(value, str) and value not in found]
        raise LayerError(tr("{} cannot be loaded as rasters: {}.").format(key, ", ".join(missing) or str(given)))
    if not layers:
        raise QgsProcessingException(algorithm.invalidRasterError(parameters, key))
    return [dated_source(layer) for layer in layers]


def _value(
    algorithm: QgsProcessingAlgorithm,
    definition: QgsProcessingParameterDefinition,
    parameters: Values,
    context: QgsProcessingContext,
    folder: Path,
    feedback: Any,
) -> Any:
    key, kind = definition.name(), definition.type()
    if kind == "boolean":
        return algorithm.parameterAsBool(parameters, key, context)
    if kind == "number":
        whole = definition.dataType() == QgsProcessingParameterNumber.Type.Integer
        return (algorithm.parameterAsInt if whole else algorithm.parameterAsDouble)(parameters, key, context)
    if kind == "enum":
        return algorithm.parameterAsEnumString(parameters, key, context)
    if kind in ("string", "field"):
        return algorithm.parameterAsString(parameters, key, context).strip() or None
    if kind == "file":
        return algorithm.parameterAsFile(parameters, key, context) or None
    if kind == "crs":
        return _crs(algorithm, parameters, key, context)
    if kind == "source":
        source = algorithm.parameterAsSource(parameters, key, context)
        if source is None:
            raise QgsProcessingException(algorithm.invalidSourceError(parameters, key))
        return write_source(source, folder / f"{key.lower()}.gpkg", feedback)
    if kind == "sink":
        return str(sink_path(folder, key))
    if kind == "rasterDestination":
        return algorithm.parameterAsOutputLayer(parameters, key, context)
    if kind in ("fileDestination", "folderDestination"):
        return algorithm.parameterAsFileOutput(parameters, key, context)
    raise TypeError(f"parameters of the type {kind} have no place in a request")


def _crs(algorithm: QgsProcessingAlgorithm, parameters: Values, key: str, context: QgsProcessingContext) -> Optional[str]:
    crs = algorithm.parameterAsCrs(parameters, key, context)
    if not crs.isValid():
        raise LayerError(tr("{} is not a CRS that QGIS knows: {}.").format(key, parameters.get(key)))
    return wkt(crs)
