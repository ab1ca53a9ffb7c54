"""The engine as the options page sees it: its state, and how it is installed, checked and removed."""

from typing import Any, Dict, List, Optional

from qgis.PyQt.QtCore import QObject, pyqtSignal

from ..bridge import engine, install, settings
from ..i18n import tr
from .background import Background


class EngineKeeper(QObject):
    """Lives as long as the plugin, so that an installation outlives the page; ``changed`` when there is something to tell."""

    changed = pyqtSignal()

    def __init__(self, parent: Optional[QObject] = None) -> None:
        super().__init__(parent)
        self.background = Background(self)
        self.told = ""
        self.progress = 0.0
        self.background.started.connect(lambda _: self.changed.emit())
        self.background.ended.connect(self.changed)
        self.background.progressed.connect(self._progressed)

    def state(self) -> str:
        """Return in a sentence where the engine is and whether it is ready."""
        try:
            return tr("Ready: {}").format(engine.find_python())
        except engine.MissingEngine as error:
            return str(error)

    def needs(self) -> str:
        """Return what there is to do: "install", "update", or nothing."""
        if settings.effective(settings.PYTHON):
            return ""  # named by the user: not ours to change
        states = {install.state(folder) for folder in (engine.clone_folder(), engine.profile_folder())}
        return "" if "ready" in states else "update" if "outdated" in states else "install"

    def removable(self) -> bool:
        """Tell whether there is an engine in the profile."""
        return engine.profile_folder().is_dir()

    def install(self) -> None:
        """Install or update the engine, from a folder of wheels if one is set; this downloads about 1 GB otherwise."""
        parameters: Dict[str, Any] = {"INSTALL": True}
        if settings.effective(settings.WHEELS):
            parameters["WHEELS"] = settings.effective(settings.WHEELS)
        self._run(parameters)

    def check(self) -> None:
        """Have the engine check itself."""
        self._run({"INSTALL": False})

    def remove(self) -> None:
        """Remove the engine of the profile."""
        try:
            engine.remove()
            self._say(tr("The engine was removed from the profile."))
        except OSError as error:
            self._say(tr("The engine could not be removed whole: {}.").format(error))

    def _run(self, parameters: Dict[str, Any]) -> None:
        self.progress = 0.0
        self.background.run("checkengine", parameters, self._done, self._say)

    def _done(self, results: Dict[str, Any], warnings: List[str]) -> None:
        self._say(" ".join([tr("The engine works.") if results.get("READY") else self.state(), *warnings]))

    def _progressed(self, value: float) -> None:
        self.progress = value
        self.changed.emit()

    def _say(self, text: str) -> None:
        self.told = text
        self.changed.emit()
