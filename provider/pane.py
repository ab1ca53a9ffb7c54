"""The photograph of the sight that was picked, with its tools: what is drawn over it, and the keys."""

from typing import Any, List, Optional

from qgis.PyQt.QtCore import QEvent, Qt, pyqtSignal
from qgis.PyQt.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from ..i18n import tr
from .judgement import CIRCLE, COLOURS
from .marking import Marking, Sight
from .marks import Key, Mark
from .pixels import Level, Pixels, Source
from .viewer import Sign, Viewer

_PREDICTED, _OTHERS = "#ffe14d", "#c8c8c8"
_KEYS = {
    Qt.Key.Key_N: "next",
    Qt.Key.Key_Right: "next",
    Qt.Key.Key_P: "previous",
    Qt.Key.Key_Left: "previous",
    Qt.Key.Key_Space: "open",
    Qt.Key.Key_S: "skip",
    Qt.Key.Key_Delete: "delete",
    Qt.Key.Key_Backspace: "delete",
    Qt.Key.Key_E: "enhanced",
    Qt.Key.Key_F: "fit",
    Qt.Key.Key_Plus: "closer",
    Qt.Key.Key_Minus: "farther",
}


class Pane(QWidget):
    """Shows a sight. ``wanted`` says which tool or key was used: next, previous, open, skip, delete, undo, redo."""

    wanted = pyqtSignal(str)
    told = pyqtSignal(str)

    def __init__(self, parent: Optional[QWidget] = None) -> None:
        super().__init__(parent)
        self.viewer = Viewer()
        self.pixels = Pixels(self)
        self._marking: Optional[Marking] = None
        self._key: Optional[Key] = None
        self._buttons = {
            "previous": _button("◀", tr("Previous photograph (P)")),
            "next": _button("▶", tr("Next photograph (N)")),
            "skip": _button(tr("Skip"), tr("The point cannot be seen here: go on to the next that is not marked (S)")),
            "delete": _button(tr("Delete"), tr("Delete the mark (Del)")),
            "fit": _button(tr("All"), tr("Show all of the photograph (F)")),
            "enhanced": _button(tr("Enhanced"), tr("Show the enhanced image in place of the photograph (E)")),
        }
        self._buttons["enhanced"].setCheckable(True)
        for name, button in self._buttons.items():
            button.clicked.connect(lambda _=False, name=name: self._use(name, pressed=True))
        self.where = QLabel()
        self.where.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        tools = QHBoxLayout()
        tools.setContentsMargins(0, 0, 0, 0)
        tools.setSpacing(2)
        for button in self._buttons.values():
            tools.addWidget(button)
        tools.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(3)
        column.addLayout(tools)
        column.addWidget(self.viewer, 1)
        column.addWidget(self.where)
        self.viewer.marked.connect(self._mark)
        self.viewer.moved.connect(self._mark)
        self.viewer.hovered.connect(self._say_where)
        self.viewer.installEventFilter(self)
        self.pixels.ready.connect(self._level)
        self.pixels.failed.connect(self._failed)
        self.show_sight(None, None)

    @property
    def key(self) -> Optional[Key]:
        """The point and photograph shown."""
        return self._key

    def show_sight(self, marking: Optional[Marking], key: Optional[Key]) -> None:
        """Show the photograph of ``key``, where its point is marked or should be seen; nothing for None."""
        changed = key != self._key
        self._marking, self._key = marking, key
        sight = self._sight()
        for name, button in self._buttons.items():
            button.setEnabled(sight is not None or (marking is not None and name in ("next", "previous")))
        if sight is None:
            self.viewer.show_source(None, [], tr("Choose a photograph of a point in the list."))
            self.where.setText("")
            return
        self._load(sight)
        if changed:
            self._look(sight)
        self.refresh()

    def refresh(self) -> None:
        """Draw marks and predictions anew."""
        sight = self._sight()
        if sight is None or self._marking is None or self.viewer.source is None:
            return
        self.viewer.set_signs(_others(self._marking, sight) + _predicted(sight), _marked(sight))
        self._buttons["delete"].setEnabled(sight.mark is not None)
        self._say_where()

    def _sight(self) -> Optional[Sight]:
        return self._marking.sight(self._key) if self._marking and self._key else None

    def _load(self, sight: Sight, note: str = "") -> None:
        """Show the original or enhanced image, as the button says."""
        photo = sight.photograph
        path = photo.path
        if self._buttons["enhanced"].isChecked() and self._marking:
            enhanced = self._marking.survey.enhanced(photo)
            if enhanced is None:
                self._buttons["enhanced"].setChecked(False)
                self.told.emit(tr("There is no enhanced image of {}: run 'Enhance'.").format(photo.name))
            path = enhanced or path
        source = Source(path, photo.width, photo.height)
        if source != self.viewer.source:
            self.viewer.show_source(source, self.pixels.want(source), tr("Reading {}...").format(photo.name))

    def _look(self, sight: Sight) -> None:
        """Bring what is sought to the middle, its error circle well in sight."""
        spot = sight.mark or sight.prediction
        if spot is None:
            self.viewer.fit()
            return
        sigma = sight.prediction.sigma if sight.prediction and sight.prediction.sigma else 0.0
        room = min(self.viewer.width(), self.viewer.height())
        close = min(3.0, max(0.1, room / max(160.0, 4.0 * CIRCLE * sigma)))
        self.viewer.look_at(spot.x, spot.y, close)

    def _level(self, source: Source, level: Level) -> None:
        self.viewer.add_level(source, level)

    def _failed(self, source: Source, told: str) -> None:
        """Show enhanced what cannot be shown, as many RAW: those pixels are the photograph's, too."""
        sight = self._sight()
        if sight is None or source != self.viewer.source or self._marking is None:
            return
        enhanced = self._marking.survey.enhanced(sight.photograph)
        if enhanced is not None and source.path != enhanced:
            self._buttons["enhanced"].setChecked(True)
            self.told.emit(tr("{} The enhanced image is shown.").format(told))
            self._load(sight)
            self.refresh()
        else:
            self.viewer.say(told)

    def _mark(self, x: float, y: float) -> None:
        if self._marking and self._key:
            self._marking.put(self._key, Mark(x, y))

    def _use(self, name: str, *, pressed: bool = False) -> None:
        if name == "enhanced":
            if not pressed:
                self._buttons[name].toggle()
            sight = self._sight()
            if sight is not None:
                self._load(sight)
                self.refresh()
        elif name == "fit":
            self.viewer.fit()
        elif name in ("closer", "farther"):
            middle = self.viewer.rect().center()
            self.viewer.zoom(1.25 if name == "closer" else 0.8, self.viewer.to_widget(0, 0) * 0 + middle)
        else:
            self.wanted.emit(name)
        if pressed:
            self.viewer.setFocus()

    def _say_where(self, x: Optional[float] = None, y: Optional[float] = None) -> None:
        sight = self._sight()
        if sight is None:
            return
        words: List[str] = [f"{sight.point} · {sight.photograph.name}"]
        if x is not None and y is not None:
            words.append(f"x {x:.1f}  y {y:.1f}")
        if sight.prediction is not None and sight.prediction.sigma is not None:
            words.append(tr("predicted to {:.1f} px").format(sight.prediction.sigma))
        if sight.offset is not None:
            words.append(tr("mark {:.1f} px off").format(sight.offset))
        self.where.setText("   ".join(words))
        self.where.setToolTip(self.where.text())

    def eventFilter(self, watched: Any, event: Any) -> bool:
        """Take the keys that belong to the photograph before QGIS's own shortcuts do."""
        if event.type() in (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress):
            name = _key_name(event)
            if name:
                if event.type() == QEvent.Type.KeyPress:
                    self._use(name)
                event.accept()
                return True
        return super().eventFilter(watched, event)


def _key_name(event: Any) -> str:
    control = bool(event.modifiers() & Qt.KeyboardModifier.ControlModifier)
    shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
    if control:
        if event.key() == Qt.Key.Key_Z:
            return "redo" if shift else "undo"
        return "redo" if event.key() == Qt.Key.Key_Y else ""
    return _KEYS.get(event.key(), "")


def _marked(sight: Sight) -> Optional[Sign]:
    return Sign(sight.mark.x, sight.mark.y, COLOURS[sight.judgement], sight.point) if sight.mark else None


def _predicted(sight: Sight) -> List[Sign]:
    if sight.prediction is None:
        return []
    radius = None if sight.prediction.sigma is None else CIRCLE * sight.prediction.sigma
    return [Sign(sight.prediction.x, sight.prediction.y, _PREDICTED, "", radius, dashed=True)]


def _others(marking: Marking, sight: Sight) -> List[Sign]:
    """Return the other points in this photograph, so that one is not taken for another."""
    marks = {k: v for k, v in marking.table.marks().items() if k[1] == sight.photograph.name and k[0] != sight.point}
    places = {k[0]: v for k, v in marking.predictions.items() if k[1] == sight.photograph.name and k[0] != sight.point}
    places.update({k[0]: v for k, v in marks.items()})
    return [Sign(v.x, v.y, _OTHERS, name, None, dashed=True) for name, v in places.items()]


def _button(text: str, tip: str) -> QToolButton:
    button = QToolButton()
    button.setText(text)
    button.setToolTip(tip)
    button.setAutoRaise(True)
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    return button
