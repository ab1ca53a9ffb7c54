"""Step ``enhance``: 8-bit images with enhanced local contrast, for tie points only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from ..contract import VectorSource, encode
from ..errors import InputError
from ..files import digest, remove
from ..parallel import run_calls
from ..progress import SILENT, Progress
from ..survey import Photograph, Survey, held
from .enhancedimage import image_path, make_image, mask_path, read_mask, read_note, standing_contrast, take_over
from .enhancement import Contrast, Method, has_window
from .enhancereport import write_report
from .listing import some
from .poses import Outlines, find_outlines

_FOLDER = "enhanced"
_VERSION = 3  # of the algorithms and of the files; raised when the same request gives other pixels


@dataclass(frozen=True)
class Request:
    """``window`` is the side of the square window in pixels, odd."""

    survey: str
    method: Method = "bandpass"
    window: int = 101
    ignore: VectorSource | None = None
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """The survey folder."""

    output: str


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Enhance every photograph of the survey.

    An image that stands under the same parameters, made from the same content and with the same mask, is kept. The images of
    each set of parameters and masks have a folder of their own, so that those of the last finished run stand until the new ones
    are complete.

    Raises
    ------
    InputError
        When the request cannot be met, or a photograph has gone, changed, or cannot be decoded.
    """
    survey = Survey.open(request.survey)  # before a lock is put into a folder that is none
    check_window(request.method, request.window, survey.photographs)
    with held(request.survey, "enhance"):
        survey = Survey.open(request.survey)
        survey.require("createsurvey")
        photographs = list(survey.photographs)
        paths = {p.name: survey.path(p).absolute() for p in photographs}
        outlines = find_outlines(survey, photographs, request.ignore) if request.ignore else None
        shapes = {} if outlines is None else _shapes(outlines, progress)
        name = _folder_name(request.method, request.window, digest(shapes) if outlines else None)
        folder = survey.folder.absolute() / _FOLDER / name
        images = {p.name: image_path(folder, p) for p in photographs}
        key = [_VERSION, request.method, _window(request.method, request.window)]
        keys = {p.name: digest(p.digest, key, *([shapes[p.name]] if p.name in shapes else [])) for p in photographs}
        _take_over(survey, folder, photographs, keys)
        contrasts = {p.name: c for p in photographs if (c := standing_contrast(images[p.name], p, keys[p.name]))}
        if contrasts:
            progress.info(f"{len(contrasts)} of {len(photographs)} images stand already.")
        missing = [p for p in photographs if p.name not in contrasts]
        made = run_calls(
            make_image,
            (
                (
                    str(paths[p.name]),
                    encode(p),
                    str(images[p.name]),
                    request.method,
                    request.window,
                    shapes.get(p.name),
                    keys[p.name],
                )
                for p in missing
            ),
            workers=request.workers,
            scheduler=request.scheduler,
            progress=progress.part(0.0, 0.95),
            total=len(missing),
        )
        contrasts |= {missing[i].name: contrast for i, contrast in made}
        notes = [] if outlines is None else [outlines.note, *_told(photographs, contrasts, progress)]
        write_report(survey, photographs, images, contrasts, request.method, request.window, notes, request.output_html_file)
        survey.finish(
            "enhance",
            digest(keys),
            built_on=("createsurvey",),
            parameters={"method": request.method, "window": request.window, "ignore": request.ignore is not None},
            result={"folder": f"{_FOLDER}/{name}", "images": len(images)},
        )
        _remove_strays(folder.parent, {*images.values(), *(mask_path(images[name]) for name in shapes)})
    progress.at(1.0)
    return Result(request.survey)


def check_window(method: Method, window: int, photographs: Sequence[Photograph]) -> None:
    """Refuse, before any work, a window that cannot be used on these photographs.

    Raises
    ------
    InputError
        When it is not odd, or larger than a photograph.
    """
    if window < 3 or window % 2 == 0:
        raise InputError(f"WINDOW={window} is not an odd number from 3 on: take {max(3, window | 1)}.")
    small = [p.name for p in photographs if _window(method, window) and min(p.width, p.height) < window]
    if small:
        raise InputError(f"WINDOW={window} is larger than {some(small)}: take a smaller one.")


def enhanced_path(survey: Survey, photograph: Photograph) -> Path:
    """Return the enhanced image of a photograph: 8-bit grey, of the photograph's size.

    Raises
    ------
    InputError
        When ``enhance`` has not been run or is stale, or the image is gone.
    """
    record = survey.require("enhance")
    path = image_path(survey.folder / _FOLDER / Path(record.result["folder"]).name, photograph)
    if not path.is_file():
        raise InputError(f"The enhanced image {path} is gone: run strandline:enhance again.")
    return path


def enhanced_mask_path(survey: Survey, photograph: Photograph) -> Path | None:
    """Return the mask of a photograph, None when nothing of it is masked.

    Raises
    ------
    InputError
        When ``enhance`` has not been run or is stale, or the image or its mask is gone.
    """
    image = enhanced_path(survey, photograph)
    note = read_note(image)
    if note is None or (note.mask is not None and not mask_path(image).is_file()):
        raise InputError(f"The enhanced image {image} is damaged, or its mask is gone: run strandline:enhance again.")
    return None if note.mask is None else mask_path(image)


def enhanced_mask(survey: Survey, photograph: Photograph) -> NDArray[np.bool_] | None:
    """Return where key points may be in a photograph (rows, columns), None for everywhere.

    Raises
    ------
    InputError
        When ``enhance`` has not been run or is stale, or the image or its mask is gone or damaged.
    """
    path = enhanced_mask_path(survey, photograph)
    return None if path is None else read_mask(path)


def _window(method: Method, window: int) -> int | None:
    return window if has_window(method) else None


def _folder_name(method: Method, window: int, masks: str | None) -> str:
    used = _window(method, window)
    return "-".join(str(part) for part in (method, used, masks and masks[:8]) if part is not None)


def _shapes(outlines: Outlines, progress: Progress) -> dict[str, str]:
    """Return the outlines that cover something, as hexadecimal WKB by the photograph's name, and warn of what is not known."""
    if outlines.unknown:
        progress.warn(f"It is not known where {some(outlines.unknown)} look: nothing of IGNORE is masked there.")
    shapes = {name: shapely.to_wkb(shape, hex=True) for name, shape in outlines.by_name.items() if not shape.is_empty}
    if not shapes:
        progress.warn("No photograph shows anything of IGNORE: check that the layer lies where the survey is, and its CRS.")
    return shapes


def _take_over(survey: Survey, folder: Path, photographs: Sequence[Photograph], keys: dict[str, str]) -> None:
    """Take into ``folder`` what the last finished run made under the same keys with other masks elsewhere."""
    record = survey.record("enhance")
    former = folder.parent / Path(record.result["folder"]).name if record else folder
    if former == folder:
        return
    for photograph in photographs:
        source, target = image_path(former, photograph), image_path(folder, photograph)
        if not target.is_file() and standing_contrast(source, photograph, keys[photograph.name]):
            take_over(source, target)


def _told(photographs: Sequence[Photograph], contrasts: dict[str, Contrast], progress: Progress) -> list[str]:
    """Warn of photographs that are wholly masked, and return that as a note."""
    covered = [p.name for p in photographs if contrasts[p.name].masked_percent == 100.0]
    if not covered:
        return []
    text = f"IGNORE covers the whole of {some(covered)}: no tie points will be found there."
    progress.warn(text)
    return [text]


def _remove_strays(folder: Path, images: set[Path]) -> None:
    """Remove what is not among ``images``: of other parameters, of photographs that are no longer there, of killed runs."""
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_dir() and not path.is_symlink():
            if not any(path.iterdir()):
                path.rmdir()
        elif path not in images:
            remove(path)
