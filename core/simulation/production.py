"""Makes all files of a simulated survey in a folder."""

from __future__ import annotations

import csv
import datetime
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..block import View
from ..camera import Camera
from ..errors import InputError
from ..files import remove, write_json
from ..frames import transformer
from ..parallel import run_calls, worker_count
from ..progress import Progress
from ..vector import write_layer
from . import exif, ground, rendering, sensor, truth
from .flight import Plan, fly, footprint_bounds, lens, plan
from .placement import Placement
from .report import precision_map, write_report
from .terrain import Beach

if TYPE_CHECKING:
    from .simulatesurvey import Request

Array = NDArray[np.float64]

# Two flights in a year: start, exposure, the sun's azimuth (from north) and elevation (degrees).
_DATES = (("2024-03-12T10:40:00", 1.0, 138.0, 46.0), ("2024-10-09T11:05:00", 0.93, 152.0, 41.0))
_INTERVAL = 2.0  # s between photographs
_STAMP = "2024-01-01T00:00:00.000Z"  # a GeoPackage holds the time it was made; the same seed is to give the same bytes
_MOST_CELLS = 1.2e8
_BAND = 256  # rows of heights computed in one call


def produce(request: Request, beach: Beach, folder: Path, progress: Progress) -> dict[str, Any]:
    """Make the survey's files in ``folder``; return the result's fields but the folder.

    Raises
    ------
    InputError
        When the parameters do not fit each other.
    """
    placement = Placement.of(beach, request.crs)
    ordinary = float(beach.heights(np.array(beach.length / 2), np.array(0.65 * beach.width), False))
    gsd = request.height / request.focal
    camera = lens(request.camera_width, request.camera_height, request.focal)
    footprint = (request.camera_width * gsd, request.camera_height * gsd)
    flight = plan(beach.length, beach.width, footprint, request.forward_overlap / 100, request.side_overlap / 100)
    dates = _DATES[: 2 if request.dates == "two" else 1]
    flights: dict[str, tuple[list[View], ground.Targets, Path]] = {}
    poses = {}
    for k, date in enumerate(dates):
        part = progress.part(0.85 * k / len(dates), 0.85 * (k + 1) / len(dates))
        one = _Date(request, beach, placement, camera, flight, ordinary + request.height, gsd, k, date)
        day = folder / one.day
        views, targets = one.make(day, part)
        flights[one.day] = (views, targets, day / "jpg")
        poses[one.day] = [_pose(view, placement) for view in views]
    (folder / "truth").mkdir()
    volumes = truth.write_truth(folder / "truth", placement, beach, len(dates))
    progress.at(0.95)
    _write_truth_tables(folder / "truth", placement, camera, poses, volumes, beach)
    _write_polygons(folder, placement, beach)
    _, _, sigma, _ = precision_map(beach, flights[next(iter(flights))][0])
    write_report(
        folder / "report" / "simulatesurvey.html", request.output_html_file, beach=beach, gsd=gsd, flights=flights,
        base=flight.base, spacing=flight.spacing, volumes=volumes,
    )  # fmt: skip
    total = volumes[-1] if volumes else None
    return {
        "image_count": len(flight.places),
        "gsd": gsd,
        "precision": float(np.nanmedian(sigma)) if np.isfinite(sigma).any() else None,
        "erosion": total and total.erosion,
        "deposition": total and total.deposition,
        "net": total and total.net,
    }


class _Date:
    """One flight over the beach."""

    def __init__(
        self, request: Request, beach: Beach, placement: Placement, camera: Camera, flight: Plan, height: float, gsd: float, k: int,
        date: tuple[str, float, float, float],
    ) -> None:  # fmt: skip
        self.request, self.beach, self.placement, self.gsd, self.after = request, beach, placement, gsd, k == 1
        start, self.exposure, azimuth, elevation = date
        self.start = datetime.datetime.fromisoformat(start)
        self.day = start[:10]
        self.entropy = [request.seed, k]
        names = [f"{self.day.replace('-', '')}_{i + 1:04d}.jpg" for i in range(len(flight.places))]
        self.views = fly(flight, camera, height, math.radians(request.tilt), names, self.random(1))
        self.headings = flight.headings
        # The beach's a axis points to the azimuth of its first row; angles there turn towards c, against the compass.
        shore = math.atan2(placement.axes[0, 0], placement.axes[0, 1])
        self.shore = shore
        self.light = rendering.Light(shore - math.radians(azimuth), math.radians(elevation))

    def random(self, *purpose: int) -> np.random.Generator:
        """Return the generator of one purpose: what is drawn for one changes nothing for another."""
        return np.random.default_rng([*self.entropy, *purpose])

    def make(self, folder: Path, progress: Progress) -> tuple[list[View], ground.Targets]:
        """Make the date's files in ``folder``; return the true views and targets in beach coordinates."""
        r = self.request
        fields = folder / "fields"
        (folder / "jpg").mkdir(parents=True)
        fields.mkdir()
        side = ground.TARGET_PIXELS * self.gsd
        targets = ground.lay_targets(self.beach, self.after, r.gcp_count, r.check_count, side, self.random(2))
        field = self._field()
        top, steepest = self._fill(fields, field, progress.part(0.0, 0.3))
        scene = rendering.Scene.load(str(fields), field, targets.placed, side / 2)
        marks = ground.mark(targets, self.views, scene, steepest, top, self.random(3))
        told = self._told()
        calls = (
            (
                str(fields), field, targets.placed, side / 2, view, steepest, top, self.exposure, r.noise,
                [*self.entropy, 4, i], told[i], str(folder / "jpg" / view.name),
            )
            for i, view in enumerate(self.views)
        )  # fmt: skip
        part = progress.part(0.3, 1.0)
        for _ in run_calls(_photograph, calls, workers=r.workers, scheduler=r.scheduler, progress=part, total=len(self.views)):
            pass
        del scene
        remove(fields)
        self._write_ground(folder, targets, marks)
        return self.views, targets

    def _field(self) -> rendering.Field:
        cell = min(max(self.gsd, 0.01), 0.06)
        a0, a1, c0, c1 = footprint_bounds(self.views, -0.1)
        columns, rows = math.ceil((a1 - a0) / cell) + 3, math.ceil((c1 - c0) / cell) + 3
        if columns * rows > _MOST_CELLS:
            raise InputError(
                f"The flight sees {(a1 - a0) * (c1 - c0) / 1e4:.1f} ha at {100 * self.gsd:.1f} cm, more than can be rendered: "
                "make LENGTH or WIDTH smaller, or fly higher."
            )
        return rendering.Field(a0 - cell, c0 - cell, cell, columns, rows)

    def _fill(self, fields: Path, field: rendering.Field, progress: Progress) -> tuple[float, float]:
        """Compute the fields; return the surface's highest point and steepest slope."""
        r, shape = self.request, self.beach.shape
        rendering.new_arrays(fields, field)
        bands = [(start, min(start + _BAND, field.rows)) for start in range(0, field.rows, _BAND)]
        spread = {"workers": min(worker_count(r.workers), len(bands)), "scheduler": r.scheduler, "total": len(bands)}
        calls = [(str(fields), field, *band, shape, self.after) for band in bands]
        for _ in run_calls(rendering.fill_heights, calls, progress=progress.part(0, 0.3), **spread):
            pass
        calls = [(*call, self.beach.contrast, self.light) for call in calls]
        for _ in run_calls(rendering.fill_radiance, calls, progress=progress.part(0.3, 1), **spread):
            pass
        heights = np.load(fields / "heights.npy", mmap_mode="r")
        tops, slopes = zip(*(rendering.bounds(heights, *band) for band in bands), strict=True)
        return max(tops), max(slopes) / field.cell

    def _told(self) -> list[exif.Metadata]:
        """Return what the drone notes of each exposure: positions by GNSS with their errors, the yaw it believes."""
        r, random = self.request, self.random(5)
        centres = self.placement.to_local(np.array([view.centre for view in self.views]))
        sigma = np.array([r.gnss_sigma_h, r.gnss_sigma_h, r.gnss_sigma_v])
        measured = self.placement.frame.to_crs(centres + sigma * random.standard_normal(centres.shape))
        crs = self.placement.frame.crs
        longitude, latitude = transformer(crs, "EPSG:4326").transform(measured[:, 0], measured[:, 1])
        take_off = float(self.beach.heights(np.array(self.beach.length / 2), np.array(0.0), self.after))
        yaw = [math.degrees(self.shore + (0.0 if heading > 0 else math.pi)) for heading in self.headings]
        return [
            exif.Metadata(
                time=(self.start + datetime.timedelta(seconds=_INTERVAL * i)).isoformat(),
                longitude=float(longitude[i]),
                latitude=float(latitude[i]),
                height=float(measured[i, 2]),
                relative_height=float(self.views[i].centre[2]) - take_off,
                sigma_h=r.gnss_sigma_h,
                sigma_v=r.gnss_sigma_v,
                yaw=(yaw[i] + 180.0) % 360.0 - 180.0,
                focal=r.focal,
            )
            for i in range(len(self.views))
        ]

    def _write_ground(self, folder: Path, targets: ground.Targets, marks: list[ground.Mark]) -> None:
        """Write gcps.gpkg, marks.csv and gcp_list.txt."""
        local = self.placement.to_local(targets.points)
        sigma = np.array([ground.SIGMA_H, ground.SIGMA_H, ground.SIGMA_V])
        errors = sigma * self.random(6).standard_normal(local.shape)
        measured = self.placement.frame.to_crs(local + errors) if len(local) else local
        count, crs = len(targets.names), self.placement.frame.crs
        fields = {
            "name": targets.names, "role": targets.roles,
            "sigma_h": [ground.SIGMA_H] * count, "sigma_v": [ground.SIGMA_V] * count,
        }  # fmt: skip
        points = [shapely.Point(*point) for point in measured]
        write_layer(str(folder / "gcps.gpkg"), "gcps", crs, fields, points, "Point Z", modified=_STAMP)
        with (folder / "marks.csv").open("w", encoding="utf-8", newline="") as stream:
            table = csv.writer(stream, lineterminator="\n")
            table.writerow(("gcp", "image", "x", "y"))
            table.writerows((m.gcp, m.image, f"{m.x:.3f}", f"{m.y:.3f}") for m in marks)
        place = dict(zip(targets.names, measured, strict=True))
        definition = self.request.crs or "EPSG:32630"
        lines = [definition.replace("\n", " ")]
        for m in marks:
            # ODM counts from the centre of the top-left pixel.
            x, y, z = place[m.gcp]
            lines.append(f"{x:.4f} {y:.4f} {z:.4f} {m.x - 0.5:.3f} {m.y - 0.5:.3f} {m.image} {m.gcp}")
        (folder / "gcp_list.txt").write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _photograph(
    fields: str, field: rendering.Field, placed: Array, half: float, view: View, steepest: float, top: float, exposure: float,
    noise: float, entropy: list[int], told: exif.Metadata, path: str,
) -> None:  # fmt: skip
    """Render one photograph and write it."""
    random = np.random.default_rng(entropy)
    scene = rendering.Scene.load(fields, field, placed, half)
    light = scene.render(view, int(random.integers(1 << 30)), steepest, top)
    signal = sensor.expose(sensor.electrons(light, exposure), noise, random)
    exif.save_jpeg(Path(path), sensor.develop(signal), told)


def _pose(view: View, placement: Placement) -> dict[str, Any]:
    rotation = view.rotation @ placement.axes
    translation = view.rotation @ placement.offset + view.translation
    centre = placement.to_local(view.centre[None])
    return {
        "image": view.name,
        "rotation": rotation.ravel().tolist(),
        "translation": translation.tolist(),
        "centre": centre[0].tolist(),
        "centre_crs": placement.frame.to_crs(centre)[0].tolist(),
    }


def _write_truth_tables(
    folder: Path, placement: Placement, camera: Camera, poses: dict[str, Any], volumes: list[truth.Volumes], beach: Beach
) -> None:
    about = "x_camera = rotation (row by row) x_local + translation; local is east, north, up at the frame's origin"
    write_json(folder / "cameras.json", {"about": about, "frame": placement.frame, "camera": camera, "views": poses})
    if not volumes:
        return
    write_json(folder / "volumes.json", {"unit": "m3", "zones": [asdict(v) for v in volumes], "without_ripples": beach.changes()})
    with (folder / "volumes.csv").open("w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(("zone", "erosion", "deposition", "net", "area"))
        table.writerows((v.zone, *(f"{x:.4f}" for x in (v.erosion, v.deposition, v.net, v.area))) for v in volumes)


def _write_polygons(folder: Path, placement: Placement, beach: Beach) -> None:
    crs, zones = placement.frame.crs, truth.zone_polygons(placement, beach)
    shapes = [shapely.MultiPolygon([polygon]) for polygon in zones.values()]
    write_layer(str(folder / "zones.gpkg"), "zones", crs, {"name": list(zones)}, shapes, "MultiPolygon", modified=_STAMP)
    stable = [shapely.MultiPolygon([truth.stable_polygon(placement, beach)])]
    write_layer(str(folder / "stable.gpkg"), "stable", crs, {"name": ["behind the dune"]}, stable, "MultiPolygon", modified=_STAMP)
