"""What Strandline adds to QGIS's windows: its menu and toolbar, and the dock."""

from typing import Any, Callable, List, Optional

from qgis.core import Qgis
from qgis.PyQt.QtCore import Qt
from qgis.PyQt.QtGui import QIcon
from qgis.PyQt.QtWidgets import QFileDialog

from ..bridge.engine import ROOT
from ..bridge.survey import SurveyError, SurveyView
from ..i18n import tr
from .background import Background
from .compat import QAction
from .dock import MarkingDock
from .surveymap import add_survey

_MENU = "Strandline"


class Desktop:
    """Adds actions, and takes them away again."""

    def __init__(self, iface: Any) -> None:
        self._iface = iface
        self._dock: Optional[MarkingDock] = None
        self._bar = iface.addToolBar("Strandline")
        self._bar.setObjectName("StrandlineToolbar")
        self._actions: List[Any] = []
        self._background = Background()
        self._add("mark", tr("Mark ground points"), self.show_dock)
        self._add("map", tr("Add survey to map..."), self.add_survey)

    def show_dock(self) -> MarkingDock:
        """Show the dock, made when it is first asked for."""
        if self._dock is None:
            self._dock = MarkingDock(self._iface.mainWindow())
            self._iface.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, self._dock)
        self._dock.setUserVisible(True)
        return self._dock

    def add_survey(self) -> None:
        """Ask for a survey and load it into the map."""
        window, bar = self._iface.mainWindow(), self._iface.messageBar()
        start = self._dock.chooser.survey.filePath() if self._dock else ""
        folder = QFileDialog.getExistingDirectory(window, tr("Survey folder"), start)
        if not folder:
            return

        def failed(told: str) -> None:
            bar.pushMessage(_MENU, told, Qgis.MessageLevel.Warning)

        try:
            add_survey(SurveyView.read(folder), self._background, self._added, failed)
        except SurveyError as error:
            failed(str(error))

    def _added(self, warnings: List[str]) -> None:
        told = " ".join([tr("The survey is in the map."), *warnings])
        self._iface.messageBar().pushMessage(_MENU, told, Qgis.MessageLevel.Info)

    def close(self) -> None:
        """Leave no trace."""
        self._background.cancel()
        for action in self._actions:
            self._iface.removePluginMenu(_MENU, action)
        if self._dock is not None:
            self._dock.close()
            self._iface.removeDockWidget(self._dock)
            self._dock.deleteLater()
        self._iface.mainWindow().removeToolBar(self._bar)
        self._bar.deleteLater()

    def _add(self, name: str, text: str, do: Callable[[], Any]) -> None:
        action = QAction(QIcon(str(ROOT / "icon.svg")), text, self._iface.mainWindow())
        action.setObjectName(f"strandline_{name}")
        action.triggered.connect(lambda _=False: do())
        self._iface.addPluginToMenu(_MENU, action)
        self._bar.addAction(action)
        self._actions.append(action)
