"""The report's part on RAW and JPG: one piece of sand in both, and the sensor's noise beside sand's contrast."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rawpy
from numpy.typing import NDArray
from PIL import Image

from ..report.html import Report, new_figure
from . import sensor

_CROP = 120, 180  # px, rows and columns of the piece
_PATCH = 256  # px, side of even sand on which noise is measured
_SHOWN = 3.0  # standard deviations of the RAW's piece from black to white


def tell(report: Report, folder: Path, name: str, *, noise: float, contrast: float) -> None:
    """Add the part to ``report``, with a piece of the exposure ``name`` of the flight in ``folder``."""
    report.heading("RAW and JPG")
    report.text(
        "Each exposure is there twice: raw/NAME.dng holds what the sensor counted behind its mosaic of red, green and blue "
        f"filters, {sensor.BITS} bits, and jpg/NAME.jpg what a camera makes of that very mosaic: white balance, demosaicing, "
        "gamma, 8 bits, JPEG of quality 90. Both have the same frame, so that marks hold for both; marks.csv and gcp_list.txt "
        "name the JPG, whose name the RAW has but for folder and ending."
    )
    figure, limit = _pieces(folder / "jpg" / f"{name}.jpg", folder / "raw" / f"{name}.dng")
    report.figure(
        figure, f"The middle of {name} in both: light relative to its mean, black to white from {-limit:.0%} to {limit:.0%}."
    )  # fmt: skip
    report.table(
        ("on dry flat sand", "mean of the RAW (DN)", "noise (DN)", "noise (%)", "sand's contrast (DN)",
         "mean of the JPG", "noise before JPEG", "sand's contrast"),
        _levels(noise, contrast),
    )  # fmt: skip
    report.text(
        f"A full well holds {sensor.FULL_WELL:.0f} electrons, {sensor.ELECTRONS:.2f} for each DN from {sensor.BLACK} (black) to "
        f"{sensor.WHITE}; reading adds {sensor.READ_NOISE:.0f}, and NOISE = {noise:g} scales what light and reading bring. Noise "
        "of the JPG is measured after demosaicing, whose averages lower it, and before JPEG. Contrast is CONTRAST times the "
        "mean; each octave of features from 2 cm to 3 m has about a third of it."
    )


def _levels(noise: float, contrast: float) -> list[tuple[Any, ...]]:
    """Return mean, noise and sand's contrast in the middle of a photograph, for each colour in RAW and JPG."""
    light = np.zeros((3, _PATCH, _PATCH), np.float32)
    light[0] = 1.0
    # A patch as small as this has its own corners; what they lose is given back.
    light /= sensor.vignette(_PATCH, _PATCH)
    grey = sensor.develop(sensor.expose(light, 1.0, noise, np.random.default_rng(0))).astype(float)
    brighter = sensor.develop(sensor.expose(light * np.float32(1.1), 1.0, 0.0, np.random.default_rng(0))).astype(float)
    darker = sensor.develop(sensor.expose(light / np.float32(1.1), 1.0, 0.0, np.random.default_rng(0))).astype(float)
    slope = (brighter - darker).mean(axis=(0, 1)) / (2 * np.log(1.1))
    rows = []
    for k, (colour, mean) in enumerate(zip(("red", "green", "blue"), sensor.sand_electrons(), strict=True)):
        level, spread = mean / sensor.ELECTRONS, sensor.noise_level(mean, noise)
        rows.append(
            (colour, level + sensor.BLACK, spread, 100 * spread / level, contrast * level)
            + (float(grey[..., k].mean()), float(grey[..., k].std()), float(contrast * slope[k]))
        )
    return rows


def _pieces(jpg: Path, raw: Path) -> tuple[Any, float]:
    """Return a figure of one piece of both files, and the relative light that is white in it."""
    with Image.open(jpg) as picture:
        developed = sensor.linear(np.asarray(picture.convert("RGB")))
    with rawpy.imread(str(raw)) as file:
        counted = sensor.demosaic(file.raw_image.copy(), np.ones((2, 2))).astype(float)
    pieces = [_relative(pixels) for pixels in (developed, counted)]
    limit = _SHOWN * float(pieces[1].std())
    figure = new_figure(9, 3.4)
    for k, (name, piece) in enumerate(zip(("JPG", "RAW"), pieces, strict=True)):
        axes = figure.add_subplot(1, 2, k + 1)
        axes.imshow(piece, cmap="gray", vmin=-limit, vmax=limit, interpolation="nearest")
        axes.set(title=name, xticks=[], yticks=[])
    figure.tight_layout()
    return figure, limit


def _relative(pixels: NDArray[Any]) -> NDArray[np.float64]:
    """Return the sum of the channels of the middle piece, relative to its mean."""
    rows, columns = (min(size, wanted) for size, wanted in zip(pixels.shape, _CROP, strict=False))
    top, left = (pixels.shape[0] - rows) // 2, (pixels.shape[1] - columns) // 2
    total = pixels[top : top + rows, left : left + columns].sum(axis=2, dtype=float)
    return np.asarray(total / total.mean() - 1.0, float)
