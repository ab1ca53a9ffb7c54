"""Small pictures of the photographs, for a look from the map."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from ..files import whole
from ..survey import Photograph, Survey

FOLDER = "thumbnails"
_SIDE = 320  # pixels of the longer side


def thumbnail(survey: Survey, photograph: Photograph) -> Path | None:
    """Return the thumbnail of a photograph, made when there is none yet; None where nothing can be seen.

    Of RAW it shows the enhanced image, which costs no development.
    """
    target = survey.folder / FOLDER / f"{photograph.name}.jpg"
    source = survey.images / photograph.name
    if target.is_file() and source.is_file() and target.stat().st_mtime >= source.stat().st_mtime:
        return target
    enhanced = (survey.folder / "enhanced").glob("*/")
    for candidate in (source, *sorted(folder / f"{photograph.name}.tif" for folder in enhanced)):
        if _make(candidate, target, (photograph.width, photograph.height)):
            return target
    return None


def _make(source: Path, target: Path, size: tuple[int, int]) -> bool:
    """Write the thumbnail of an image of ``size``; tell whether that was one."""
    try:
        with Image.open(source) as image:
            if image.size != size:
                return False  # a RAW's preview, cropped otherwise
            image.draft("RGB", (_SIDE, _SIDE))  # JPG is decoded at an eighth
            small = image.convert("L" if image.mode in ("L", "1") else "RGB")
            small.thumbnail((_SIDE, _SIDE))
    except (OSError, SyntaxError, ValueError):
        return False
    target.parent.mkdir(parents=True, exist_ok=True)
    with whole(target) as part:
        small.save(part, "JPEG", quality=80)
    return True
