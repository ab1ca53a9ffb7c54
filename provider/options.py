"""The page 'Strandline' in QGIS's options."""

from typing import Any

from qgis.gui import QgsFileWidget, QgsOptionsPageWidget, QgsOptionsWidgetFactory
from qgis.PyQt.QtGui import QIcon
from qgis.PyQt.QtWidgets import QFormLayout, QLabel, QLineEdit

from ..bridge import settings
from ..bridge.engine import ROOT
from ..i18n import tr


class OptionsFactory(QgsOptionsWidgetFactory):
    """Makes the page when the options are opened."""

    def __init__(self) -> None:
        super().__init__("Strandline", QIcon(str(ROOT / "icon.svg")))

    def icon(self) -> QIcon:
        """Return the icon."""
        return QIcon(str(ROOT / "icon.svg"))

    def createWidget(self, parent: Any) -> "OptionsPage":
        """Return a new page."""
        return OptionsPage(parent)


class OptionsPage(QgsOptionsPageWidget):
    """Asks for the engine's Python and the Dask scheduler."""

    def __init__(self, parent: Any) -> None:
        super().__init__(parent)
        self._python = QgsFileWidget()
        self._python.setFilePath(settings.read(settings.PYTHON))
        self._python.lineEdit().setPlaceholderText(tr("the one that 'Check engine' installs"))
        self._scheduler = QLineEdit(settings.read(settings.SCHEDULER))
        self._scheduler.setPlaceholderText(tr("none: this computer"))
        told = QLabel(
            tr("Strandline computes in a Python of its own. Run 'Check engine' from the toolbox to install or test it.")
        )
        told.setWordWrap(True)
        form = QFormLayout(self)
        form.addRow(told)
        form.addRow(tr("Python of the engine"), self._python)
        form.addRow(tr("Dask scheduler"), self._scheduler)

    def apply(self) -> None:
        """Store what was entered; QGIS calls this on OK."""
        settings.write(settings.PYTHON, self._python.filePath())
        settings.write(settings.SCHEDULER, self._scheduler.text())
