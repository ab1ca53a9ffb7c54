"""The grey image in which the tie points of a photograph are sought."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import digest, file_digest
from ..photographs.enhance import enhanced_mask_path, enhanced_path
from ..photographs.enhancedimage import read_mask
from ..photographs.reading import decode_pixels, mean_level, read_channel_sum
from ..survey import Photograph, Survey


@dataclass(frozen=True)
class SearchedImage:
    """A photograph's image to search: ``path`` is the photograph itself, or the image that ``enhance`` made of it.

    ``mask`` is the file that tells where keypoints may be, None for everywhere; ``max_size`` the longer side in pixels to which
    the image is reduced, 0 for not at all.
    """

    photograph: Photograph
    path: Path
    enhanced: bool
    mask: Path | None
    max_size: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the photograph."""
        return self.photograph.width, self.photograph.height

    @property
    def working_size(self) -> tuple[int, int]:
        """Width and height when reduced."""
        longer = max(self.size)
        if not 0 < self.max_size < longer:
            return self.size
        width, height = (max(1, round(side * self.max_size / longer)) for side in self.size)
        return width, height

    @property
    def reduction(self) -> NDArray[np.float32]:
        """Pixels of the reduced image per pixel of the photograph, along x and y (2,)."""
        return np.divide(self.working_size, self.size, dtype=np.float32)

    def content(self) -> str:
        """Return a fingerprint of what is searched."""
        seen = file_digest(self.path) if self.enhanced else [self.photograph.digest, "original"]
        return digest(seen, self.mask and file_digest(self.mask), self.max_size)

    def read(self) -> NDArray[np.uint8]:
        """Return the grey levels (rows, columns), not reduced.

        Raises
        ------
        InputError
            When the file cannot be read or decoded, or a photograph has changed.
        """
        if not self.enhanced:
            return mean_level(read_channel_sum(self.path, self.photograph))
        try:
            return decode_pixels(self.path.read_bytes())
        except (OSError, ValueError) as error:
            raise InputError(f"The enhanced image {self.path} is {error}: delete it and run strandline:enhance again.") from error

    def read_reduced(self) -> NDArray[np.uint8]:
        """Return the grey levels (rows, columns) at the ``working_size``."""
        image = self.read()
        if self.working_size == self.size:
            return image
        return np.asarray(cv2.resize(image, self.working_size, interpolation=cv2.INTER_AREA), np.uint8)

    def read_mask(self) -> NDArray[np.bool_] | None:
        """Return where keypoints may be (rows, columns), None for everywhere."""
        return None if self.mask is None else read_mask(self.mask)


def searched_image(survey: Survey, photograph: Photograph, *, enhanced: bool, max_size: int) -> SearchedImage:
    """Return the image of a photograph to search: the enhanced one, or the photograph itself."""
    if not enhanced:
        return SearchedImage(photograph, survey.path(photograph).absolute(), False, None, max_size)
    mask = enhanced_mask_path(survey, photograph)
    return SearchedImage(photograph, enhanced_path(survey, photograph).absolute(), True, mask and mask.absolute(), max_size)
