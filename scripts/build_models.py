"""Make models/*.model3 again. Run by ``make models``; needs QGIS and the plugin on QGIS_PLUGINPATH.

A model's inputs are the parameters of its children under a prefix; every mandatory parameter of a child gets a
source, because the modeller ignores defaults when it checks a model.
"""

import os
import sys
from pathlib import Path

sys.path.insert(0, os.environ["QGIS_PLUGINPATH"])

from qgis.core import (
    QgsApplication,
    QgsProcessingModelAlgorithm,
    QgsProcessingModelChildAlgorithm,
    QgsProcessingModelChildParameterSource,
    QgsProcessingModelOutput,
    QgsProcessingModelParameter,
    QgsProcessingParameterDefinition,
)
from qgis.PyQt.QtCore import QPointF, QSizeF
from qgis.testing import start_app
from strandline import classFactory

FOLDER = Path(__file__).resolve().parent.parent / "models"
OPTIONAL = QgsProcessingParameterDefinition.Flag.FlagOptional
Source = QgsProcessingModelChildParameterSource
#: What differs from date to date; all else is asked once.
OF_A_DATE = {"IMAGES", "GCPS", "NAME_FIELD", "HEIGHT_FIELD", "ROLE_FIELD", "MARKS", "GCP_FILE"}
STEPS = ("createsurvey", "enhance", "tiepoints", "orient", "georeference", "exportdsm")


class Builder:
    """A model in the making; children stand in columns, inputs above and outputs below them."""

    def __init__(self, title, text):
        self.model = QgsProcessingModelAlgorithm(title, "Models", "models")
        self._asked = []
        self._help = {"ALG_DESC": text, "ALG_CREATOR": "Strandline"}
        self._column, self._row = 0, 0

    def add(self, step, child_id, title, *, asked=(), wired=None, outputs=None, prefix="", suffix=""):
        """Add a child: ``asked`` keys become inputs of the model, ``wired`` maps keys to (child, output)."""
        wired, outputs = wired or {}, outputs or {}
        child = QgsProcessingModelChildAlgorithm(f"strandline:{step}")
        child.setChildId(child_id)
        child.setDescription(title)
        child.setPosition(QPointF(300.0 + 260.0 * self._column, 600.0 + 110.0 * (self._row % 2)))
        child.setSize(QSizeF(220.0, 50.0))
        algorithm = QgsApplication.processingRegistry().createAlgorithmById(f"strandline:{step}")
        for place, definition in enumerate(algorithm.parameterDefinitions()):
            key = definition.name()
            if key in asked:
                name = self._ask(definition, place, *((prefix, suffix) if key in OF_A_DATE else ("", "")))
                child.addParameterSources(key, [Source.fromModelParameter(name)])
            elif key in wired:
                child.addParameterSources(key, [Source.fromChildOutput(*wired[key])])
            elif not definition.isDestination() and not definition.flags() & OPTIONAL:
                child.addParameterSources(key, [Source.fromStaticValue(definition.defaultValue())])
        results = {}
        for row, (key, (name, label, mandatory)) in enumerate(outputs.items()):
            result = QgsProcessingModelOutput(f"{prefix}{name}", f"{label}{suffix}")
            result.setChildId(child_id)
            result.setChildOutputName(key)
            result.setMandatory(mandatory)
            result.setDescription(f"{label}{suffix}")
            result.setPosition(QPointF(300.0 + 260.0 * self._column, 780.0 + 60.0 * row))
            result.setSize(QSizeF(200.0, 40.0))
            results[result.name()] = result
        child.setModelOutputs(results)
        self.model.addChildAlgorithm(child)
        self._column += 1

    def save(self, file):
        """Check the model and write it."""
        self.model.setHelpContent(self._help)
        self.model.setParameterOrder(self._asked)  # else the dialog asks by the alphabet
        self.model.updateDestinationParameters()
        fine, told = self.model.validate()
        if not fine:
            raise SystemExit(f"{file}: {told}")
        if not self.model.toFile(str(FOLDER / file)):
            raise SystemExit(f"{file} cannot be written")
        print(file, [d.name() for d in self.model.parameterDefinitions()])

    def _ask(self, definition, place, prefix, suffix):
        """Make an input like ``definition`` unless there is one; return its name."""
        name, label = f"{prefix}{definition.name()}", f"{definition.description()}{suffix}"
        if self.model.parameterDefinition(name) is None:
            self._asked.append(name)
            self._help[name] = definition.help()
            copy = definition.clone()
            copy.setName(name)
            copy.setDescription(label)
            if hasattr(copy, "setParentLayerParameterName"):
                copy.setParentLayerParameterName(prefix + copy.parentLayerParameterName())
            parameter = QgsProcessingModelParameter(name)
            parameter.setDescription(label)
            parameter.setPosition(QPointF(300.0 + 260.0 * self._column, 40.0 + 60.0 * place))
            parameter.setSize(QSizeF(200.0, 40.0))
            self.model.addModelParameter(copy, parameter)
        return name


def chain(builder, prefix="", suffix="", *, maps=True):
    """Add the six steps from photographs to a DSM; return the child that makes it."""
    ids = {step: f"{prefix.lower()}{step}" for step in STEPS}
    survey = {"SURVEY": (ids["createsurvey"], "OUTPUT")}
    more = {"prefix": prefix, "suffix": suffix}
    builder.add(
        "createsurvey",
        ids["createsurvey"],
        f"Create survey{suffix}",
        asked=("IMAGES", "FILTER", "CRS"),
        outputs={"OUTPUT": ("SURVEY", "Survey folder", True)},
        **more,
    )
    builder.add("enhance", ids["enhance"], f"Enhance photographs{suffix}", asked=("METHOD", "WINDOW"), wired=survey, **more)
    survey = {"SURVEY": (ids["enhance"], "OUTPUT")}
    builder.add(
        "tiepoints", ids["tiepoints"], f"Find tie points{suffix}", asked=("MAX_FEATURES", "MAX_SIZE"), wired=survey, **more
    )
    survey = {"SURVEY": (ids["tiepoints"], "OUTPUT")}
    builder.add("orient", ids["orient"], f"Orient photographs{suffix}", asked=("CAMERA_MODEL",), wired=survey, **more)
    survey = {"SURVEY": (ids["orient"], "OUTPUT")}
    asked = ("GCPS", "NAME_FIELD", "HEIGHT_FIELD", "ROLE_FIELD", "MARKS", "GCP_FILE", "GCP_HEIGHTS", "GNSS_HEIGHTS")
    builder.add(
        "georeference",
        ids["georeference"],
        f"Georeference{suffix}",
        asked=asked,
        wired=survey,
        outputs={"RESIDUALS": ("RESIDUALS", "Residuals", False)} if maps else {},
        **more,
    )
    survey = {"SURVEY": (ids["georeference"], "OUTPUT")}
    outputs = {"OUTPUT": ("DSM", "DSM", True)}
    if maps:
        outputs["PRECISION"] = ("PRECISION", "Precision", False)
        outputs["ORTHO"] = ("ORTHO", "Orthophoto", False)
        outputs["OUTPUT_HTML_FILE"] = ("REPORT", "Report", False)
    builder.add(
        "exportdsm", ids["exportdsm"], f"Export DSM{suffix}", asked=("RESOLUTION", "AREA"), wired=survey, outputs=outputs, **more
    )
    return ids["exportdsm"]


def survey_to_dsm():
    """From one flight's photographs to its surface."""
    text = "From the photographs of one flight to its surface model: all six steps with their usual options."
    builder = Builder("Survey to DSM", text)
    chain(builder)
    builder.save("survey_to_dsm.model3")


def two_surveys_to_volumes():
    """From two flights' photographs to volumes."""
    text = "From the photographs of two flights to the volumes of erosion and deposition between them."
    builder = Builder("Two surveys to volumes", text)
    before = chain(builder, "BEFORE_", " (before)", maps=False)
    after = chain(builder, "AFTER_", " (after)", maps=False)
    builder.add(
        "dsmdifference",
        "dsmdifference",
        "DSM difference",
        asked=("STABLE", "ZONES", "ZONE_FIELD", "COREGISTER", "LOD", "CONFIDENCE"),
        wired={
            "BEFORE": (before, "OUTPUT"),
            "AFTER": (after, "OUTPUT"),
            "BEFORE_PRECISION": (before, "PRECISION"),
            "AFTER_PRECISION": (after, "PRECISION"),
        },
        outputs={
            "OUTPUT": ("DIFFERENCE", "Difference", True),
            "VOLUMES": ("VOLUMES", "Volumes", True),
            "OUTPUT_HTML_FILE": ("REPORT", "Report", False),
        },
    )
    builder.save("two_surveys_to_volumes.model3")


if __name__ == "__main__":
    start_app()
    plugin = classFactory(None)
    plugin.initProcessing()
    FOLDER.mkdir(exist_ok=True)
    survey_to_dsm()
    two_surveys_to_volumes()
