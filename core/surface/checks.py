"""What is refused before any work, so that it costs nothing."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from ..errors import InputError
from ..raster import check_destination
from .filling import MOST
from .mosaic import Tile
from .plan import Plan
from .points import check_points_destination

RASTERS = ("output", "precision", "correlation", "views", "filled", "ortho")
_FINEST = 1e-4  # m
_CELL = {"output": 4, "precision": 4, "correlation": 4, "views": 1, "filled": 1, "ortho": 8, "points": 12}  # bytes on disk
_COLLECTED = 1.6  # a raster and what it is made of, compressed, of the bytes of its values
_TILE, _COARSE_TILE = 23, 4  # bytes of a cell of a finished tile, on the finest level and on the others


def check_numbers(window: int, depth: str, **numbers: float) -> None:
    """Refuse parameters that mean nothing.

    Raises
    ------
    InputError
        By name.
    """
    if window and not (3 <= window <= 31 and window % 2):
        raise InputError(f"WINDOW={window} is not an odd number from 3 to 31: choose one, or 0 to adapt it.")
    for name, value in numbers.items():
        if not 0 <= value < float("inf"):
            raise InputError(f"{name.upper()}={value:g} is no number of 0 or more: give one.")
    if 0 < numbers["resolution"] < _FINEST:
        raise InputError(f"RESOLUTION={numbers['resolution']:g} m is finer than any photograph: give metres, or 0.")
    if depth not in ("8", "16"):
        raise InputError(f"ORTHO_DEPTH={depth} is neither 8 nor 16: choose one.")


def check_files(outputs: dict[str, str], page: str | None) -> None:
    """Refuse files that cannot be written, or are named twice.

    Raises
    ------
    InputError
        By name.
    """
    for name, path in outputs.items():
        if name == "points":
            check_points_destination(path)
        else:
            check_destination(path)
    named = [*outputs.values(), *([page] if page else [])]
    places = [os.path.normcase(Path(path).resolve()) for path in named]
    for path, place in zip(named, places, strict=True):
        if places.count(place) > 1:
            raise InputError(f"{path} is named for two outputs: give each a name of its own.")


def check_photographs(outputs: dict[str, str], photographs: tuple[str, ...]) -> None:
    """Refuse to write over a photograph.

    Raises
    ------
    InputError
        By name.
    """
    sources = {os.path.normcase(Path(path).resolve()) for path in photographs}
    for path in outputs.values():
        if os.path.normcase(Path(path).resolve()) in sources:
            raise InputError(f"{path} is a photograph of the survey: give the output another name.")


def holes(fill: float, cell: float) -> int:
    """Return how many cells the largest hole has that FILL (m2) fills.

    Raises
    ------
    InputError
        When they are more than can be held at once.
    """
    cells = int(fill / cell**2 + 1e-6)
    if cells > MOST:
        raise InputError(
            f"FILL={fill:g} m2 is more than {MOST} cells of {cell:g} m, too large a gap to interpolate: "
            f"give {int(MOST * cell**2)} m2 or less."
        )
    return cells


def check_room(plan: Plan, cut: list[list[Tile]], outputs: dict[str, str]) -> None:
    """Refuse to start what the disks have no room for: the tiles that are missing, and the outputs.

    Raises
    ------
    InputError
        With the folder, what it has and what it would need.
    """
    wanted: dict[int, tuple[float, Path]] = {}

    def add(folder: Path, size: float) -> None:
        place = next(f for f in (folder.absolute(), *folder.absolute().parents) if f.exists())
        device = place.stat().st_dev
        wanted[device] = wanted.get(device, (0.0, place))[0] + size, wanted.get(device, (0.0, place))[1]

    for tiles in cut:
        missing = [t for t in tiles if not t.path(plan.scratch).is_file()]
        cell = _TILE if tiles and tiles[0].level.number == 0 else _COARSE_TILE
        add(Path(plan.scratch), sum(float(cell * t.window[2] * t.window[3]) for t in missing))
    cells = sum(t.core_window[2] * t.core_window[3] for t in cut[-1])
    for name, path in outputs.items():
        add(Path(path).parent, _COLLECTED * _CELL[name] * cells)
    for size, folder in wanted.values():
        free = shutil.disk_usage(folder).free
        if free < size:
            raise InputError(
                f"{folder} has {free / 1e9:.2g} GB free, and this surface takes up to {size / 1e9:.2g} GB while it is made: "
                "free some space, or choose a coarser RESOLUTION or a smaller AREA."
            )
