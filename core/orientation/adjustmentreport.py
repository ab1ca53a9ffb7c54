"""What the report of ``georeference`` shows of an adjustment."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..report.html import Report
from .solution import AdjustedCamera, Solution
from .tieprecision import CAPTION, medians, precision_map

_ORIGINS = {
    "files": "the photographs' files",
    "calibration": "the calibration of another survey",
    "nothing": "no more than what cameras are like",
    "held": "the calibration, held",
}


def add(page: Report, solution: Solution) -> None:
    """Add what other choices would have given, the sigmas of the adjustment, and the cameras to the page."""
    if solution.alternatives:
        page.heading("What one more control point buys")
        page.table(
            ["method", "control points", "check: plan (m)", "check: height (m)", "predicted: plan (m)", "predicted: height (m)"],
            [
                [a.method, _control(a.control, a.names), a.plani, a.alti, a.predicted_plani, a.predicted_alti]
                for a in solution.alternatives
            ],
        )
        page.text(
            "The same photographs, weights and check points in every row; control points are taken in an order that spreads "
            "them. Predicted are the root mean squares of what check points' survey and marks, the ties and the control lead to."
        )
    page.heading("Adjustment")
    rows: list[list[Any]] = [["tie points, sigma of a coordinate (px)", solution.pixel_sigma]]
    told = medians(solution)
    if told is not None:
        for label, (east, north, up) in zip(("median sigma", "95 % are below"), told, strict=True):
            rows += [
                [f"tie points of three rays, {label} in plan (m)", float(np.hypot(east, north))],
                ["  in height (m)", float(up)],
            ]
    if solution.centre_sigma is not None:
        plan = np.hypot(solution.centre_sigma[:, 0], solution.centre_sigma[:, 1])
        rows += [
            ["projection centres, median sigma in plan (m)", float(np.median(plan))],
            ["  in height (m)", float(np.median(solution.centre_sigma[:, 2]))],
        ]
    rows.append(["common height error beyond shift, tilt, scale and bending (m, RMS)", solution.common.rest])
    page.table(["", "value"], rows)
    page.text(
        "Sigmas come from the covariance of the whole adjustment: none holds other unknowns fixed. Tie points are an even "
        "choice, one or more in every patch of every photograph, since neighbours repeat each other."
    )
    figure = precision_map(solution)
    if figure is not None:
        page.figure(figure, CAPTION)
    for camera in solution.cameras:
        _add_camera(page, camera)


def _add_camera(page: Report, camera: AdjustedCamera) -> None:
    page.heading(f"{camera.label[0].upper()}{camera.label[1:]}")
    if not camera.names:
        page.text("Its interior orientation was held: CALIBRATION_USE=fixed in strandline:orient. Its error is in no sigma here.")
        return
    page.table(
        ["parameter", "adjusted", "sigma", "sigma beforehand"],
        [
            [name, float(value), float(sigma), float(before)]
            for name, value, sigma, before in zip(camera.names, camera.values, camera.sigma, camera.before, strict=True)
        ],
    )
    page.text(f"Known beforehand from {_ORIGINS[camera.origin]}. Focal lengths and principal point are in pixels.")


def _control(count: int, names: tuple[str, ...]) -> str:
    if not count:
        return "0 (GNSS only)"
    return f"{count} ({', '.join(names[:5])}{', ...' if len(names) > 5 else ''})"
