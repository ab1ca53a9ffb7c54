"""What the user has set once for all of Strandline, in QGIS's own settings."""

from qgis.core import QgsSettings

PYTHON = "strandline/python"
SCHEDULER = "strandline/scheduler"


def read(key: str) -> str:
    """Return the setting ``key``, an empty string when it is not set."""
    return str(QgsSettings().value(key) or "").strip()


def write(key: str, value: str) -> None:
    """Store the setting ``key``; an empty ``value`` removes it."""
    if value.strip():
        QgsSettings().setValue(key, value.strip())
    else:
        QgsSettings().remove(key)
