"""The tables and layers of a simulated survey."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj import CRS

from ..block import View
from ..camera import Camera
from ..files import write_json
from ..vector import write_layer
from . import truth
from .ground import Mark, Targets
from .placement import Placement
from .terrain import Beach

Array = NDArray[np.float64]

_STAMP = "2024-01-01T00:00:00.000Z"  # a GeoPackage holds the time it was made; the same seed is to give the same bytes


def write_ground(
    folder: Path, placement: Placement, targets: Targets, measured: Array, sigmas: tuple[float, float], marks: list[Mark]
) -> None:
    """Write gcps.gpkg (coordinates ``measured`` (n, 3) in the CRS, ``sigmas`` in plan and height), marks.csv, gcp_list.txt."""
    count = len(targets.names)
    fields: dict[str, list[Any]] = {
        "name": targets.names,
        "role": targets.roles,
        "sigma_h": [sigmas[0]] * count,
        "sigma_v": [sigmas[1]] * count,
    }
    points = [shapely.Point(*point) for point in measured]
    write_layer(str(folder / "gcps.gpkg"), "gcps", placement.frame.crs, fields, points, "Point Z", modified=_STAMP)
    rows = [(m.gcp, m.image, f"{m.x:.3f}", f"{m.y:.3f}") for m in marks]
    _write_csv(folder / "marks.csv", ("gcp", "image", "x", "y"), rows)
    place = dict(zip(targets.names, measured, strict=True))
    crs = CRS(placement.frame.crs)
    code = crs.to_epsg()
    lines = [f"EPSG:{code}" if code else " ".join(crs.to_wkt().split())]
    for m in marks:
        x, y, z = place[m.gcp]
        # ODM counts from the centre of the top-left pixel.
        lines.append(f"{x:.4f} {y:.4f} {z:.4f} {m.x - 0.5:.3f} {m.y - 0.5:.3f} {m.image} {m.gcp}")
    (folder / "gcp_list.txt").write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def write_tables(
    folder: Path,
    placement: Placement,
    camera: Camera,
    flights: dict[str, tuple[list[View], Targets]],
    volumes: list[truth.Volumes],
    beach: Beach,
) -> None:
    """Write cameras.json (true poses in the local frame), targets.csv (in the CRS), and of two dates volumes.json and .csv."""
    about = "x_camera = rotation (row by row) x_local + translation; local is east, north, up at the frame's origin"
    poses = {day: [_pose(view, placement) for view in flown] for day, (flown, _) in flights.items()}
    write_json(folder / "cameras.json", {"about": about, "frame": placement.frame, "camera": camera, "views": poses})
    targets = [
        (day, name, *(f"{value:.4f}" for value in place))
        for day, (_, laid) in flights.items()
        for name, place in zip(laid.names, placement.to_crs(laid.points.reshape(-1, 3)), strict=True)
    ]
    _write_csv(folder / "targets.csv", ("date", "name", "x", "y", "z"), targets)
    if volumes:
        zones = [asdict(v) for v in volumes]
        write_json(folder / "volumes.json", {"unit": "m3", "zones": zones, "without_ripples": beach.changes()})
        rows = [(v.zone, *(f"{x:.4f}" for x in (v.erosion, v.deposition, v.net, v.area))) for v in volumes]
        _write_csv(folder / "volumes.csv", ("zone", "erosion", "deposition", "net", "area"), rows)


def write_polygons(folder: Path, placement: Placement, beach: Beach) -> None:
    """Write zones.gpkg and stable.gpkg."""
    stable = {"behind the dune": truth.stable_polygon(placement, beach)}
    for name, polygons in (("zones", truth.zone_polygons(placement, beach)), ("stable", stable)):
        shapes = [shapely.MultiPolygon([polygon]) for polygon in polygons.values()]
        path, fields = str(folder / f"{name}.gpkg"), {"name": list(polygons)}
        write_layer(path, name, placement.frame.crs, fields, shapes, "MultiPolygon", modified=_STAMP)


def _pose(view: View, placement: Placement) -> dict[str, Any]:
    centre = placement.to_local(view.centre[None])
    return {
        "image": view.name,
        "rotation": (view.rotation @ placement.axes).ravel().tolist(),
        "translation": (view.rotation @ placement.offset + view.translation).tolist(),
        "centre": centre[0].tolist(),
        "centre_crs": placement.frame.to_crs(centre)[0].tolist(),
    }


def _write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(columns)
        table.writerows(rows)
