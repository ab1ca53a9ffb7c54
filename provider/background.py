"""Algorithms in the background: one at a time, with its progress, its messages and a way to stop it."""

from typing import Any, Callable, Dict, List, Optional

from qgis.core import (
    QgsApplication,
    QgsProcessingAlgRunnerTask,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProject,
)
from qgis.PyQt.QtCore import QObject, pyqtSignal

from ..i18n import tr

Results = Dict[str, Any]


class _Listening(QgsProcessingFeedback):
    """Keeps what the algorithm says; it speaks from another thread."""

    def __init__(self) -> None:
        super().__init__(False)
        self.errors: List[str] = []
        self.warnings: List[str] = []

    def reportError(self, error: str, fatalError: bool = False) -> None:
        self.errors.append(error)
        super().reportError(error, fatalError)

    def pushWarning(self, warning: str) -> None:
        self.warnings.append(warning)
        super().pushWarning(warning)


class Background(QObject):
    """Runs an algorithm as a task of QGIS, which shows it in the status bar, too."""

    started = pyqtSignal(str)
    progressed = pyqtSignal(float)
    ended = pyqtSignal()

    def __init__(self, parent: Optional[QObject] = None) -> None:
        super().__init__(parent)
        self._task: Optional[QgsProcessingAlgRunnerTask] = None
        self._kept: List[Any] = []

    @property
    def busy(self) -> bool:
        """Tell whether something runs."""
        return self._task is not None

    def run(
        self,
        name: str,
        parameters: Dict[str, Any],
        done: Callable[[Results, List[str]], None],
        failed: Callable[[str], None],
        keep: Any = None,
    ) -> bool:
        """Start ``name``; ``done`` gets its results and warnings, ``failed`` a sentence; ``keep`` lives until then.

        Return whether it was started.
        """
        if self.busy:
            failed(tr("Something is still running: wait for it or cancel it."))
            return False
        algorithm = QgsApplication.processingRegistry().createAlgorithmById(f"strandline:{name}")
        context = QgsProcessingContext()
        context.setProject(QgsProject.instance())
        fine, told = algorithm.canExecute()
        if fine:
            fine, told = algorithm.checkParameterValues(parameters, context)
        if not fine:
            failed(told)
            return False
        feedback = _Listening()
        task = QgsProcessingAlgRunnerTask(algorithm, parameters, context, feedback)
        if task.isCanceled():  # its preparation failed
            failed("; ".join(feedback.errors) or tr("{} cannot be started.").format(algorithm.displayName()))
            return False

        def executed(successful: bool, results: Results) -> None:
            cancelled = feedback.isCanceled()
            kept, self._task, self._kept = self._kept, None, []  # alive to the end of this; what follows may start another
            self.ended.emit()
            if successful:
                done(results, list(feedback.warnings))
            elif not cancelled:
                failed(feedback.errors[-1].strip() if feedback.errors else tr("It failed without a word."))
            kept.clear()

        task.executed.connect(executed)
        task.progressChanged.connect(self.progressed)
        self._task, self._kept = task, [algorithm, context, feedback, keep]
        self.started.emit(algorithm.displayName())
        QgsApplication.taskManager().addTask(task)
        return True

    def cancel(self) -> None:
        """Stop what runs; the engine is gone within a moment."""
        if self._task is not None:
            self._task.cancel()
