"""Check engine: prove that the engine works, or install it."""

import os
import re
from pathlib import Path
from typing import Any, Dict, Iterable, Optional, Tuple

from qgis.core import (
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingFeedback,
    QgsProcessingOutputBoolean,
    QgsProcessingOutputDefinition,
    QgsProcessingParameterDefinition,
)

from ..bridge import install
from ..bridge.child import Cancelled, Child
from ..bridge.door import EngineError, run_step
from ..bridge.engine import MissingEngine, base_python, find_python, install_folder
from ..bridge.environment import cleaned
from ..bridge.request import Values
from ..i18n import tr
from . import parameters as ask
from .base import About, StepAlgorithm

_EXPECTED = 45  # packages, with those they need; only the progress bar hangs on it


class CheckEngine(StepAlgorithm):
    """The algorithm ``strandline:checkengine``."""

    def about(self) -> About:
        """Return what the algorithm is called and does."""
        return About(
            "checkengine",
            "tools",
            tr("Check engine"),
            tr(
                "Tells whether the engine, the Python environment in which Strandline computes, is complete. With 'Install' it "
                "is made first: a virtual environment of about 1 GB in the QGIS profile, from the versions that Strandline was "
                "tested with. Nothing else in Strandline downloads anything."
            ),
        )

    def canExecute(self) -> Tuple[bool, str]:
        """Say yes: a missing engine is what it tells about."""
        return True, ""

    def parameters(self) -> Iterable[QgsProcessingParameterDefinition]:
        """Return the parameters."""
        yield ask.switch("INSTALL", tr("Install"), tr("Install or complete the engine before checking it."), default=False)
        yield ask.file(
            "PYTHON",
            tr("Python to use"),
            tr("A Python of at least 3.11 to make a new environment with. Empty: one is looked for on this computer."),
        )
        yield ask.folder(
            "WHEELS",
            tr("Folder of wheels"),
            tr("Install from the Python packages in this folder instead of the network, for computers without one."),
            optional=True,
        )

    def outputs(self) -> Iterable[QgsProcessingOutputDefinition]:
        """Return the verdict."""
        yield QgsProcessingOutputBoolean("READY", tr("The engine is ready"))

    def processAlgorithm(
        self, parameters: Values, context: QgsProcessingContext, feedback: QgsProcessingFeedback
    ) -> Dict[str, Any]:
        """Install when asked, then let the engine check itself."""
        try:
            if self.parameterAsBool(parameters, "INSTALL", context):
                python = self.parameterAsFile(parameters, "PYTHON", context)
                wheels = self.parameterAsFile(parameters, "WHEELS", context)
                self._install(python or None, Path(wheels) if wheels else None, feedback)
            result = run_step(find_python(), self.name(), {}, feedback)
        except Cancelled as error:
            raise QgsProcessingException(tr("Cancelled.")) from error
        except (EngineError, MissingEngine) as error:
            if self.parameterAsBool(parameters, "INSTALL", context):
                raise QgsProcessingException(str(error)) from error
            feedback.reportError(str(error))
            return {"READY": False}
        packages = ", ".join(f"{name} {version}" for name, version in result["packages"].items())
        feedback.pushInfo(tr("The engine is ready: Python {}, {}.").format(result["python"], packages))
        return {"READY": result["ready"]}

    def _install(self, python: Optional[str], wheels: Optional[Path], feedback: QgsProcessingFeedback) -> None:
        base, folder = base_python(python), install_folder()
        feedback.pushInfo(tr("Installing the engine in {} with {}.").format(folder, base))
        last, seen = base, 0
        with Child(install.command(base, folder, wheels=wheels, fresh=python is not None), cleaned(os.environ)) as child:
            for line in child.lines(feedback):
                feedback.pushInfo(line)
                last = line if line.strip() else last
                seen += bool(re.match(r"(Collecting|Processing) ", line))
                feedback.setProgress(95.0 if line.startswith("Successfully installed") else min(80.0, 80.0 * seen / _EXPECTED))
            if child.wait(feedback) != 0:
                raise EngineError(tr("The engine could not be installed: {} (see the lines above).").format(last))
