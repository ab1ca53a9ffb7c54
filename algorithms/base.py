"""What all algorithms share: one step through the door, its results handed to QGIS."""

import shutil
import tempfile
from pathlib import Path
from typing import Any, Dict, Iterable, NamedTuple, Optional, Tuple

from qgis.core import (
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingFeedback,
    QgsProcessingOutputDefinition,
    QgsProcessingParameterDefinition,
)
from qgis.PyQt.QtGui import QIcon

from ..bridge import settings
from ..bridge.door import Cancelled, EngineError, run_step
from ..bridge.engine import ROOT, MissingEngine, find_python
from ..bridge.layers import LayerError, copy_features, open_result, result_fields
from ..bridge.request import Values, build, is_given, rasters, sink_path
from ..i18n import tr
from .styles import Style


class About(NamedTuple):
    """An algorithm's id, its group's id, and its words."""

    id: str
    group: str
    title: str
    text: str


def group_title(group: str) -> str:
    """Return the group's name as the toolbox shows it; the numbers keep the order of the work."""
    return {"survey": tr("1 Survey"), "surface": tr("2 Surface"), "change": tr("3 Change"), "tools": tr("Tools")}[group]


class StepAlgorithm(QgsProcessingAlgorithm):
    """A step of the engine as an algorithm; a subclass states its parameters, outputs, words and styles.

    Parameters become the request and the result becomes the outputs by their keys alone.
    """

    #: How results are drawn when QGIS loads them, by output key.
    STYLES: Dict[str, Style] = {}

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        raise NotImplementedError

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters, in the order of the dialog."""
        raise NotImplementedError

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the outputs that are not destinations chosen by the user."""
        return ()

    def initAlgorithm(self, configuration: Optional[Dict[str, Any]] = None) -> None:
        """Define parameters and outputs."""
        for parameter in self.parameters():
            self.addParameter(parameter)
        for output in self.outputs():
            self.addOutput(output)

    def name(self) -> str:
        """Return the id."""
        return self.about().id

    def displayName(self) -> str:
        """Return the name shown."""
        return self.about().title

    def groupId(self) -> str:
        """Return the group's id."""
        return self.about().group

    def group(self) -> str:
        """Return the group's name."""
        return group_title(self.about().group)

    def shortHelpString(self) -> str:
        """Return what the algorithm does."""
        return self.about().text

    def createInstance(self) -> "StepAlgorithm":
        """Return a new algorithm of this kind."""
        return type(self)()

    def icon(self) -> QIcon:
        """Return the icon of Strandline."""
        return QIcon(str(ROOT / "icon.svg"))

    def canExecute(self) -> Tuple[bool, str]:
        """Tell whether there is an engine."""
        try:
            find_python()
        except MissingEngine as error:
            return False, str(error)
        return True, ""

    def checkParameterValues(self, parameters: Values, context: QgsProcessingContext) -> Tuple[bool, str]:
        """Refuse early what can be seen without the engine."""
        fine, told = super().checkParameterValues(parameters, context)
        if fine and self.parameterDefinition("SURVEY"):
            survey = self.parameterAsFile(parameters, "SURVEY", context)
            if not (Path(survey) / "survey.json").is_file():
                return False, tr("{} is not a survey folder: make one with 'Create survey'.").format(survey)
        return fine, told

    def prepareAlgorithm(self, parameters: Values, context: QgsProcessingContext, feedback: QgsProcessingFeedback) -> bool:
        """Look at the rasters while layers may be touched."""
        try:
            self._rasters = rasters(self, parameters, context)
        except LayerError as error:
            raise QgsProcessingException(str(error)) from error
        return True

    def processAlgorithm(
        self, parameters: Values, context: QgsProcessingContext, feedback: QgsProcessingFeedback
    ) -> Dict[str, Any]:
        """Send the request, wait for the result, hand it over."""
        folder = Path(tempfile.mkdtemp(prefix="strandline-layers-"))
        try:
            python = find_python()
            request = {**build(self, parameters, context, folder, feedback), **self._rasters}
            if "scheduler" in request:
                request["scheduler"] = request["scheduler"] or settings.effective(settings.SCHEDULER) or None
            if "workers" in request:
                request["workers"] = request["workers"] or settings.workers()
            result = run_step(python, self.name(), request, feedback)
            return self._outputs(result, request, parameters, context, folder, feedback)
        except (LayerError, EngineError, MissingEngine, settings.BadSetting) as error:
            raise QgsProcessingException(str(error)) from error
        except Cancelled as error:
            raise QgsProcessingException(tr("Cancelled.")) from error
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def postProcessAlgorithm(self, context: QgsProcessingContext, feedback: QgsProcessingFeedback) -> Dict[str, Any]:
        """Have the layers that QGIS is about to load styled."""
        for key, style in self.STYLES.items():
            place = self._results.get(key)
            if place and context.willLoadLayerOnCompletion(place):
                context.layerToLoadOnCompletionDetails(place).setPostProcessor(style)
        return {}

    def _outputs(
        self,
        result: Dict[str, Any],
        request: Values,
        parameters: Values,
        context: QgsProcessingContext,
        folder: Path,
        feedback: QgsProcessingFeedback,
    ) -> Dict[str, Any]:
        """Return the algorithm's outputs: the engine's, the files asked for, and the sinks, filled."""
        outputs = {key.upper(): value for key, value in result.items()}
        for definition in self.destinationParameterDefinitions():
            key = definition.name()
            if not is_given(parameters, definition):
                outputs.pop(key, None)
            elif definition.type() == "sink":
                outputs[key] = self._fill_sink(key, parameters, context, folder, feedback)
            else:
                outputs[key] = request[key.lower()]
        self._results = {key: value for key, value in outputs.items() if value is not None}
        return {key: outputs.get(key) for key in (o.name() for o in self.outputDefinitions()) if key in outputs}

    def _fill_sink(
        self, key: str, parameters: Values, context: QgsProcessingContext, folder: Path, feedback: QgsProcessingFeedback
    ) -> Optional[str]:
        path = sink_path(folder, key)
        if not path.exists():
            feedback.pushWarning(tr("There is nothing to write to {}.").format(self.parameterDefinition(key).description()))
            return None
        layer = open_result(path)
        sink, place = self.parameterAsSink(parameters, key, context, result_fields(layer), layer.wkbType(), layer.crs())
        if sink is None:
            raise QgsProcessingException(self.invalidSinkError(parameters, key))
        copy_features(layer, sink, feedback)
        return str(place)
