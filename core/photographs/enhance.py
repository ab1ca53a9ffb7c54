"""Step ``enhance``: 8-bit images with enhanced local contrast, for tie points only."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from PIL import Image

from ..contract import VectorSource, decode, encode
from ..errors import InputError
from ..files import digest, remove, whole
from ..parallel import run_calls
from ..progress import SILENT, Progress
from ..survey import Photograph, Survey, held
from .enhancement import Contrast, enhance_photograph
from .enhancereport import write_report
from .listing import some
from .reading import read_channel_sum

_FOLDER = "enhanced"
_VERSION = 1  # of the algorithms and of the files; raised when the same request gives other pixels


@dataclass(frozen=True)
class Request:
    """``window`` is the side of the square window in pixels, odd."""

    survey: str
    method: Literal["arctan", "micmac", "equalize", "none"] = "arctan"
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

    An image that stands under the same parameters, made from the same content, is kept. The images of each set of parameters
    have a folder of their own, so that those of the last finished run stand until the new ones are complete.

    Raises
    ------
    InputError
        When the request cannot be met, or a photograph has gone, changed, or cannot be decoded.
    """
    if request.window < 3 or request.window % 2 == 0:
        raise InputError(f"WINDOW={request.window} is not an odd number from 3 on: take {max(3, request.window | 1)}.")
    if request.ignore is not None:
        raise InputError(
            "IGNORE of 'enhance' is not available yet, because it needs to know where the photographs look: leave it empty here "
            "and give it to the later steps."
        )
    Survey.open(request.survey)  # before a lock is put into a folder that is none
    with held(request.survey, "enhance"):
        survey = Survey.open(request.survey)
        survey.require("createsurvey")
        photographs = list(survey.photographs)
        _check(request, photographs)
        folder = survey.folder.absolute() / _FOLDER / _parameters_name(request.method, request.window)
        key = [_VERSION, request.method, _window(request.method, request.window)]
        paths = {p.name: survey.path(p).absolute() for p in photographs}
        images = {p.name: _image_path(folder, p) for p in photographs}
        keys = {p.name: digest(p.digest, key) for p in photographs}
        contrasts = {p.name: c for p in photographs if (c := _standing(images[p.name], p, keys[p.name]))}
        if contrasts:
            progress.info(f"{len(contrasts)} of {len(photographs)} images stand already.")
        missing = [p for p in photographs if p.name not in contrasts]
        made = run_calls(
            _enhance_file,
            ((str(paths[p.name]), encode(p), str(images[p.name]), request.method, request.window, keys[p.name]) for p in missing),
            workers=request.workers,
            scheduler=request.scheduler,
            progress=progress.part(0.0, 0.95),
            total=len(missing),
        )
        contrasts |= {missing[i].name: contrast for i, contrast in made}
        write_report(survey, photographs, images, contrasts, request.method, request.window, request.output_html_file)
        survey.finish(
            "enhance",
            digest(keys),
            built_on=("createsurvey",),
            parameters={"method": request.method, "window": request.window},
            result={"folder": f"{_FOLDER}/{folder.name}", "images": len(images)},
        )
        _remove_strays(folder.parent, set(images.values()))
    progress.at(1.0)
    return Result(request.survey)


def enhanced_path(survey: Survey, photograph: Photograph) -> Path:
    """Return the enhanced image of a photograph: 8-bit grey, of the photograph's size.

    Raises
    ------
    InputError
        When ``enhance`` has not been run or is stale, or the image is gone.
    """
    parameters = survey.require("enhance").parameters
    folder = survey.folder / _FOLDER / _parameters_name(parameters["method"], parameters["window"])
    path = _image_path(folder, photograph)
    if not path.is_file():
        raise InputError(f"The enhanced image {path} is gone: run strandline:enhance again.")
    return path


def _window(method: str, window: int) -> int | None:
    return window if method in ("arctan", "micmac") else None


def _parameters_name(method: str, window: int) -> str:
    used = _window(method, window)
    return method if used is None else f"{method}-{used}"


def _image_path(folder: Path, photograph: Photograph) -> Path:
    # The whole name stays, so that a.jpg and a.png do not meet.
    return folder / f"{photograph.name}.tif"


def _check(request: Request, photographs: list[Photograph]) -> None:
    small = [p.name for p in photographs if _window(request.method, request.window) and min(p.width, p.height) < request.window]
    if small:
        raise InputError(f"WINDOW={request.window} is larger than {some(small)}: take a smaller one.")


def _enhance_file(path: str, photograph: dict[str, Any], image: str, method: Any, window: int, key: str) -> Contrast:
    """Write the enhanced ``image`` of a photograph, with the ``key`` it was made under, and return its contrast."""
    total = read_channel_sum(Path(path), decode(Photograph, photograph))
    grey, contrast = enhance_photograph(total, method, window)
    note = json.dumps({"key": key, "contrast": encode(contrast)})
    with whole(Path(image)) as part:
        # Not compressed: deflate saves a quarter of the space and takes longer than all the rest.
        Image.fromarray(grey).save(part, "TIFF", description=note)
    return contrast


def _standing(image: Path, photograph: Photograph, key: str) -> Contrast | None:
    """Return the contrast noted in an image that was made under ``key``, None when there is no such image."""
    if not image.is_file() or image.stat().st_size < photograph.width * photograph.height:
        return None
    try:
        with Image.open(image) as standing:
            note = json.loads(standing.getexif()[270])
            return decode(Contrast, note["contrast"]) if note["key"] == key else None
    except (OSError, SyntaxError, ValueError, KeyError, TypeError, InputError):
        return None  # not ours, or of another version: it is made anew


def _remove_strays(folder: Path, images: set[Path]) -> None:
    """Remove what is not among ``images``: of other parameters, of photographs that are no longer there, of killed runs."""
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_dir() and not path.is_symlink():
            if not any(path.iterdir()):
                path.rmdir()
        elif path not in images:
            remove(path)
