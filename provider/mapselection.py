"""A point picked in the map is picked in the list, and the other way round."""

import contextlib
from typing import Any, Optional

from qgis.PyQt.QtCore import QObject, pyqtSignal

from .marking import Marking


class MapSelection(QObject):
    """Listens to the selection of the layer of ground points; ``picked`` tells the point's name."""

    picked = pyqtSignal(str)

    def __init__(self, parent: Optional[QObject] = None) -> None:
        super().__init__(parent)
        self._marking: Optional[Marking] = None
        self._quiet = False

    def follow(self, marking: Optional[Marking]) -> None:
        """Listen to the layer of ``marking``, and no longer to the one before."""
        if self._marking is not None:
            with contextlib.suppress(RuntimeError, TypeError):  # the layer may be gone, and its signal with it
                self._marking.layer.selectionChanged.disconnect(self._selected)
        self._marking = marking
        if marking is not None:
            marking.layer.selectionChanged.connect(self._selected)

    def pick(self, name: str) -> None:
        """Select the point called ``name`` in the map."""
        point = self._marking.point(name) if self._marking else None
        if point is not None and self._marking and list(self._marking.layer.selectedFeatureIds()) != [point.feature]:
            self._quiet = True
            self._marking.layer.selectByIds([point.feature])
            self._quiet = False

    def _selected(self, selected: Any, *_: Any) -> None:
        if self._quiet or self._marking is None:
            return
        chosen = set(self._marking.layer.selectedFeatureIds())
        for point in self._marking.points:
            if point.feature in chosen:
                self.picked.emit(point.name)
                return
