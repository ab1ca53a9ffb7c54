"""The list: each ground point with the photographs that show it, coloured by what the adjustment left."""

from typing import Any, Dict, List, Optional

from qgis.PyQt.QtCore import QSize, Qt, pyqtSignal
from qgis.PyQt.QtGui import QColor, QIcon, QPainter, QPixmap
from qgis.PyQt.QtWidgets import QHeaderView, QTreeWidget, QTreeWidgetItem

from ..i18n import tr
from .judgement import COLOURS, UNKNOWN, Residual
from .marking import Marking, Sight
from .marks import Key

_ROLE = Qt.ItemDataRole.UserRole
_SHOWN = 200  # photographs listed of a point where nothing tells which show it


class PointList(QTreeWidget):
    """A tree of two levels. ``chosen`` says what the user picked: a point, and a photograph or an empty text."""

    chosen = pyqtSignal(str, str)

    def __init__(self, parent: Any = None) -> None:
        super().__init__(parent)
        self.setColumnCount(3)
        self.setHeaderLabels([tr("Point, photograph"), tr("Marks"), tr("Off")])
        self.headerItem().setToolTip(
            1, tr("Of a point: in how many photographs it is marked. Of a photograph: how it was marked.")
        )
        self.headerItem().setToolTip(2, tr("Of a point: its residual in plan and height. Of a mark: from where it should be."))
        self.setUniformRowHeights(True)
        self.setAlternatingRowColors(True)
        header = self.header()
        header.setStretchLastSection(False)
        header.setMinimumSectionSize(30)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        for column in (1, 2):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        self._marking: Optional[Marking] = None
        self._quiet = False
        self._items: Dict[Key, QTreeWidgetItem] = {}
        self.currentItemChanged.connect(self._picked)
        self.itemExpanded.connect(self._fill)

    def show_marking(self, marking: Optional[Marking]) -> None:
        """List the points of ``marking``."""
        self._marking = marking
        self._quiet = True
        self.clear()
        self._items = {}
        for point in marking.points if marking else []:
            item = QTreeWidgetItem([point.name])
            item.setData(0, _ROLE, (point.name, ""))
            item.setChildIndicatorPolicy(QTreeWidgetItem.ChildIndicatorPolicy.ShowIndicator)
            self._items[(point.name, "")] = item
            self.addTopLevelItem(item)
        self._quiet = False
        self.refresh()

    def refresh(self) -> None:
        """Say again what has changed, and leave open what is open."""
        if self._marking is None:
            return
        current = self.current()
        self._quiet = True
        for point in self._marking.points:
            item = self._items.get((point.name, ""))
            if item is not None:
                self._say_point(item, point.name, point.role)
                if item.isExpanded():
                    self._fill(item)
        self._quiet = False
        if current is not None:
            self.choose(*current, quietly=True)

    def current(self) -> Optional[Key]:
        """Return the point and photograph picked; the photograph is empty when a point is."""
        item = self.currentItem()
        return None if item is None else tuple(item.data(0, _ROLE))

    def choose(self, point: str, photograph: str = "", quietly: bool = False) -> None:
        """Pick what is named."""
        head = self._items.get((point, ""))
        if head is None:
            return
        if photograph and (point, photograph) not in self._items:
            self._fill(head)
        item = self._items.get((point, photograph), head)
        quiet, self._quiet = self._quiet, quietly or self._quiet
        if item is not head:
            head.setExpanded(True)
        self.setCurrentItem(item)
        self.scrollToItem(item)
        self._quiet = quiet

    def _fill(self, head: QTreeWidgetItem) -> None:
        """List the photographs of a point; they are asked for when they are seen."""
        if self._marking is None or head.parent() is not None:
            return
        quiet, self._quiet = self._quiet, True
        name = head.data(0, _ROLE)[0]
        sights = self._marking.sights(name)[:_SHOWN]
        if [s.key for s in sights] != [tuple(head.child(i).data(0, _ROLE)) for i in range(head.childCount())]:
            for child in head.takeChildren():
                self._items.pop(tuple(child.data(0, _ROLE)), None)
            for sight in sights:
                item = QTreeWidgetItem([sight.photograph.name])
                item.setData(0, _ROLE, sight.key)
                self._items[sight.key] = item
                head.addChild(item)
        for sight in sights:
            _say_sight(self._items[sight.key], sight)
        self._quiet = quiet

    def _say_point(self, item: QTreeWidgetItem, name: str, role: str) -> None:
        marking = self._marking
        residual = marking.residuals.get(name) if marking else None
        count = marking.mark_count(name) if marking else 0
        item.setIcon(0, dot(COLOURS[residual.judgement] if residual else "#9a9a9a", filled=count > 0))
        item.setText(1, str(count) if count else "")
        item.setText(2, _short(residual))
        item.setToolTip(0, " - ".join(filter(None, (name, role))))
        item.setToolTip(2, _long(residual))
        for column in (1, 2):
            item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        font = item.font(0)
        font.setBold(True)
        item.setFont(0, font)

    def _picked(self, now: Optional[QTreeWidgetItem], before: Any) -> None:
        if now is not None and not self._quiet:
            self.chosen.emit(*now.data(0, _ROLE))


def dot(colour: str, *, filled: bool) -> QIcon:
    """Return a round sign."""
    pixmap = QPixmap(QSize(24, 24))
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    pen = painter.pen()
    pen.setColor(QColor(colour).darker(130))
    pen.setWidth(3)
    painter.setPen(pen)
    if filled:
        painter.setBrush(QColor(colour))
    painter.drawEllipse(5, 5, 14, 14)
    painter.end()
    return QIcon(pixmap)


def _say_sight(item: QTreeWidgetItem, sight: Sight) -> None:
    mark = sight.mark
    item.setIcon(0, dot(COLOURS[sight.judgement] if mark else "#9a9a9a", filled=mark is not None))
    how = ""
    if mark is not None:
        how = tr("by eye") if mark.score is None else tr("score {:.2f}").format(mark.score)
    elif sight.skipped:
        how = tr("skipped")
    item.setText(1, how)
    item.setText(2, "" if sight.offset is None else f"{sight.offset:.1f} px")
    item.setForeground(0, item.foreground(1) if not sight.skipped else QColor("#9a9a9a"))
    item.setToolTip(0, sight.photograph.name)
    if mark is not None:
        item.setToolTip(1, f"{mark.x:.2f}, {mark.y:.2f}")
    item.setTextAlignment(2, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)


def _short(residual: Optional[Residual]) -> str:
    if residual is None or residual.plan is None or residual.up is None:
        return ""
    return f"{100 * residual.plan:.1f} / {100 * residual.up:+.1f} cm"


def _long(residual: Optional[Residual]) -> str:
    if residual is None:
        return ""
    if residual.plan is None:
        return tr("It took no part in the adjustment: two marks are needed.")
    values: List[Any] = [residual.role, residual.east, residual.north, residual.up]
    told = tr("{}: {:+.3f} m east, {:+.3f} m north, {:+.3f} m up").format(*values)
    words = {"good": tr("as was to be expected"), "doubtful": tr("larger than expected"), "bad": tr("much too large")}
    return f"{told} ({words[residual.judgement]})" if residual.judgement != UNKNOWN else told
