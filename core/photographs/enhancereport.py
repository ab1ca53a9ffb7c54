"""The report of ``enhance``: what the filter did to the contrast, with pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..report.html import Report, new_figure
from ..survey import Photograph, Survey
from .enhancement import Contrast, noise_floor
from .reading import decode_pixels, mean_level, read_channel_sum

_SHOWN = 3  # photographs with pictures
_CROP = 480  # pixels at full resolution
_REDUCED = 640  # pixels of a reduced picture's longer side


def write_report(
    survey: Survey,
    photographs: list[Photograph],
    images: dict[str, Path],
    contrasts: dict[str, Contrast],
    method: str,
    window: int,
    copy: str | None,
) -> None:
    """Write the report; ``images`` and ``contrasts`` are by the photograph's name."""
    local = method in ("arctan", "micmac")
    report = Report("Enhanced images", _verdict(photographs, contrasts, method, window, local))
    report.text(
        "These images serve the detection of tie points only; the surface and the orthophoto are made from the photographs. "
        "All numbers are in DN of the sum of a photograph's colour channels."
    )
    if local:
        report.text(
            "Noise floor: a standard deviation in the window below the square root of the number of channels (1 DN in each) is "
            "taken as that. A pixel's noise includes the finest texture."
        )
    for photograph in photographs[:: max(1, (len(photographs) - 1) // (_SHOWN - 1))][:_SHOWN]:
        _show(report, survey, photograph, images[photograph.name])
    report.heading("Photographs")
    report.table(
        ["name", "noise of a pixel", "mean sigma in the window", "ratio", "below the floor (%)"],
        [(p.name, *_numbers(contrasts[p.name])) for p in photographs],
    )
    report.save(survey.report_path("enhance"), copy)


def _verdict(photographs: list[Photograph], contrasts: dict[str, Contrast], method: str, window: int, local: bool) -> str:
    sigmas = [s for p in photographs if (s := contrasts[p.name].mean_sigma) is not None]
    if not local or not sigmas:
        return f"{len(photographs)} images by the method '{method}'."
    noise = np.median([contrasts[p.name].noise for p in photographs])
    below = np.mean([contrasts[p.name].below_percent or 0.0 for p in photographs])
    return (
        f"{len(photographs)} images by the method '{method}' with a window of {window} pixels: the contrast in the window is "
        f"{np.median(sigmas):.1f} DN against {noise:.1f} DN of pixel noise; {below:.1f} % of the pixels lie below the floor."
    )


def _numbers(contrast: Contrast) -> tuple[float | None, ...]:
    sigma = contrast.mean_sigma
    return contrast.noise, sigma, sigma / contrast.noise if sigma and contrast.noise else None, contrast.below_percent


def _show(report: Report, survey: Survey, photograph: Photograph, image: Path) -> None:
    total = read_channel_sum(survey.path(photograph), photograph)
    before = mean_level(total)
    after = decode_pixels(image.read_bytes())
    report.heading(photograph.name)
    report.picture(_pair(_reduced(before), _reduced(after)), "Before and after, reduced.")
    report.picture(_pair(_crop(before), _crop(after)), f"Before and after, {_CROP} pixels from the middle.")
    figure = new_figure(8.0, 2.6)
    for axes, pixels, title in zip(figure.subplots(1, 2), (before, after), ("before", "after"), strict=True):
        axes.stairs(np.bincount(pixels[::4, ::4].ravel(), minlength=256), np.arange(257), fill=True, color="#2a6f97")
        axes.set_title(f"{title}: mean {pixels.mean():.0f}, standard deviation {pixels.std():.0f}", fontsize=9)
        axes.set_xlim(0, 256)
        axes.set_yticks([])
        axes.set_xlabel("grey level")
    figure.tight_layout()
    floor = noise_floor(total.channels)
    report.figure(figure, f"Histograms. The noise floor of this photograph is {floor:.2f} DN of {total.white}.")


def _pair(left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.uint8]:
    gap = np.full((left.shape[0], 6), 255, np.uint8)
    return np.ascontiguousarray(np.hstack([left, gap, right]))


def _reduced(pixels: NDArray[Any]) -> NDArray[Any]:
    factor = min(1.0, _REDUCED / max(pixels.shape))
    size = max(1, round(pixels.shape[1] * factor)), max(1, round(pixels.shape[0] * factor))
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)


def _crop(pixels: NDArray[Any]) -> NDArray[Any]:
    row, column = (max(0, (n - _CROP) // 2) for n in pixels.shape)
    return pixels[row : row + _CROP, column : column + _CROP]
