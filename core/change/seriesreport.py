"""What the reports of a series share: the dates, their errors, colours."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..report.html import Report
from .alignment import Aligned
from .epocherror import EpochError
from .series import Series
from .uncertainty import Fitted, Given


def colours(count: int) -> list[Any]:
    """Return a colour for each date, from the first, light, to the last, dark."""
    from matplotlib import colormaps

    return [colormaps["viridis_r"](v) for v in np.linspace(0.08, 1.0, count)]


def dates_told(report: Report, series: Series, errors: list[EpochError], stable: bool) -> None:
    """Add the table of dates with what is known of their errors."""
    report.heading("Dates and errors")
    rows = []
    for epoch, error in zip(series.epochs, errors, strict=True):
        number = error.common if epoch.sigma is None else epoch.sigma
        given = "precision raster" if isinstance(epoch.sigma, Aligned) else number
        m = error.model
        split = None
        if m.random is not None:
            parts = [f"{m.random:.2f} random"]
            if m.structures is None:
                parts.append("correlated not known")
            for factor, reach in m.structures or ():
                parts.append(f"{factor:.2f} over {reach:.3g} m" if np.isfinite(reach) else f"{factor:.2f} over all (a bound)")
            split = ", ".join(parts)
        rows.append(
            [
                epoch.name,
                epoch.told_by,
                epoch.heights.file.path,
                epoch.heights.cell,
                error.shift.describe(),
                error.stable_nmad,
                given,
                split,
                _level(error),
            ]
        )
    names = ("date", "told by", "file", "cell (m)", "taken off", "NMAD on STABLE (m)", "sigma of a cell (m)")
    report.table([*names, "times that sigma", "level, one sigma (m)"], rows)
    text = "Errors are kept per date and are independent from date to date: a change has those of both of its dates."
    if stable:
        text += (
            " Each date is brought to the mean of all dates on STABLE. What all dates have in common, the level of that mean "
            "above the datum, drops out of every change and is in no sigma here."
        )
    report.text(text + " A dash: not known.")
    g = series.grid
    report.text(f"Common grid: {g.width} x {g.height} cells of {g.cell:.6g} x {g.step_north:.6g} m, {g.crs.split(chr(34))[1]}.")


def _level(error: EpochError) -> float | None:
    told = error.systematic
    if isinstance(told, Given):
        return told.value
    return float(np.sqrt(max(0.0, told.covariance[0, 0]))) if isinstance(told, Fitted) else None
