"""The page 'Strandline' in QGIS's options."""

from typing import Any, Optional

from qgis.gui import QgsFileWidget, QgsOptionsPageWidget, QgsOptionsWidgetFactory
from qgis.PyQt.QtGui import QIcon
from qgis.PyQt.QtWidgets import (
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QMessageBox,
    QProgressBar,
    QPushButton,
    QSpinBox,
    QVBoxLayout,
)

from ..bridge import settings
from ..bridge.engine import ROOT, profile_folder
from ..i18n import tr
from .enginekeeper import EngineKeeper


class OptionsFactory(QgsOptionsWidgetFactory):
    """Makes the page when the options are opened."""

    def __init__(self) -> None:
        super().__init__("Strandline", QIcon(str(ROOT / "icon.svg")))
        self._keeper = EngineKeeper()

    def icon(self) -> QIcon:
        """Return the icon."""
        return QIcon(str(ROOT / "icon.svg"))

    def createWidget(self, parent: Any) -> "OptionsPage":
        """Return a new page."""
        return OptionsPage(parent, self._keeper)

    def close(self) -> None:
        """Stop what runs."""
        self._keeper.background.cancel()


class OptionsPage(QgsOptionsPageWidget):
    """Shows the engine with what can be done about it, and asks for what holds for all steps."""

    def __init__(self, parent: Any, keeper: Optional[EngineKeeper] = None) -> None:
        super().__init__(parent)
        self._keeper = keeper or EngineKeeper(self)
        self.state, self.told, self.bar = QLabel(), QLabel(), QProgressBar()
        self.install, self.check, self.remove = QPushButton(), QPushButton(tr("Check")), QPushButton(tr("Remove..."))
        self.stop = QPushButton(tr("Cancel"))
        self.python, self.wheels = QgsFileWidget(), QgsFileWidget()
        self.wheels.setStorageMode(QgsFileWidget.StorageMode.GetDirectory)
        self.python.setFilePath(settings.read(settings.PYTHON))
        self.wheels.setFilePath(settings.read(settings.WHEELS))
        self.python.lineEdit().setPlaceholderText(tr("the one that 'Install' makes"))
        self.wheels.lineEdit().setPlaceholderText(tr("none: packages come from the network"))
        self.workers = QSpinBox()
        self.workers.setRange(0, 1024)
        self.workers.setSpecialValueText(tr("one per processor"))
        stored = settings.read(settings.WORKERS)
        self.workers.setValue(int(stored) if stored.isdecimal() else 0)
        self.workers.setToolTip(tr("Each process takes memory: use fewer if it runs short."))
        self.scheduler = QLineEdit(settings.read(settings.SCHEDULER))
        self.scheduler.setPlaceholderText(tr("none: this computer"))
        self._lay_out()
        self.install.clicked.connect(self.run_install)
        self.check.clicked.connect(self.run_check)
        self.remove.clicked.connect(self._remove)
        self.stop.clicked.connect(self._keeper.background.cancel)
        self._keeper.changed.connect(self.refresh)
        self.refresh()

    def apply(self) -> None:
        """Store what was entered; QGIS calls this on OK."""
        settings.write(settings.PYTHON, self.python.filePath())
        settings.write(settings.WHEELS, self.wheels.filePath())
        settings.write(settings.WORKERS, str(self.workers.value() or ""))
        settings.write(settings.SCHEDULER, self.scheduler.text())

    def refresh(self) -> None:
        """Say how the engine stands."""
        keeper, busy = self._keeper, self._keeper.background.busy
        needs = keeper.needs()
        self.state.setText(keeper.state())
        self.told.setText(keeper.told)
        self.told.setVisible(bool(keeper.told))
        self.install.setText(tr("Update") if needs == "update" else tr("Install"))
        self.install.setEnabled(bool(needs) and not busy)
        self.check.setEnabled(not busy)
        self.remove.setEnabled(keeper.removable() and not busy)
        self.bar.setVisible(busy)
        self.stop.setVisible(busy)
        self.bar.setValue(round(keeper.progress))

    def run_install(self) -> None:
        """Install, from where was perhaps entered just now."""
        self.apply()
        self._keeper.install()

    def run_check(self) -> None:
        """Check the engine that was perhaps named just now."""
        self.apply()
        self._keeper.check()

    def _remove(self) -> None:
        asked = tr("Remove the engine in {}? It can be installed again.").format(profile_folder())
        buttons = QMessageBox.StandardButton.Yes | QMessageBox.StandardButton.No
        if QMessageBox.question(self, "Strandline", asked, buttons) == QMessageBox.StandardButton.Yes:
            self._keeper.remove()

    def _lay_out(self) -> None:
        engine = QGroupBox(tr("Engine"))
        form = QFormLayout(engine)
        told = QLabel(tr("Strandline computes in a Python of its own, outside QGIS."))
        for label in (told, self.state, self.told):
            label.setWordWrap(True)
        form.addRow(told)
        form.addRow(tr("State"), self.state)
        buttons, running = QHBoxLayout(), QHBoxLayout()
        for button in (self.install, self.check, self.remove):
            buttons.addWidget(button)
        buttons.addStretch(1)
        running.addWidget(self.bar)
        running.addWidget(self.stop)
        form.addRow(buttons)
        form.addRow(running)
        form.addRow(self.told)
        form.addRow(_named(tr("Python of the engine"), settings.PYTHON), self.python)
        form.addRow(_named(tr("Folder of wheels"), settings.WHEELS), self.wheels)
        work = QGroupBox(tr("Work"))
        form = QFormLayout(work)
        form.addRow(_named(tr("Processes"), settings.WORKERS), self.workers)
        form.addRow(_named(tr("Dask scheduler"), settings.SCHEDULER), self.scheduler)
        told = QLabel(tr("Environment variables ({}) come before these options, an algorithm's parameters before both."))
        told.setText(told.text().format(", ".join(settings.VARIABLES.values())))
        told.setWordWrap(True)
        form.addRow(told)
        column = QVBoxLayout(self)
        column.addWidget(engine)
        column.addWidget(work)
        column.addStretch(1)


def _named(text: str, key: str) -> str:
    """Return the name of an option, with what the environment says in its place."""
    said = settings.overridden(key)
    return tr("{} ({} says {})").format(text, settings.VARIABLES[key], said) if said else text
