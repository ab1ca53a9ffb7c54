"""The report of a simulated survey: a photograph, the terrain, the truth, the flight and the precision to expect."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..block import View
from ..report.html import Report, new_figure
from ..report.relief import exaggeration, heights_drawn, hillshade
from . import exposure
from .flight import Plan, expected_precision
from .ground import Targets
from .terrain import ZONES, Beach
from .truth import Volumes

Array = NDArray[np.float64]

EXPECTED_PIXELS = 0.3  # sigma of an image coordinate that planning reckons with
_PICTURE = 1100  # px, the longer side of a photograph in the report


def precision_map(beach: Beach, views: list[View]) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    """Return places a (columns), c (rows), the expected sigma_Z (rows, columns; m) and the number of views over the area."""
    a = np.linspace(0, beach.length, 61)
    c = np.linspace(0, beach.width, 41)
    mesh = np.stack(np.meshgrid(a, c), axis=-1).reshape(-1, 2)
    points = np.column_stack([mesh, beach.heights(mesh[:, 0], mesh[:, 1], False)])
    sigma, count = expected_precision(views, points, EXPECTED_PIXELS)
    return a, c, sigma.reshape(len(c), len(a)), count.reshape(len(c), len(a))


def write_report(
    path: Path,
    copy: str | None,
    *,
    beach: Beach,
    gsd: float,
    flights: dict[str, tuple[list[View], Targets, Path]],
    plan: Plan,
    volumes: list[Volumes],
    noise: float,
) -> None:
    """Write the page; ``flights`` maps a date to its views (beach coordinates), targets and folder."""
    first = next(iter(flights))
    views = flights[first][0]
    a, c, sigma, count = precision_map(beach, views)
    total = sum(len(flight[0]) for flight in flights.values())
    median = float(np.nanmedian(sigma)) if np.isfinite(sigma).any() else None
    shown = "not known" if median is None else f"{100 * median:.1f} cm"
    verdict = f"{total} photographs with a ground pixel of {100 * gsd:.1f} cm; heights to expect to {shown} (1 sigma)."
    report = Report("Simulated survey", verdict)
    report.text(
        "The beach does not exist: surface, sand, flight, camera and noise are computed from a seed, so that all that a survey "
        "should find is known. The folder truth holds the true surfaces, their difference, volumes and camera poses."
    )
    for date, (views_of, _, folder) in flights.items():
        middle = views_of[len(views_of) // 2].name
        with Image.open(folder / "jpg" / middle) as picture:
            picture.thumbnail((_PICTURE, _PICTURE))
            report.picture(np.asarray(picture.convert("RGB")), f"Photograph {middle} of {date}.")
    exposure.tell(report, flights[first][2], Path(views[len(views) // 2].name).stem, noise=noise, contrast=beach.contrast)
    report.heading("The flight")
    report.table(
        ("quantity", "value"),
        [
            ("photographs a date", len(views)),
            ("height above the beach (m)", float(np.mean([v.centre[2] for v in views]))),
            ("ground pixel (m)", gsd),
            ("distance between photographs (m)", plan.base),
            ("distance between strips (m)", plan.spacing),
            ("views of a place, median", float(np.median(count))),
            ("expected sigma of heights, median (m)", median),
        ],
    )
    figure = _plan(beach, views, flights[first][1], a, c, sigma)
    report.figure(figure, f"Plan of the flight of {first} over the precision to expect.")
    report.text(
        f"The precision is that of the normal case, sigma_Z = sigma x ground pixel x H / sqrt(sum of (b - mean b)^2) over the "
        f"places b of the views that see a place, with sigma = {EXPECTED_PIXELS} px for a point measured in all of them. It "
        "holds for single points and counts no error of orientation or control."
    )
    report.heading("The terrain")
    report.figure(*_terrain(beach, len(flights)))
    if volumes:
        report.heading("The truth")
        report.figure(_difference(beach), "True difference, after minus before, and the zones.")
        columns = ("zone", "erosion (m3)", "deposition (m3)", "net (m3)", "area (m2)")
        report.table(columns, [(v.zone, v.erosion, v.deposition, v.net, v.area) for v in volumes])
        report.text(
            "Erosion and deposition count every ripple that moved; what the scarp lost is "
            f"{beach.changes()['erosion']:.1f} m3, what the lobe gained {beach.changes()['deposition']:.1f} m3."
        )
    report.save(path, copy)


def _plan(beach: Beach, views: list[View], targets: Targets, a: Array, c: Array, sigma: Array) -> Any:
    figure = new_figure(9, 6)
    axes = figure.add_subplot()
    image = axes.pcolormesh(a, c, 100 * sigma, cmap="viridis_r", shading="nearest")
    figure.colorbar(image, label="expected sigma of heights (cm)", shrink=0.8)
    centres = np.array([v.centre for v in views])
    axes.plot(centres[:, 0], centres[:, 1], "k-", lw=0.6)
    axes.plot(centres[:, 0], centres[:, 1], "k^", ms=5, label="photograph")
    for role, marker in (("control", "s"), ("check", "o")):
        chosen = np.array([r == role for r in targets.roles], bool)
        if chosen.any():
            axes.plot(*targets.points[chosen, :2].T, marker, color="crimson", mec="white", label=role)
    axes.set(xlabel="along the shore (m)", ylabel="towards the sea (m)", aspect="equal")
    axes.legend(loc="upper right", fontsize=8)
    return figure


def _terrain(beach: Beach, dates: int) -> tuple[Any, str]:
    figure = new_figure(9, 4.6 * dates)
    a, c = _mesh(beach)
    # A hillshade's rows run to the south, which is the land here.
    heights = [beach.heights(a[None], c[::-1, None], k == 1) for k in range(dates)]
    step = float(a[1] - a[0])
    factor = exaggeration(heights[0], step)
    for k in range(dates):
        axes = figure.add_subplot(dates, 1, k + 1)
        axes.imshow(hillshade(heights[k], step, factor), cmap="gray", vmin=0, vmax=1, extent=_extent(beach))
        axes.set(xlabel="along the shore (m)", ylabel="towards the sea (m)", title=("before", "after")[k])
    figure.tight_layout()
    return figure, f"Hillshade of the true surfaces, the ripples included, {heights_drawn(factor)}; the sea is flat."


def _difference(beach: Beach) -> Any:
    figure = new_figure(9, 5)
    axes = figure.add_subplot()
    a, c = _mesh(beach)
    change = beach.heights(a[None], c[:, None], True) - beach.heights(a[None], c[:, None], False)
    limit = float(np.abs(change).max())
    image = axes.imshow(change, cmap="RdBu", vmin=-limit, vmax=limit, origin="lower", extent=_extent(beach))
    figure.colorbar(image, label="difference (m)", shrink=0.7)
    for name, (start, end) in ZONES.items():
        axes.axhline(start * beach.across, color="k", lw=0.5)
        axes.text(0.01 * beach.length, (start + 0.3) * beach.across, name, fontsize=8)
        axes.axhline(end * beach.across, color="k", lw=0.5)
    axes.set(xlabel="along the shore (m)", ylabel="towards the sea (m)")
    return figure


def _mesh(beach: Beach) -> tuple[Array, Array]:
    step = max(0.1, max(beach.length, beach.width) / 800)
    return np.arange(0, beach.length, step), np.arange(0, beach.width, step)


def _extent(beach: Beach) -> tuple[float, float, float, float]:
    return 0, beach.length, 0, beach.width
