"""The Processing provider ``strandline``."""

from qgis.core import QgsApplication, QgsProcessingModelAlgorithm, QgsProcessingProvider
from qgis.PyQt.QtGui import QIcon

from ..algorithms import ALGORITHMS
from ..bridge.engine import ROOT


class StrandlineProvider(QgsProcessingProvider):
    """Offers Strandline's algorithms to the toolbox, the modeller, scripts and qgis_process."""

    def id(self) -> str:
        """Return the id, which saved models hold."""
        return "strandline"

    def name(self) -> str:
        """Return the name shown."""
        return "Strandline"

    def icon(self) -> QIcon:
        """Return the icon."""
        return QIcon(str(ROOT / "icon.svg"))

    def svgIconPath(self) -> str:
        """Return the icon's file."""
        return str(ROOT / "icon.svg")

    def loadAlgorithms(self) -> None:
        """Add the algorithms and, once the registry knows these, the ready models made of them."""
        for algorithm in ALGORITHMS:
            self.addAlgorithm(algorithm())
        if QgsApplication.processingRegistry().providerById(self.id()) is self:
            self._load_models()

    def _load_models(self) -> None:
        for path in sorted((ROOT / "models").glob("*.model3")):
            model = QgsProcessingModelAlgorithm()
            if model.fromFile(str(path)):
                self.addAlgorithm(model)
