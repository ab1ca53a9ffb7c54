"""One enhanced image on disk: a TIFF, beside it the mask where there is one, and in it a note of what it was made from."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image

from ..contract import decode, encode
from ..errors import InputError
from ..files import file_digest, whole
from ..survey import Photograph
from .enhancement import Contrast, Method, enhance_photograph, usable
from .masking import unmasked
from .reading import read_channel_sum

_DESCRIPTION = 270  # TIFF tag


@dataclass(frozen=True)
class Note:
    """What an image's description holds: the ``key`` it was made under, and the fingerprint of its mask, None without one."""

    key: str
    contrast: Contrast
    mask: str | None = None


def image_path(folder: Path, photograph: Photograph) -> Path:
    """Return where a photograph's image lies in the folder of its parameters."""
    # The whole name stays, so that a.jpg and a.png do not meet.
    return folder / f"{photograph.name}.tif"


def mask_path(image: Path) -> Path:
    """Return where the mask of an image lies: a PNG of one bit, white where key points may be."""
    return image.with_suffix(".mask.png")


def make_image(
    path: str, photograph: dict[str, Any], image: str, method: Method, window: int, outline: str | None, key: str
) -> Contrast:
    """Write the enhanced ``image`` of a photograph, with the ``key`` it was made under, and return its contrast.

    ``outline`` (hexadecimal WKB, pixels) is what is masked; None for nothing.
    """
    total = read_channel_sum(Path(path), decode(Photograph, photograph), means=method == "bandpass")
    height, width = total.values.shape
    valid = None if outline is None else unmasked(shapely.from_wkb(outline), width, height)
    grey, contrast = enhance_photograph(total, method, window, valid)
    note = Note(key, contrast)
    if valid is not None:
        mask = mask_path(Path(image))
        with whole(mask) as part:
            Image.fromarray(usable(valid, method, window)).save(part, "PNG")
        note = Note(key, contrast, file_digest(mask))
    with whole(Path(image)) as part:
        # Not compressed: deflate saves a quarter of the space and takes longer than all the rest.
        Image.fromarray(grey).save(part, "TIFF", description=json.dumps(encode(note)))
    return contrast


def read_note(image: Path) -> Note | None:
    """Return an image's note, None when it is not an image of ours, or of another version."""
    try:
        with Image.open(image) as standing:
            return decode(Note, json.loads(standing.getexif()[_DESCRIPTION]))
    except (OSError, SyntaxError, ValueError, KeyError, TypeError, InputError):
        return None


def standing_contrast(image: Path, photograph: Photograph, key: str) -> Contrast | None:
    """Return the contrast noted in an image that stands, with its mask, as it was made under ``key``; else None."""
    if not image.is_file() or image.stat().st_size < photograph.width * photograph.height:
        return None
    note, mask = read_note(image), mask_path(image)
    if note is None or note.key != key:
        return None
    stands = note.mask is None or (mask.is_file() and file_digest(mask) == note.mask)
    return note.contrast if stands else None


def read_mask(path: Path) -> NDArray[np.bool_]:
    """Return a mask (rows, columns), True where key points may be.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    try:
        with Image.open(path) as image:
            return np.array(image.convert("1"), bool)
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError(f"The mask {path} cannot be read ({error}): delete it and run strandline:enhance again.") from error


def take_over(source: Path, target: Path) -> None:
    """Put the image ``source`` and its mask at ``target`` too, without a second copy where the disk knows links."""
    for old, new in ((mask_path(source), mask_path(target)), (source, target)):
        if old.is_file():
            with whole(new) as part:
                try:
                    os.link(old, part)
                except OSError:
                    shutil.copyfile(old, part)
