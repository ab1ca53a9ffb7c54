"""What Qt 5 and Qt 6 name or place differently, in one place."""

from typing import Any

from qgis.PyQt import QtGui, QtWidgets
from qgis.PyQt.QtCore import QPointF


def _from_either(name: str) -> Any:
    """Return a class that moved from QtWidgets to QtGui in Qt 6."""
    return getattr(QtGui, name, None) or getattr(QtWidgets, name)


QAction = _from_either("QAction")
QUndoCommand = _from_either("QUndoCommand")
QUndoStack = _from_either("QUndoStack")


def position(event: Any) -> QPointF:
    """Return where a mouse or wheel event is in its widget."""
    if hasattr(event, "position"):
        return event.position()
    return event.localPos()
