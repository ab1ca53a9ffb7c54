"""The dock in which ground points are marked in the photographs."""

from importlib import import_module
from typing import Any, Callable, Dict, List, Optional

from qgis.gui import QgsCollapsibleGroupBox, QgsDockWidget
from qgis.PyQt.QtCore import Qt
from qgis.PyQt.QtWidgets import QFrame, QLabel, QMenu, QProgressBar, QScrollArea, QSplitter, QToolButton, QVBoxLayout, QWidget

from ..bridge.survey import SurveyError, SurveyView
from ..i18n import tr
from . import engine_runs
from .background import Background
from .chosen import Chooser
from .groundpoints import one_point
from .judgement import read_residuals
from .mapselection import MapSelection
from .marking import Marking
from .marks import MarksError, MarksTable
from .pane import Pane
from .pointlist import PointList
from .surveymap import add_survey, keep_residuals
from .widgets import button, row


class MarkingDock(QgsDockWidget):
    """Puts chooser, list, photograph and engine together."""

    def __init__(self, parent: Optional[QWidget] = None) -> None:
        super().__init__(tr("Mark ground points"), parent)
        self.setObjectName("StrandlineMarking")
        self.marking: Optional[Marking] = None
        self.chooser, self.list, self.pane = Chooser(), PointList(), Pane()
        self.background, self.selection = Background(self), MapSelection(self)
        self.predict = button(tr("Predict"), tr("Compute where each point should be seen in which photograph"))
        self.measure = button(tr("Measure"), tr("Look for painted targets where points are predicted, and measure them"))
        self.adjust = button(tr("Adjust"), tr("Georeference the survey with these marks, then show the residuals"))
        self.show_map = button(tr("To map"), tr("Add the survey's photographs, tie points, residuals and surface to the map"))
        self.undo = button("↶", tr("Undo (Ctrl+Z)"))
        self.redo = button("↷", tr("Redo (Ctrl+Shift+Z)"))
        self.verdict, self.message, self.bar, self.stop = (
            QLabel(),
            QLabel(),
            QProgressBar(),
            button(tr("Cancel"), tr("Stop what is running")),
        )
        self._lay_out()
        self._connect()
        self.choose()

    def choose(self) -> None:
        """Begin with what is chosen above, as far as it goes."""
        self._end()
        try:
            survey = SurveyView.read(self.chooser.survey.filePath())
            points, table = self.chooser.points.currentLayer(), self.chooser.table()
            fields = self.chooser.fields()
            if points is None or not fields.name or table is None:
                self.say(tr("Choose the layer of ground points, the field of their names, and the table of marks."))
                return
            self.marking = Marking(survey, points, fields, MarksTable(table, self), self)
        except (SurveyError, MarksError) as error:
            self.say(str(error) if self.chooser.survey.filePath() else tr("Choose the survey folder to begin."))
            return
        for layer in (points, table):
            layer.willBeDeleted.connect(self._end)
        self.marking.changed.connect(self._refresh)
        self.marking.told.connect(self.say)
        self.selection.follow(self.marking)
        self.list.show_marking(self.marking)
        self._refresh()
        self.say(self._state())
        if survey.state("georeference") == "ready":
            self.run_predict()

    def say(self, text: str) -> None:
        """Tell the user something."""
        self.message.setText(text)
        self.message.setVisible(bool(text))

    def run_predict(self) -> None:
        """Have the engine predict; by the photographs' positions first when nothing is georeferenced yet."""
        marking = self._ready()
        if marking is None:
            return
        marking.survey = SurveyView.read(str(marking.survey.folder))
        if marking.survey.state("georeference") == "ready":
            parameters = engine_runs.prediction_parameters(marking.survey, marking.layer, marking.fields, "none")
            self._run("predictmarks", parameters, lambda results: self._predicted(marking, results))
        elif marking.survey.state("orient") != "ready":
            self.say(tr("The survey is not oriented yet: run 'Orient' first. Until then all photographs are listed."))
        elif any(p.position for p in marking.survey.photographs):
            parameters = engine_runs.gnss_parameters(marking.survey)
            self._run("georeference", parameters, lambda results: self.run_predict())
        else:
            self.say(
                tr("Nothing tells where the photographs were taken: mark three points in two photographs each, then adjust.")
            )

    def run_measure(self, all_points: bool) -> None:
        """Have the engine measure the targets of the point that is picked, or of all."""
        marking, current = self._ready(), self.list.current()
        if marking is None:
            return
        point = marking.point(current[0]) if current else None
        if not all_points and point is None:
            self.say(tr("Choose a point in the list first."))
            return
        layer = marking.layer if all_points or point is None else one_point(marking.layer, point)
        parameters = engine_runs.prediction_parameters(marking.survey, layer, marking.fields, "target")
        self._run("predictmarks", parameters, lambda results: self._measured(marking, results), keep=layer)

    def run_adjust(self) -> None:
        """Have the engine georeference with the marks."""
        marking = self._ready()
        if marking is None:
            return
        if not marking.table.marks():
            self.say(tr("There are no marks yet: mark points in the photographs first."))
            return
        marking.survey = SurveyView.read(str(marking.survey.folder))
        parameters, without = engine_runs.adjustment_parameters(
            marking.survey, marking.layer, marking.fields, marking.table.layer
        )
        note = tr("The areas that the last georeferencing ignored are not: use 'Adjust with...' for that.") if without else ""
        self._run("georeference", parameters, lambda results: self._adjusted(marking, results, note))

    def add_to_map(self) -> None:
        """Load the survey into the map."""
        if self.marking is not None:
            add_survey(self.marking.survey, self.background, lambda warnings: self.say(" ".join(warnings)), self.say)

    def open_dialog(self) -> None:
        """Open 'Georeference' itself, filled in, for all that the button does not ask."""
        processing = import_module("processing")  # QGIS's own plugin, there in the desktop alone

        if self.marking is not None:
            marking = self.marking
            parameters, _ = engine_runs.adjustment_parameters(marking.survey, marking.layer, marking.fields, marking.table.layer)
            dialog = processing.createAlgorithmDialog("strandline:georeference", parameters)
            dialog.algorithmFinished.connect(lambda ok, results: ok and self._adjusted(marking, results, ""))
            dialog.show()

    def go(self, name: str) -> None:
        """Do what a key or button of the photograph says."""
        marking, key = self.marking, self.pane.key or self.list.current()
        if marking is None:
            return
        if name in ("undo", "redo"):
            getattr(marking.undo, name)()
        elif name == "delete" and self.pane.key:
            marking.remove(self.pane.key)
        elif name in ("next", "previous", "open", "skip"):
            if name == "skip" and self.pane.key:
                marking.skip(self.pane.key)
            to = marking.step(key, -1 if name == "previous" else 1, open_only=name in ("open", "skip"))
            if to is None:
                self.say(tr("This is the first.") if name == "previous" else tr("This is the last."))
            else:
                self.list.choose(*to)

    def _ready(self) -> Optional[Marking]:
        if self.marking is None:
            self.choose()
        return self.marking

    def _run(self, name: str, parameters: Dict[str, Any], done: Callable[[Any], None], keep: Any = None) -> None:
        marking = self.marking

        def arrived(results: Any, warnings: List[str]) -> None:
            if marking is self.marking:  # what was chosen meanwhile is another story
                self.say(" ".join(warnings[:2]))
                done(results)

        self.say("")
        self.background.run(name, parameters, arrived, self.say, keep)

    def _predicted(self, marking: Marking, results: Dict[str, Any]) -> None:
        marking.take_predictions(engine_runs.read_predictions(engine_runs.opened(results["OUTPUT"])))
        self.list.show_marking(marking)
        self._again()

    def _measured(self, marking: Marking, results: Dict[str, Any]) -> None:
        taken, left = marking.take_measured(engine_runs.read_measured(engine_runs.opened(results["OUTPUT"])))
        told = tr("{} targets were measured, {} were not found.").format(taken + left, results["MISSED_COUNT"])
        if left:
            told += " " + tr("{} marks by eye lie more than 3 px from them and stay.").format(left)
        self.say(told)

    def _adjusted(self, marking: Marking, results: Dict[str, Any], note: str) -> None:
        if results.get("RESIDUALS"):
            marking.take_residuals(read_residuals(engine_runs.opened(results["RESIDUALS"])))
            try:
                keep_residuals(marking.survey, str(results["RESIDUALS"]))
            except OSError as error:
                note += " " + tr("The residuals cannot be kept for the map: {}.").format(error)
        told = tr("Control: {} in plan, {} in height. Check: {}, {}.").format(
            *(engine_runs.centimetres(results.get(k)) for k in ("PLANI_CONTROL", "ALTI_CONTROL", "PLANI_CHECK", "ALTI_CHECK"))
        )
        self.verdict.setText(" ".join(filter(None, (told, note, self.message.text()))))
        self.verdict.show()
        self.run_predict()  # where the marks should lie now

    def _again(self) -> None:
        """Show what was shown once more: its predictions are there now."""
        key = self.pane.key
        if key is not None and self.marking is not None:
            self.list.choose(*key, quietly=True)
            self.pane.refresh()

    def _picked(self, point: str, photograph: str) -> None:
        self.selection.pick(point)
        if not self.pane.key and not self.head.isCollapsed():
            self.head.setCollapsed(True)  # all is chosen, the room is the photograph's
        key = (point, photograph) if photograph else None
        if self.marking is not None and key is None:
            sights = self.marking.sights(point)
            key = sights[0].key if sights else None
        self.pane.show_sight(self.marking, key)

    def _refresh(self) -> None:
        marking = self.marking
        self.list.refresh()
        self.pane.refresh()
        for tool, able in ((self.undo, "canUndo"), (self.redo, "canRedo")):
            tool.setEnabled(marking is not None and bool(getattr(marking.undo, able)()))
        for tool in (self.predict, self.measure, self.adjust, self.show_map):
            tool.setEnabled(marking is not None and not self.background.busy)

    def _state(self) -> str:
        """Return what is to be known of survey and table, in a sentence or two."""
        marking = self.marking
        if marking is None:
            return ""
        told = []
        if not marking.points:
            told.append(tr("No point of the layer has a name: choose the field of the names."))
        if marking.survey.state("georeference") == "stale":
            told.append(tr("The georeferencing is older than the orientation: adjust again."))
        elif marking.survey.state("georeference") == "missing":
            told.append(
                tr("Nothing is georeferenced yet: all photographs are listed, the nearest first. 'Predict' does it by GNSS.")
            )
        if marking.table.unread:
            told.append(
                tr("{} rows of the table name no point or photograph, are not complete, or stand twice: {}.").format(
                    len(marking.table.unread), "; ".join(marking.table.unread[:3])
                )
            )
        return " ".join(told)

    def _end(self) -> None:
        """Let go of what was marked."""
        if self.marking is None:
            return
        marking, self.marking = self.marking, None
        self.background.cancel()
        self.selection.follow(None)
        self.list.show_marking(None)
        self.pane.show_sight(None, None)
        for signal, slot in ((marking.changed, self._refresh), (marking.told, self.say)):
            signal.disconnect(slot)
        marking.table.deleteLater()
        marking.deleteLater()
        self._refresh()

    def closeEvent(self, event: Any) -> None:
        """Let go of the photographs: they take memory."""
        self.pane.pixels.stop()
        super().closeEvent(event)

    def _progress(self, name: str = "") -> None:
        self.bar.setFormat(f"{name} %p%" if name else "%p%")
        self.bar.setValue(0)
        for widget in (self.bar, self.stop):
            widget.setVisible(self.background.busy)
        self._refresh()

    def _connect(self) -> None:
        self.chooser.chosen.connect(self.choose)
        self.chooser.told.connect(self.say)
        self.list.chosen.connect(self._picked)
        self.pane.wanted.connect(self.go)
        self.pane.told.connect(self.say)
        self.selection.picked.connect(lambda name: self.list.choose(name))
        self.predict.clicked.connect(self.run_predict)
        self.adjust.clicked.connect(self.run_adjust)
        self.show_map.clicked.connect(self.add_to_map)
        self.undo.clicked.connect(lambda: self.go("undo"))
        self.redo.clicked.connect(lambda: self.go("redo"))
        self.stop.clicked.connect(self.background.cancel)
        self.background.started.connect(self._progress)
        self.background.progressed.connect(lambda value: self.bar.setValue(round(value)))
        self.background.ended.connect(self._progress)

    def _lay_out(self) -> None:
        self.head = QgsCollapsibleGroupBox(tr("Survey, points and marks"))
        QVBoxLayout(self.head).addWidget(self.chooser)
        menu = QMenu(self)
        menu.addAction(tr("Targets of this point"), lambda: self.run_measure(False))
        menu.addAction(tr("Targets of all points"), lambda: self.run_measure(True))
        self.measure.setMenu(menu)
        self.measure.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        more = QMenu(self)
        more.addAction(tr("Adjust with..."), self.open_dialog)
        self.adjust.setMenu(more)
        self.adjust.setPopupMode(QToolButton.ToolButtonPopupMode.MenuButtonPopup)
        tools = row(self.predict, self.measure, self.adjust, self.show_map, None, self.undo, self.redo)
        for label in (self.verdict, self.message):
            label.setWordWrap(True)
            label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.bar.setTextVisible(True)
        split = QSplitter(Qt.Orientation.Vertical)
        split.addWidget(self.list)
        split.addWidget(self.pane)
        split.setStretchFactor(0, 2)
        split.setStretchFactor(1, 5)
        split.setChildrenCollapsible(False)
        whole = QWidget()
        column = QVBoxLayout(whole)
        column.setContentsMargins(6, 6, 6, 6)
        column.addWidget(self.head)
        column.addLayout(tools)
        column.addWidget(split, 1)
        column.addLayout(row(self.bar, self.stop))
        column.addWidget(self.verdict)
        column.addWidget(self.message)
        for widget in (self.bar, self.stop, self.verdict):
            widget.hide()
        scroll = QScrollArea()  # on small screens, or with large letters, QGIS's window need not grow for the dock
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setWidget(whole)
        self.setWidget(scroll)
