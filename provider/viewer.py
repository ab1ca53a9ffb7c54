"""The photograph on the screen: zoom about the cursor, pan, click to mark, drag to correct. It knows nothing of tables."""

from typing import Any, List, NamedTuple, Optional

from qgis.PyQt.QtCore import QPointF, QRectF, Qt, QTimer, pyqtSignal
from qgis.PyQt.QtGui import QColor, QPainter, QPalette, QPen, QTextOption, QTransform
from qgis.PyQt.QtWidgets import QApplication, QSizePolicy, QWidget

from .compat import position
from .pixels import Level, Source

_LEAST, _MOST = 0.01, 32.0  # screen pixels per pixel of the photograph
_STEP = 1.25  # of zoom, for a notch of the wheel
_REACH = 9.0  # screen pixels within which a mark is taken hold of


class Sign(NamedTuple):
    """Something drawn over the photograph: a cross at (x, y), a circle of ``radius`` (px) when there is one."""

    x: float
    y: float
    colour: str
    label: str = ""
    radius: Optional[float] = None
    dashed: bool = False


class Viewer(QWidget):
    """Shows levels of one photograph. Coordinates are pixels from the top-left corner of its top-left pixel."""

    marked = pyqtSignal(float, float)
    moved = pyqtSignal(float, float)
    hovered = pyqtSignal(float, float)

    def __init__(self, parent: Optional[QWidget] = None) -> None:
        super().__init__(parent)
        self.setMinimumSize(200, 160)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setCursor(Qt.CursorShape.CrossCursor)
        self._source: Optional[Source] = None
        self._levels: List[Level] = []
        self._signs: List[Sign] = []
        self._mark: Optional[Sign] = None  # the one that can be dragged
        self._text = ""
        self._scale, self._corner = 1.0, QPointF()  # screen px per px; the screen's place of (0, 0)
        self._fitted = True
        self._pressed: Optional[QPointF] = None
        self._held, self._panning, self._dragged = False, False, False
        self._still = QTimer(self)  # panning draws quickly, and well when the hand rests
        self._still.setSingleShot(True)
        self._still.timeout.connect(self.update)

    def show_source(self, source: Optional[Source], levels: List[Level], text: str = "") -> None:
        """Show another photograph, with the levels that are there; ``text`` is shown while there are none."""
        same = source is not None and self._source is not None and source[1:] == self._source[1:]
        self._source, self._levels, self._text = source, list(levels), text
        self._signs, self._mark = [], None
        if not same:
            self.fit()
        self.update()

    def add_level(self, source: Source, level: Level) -> None:
        """Take another level of the photograph that is shown."""
        if source == self._source:
            self._levels.append(level)
            self.update()

    def set_signs(self, signs: List[Sign], mark: Optional[Sign]) -> None:
        """Draw ``signs``, and ``mark``, which can be dragged."""
        self._signs, self._mark = list(signs), mark
        self.update()

    def say(self, text: str) -> None:
        """Show ``text`` in place of a photograph."""
        self._text = text
        self.update()

    @property
    def source(self) -> Optional[Source]:
        """What is shown."""
        return self._source

    @property
    def scale(self) -> float:
        """Screen pixels per pixel of the photograph."""
        return self._scale

    def to_photograph(self, place: QPointF) -> QPointF:
        """Return what lies at a place of the widget."""
        return (place - self._corner) / self._scale

    def to_widget(self, x: float, y: float) -> QPointF:
        """Return where (x, y) of the photograph lies in the widget."""
        return QPointF(x, y) * self._scale + self._corner

    def fit(self) -> None:
        """Show all of the photograph."""
        if self._source is None:
            return
        width, height = self._source.width, self._source.height
        self._scale = max(_LEAST, min(self.width() / width, self.height() / height, 1.0))
        self._corner = QPointF((self.width() - width * self._scale) / 2, (self.height() - height * self._scale) / 2)
        self._fitted = True
        self.update()

    def look_at(self, x: float, y: float, scale: Optional[float] = None) -> None:
        """Bring (x, y) to the middle, at ``scale`` when given."""
        self._fitted = False
        self._scale = min(_MOST, max(_LEAST, scale or self._scale))
        self._corner = QPointF(self.width() / 2, self.height() / 2) - QPointF(x, y) * self._scale
        self._keep_in_sight()
        self.update()

    def zoom(self, factor: float, about: QPointF) -> None:
        """Zoom so that what lies at ``about`` stays there."""
        fixed = self.to_photograph(about)
        self._fitted = False
        self._scale = min(_MOST, max(_LEAST, self._scale * factor))
        self._corner = about - fixed * self._scale
        self._keep_in_sight()
        self.update()

    def _keep_in_sight(self) -> None:
        """Leave no less than a strip of the photograph on the screen."""
        if self._source is None:
            return
        strip = 40.0
        x = min(max(self._corner.x(), strip - self._source.width * self._scale), self.width() - strip)
        y = min(max(self._corner.y(), strip - self._source.height * self._scale), self.height() - strip)
        self._corner = QPointF(x, y)

    def paintEvent(self, event: Any) -> None:
        """Draw the best level there is for the scale, then what lies over it."""
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor("#3a3a3a"))
        if self._source is not None and self._levels:
            self._paint_level(painter)
            self._paint_signs(painter)
        elif self._text:
            painter.setPen(QColor("#dddddd"))
            painter.drawText(
                QRectF(self.rect()).adjusted(12, 12, -12, -12), self._text, QTextOption(Qt.AlignmentFlag.AlignCenter)
            )
        if self.hasFocus():
            painter.setPen(QPen(self.palette().color(QPalette.ColorRole.Highlight), 2))
            painter.drawRect(self.rect().adjusted(1, 1, -1, -1))
        painter.end()

    def _paint_level(self, painter: QPainter) -> None:
        wanted = 1.0 / (self._scale * self.devicePixelRatioF())
        fine = [level for level in self._levels if level.factor <= max(1.0, wanted)]
        level = max(fine, key=lambda v: v.factor) if fine else min(self._levels, key=lambda v: v.factor)
        painter.save()
        painter.setTransform(QTransform.fromTranslate(self._corner.x(), self._corner.y()), True)
        painter.scale(self._scale * level.factor, self._scale * level.factor)
        # Enlarged pixels stay squares: one sees what one marks.
        smooth = self._scale * level.factor < 1.0 or level.factor > 1
        quick = self._panning or self._still.isActive()
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, smooth and not quick)
        seen = painter.transform().inverted()[0].mapRect(QRectF(self.rect())).adjusted(-1, -1, 1, 1)
        seen = QRectF(seen.toAlignedRect().intersected(level.image.rect()))
        painter.drawImage(seen, level.image, seen)
        painter.restore()

    def _paint_signs(self, painter: QPainter) -> None:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, True)
        for sign in [*self._signs, *([self._mark] if self._mark else [])]:
            place = self.to_widget(sign.x, sign.y)
            style = Qt.PenStyle.DashLine if sign.dashed else Qt.PenStyle.SolidLine
            for colour, thickness in ((QColor(0, 0, 0, 150), 3.5), (QColor(sign.colour), 1.6)):
                painter.setPen(QPen(colour, thickness, style))
                _cross(painter, place, 5.0 if sign.dashed else 11.0)
                if sign.radius is not None and sign.radius * self._scale > 3.0:
                    painter.drawEllipse(place, sign.radius * self._scale, sign.radius * self._scale)
            if sign.label:
                _label(painter, place, sign)

    def resizeEvent(self, event: Any) -> None:
        """Keep what was fitted fitted, and the middle in the middle otherwise."""
        if self._fitted:
            self.fit()
        elif event.oldSize().isValid():
            grown = event.size() - event.oldSize()
            self._corner += QPointF(grown.width() / 2, grown.height() / 2)
        super().resizeEvent(event)

    def wheelEvent(self, event: Any) -> None:
        """Zoom about the cursor."""
        notches = event.angleDelta().y() / 120.0
        if notches and self._source is not None:
            self.zoom(_STEP**notches, position(event))
        event.accept()

    def mousePressEvent(self, event: Any) -> None:
        """Take hold of the mark, or of the photograph."""
        if self._source is None or event.button() not in (Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton):
            super().mousePressEvent(event)
            return
        self.setFocus()
        self._pressed = position(event)
        self._panning = event.button() == Qt.MouseButton.MiddleButton
        self._held = not self._panning and self._mark is not None and self._on_mark(self._pressed)

    def mouseMoveEvent(self, event: Any) -> None:
        """Drag the mark, or the photograph."""
        place = position(event)
        if self._source is None:
            return
        if self._pressed is not None and self._held and self._mark is not None:
            step = (place - self._pressed) / self._scale  # the mark keeps its distance from the cursor, it does not jump to it
            self._pressed, self._dragged = place, True
            self._mark = self._mark._replace(x=self._mark.x + step.x(), y=self._mark.y + step.y())
            self.update()
        elif self._pressed is not None:
            if not self._panning and (place - self._pressed).manhattanLength() >= QApplication.startDragDistance():
                self._panning = True
                self.setCursor(Qt.CursorShape.ClosedHandCursor)
            if self._panning:
                self._corner += place - self._pressed
                self._pressed = place
                self._fitted = False
                self._keep_in_sight()
                self._still.start(120)
                self.update()
        else:
            over = self._mark is not None and self._on_mark(place)
            self.setCursor(Qt.CursorShape.SizeAllCursor if over else Qt.CursorShape.CrossCursor)
        spot = self._spot(place)
        self.hovered.emit(spot.x(), spot.y())

    def mouseReleaseEvent(self, event: Any) -> None:
        """Announce a mark that was set or dragged."""
        if self._pressed is None:
            return
        place, panned, mark = position(event), self._panning, self._mark if self._held else None
        dragged = self._dragged
        self._pressed, self._panning, self._held, self._dragged = None, False, False, False
        self.setCursor(Qt.CursorShape.CrossCursor)
        if panned:
            self.update()
            return
        spot = self._spot(place) if mark is None else QPointF(mark.x, mark.y)
        if not self._inside(spot):
            return
        if mark is None:
            self.marked.emit(spot.x(), spot.y())
        elif dragged:
            self.moved.emit(spot.x(), spot.y())

    def _spot(self, place: QPointF) -> QPointF:
        """Return what is pointed at: the middle of the screen's pixel where the system tells no more than which it is."""
        ratio = self.devicePixelRatioF()
        whole = all(abs(v * ratio - round(v * ratio)) < 1e-6 for v in (place.x(), place.y()))
        return self.to_photograph(place + QPointF(0.5, 0.5) / ratio if whole else place)

    def _inside(self, spot: QPointF) -> bool:
        return self._source is not None and 0 <= spot.x() <= self._source.width and 0 <= spot.y() <= self._source.height

    def _on_mark(self, place: QPointF) -> bool:
        off = self.to_widget(self._mark.x, self._mark.y) - place if self._mark else QPointF(1e9, 1e9)
        return max(abs(off.x()), abs(off.y())) <= _REACH


def _cross(painter: QPainter, place: QPointF, arm: float) -> None:
    """Draw a cross that leaves its middle open."""
    gap = 2.5 if arm > 6 else 0.0
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        painter.drawLine(place + QPointF(dx, dy) * gap, place + QPointF(dx, dy) * arm)


def _label(painter: QPainter, place: QPointF, sign: Sign) -> None:
    corner = place + QPointF(13, -6)
    for off in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        painter.setPen(QColor(0, 0, 0, 190))
        painter.drawText(corner + QPointF(*off), sign.label)
    painter.setPen(QColor(sign.colour))
    painter.drawText(corner, sign.label)
