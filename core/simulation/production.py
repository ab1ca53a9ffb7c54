"""Makes all files of a simulated survey in a folder."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..block import View
from ..camera import Camera
from ..errors import InputError
from ..files import remove
from ..frames import transformer
from ..parallel import run_calls
from ..progress import Progress
from . import dng, exif, ground, outputs, rendering, sensor, truth
from .flight import Plan, fly, footprint_bounds, lens, plan
from .placement import Placement
from .report import precision_map, write_report
from .terrain import Beach

if TYPE_CHECKING:
    from .simulatesurvey import Request

Array = NDArray[np.float64]

# Two flights in a year: start, exposure, the sun's azimuth (from north) and elevation (degrees).
_DATES = (("2024-03-12T10:40:00", 1.0, 138.0, 46.0), ("2024-10-09T11:05:00", 0.93, 152.0, 41.0))
JPG, RAW = "jpg", "raw"  # folders of a date; a photograph has the same name in both
_INTERVAL = 2.0  # s between photographs
_FINEST, _COARSEST = 0.01, 0.06  # m, cells of the fields; ripples want them fine
_MOST_CELLS = 1.2e8
_BAND = 128  # rows of heights computed in one call
# What is drawn for one purpose changes nothing for another.
_FLIGHT, _TARGETS, _MARKS, _SENSOR, _GNSS, _SURVEY = range(6)


@dataclass(frozen=True)
class Setting:
    """What both dates have in common."""

    request: Request
    beach: Beach
    placement: Placement
    camera: Camera
    plan: Plan
    gsd: float

    @classmethod
    def of(cls, request: Request, beach: Beach) -> Setting:
        """Place the beach and plan the flight."""
        gsd = request.height / request.focal
        camera = lens(request.camera_width, request.camera_height, request.focal)
        footprint = (camera.width * gsd, camera.height * gsd)
        flight = plan(beach.length, beach.width, footprint, request.forward_overlap / 100, request.side_overlap / 100)
        return cls(request, beach, Placement.of(beach, request.crs), camera, flight, gsd)


@dataclass(frozen=True)
class Date:
    """One flight: its day, the true views and targets (beach coordinates), and the grid of what they show."""

    number: int
    day: str
    views: list[View]
    targets: ground.Targets
    field: rendering.Field

    @classmethod
    def of(cls, setting: Setting, number: int) -> Date:
        """Fly and lay the targets.

        Raises
        ------
        InputError
            When the flight sees more than can be rendered, or the area is too small for the targets.
        """
        r, beach = setting.request, setting.beach
        day = _DATES[number][0][:10]
        names = [f"{day.replace('-', '')}_{i + 1:04d}.jpg" for i in range(len(setting.plan.places))]
        berm = float(beach.heights(np.array(beach.length / 2), np.array(0.65 * beach.width), False))
        random = _random(r, number, _FLIGHT)
        views = fly(setting.plan, setting.camera, berm + r.height, math.radians(r.tilt), names, random)
        side = ground.TARGET_PIXELS * setting.gsd
        targets = ground.lay_targets(beach, number == 1, r.gcp_count, r.check_count, side, _random(r, number, _TARGETS))
        return cls(number, day, views, targets, _field(views, setting.gsd))


def produce(request: Request, beach: Beach, folder: Path, progress: Progress) -> dict[str, Any]:
    """Make the survey's files in ``folder``; return the result's fields but the folder.

    Raises
    ------
    InputError
        When the parameters do not fit each other.
    """
    setting = Setting.of(request, beach)
    dates = [Date.of(setting, k) for k in range(2 if request.dates == "two" else 1)]
    fields = [_fields(setting, date, folder / date.day / "fields") for date in dates]
    spread: dict[str, Any] = {"workers": request.workers, "scheduler": request.scheduler}
    bands = [(f, start, min(start + _BAND, f.field.rows)) for f in fields for start in range(0, f.field.rows, _BAND)]
    for _ in run_calls(rendering.fill, bands, progress=progress.part(0, 0.25), total=len(bands), **spread):
        pass
    calls = [call for f, date in zip(fields, dates, strict=True) for call in _exposures(setting, date, f, folder / date.day)]
    for _ in run_calls(_photograph, calls, progress=progress.part(0.25, 0.85), total=len(calls), **spread):
        pass
    for f, date in zip(fields, dates, strict=True):
        random = _random(request, date.number, _MARKS)
        marks = ground.mark(date.targets, date.views, _scene(setting, date, f), request.mark_sigma, random)
        sigmas = request.gcp_sigma_h, request.gcp_sigma_v
        measured = ground.measure(date.targets, setting.placement, *sigmas, _random(request, date.number, _SURVEY))
        outputs.write_ground(folder / date.day, setting.placement, date.targets, measured, sigmas, marks)
        remove(Path(f.folder))
    (folder / "truth").mkdir()
    volumes = truth.write_truth(folder / "truth", setting.placement, beach, len(dates))
    progress.at(0.95)
    flights = {date.day: (date.views, date.targets) for date in dates}
    outputs.write_tables(folder / "truth", setting.placement, setting.camera, flights, volumes, beach)
    outputs.write_polygons(folder, setting.placement, beach)
    sigma = precision_map(beach, dates[0].views)[2]
    write_report(
        folder / "report" / "simulatesurvey.html",
        request.output_html_file,
        beach=beach,
        gsd=setting.gsd,
        flights={date.day: (date.views, date.targets, folder / date.day) for date in dates},
        plan=setting.plan,
        volumes=volumes,
        noise=request.noise,
    )
    total = volumes[-1] if volumes else None
    return {
        "image_count": len(dates[0].views),
        "gsd": setting.gsd,
        "precision": float(np.nanmedian(sigma)) if np.isfinite(sigma).any() else None,
        "erosion": total and total.erosion,
        "deposition": total and total.deposition,
        "net": total and total.net,
    }


def _random(request: Request, *purpose: int) -> np.random.Generator:
    return np.random.default_rng([request.seed, *purpose])


def _field(views: list[View], gsd: float) -> rendering.Field:
    cell = min(max(gsd, _FINEST), _COARSEST)
    a0, a1, c0, c1 = footprint_bounds(views, -0.1)
    columns, rows = math.ceil((a1 - a0) / cell) + 3, math.ceil((c1 - c0) / cell) + 3
    if columns * rows > _MOST_CELLS:
        raise InputError(
            f"The flight sees {(a1 - a0) * (c1 - c0) / 1e4:.1f} ha at {100 * gsd:.1f} cm, more than can be rendered: "
            "make LENGTH or WIDTH smaller, or fly higher."
        )
    return rendering.Field(a0 - cell, c0 - cell, cell, columns, rows)


def _fields(setting: Setting, date: Date, folder: Path) -> rendering.Fields:
    _, _, azimuth, elevation = _DATES[date.number]
    # Angles in the beach turn from a towards c, against the compass.
    light = rendering.Light(setting.placement.azimuth - math.radians(azimuth), math.radians(elevation))
    fields = rendering.Fields(str(folder), date.field, setting.beach, date.number == 1, light)
    folder.mkdir(parents=True)
    fields.create()
    return fields


def _scene(setting: Setting, date: Date, fields: rendering.Fields) -> rendering.Scene:
    heights, radiance = fields.open("r")
    half = ground.TARGET_PIXELS * setting.gsd / 2
    return rendering.Scene.of(date.field, heights, radiance, date.targets.placed, half)


def _exposures(setting: Setting, date: Date, fields: rendering.Fields, folder: Path) -> list[tuple[Any, ...]]:
    """Return the arguments of ``_photograph`` for each of a date's photographs."""
    for kind in (JPG, RAW):
        (folder / kind).mkdir()
    return [(setting, date, fields, i, told, folder) for i, told in enumerate(_told(setting, date))]


def _photograph(setting: Setting, date: Date, fields: rendering.Fields, i: int, told: exif.Metadata, folder: Path) -> None:
    """Render one exposure; write the mosaic as RAW and what the camera makes of it as JPG."""
    random = _random(setting.request, date.number, _SENSOR, i)
    light = _scene(setting, date, fields).render(date.views[i], int(random.integers(1 << 30)))
    mosaic = sensor.expose(light, _DATES[date.number][1], setting.request.noise, random)
    name = Path(date.views[i].name)
    dng.save_dng(folder / RAW / name.with_suffix(".dng"), mosaic, told)
    exif.save_jpeg(folder / JPG / name, sensor.develop(mosaic), told)


def _told(setting: Setting, date: Date) -> list[exif.Metadata]:
    """Return what the drone notes of each exposure: positions by GNSS with their errors, the yaw it believes."""
    r, placement, random = setting.request, setting.placement, _random(setting.request, date.number, _GNSS)
    centres = placement.to_local(np.array([view.centre for view in date.views]))
    sigma = np.array([r.gnss_sigma_h, r.gnss_sigma_h, r.gnss_sigma_v])
    measured = placement.frame.to_crs(centres + sigma * random.standard_normal(centres.shape))
    longitude, latitude = transformer(placement.frame.crs, "EPSG:4326").transform(measured[:, 0], measured[:, 1])
    take_off = float(setting.beach.heights(np.array(setting.beach.length / 2), np.array(0.0), date.number == 1))
    start = datetime.datetime.fromisoformat(_DATES[date.number][0])
    yaw = np.degrees(placement.azimuth) + np.where(setting.plan.headings > 0, 0.0, 180.0)
    return [
        exif.Metadata(
            time=(start + datetime.timedelta(seconds=_INTERVAL * i)).isoformat(),
            longitude=float(longitude[i]),
            latitude=float(latitude[i]),
            height=float(measured[i, 2]),
            relative_height=float(date.views[i].centre[2]) - take_off,
            sigma_h=r.gnss_sigma_h,
            sigma_v=r.gnss_sigma_v,
            yaw=float((yaw[i] + 180.0) % 360.0 - 180.0),
            focal=r.focal,
        )
        for i in range(len(date.views))
    ]
