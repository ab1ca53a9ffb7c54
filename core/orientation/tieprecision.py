"""The sigma of each tie point, and their map over the block: a precision map (James, Robson & Smith 2017)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..report.html import new_figure
from .pointcloud import write_points
from .solution import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

CAPTION = (
    "Each tie point in the colour of its own predicted sigma: what its rays leave and what the georeferencing adds. Grey ones "
    "lie beyond the scale, whose end is the 95th percentile."
)
_SHOWN = 30_000  # points; more are dots upon dots
_WELL_SEEN = 3  # rays; two hardly tell an error of either


def write_tie_points(path: str, solution: Solution) -> None:
    """Write the block's tie points in the CRS, with their sigmas in E, N and U where an adjustment tells them."""
    block, sigmas = solution.block, solution.tie_sigma
    named = None if sigmas is None else {f"sigma_{axis}": values for axis, values in zip("enu", sigmas.T, strict=True)}
    places = solution.frame.to_crs(block.points)
    write_points(path, places, rays=block.rays, errors=block.errors, sigmas=named, crs=solution.frame.crs)


def medians(solution: Solution) -> tuple[Array, Array] | None:
    """Return the median sigmas (3,) of tie points of three rays or more, and the 95th percentiles; None without any."""
    if solution.tie_sigma is None:
        return None
    good = solution.tie_sigma[(solution.block.rays >= _WELL_SEEN) & np.isfinite(solution.tie_sigma[:, 0])]
    if not len(good):
        return None
    return np.median(good, axis=0), np.percentile(good, 95, axis=0)


def precision_map(solution: Solution) -> Figure | None:
    """Return the map of sigmas in plan and in height, None where no tie point has one."""
    sigmas = solution.tie_sigma
    if sigmas is None or not np.isfinite(sigmas).any():
        return None
    shown = np.flatnonzero(np.isfinite(sigmas[:, 0]))
    shown = shown[:: max(1, len(shown) // _SHOWN)]
    places = solution.frame.to_crs(solution.block.points[shown])[:, :2]
    origin = places.mean(axis=0)
    figure = new_figure(11.0, 5.0)
    for k, (title, values) in enumerate((("plan", np.hypot(*sigmas[shown, :2].T)), ("height", sigmas[shown, 2]))):
        axes = figure.add_subplot(1, 2, k + 1)
        order = np.argsort(-values)  # the best on top, so that a few bad ones do not hide them
        top = float(np.percentile(values, 95))
        inside = values[order] <= top
        at, colours = (places - origin)[order], 100 * values[order]
        axes.plot(*at[~inside].T, ".", color="#b0b0b0", markersize=2)
        low = 100 * float(values.min())
        drawn = axes.scatter(
            at[inside, 0], at[inside, 1], s=3, c=colours[inside], cmap="viridis_r", vmin=low, vmax=100 * top, linewidths=0
        )
        axes.set(aspect="equal", xlabel=f"easting - {origin[0]:.0f} m")
        if k == 0:
            axes.set_ylabel(f"northing - {origin[1]:.0f} m")
        axes.set_title(f"Sigma in {title} (cm)", fontsize=10)
        figure.colorbar(drawn, ax=axes, shrink=0.8)
    return figure
