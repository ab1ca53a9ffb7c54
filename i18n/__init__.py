"""The plugin's words in the user's language."""

from qgis.PyQt.QtCore import QCoreApplication

CONTEXT = "Strandline"


def tr(text: str) -> str:
    """Return ``text`` translated; ``make strings`` collects the literal arguments of this function."""
    return QCoreApplication.translate(CONTEXT, text)
