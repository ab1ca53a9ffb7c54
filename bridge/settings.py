"""What is set once for all of Strandline: by the environment, for machines without a window, else in QGIS's own settings."""

import os
from typing import Dict

from qgis.core import QgsSettings

from ..i18n import tr

PYTHON = "strandline/python"
SCHEDULER = "strandline/scheduler"
WORKERS = "strandline/workers"
WHEELS = "strandline/wheels"
#: The environment variables that come before the settings.
VARIABLES: Dict[str, str] = {
    PYTHON: "STRANDLINE_PYTHON",
    SCHEDULER: "STRANDLINE_SCHEDULER",
    WORKERS: "STRANDLINE_WORKERS",
    WHEELS: "STRANDLINE_WHEELS",
}


class BadSetting(Exception):
    """A setting cannot be used; the text is one sentence for the user."""


def read(key: str) -> str:
    """Return the setting ``key`` as it is stored in QGIS, an empty string when it is not set."""
    return str(QgsSettings().value(key) or "").strip()


def write(key: str, value: str) -> None:
    """Store the setting ``key``; an empty ``value`` removes it."""
    if value.strip():
        QgsSettings().setValue(key, value.strip())
    else:
        QgsSettings().remove(key)


def overridden(key: str) -> str:
    """Return what the environment says in place of the setting ``key``, an empty string when it says nothing."""
    return os.environ.get(VARIABLES[key], "").strip()


def effective(key: str) -> str:
    """Return what holds for ``key``: what the environment says, else the setting, else an empty string."""
    return overridden(key) or read(key)


def workers() -> int:
    """Return how many processes a step may use that was not told; 0 is one per processor.

    Raises
    ------
    BadSetting
        When what is set is not a whole number of at least 0.
    """
    text = effective(WORKERS) or "0"
    if not text.isdecimal():
        name = VARIABLES[WORKERS] if overridden(WORKERS) else tr("The option 'Processes'")
        raise BadSetting(tr("{} is '{}': it must be a whole number, 0 for one process per processor.").format(name, text))
    return int(text)
