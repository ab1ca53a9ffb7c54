"""Buttons and rows as the dock has them."""

from typing import Any

from qgis.PyQt.QtWidgets import QHBoxLayout, QToolButton


def button(text: str, tip: str) -> QToolButton:
    """Return a button that says what it does when the mouse rests on it."""
    made = QToolButton()
    made.setText(text)
    made.setToolTip(tip)
    return made


def row(*widgets: Any) -> QHBoxLayout:
    """Return widgets side by side; None is a gap that grows."""
    made = QHBoxLayout()
    made.setContentsMargins(0, 0, 0, 0)
    for widget in widgets:
        if widget is None:
            made.addStretch(1)
        else:
            made.addWidget(widget)
    return made
