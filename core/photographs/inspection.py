"""One photograph as the survey lists it: is it whole, what is its content, what do its metadata tell."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..files import bytes_digest
from ..survey import Photograph
from .metadata import camera_name, focal_pixels, read_metadata
from .reading import frame_size, is_raw
from .wholeness import whole_raw


@dataclass(frozen=True)
class Inspection:
    """A photograph, what of its metadata could not be read, and how far EXIF's and XMP's height are apart (m)."""

    photograph: Photograph
    problems: tuple[str, ...] = ()
    heights_differ: float | None = None


def inspect(path: str, name: str) -> Inspection | str:
    """Return what is in the file ``path`` of the photograph ``name``, or in a few words why it cannot be used.

    A RAW file is decoded in full.
    """
    try:
        data = Path(path).read_bytes()
        raw = is_raw(name)
        width, height = whole_raw(data).values.shape[1::-1] if raw else frame_size(data)
    except OSError as error:
        return error.strerror or "unreadable"
    except ValueError as error:
        return str(error)
    told = read_metadata(data)
    photograph = Photograph(
        name=name,
        bytes=len(data),
        digest=bytes_digest(data),
        width=width,
        height=height,
        camera=camera_name(told, width, height),
        focal=focal_pixels(told, width, height),
        time=told.time,
        position=told.position,
        relative_height=told.relative_height,
        yaw=told.yaw,
        pitch=told.pitch,
        roll=told.roll,
    )
    differ = None
    if told.exif_height is not None and told.xmp_height is not None:
        differ = abs(told.exif_height - told.xmp_height)
    return Inspection(photograph, told.problems, differ)
