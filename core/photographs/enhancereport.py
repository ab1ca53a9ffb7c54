"""The report of ``enhance``: what the filter did to the contrast, with pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..report.html import Report, new_figure
from ..survey import Photograph, Survey
from .enhancedimage import mask_path, read_mask
from .enhancement import Contrast, Method, has_window
from .reading import decode_pixels, mean_level, read_channel_sum

_SHOWN = 3  # photographs with pictures
_CROP = 480  # pixels at full resolution
_REDUCED = 640  # pixels of a reduced picture's longer side
_MASKED = (205, 92, 92)  # the colour laid over what is masked


def write_report(
    survey: Survey,
    photographs: list[Photograph],
    images: dict[str, Path],
    contrasts: dict[str, Contrast],
    method: Method,
    window: int,
    notes: Sequence[str],
    copy: str | None,
) -> None:
    """Write the report; ``images`` and ``contrasts`` are by the photograph's name, ``notes`` are on what is masked."""
    report = Report("Enhanced images", _verdict(photographs, contrasts, method, window))
    report.text(
        "These images serve the detection of tie points only; the surface and the orthophoto are made from the photographs. "
        "All numbers are in the file's own steps (DN), for the sum of a photograph's colour channels."
    )
    if has_window(method):
        report.text(
            "Noise floor: a standard deviation in the window below the square root of the number of channels (1 DN in each) is "
            "taken as that. A pixel's noise includes the finest texture."
            + (" Here both are of the image that the band of scales leaves." if method == "bandpass" else "")
        )
    if method == "bandpass":
        report.text(
            "Below the finest period, in pixels, a photograph holds more noise than texture: what its three colours do not share "
            "is noise. The low-pass (sigma in pixels) follows it, and so does the weight of the coarse that is taken off to lift "
            "the fine. Without a period (fewer than three colours, copies of one, too little ground) the low-pass is 1 pixel."
        )
    if notes:
        report.heading("Areas to ignore")
        for note in notes:
            report.text(note)
    for photograph in _chosen(photographs, contrasts):
        _show(report, survey, photograph, images[photograph.name], contrasts[photograph.name])
    report.heading("Photographs")
    report.table(
        [
            "name",
            "DN per channel from black to white",
            "noise of a pixel",
            "noise floor",
            "mean sigma in the window",
            "sigma / noise",
            "below the floor (%)",
            "masked (%)",
            "finest period",
            "low-pass",
            "weight",
        ],
        [(p.name, *_numbers(contrasts[p.name])) for p in photographs],
    )
    report.save(survey.report_path("enhance"), copy)


def _verdict(photographs: list[Photograph], contrasts: dict[str, Contrast], method: Method, window: int) -> str:
    sigmas = [s for p in photographs if (s := contrasts[p.name].mean_sigma) is not None]
    if not sigmas:
        return f"{len(photographs)} images by the method '{method}'."
    noise = np.median([contrasts[p.name].noise for p in photographs])
    below = np.mean([b for p in photographs if (b := contrasts[p.name].below_percent) is not None])
    return (
        f"{len(photographs)} images by the method '{method}' with a window of {window} pixels: the contrast in the window is "
        f"{np.median(sigmas):.1f} DN against {noise:.1f} DN of noise of a pixel in the photographs; {below:.1f} % of the pixels "
        "lie below the noise floor."
    )


def _chosen(photographs: list[Photograph], contrasts: dict[str, Contrast]) -> list[Photograph]:
    """Return the photographs to show: the first, the middle and the last, of those in part masked when there are any."""
    masked = [p for p in photographs if 0.0 < (contrasts[p.name].masked_percent or 0.0) < 100.0] or photographs
    return masked[:: max(1, (len(masked) - 1) // (_SHOWN - 1))][:_SHOWN]


def _numbers(contrast: Contrast) -> tuple[float | None, ...]:
    sigma, noise = contrast.mean_sigma, contrast.noise
    ratio = sigma / noise if sigma is not None and noise else None
    period = None if contrast.crossover is None else 1 / contrast.crossover
    band = period, contrast.low_pass, contrast.weight
    return contrast.levels, noise, contrast.floor, sigma, ratio, contrast.below_percent, contrast.masked_percent, *band


def _show(report: Report, survey: Survey, photograph: Photograph, image: Path, contrast: Contrast) -> None:
    before = mean_level(read_channel_sum(survey.path(photograph), photograph))
    after = decode_pixels(image.read_bytes())
    kept = np.ones(before.shape, bool) if contrast.masked_percent is None else read_mask(mask_path(image))
    shown = [_tinted(pixels, kept) for pixels in (before, after)]
    masked = "" if contrast.masked_percent is None else f" Red: masked, {contrast.masked_percent:.0f} %."
    report.heading(photograph.name)
    report.picture(_pair(*map(_reduced, shown)), f"Before and after, reduced.{masked}")
    report.picture(_pair(*map(_crop, shown)), f"Before and after, {_CROP} pixels from the middle.{masked}")
    figure = new_figure(8.0, 2.6)
    for axes, pixels, title in zip(figure.subplots(1, 2), (before, after), ("before", "after"), strict=True):
        sample = pixels[::4, ::4][kept[::4, ::4]]
        axes.stairs(np.bincount(sample, minlength=256), np.arange(257), fill=True, color="#2a6f97")
        told = f": mean {sample.mean():.0f}, standard deviation {sample.std():.0f}" if sample.size else ""
        axes.set_title(title + told, fontsize=9)
        axes.set_xlim(0, 256)
        axes.set_yticks([])
        axes.set_xlabel("grey level")
    figure.tight_layout()
    floor = f" The noise floor of this photograph is {contrast.floor:.2f} DN." if contrast.floor is not None else ""
    report.figure(figure, f"Histograms of what is not masked.{floor} Black to white is {contrast.levels:.0f} DN per channel.")


def _tinted(pixels: NDArray[np.uint8], kept: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return a grey image with what is masked in colour (rows, columns, 3)."""
    colours = np.repeat(pixels[:, :, None], 3, axis=2)
    if not kept.all():
        colours[~kept] = (0.5 * colours[~kept] + 0.5 * np.array(_MASKED)).astype(np.uint8)
    return colours


def _pair(left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.uint8]:
    gap = np.full((left.shape[0], 6, 3), 255, np.uint8)
    return np.ascontiguousarray(np.hstack([left, gap, right]))


def _reduced(pixels: NDArray[Any]) -> NDArray[Any]:
    factor = min(1.0, _REDUCED / max(pixels.shape))
    size = max(1, round(pixels.shape[1] * factor)), max(1, round(pixels.shape[0] * factor))
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)


def _crop(pixels: NDArray[Any]) -> NDArray[Any]:
    row, column = (max(0, (n - _CROP) // 2) for n in pixels.shape[:2])
    return pixels[row : row + _CROP, column : column + _CROP]
