"""The steps by id. A step's module holds ``Request``, ``Result`` and ``run(request, progress)``."""

from __future__ import annotations

import importlib
from typing import Any, Protocol

from .errors import InputError
from .progress import Progress

_MODULES = {
    "createsurvey": ".photographs.createsurvey",
    "enhance": ".photographs.enhance",
    "tiepoints": ".tiepoints.tiepoints",
    "orient": ".orientation.orient",
    "georeference": ".orientation.georeference",
    "predictmarks": ".orientation.predictmarks",
    "surveylayers": ".orientation.surveylayers",
    "exportdsm": ".surface.exportdsm",
    "dsmdifference": ".change.dsmdifference",
    "profiles": ".change.profiles",
    "shoreline": ".change.shoreline",
    "timeseries": ".change.timeseries",
    "compareinputs": ".comparison.compareinputs",
    "simulatesurvey": ".simulation.simulatesurvey",
    "checkengine": ".checkengine",
}
STEP_IDS = tuple(_MODULES)


class Step(Protocol):
    """What every step's module offers."""

    Request: type[Any]
    Result: type[Any]

    def run(self, request: Any, progress: Progress) -> Any:
        """Do the step."""


def load(step: str) -> Step:
    """Import and return the module of ``step``; only then are its libraries loaded.

    Raises
    ------
    InputError
        When there is no such step.
    """
    if step not in _MODULES:
        raise InputError(f"There is no step {step!r}; the steps are {', '.join(_MODULES)}.")
    module: Step = importlib.import_module(_MODULES[step], __package__)
    return module
