"""What QGIS loads."""

from pathlib import Path
from typing import Any

from qgis.core import QgsApplication
from qgis.PyQt.QtCore import QCoreApplication, QLocale, QSettings, QTranslator

from ..bridge.engine import ROOT
from .provider import StrandlineProvider


class StrandlinePlugin:
    """Registers the provider, and in the desktop what belongs to its windows."""

    def __init__(self, iface: Any) -> None:
        self._iface, self._provider, self._options = iface, None, None
        self._desktop = None
        self._translator = QTranslator()
        language = str(QSettings().value("locale/userLocale") or QLocale().name())[:2]
        words: Path = ROOT / "i18n" / f"strandline_{language}.qm"
        if words.is_file() and self._translator.load(str(words)):
            QCoreApplication.installTranslator(self._translator)

    def initProcessing(self) -> None:
        """Register the provider; this is all that qgis_process asks for."""
        self._provider = StrandlineProvider()
        QgsApplication.processingRegistry().addProvider(self._provider)
        self._provider.refreshAlgorithms()  # the models can be read only now

    def initGui(self) -> None:
        """Start in the desktop."""
        from .desktop import Desktop
        from .options import OptionsFactory

        self.initProcessing()
        self._options = OptionsFactory()
        self._iface.registerOptionsWidgetFactory(self._options)
        self._desktop = Desktop(self._iface)

    def unload(self) -> None:
        """Leave no trace."""
        if self._desktop is not None:
            self._desktop.close()
            self._desktop = None
        if self._options is not None:
            self._iface.unregisterOptionsWidgetFactory(self._options)
            self._options.close()
            self._options = None
        if self._provider is not None:
            QgsApplication.processingRegistry().removeProvider(self._provider)
            self._provider = None
        QCoreApplication.removeTranslator(self._translator)
