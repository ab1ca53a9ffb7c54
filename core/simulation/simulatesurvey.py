"""Step ``simulatesurvey``: photographs of a beach that never was, with all that is true of it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from ..errors import InputError
from ..files import PART, copy_file, digest, remove, whole, write_json
from ..progress import SILENT, Progress
from ..survey import held
from .terrain import Beach

_FILE = "simulation.json"
_VERSION = 5  # of what the same parameters give
_SIDECARS = (".aux.xml", "-wal", "-shm", "-journal", ".qmd", ".qml")  # what looking at the files may add


@dataclass(frozen=True)
class Request:
    """Terrain, flight, camera, contrast and noise; lengths in metres, angles in degrees, overlaps in percent.

    ``length`` is along the shore, ``width`` across it. ``height`` is that of the flight above the beach; ``tilt`` the standard
    deviation of the camera's tilt. ``crs`` is a projected CRS in metres. ``contrast`` is the standard deviation of the sand's
    reflectance relative to its mean over features from 2 cm to 3 m. ``noise`` scales shot and read noise (1 = a small drone
    camera at base ISO, 0 = none). ``mark_sigma`` (px) is of a ground point marked in a photograph.
    """

    output: str
    dates: Literal["one", "two"] = "two"
    length: float = 60.0
    width: float = 40.0
    crs: str | None = None
    height: float = 50.0
    forward_overlap: float = 80.0
    side_overlap: float = 70.0
    tilt: float = 3.0
    camera_width: int = 1600
    camera_height: int = 1200
    focal: float = 1300.0
    contrast: float = 0.04
    noise: float = 1.0
    gnss_sigma_h: float = 0.03
    gnss_sigma_v: float = 0.05
    gcp_sigma_h: float = 0.01
    gcp_sigma_v: float = 0.02
    mark_sigma: float = 0.3
    gcp_count: int = 6
    check_count: int = 4
    seed: int = 1
    workers: int = 0
    scheduler: str | None = None
    output_html_file: str | None = None


@dataclass(frozen=True)
class Result:
    """The folder, photographs per date, the ground pixel (m), and the true volumes (m3) when there are two dates.

    ``precision`` is the standard deviation (m) of heights to expect, the median over the area.
    """

    output: str
    image_count: int
    gsd: float
    precision: float | None
    erosion: float | None
    deposition: float | None
    net: float | None


def run(request: Request, progress: Progress = SILENT) -> Result:
    """Render the survey into ``request.output``, whole or not at all.

    A folder that holds this very simulation is kept; one that holds another simulation and nothing else is replaced.

    Raises
    ------
    InputError
        When a parameter is impossible, or the folder holds anything else.
    """
    _validate(request)
    parameters = {k: v for k, v in asdict(request).items() if k not in ("output", "workers", "scheduler", "output_html_file")}
    fingerprint = digest(_VERSION, parameters)
    output = Path(request.output).absolute()
    standing = _standing(output)
    if standing is not None and standing["fingerprint"] == fingerprint and _complete(output, standing["files"]):
        progress.info(f"{output} holds this simulation already: it is kept.")
        if request.output_html_file:
            copy_file(output / "report" / "simulatesurvey.html", request.output_html_file)
        return Result(output=request.output, **standing["result"])

    from .production import produce  # numba and matplotlib are loaded only when there is work

    _remove_abandoned(output)
    with whole(output) as part:
        with held(part, "simulatesurvey", make=True):
            result = produce(request, _beach(request), part, progress)
        (part / "survey.lock").unlink()
        files = {p.relative_to(part).as_posix(): p.stat().st_size for p in sorted(part.rglob("*")) if p.is_file()}
        write_json(part / _FILE, {"fingerprint": fingerprint, "parameters": parameters, "result": result, "files": files})
    return Result(output=request.output, **result)


def _beach(request: Request) -> Beach:
    return Beach(request.length, request.width, request.contrast, request.seed)


def _validate(r: Request) -> None:
    ranges = {
        "LENGTH": (r.length, 10, 5000, "m"),
        "WIDTH": (r.width, 10, 1000, "m"),
        "FORWARD_OVERLAP": (r.forward_overlap, 0, 98, "%"),
        "SIDE_OVERLAP": (r.side_overlap, 0, 98, "%"),
        "TILT": (r.tilt, 0, 10, "degrees"),
        "CAMERA_WIDTH": (r.camera_width, 200, 12000, "px"),
        "CAMERA_HEIGHT": (r.camera_height, 200, 12000, "px"),
        "CONTRAST": (r.contrast, 0, 0.3, ""),
        "NOISE": (r.noise, 0, 20, ""),
        "GNSS_SIGMA_H": (r.gnss_sigma_h, 0, 100, "m"),
        "GNSS_SIGMA_V": (r.gnss_sigma_v, 0, 100, "m"),
        "GCP_SIGMA_H": (r.gcp_sigma_h, 0, 100, "m"),
        "GCP_SIGMA_V": (r.gcp_sigma_v, 0, 100, "m"),
        "MARK_SIGMA": (r.mark_sigma, 0, 100, "px"),
        "GCP_COUNT": (r.gcp_count, 0, 200, ""),
        "CHECK_COUNT": (r.check_count, 0, 200, ""),
        "SEED": (r.seed, 0, 10**9, ""),
    }
    for name, (value, low, high, unit) in ranges.items():
        if not low <= value <= high:
            raise InputError(f"{name} is {value:g}, but must lie between {low} and {high}{unit and ' ' + unit}.")
    widest = max(r.camera_width, r.camera_height)
    if not 0.4 * widest <= r.focal <= 20 * widest:
        raise InputError(f"FOCAL is {r.focal:g} px, but must lie between 0.4 and 20 times the longer side of {widest} px.")
    highest = 6.0 * _beach(r).relief  # the dune's crest and some air above it
    if not highest <= r.height <= 500:
        raise InputError(f"HEIGHT is {r.height:g} m, but must lie between {highest:.1f} m, to clear the dune, and 500 m.")


def _standing(output: Path) -> dict[str, Any] | None:
    """Return what the simulation in ``output`` recorded, None when there is nothing.

    Raises
    ------
    InputError
        When there is anything but a simulation.
    """
    if not output.exists():
        return None
    if not output.is_dir():
        raise InputError(f"{output} is a file: give a folder as OUTPUT.")
    try:
        record = json.loads((output / _FILE).read_text(encoding="utf-8"))
        known = {*record["files"], _FILE}
    except (OSError, ValueError, KeyError, TypeError) as error:
        if any(output.iterdir()):
            raise InputError(f"The folder {output} is not empty and holds no simulation: choose another OUTPUT.") from error
        return None
    for path in sorted(output.rglob("*")):
        name = path.relative_to(output).as_posix()
        if path.is_file() and name not in known and not name.endswith(_SIDECARS):
            raise InputError(f"The folder {output} holds {name}, which is not of the simulation: choose another OUTPUT.")
    return dict(record)


def _complete(output: Path, files: dict[str, int]) -> bool:
    return all((output / name).is_file() and (output / name).stat().st_size == size for name, size in files.items())


def _remove_abandoned(output: Path) -> None:
    """Remove what killed runs left beside ``output``; a run that lives holds its folder."""
    for path in output.parent.glob(f"{PART}*-{output.name}"):
        if path.is_dir():
            try:
                with held(path, "simulatesurvey"):
                    pass
            except InputError:
                continue
            remove(path)
