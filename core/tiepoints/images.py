"""The grey image in which tie points of a photograph are sought."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..contract import decode
from ..errors import InputError
from ..photographs.reading import decode_pixels, mean_level, read_channel_sum
from ..survey import Photograph


def read_grey(image: str, photograph: dict[str, Any] | None) -> NDArray[np.uint8]:
    """Return the grey levels (rows, columns) of an enhanced image, or of the photograph that ``photograph`` describes.

    Raises
    ------
    InputError
        When the file cannot be read or decoded, or a photograph has changed.
    """
    source = Path(image)
    if photograph is not None:
        return mean_level(read_channel_sum(source, decode(Photograph, photograph)))
    try:
        return decode_pixels(source.read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(f"The enhanced image {image} is {error}: delete it and run strandline:enhance again.") from error


def reduced_size(size: tuple[int, int], max_size: int) -> tuple[int, int]:
    """Return width and height after the longer one is reduced to ``max_size`` pixels; 0 is no limit."""
    longer = max(size)
    if not 0 < max_size < longer:
        return size
    return max(1, round(size[0] * max_size / longer)), max(1, round(size[1] * max_size / longer))


def reduced(image: NDArray[np.uint8], max_size: int) -> NDArray[np.uint8]:
    """Return the image at its ``reduced_size``."""
    height, width = image.shape
    size = reduced_size((width, height), max_size)
    return image if size == (width, height) else np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
