"""What Strandline adds to QGIS's windows: its menu and toolbar, and the dock."""

from typing import Any, Callable, List, Optional

from qgis.PyQt.QtCore import Qt
from qgis.PyQt.QtGui import QIcon

from ..bridge.engine import ROOT
from ..i18n import tr
from .compat import QAction
from .dock import MarkingDock

_MENU = "Strandline"


class Desktop:
    """Adds actions, and takes them away again."""

    def __init__(self, iface: Any) -> None:
        self._iface = iface
        self._dock: Optional[MarkingDock] = None
        self._bar = iface.addToolBar("Strandline")
        self._bar.setObjectName("StrandlineToolbar")
        self._actions: List[Any] = []
        self._add("mark", tr("Mark ground points"), self.show_dock)

    def show_dock(self) -> MarkingDock:
        """Show the dock, made when it is first asked for."""
        if self._dock is None:
            self._dock = MarkingDock(self._iface.mainWindow())
            self._iface.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, self._dock)
        self._dock.setUserVisible(True)
        return self._dock

    def close(self) -> None:
        """Leave no trace."""
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
