"""The report of ``createsurvey``: what was found, and where it was taken."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
from pyproj import CRS

from ..frames import transformer
from ..report.html import Report, new_figure
from ..survey import Photograph, Survey
from .reading import is_raw

_LABELS = 40  # photographs up to which the map names each one


def write_report(survey: Survey, notes: list[str], copy: Path | str | None) -> None:
    """Write the report of the survey's photographs; ``notes`` are warnings, a sentence each."""
    photographs = survey.photographs
    report = Report(f"Survey {survey.folder.resolve().name}", verdict(survey))
    for note in notes:
        report.warning(note)
    report.heading("Cameras")
    cameras = Counter(p.camera for p in photographs)
    focal = {p.camera: p.focal for p in photographs}
    report.table(["camera", "photographs", "focal length (px)"], [(c, n, focal[c]) for c, n in cameras.most_common()])
    if survey.crs and any(p.position for p in photographs):
        report.heading("Positions")
        _map(report, survey)
    report.heading("Photographs")
    report.table(
        ["name", "width", "height", "time", "longitude", "latitude", "GNSS height (m)", "sigma_h (m)", "sigma_v (m)"]
        + ["above take-off (m)", "yaw", "pitch", "roll"],
        [_row(p) for p in photographs],
    )
    report.text(
        "Positions are WGS 84 degrees. The vertical datum of GNSS heights is not known from the photographs. A position with its "
        "height is EXIF's; where the XMP has the sigmas of an RTK receiver it is the XMP's. A POSITIONS table replaces both."
    )
    if any(is_raw(p.name) for p in photographs):
        report.text(
            "RAW photographs are used as the sensor saw them, proportional to light. Width and height are those of the frame "
            "that the camera gives its JPG: the one the file names, else that of its full preview, else all the sensor sees."
        )
    report.save(survey.report_path("createsurvey"), copy)


def verdict(survey: Survey) -> str:
    """Return what was found in one sentence."""
    photographs = survey.photographs
    cameras = len({p.camera for p in photographs})
    placed = [p.position for p in photographs if p.position]
    sigmas = sum(1 for p in placed if p.sigma_h)
    frame = f"the CRS is {CRS.from_user_input(survey.crs).name}" if survey.crs else "there is no CRS yet"
    return (
        f"{_count(len(photographs), 'photograph')} of {_count(cameras, 'camera')}, {len(placed)} with a position "
        f"({sigmas} with its sigma); {frame}."
    )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _row(p: Photograph) -> tuple[object, ...]:
    place: tuple[object, ...] = (None,) * 5
    if (q := p.position) is not None:
        place = (f"{q.longitude:.7f}", f"{q.latitude:.7f}", _metres(q.height), q.sigma_h, q.sigma_v)
    return (p.name, p.width, p.height, p.time, *place, _metres(p.relative_height), p.yaw, p.pitch, p.roll)


def _metres(value: float | None) -> str | None:
    return None if value is None else f"{value:.2f}"


def _map(report: Report, survey: Survey) -> None:
    placed = [(p, p.position) for p in survey.photographs if p.position]
    change = transformer("EPSG:4326", CRS.from_user_input(survey.crs))
    easting, northing = (
        np.asarray(v, float) for v in change.transform([q.longitude for _, q in placed], [q.latitude for _, q in placed])
    )
    heights = np.array([np.nan if q.height is None else q.height for _, q in placed])
    figure = new_figure(8.0, 6.0)
    axes = figure.add_subplot()
    east, north = easting - np.median(easting), northing - np.median(northing)
    ordered = sorted(range(len(placed)), key=lambda i: (placed[i][0].time or "", placed[i][0].name))
    axes.plot(east[ordered], north[ordered], color="#bbbbbb", linewidth=0.8, zorder=1)
    if np.isfinite(heights).any():
        points = axes.scatter(east, north, c=heights, cmap="viridis", s=28, zorder=2)
        figure.colorbar(points, label="GNSS height (m)")
    else:
        axes.scatter(east, north, color="#2a6f97", s=28, zorder=2)
    angles = [(i, np.radians(p.yaw)) for i, (p, _) in enumerate(placed) if p.yaw is not None]
    if angles:
        which = [i for i, _ in angles]
        axes.quiver(
            east[which], north[which], np.sin([a for _, a in angles]), np.cos([a for _, a in angles]), width=0.002, scale=30.0
        )
    if len(placed) <= _LABELS:
        for (p, _), x, y in zip(placed, east, north, strict=True):
            axes.annotate(Path(p.name).stem, (x, y), fontsize=6, textcoords="offset points", xytext=(4, 4))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"easting - {np.median(easting):.1f} m")
    axes.set_ylabel(f"northing - {np.median(northing):.1f} m")
    axes.grid(alpha=0.3)
    report.figure(
        figure, "Camera positions, joined in the order of their time; arrows point where the top of a photograph looks."
    )
