"""RAW photographs, developed linearly: what the sensor saw, without white balance, colour matrix, gamma or brightening."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_THREADS = "OMP_NUM_THREADS"


@dataclass(frozen=True)
class Development:
    """``pixels`` (rows, columns, channels), uint16, are proportional to light, 65535 at saturation; ``step`` is one DN."""

    pixels: NDArray[np.uint16]
    step: float


def decode_raw(data: bytes) -> Development:
    """Return the pixels of a RAW photograph, never turned.

    Raises
    ------
    ValueError
        In a few words, when LibRaw cannot decode ``data``.
    """
    if not data:
        raise ValueError("empty")
    rawpy = _library()
    try:
        with rawpy.imread(io.BytesIO(data)) as raw:
            black = float(np.mean(raw.black_level_per_channel))
            pixels = raw.postprocess(
                demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR,
                user_wb=[1.0, 1.0, 1.0, 1.0],
                output_color=rawpy.ColorSpace.raw,
                output_bps=16,
                gamma=(1.0, 1.0),
                no_auto_bright=True,
                adjust_maximum_thr=0.0,
                user_flip=0,
            )
            return Development(pixels, 65535.0 / (raw.white_level - black))
    except rawpy.LibRawError as error:
        raise ValueError(f"not decodable ({error})") from error


def _library() -> Any:
    """Return rawpy, loaded so that LibRaw uses one thread: work is shared out by photographs."""
    former = os.environ.get(_THREADS)
    os.environ[_THREADS] = "1"
    try:
        import rawpy
    finally:
        if former is None:
            del os.environ[_THREADS]
        else:
            os.environ[_THREADS] = former
    return rawpy
