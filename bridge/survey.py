"""A survey folder as QGIS may look at it: read only, from ``survey.json`` alone. The engine is the one that writes it."""

import json
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

from ..i18n import tr


class SurveyError(Exception):
    """A folder is not a survey that can be read; the text is one sentence for the user."""


class Photograph(NamedTuple):
    """One exposure: its name in the survey, its file, its size in pixels; its position (WGS 84, degrees, m) if it has one."""

    name: str
    path: Path
    width: int
    height: int
    position: Optional[Tuple[float, float, Optional[float]]]


class SurveyView:
    """What stands in a survey folder at the moment it is read."""

    def __init__(self, folder: Path, content: Dict[str, Any]) -> None:
        self.folder = folder
        images = (folder.resolve() / content["images"]).resolve()
        self.crs: Optional[str] = content.get("crs")
        self.photographs: List[Photograph] = [_photograph(images, p) for p in content["photographs"]]
        self._steps: Dict[str, Dict[str, Any]] = content.get("steps", {})

    @classmethod
    def read(cls, folder: str) -> "SurveyView":
        """Read the survey in ``folder``.

        Raises
        ------
        SurveyError
            When it is none, or damaged.
        """
        path = Path(folder) / "survey.json"
        if not folder or not path.is_file():
            raise SurveyError(tr("{} is not a survey folder: make one with 'Create survey'.").format(folder))
        try:
            return cls(Path(folder), json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SurveyError(tr("The survey {} cannot be read: {}.").format(folder, error)) from error

    def parameters(self, step: str) -> Dict[str, Any]:
        """Return the parameters ``step`` was last run with, keys in lower case; none when it was not."""
        return dict(self._steps.get(step, {}).get("parameters", {}))

    def result(self, step: str) -> Dict[str, Any]:
        """Return what ``step`` last gave; nothing when it was not run."""
        return dict(self._steps.get(step, {}).get("result", {}))

    def finished(self, step: str) -> str:
        """Return when ``step`` was last finished (ISO 8601), an empty text when it was not."""
        return str(self._steps.get(step, {}).get("finished", ""))

    def state(self, step: str) -> str:
        """Return "missing", "stale" (something it was built on has changed since) or "ready"."""
        record = self._steps.get(step)
        if record is None:
            return "missing"
        for earlier, fingerprint in record.get("built_on", {}).items():
            standing = self._steps.get(earlier)
            if standing is None or standing["fingerprint"] != fingerprint or self.state(earlier) == "stale":
                return "stale"
        return "ready"

    def enhanced(self, photograph: Photograph) -> Optional[Path]:
        """Return the enhanced image of ``photograph``, the newest where there are several kinds, None without one."""
        found = list((self.folder / "enhanced").glob(f"*/{_literal(photograph.name)}.tif"))
        found += list((self.folder / "enhanced").glob(f"{_literal(photograph.name)}.tif"))
        return max(found, key=lambda path: path.stat().st_mtime, default=None)


def _photograph(images: Path, content: Dict[str, Any]) -> Photograph:
    place = content.get("position")
    position = (place["longitude"], place["latitude"], place.get("height")) if place else None
    return Photograph(content["name"], images / content["name"], int(content["width"]), int(content["height"]), position)


def _literal(name: str) -> str:
    """Return ``name`` so that a glob takes it as it is."""
    return "".join(f"[{c}]" if c in "[]*?" else c for c in name)
