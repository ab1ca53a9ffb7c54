"""Maps of a raster's values with a bar of colours, and pictures with a scale, in the coordinates of the CRS."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .html import new_figure
from .relief import round_factor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Bounds = tuple[float, float, float, float]  # west, south, east, north

_WIDTH, _LEAST, _MOST = 9.0, 3.0, 10.0  # inches
_EMPTY = "#eeeeea"  # what has no value, a little off the page's white


def value_map(
    values: NDArray[np.floating], bounds: Bounds, *, colours: Any, label: str, limits: tuple[float, float] | None = None,
    clip: float = 0.0, whole: int | None = None,
) -> Figure:  # fmt: skip
    """Return a map of values (rows, columns; NaN: none) with their bar.

    Colours run between ``limits``, or between the percentiles ``clip`` and 100 - ``clip``, and the bar ends in a point where
    values lie beyond. ``whole`` draws whole numbers, 0 to it, each in a colour of its own.
    """
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm

    known = values[np.isfinite(values)]
    if limits is None and len(known):
        limits = float(np.percentile(known, clip)), float(np.percentile(known, 100 - clip))
    low, high = limits or (0.0, 1.0)
    high = high if high > low else low + 1e-9
    figure, axes = _framed(values.shape, bounds)
    drawn: dict[str, Any] = {"vmin": low, "vmax": high, "cmap": colours}
    if whole is not None:
        edges = np.arange(0.5, whole + 1.5)
        drawn = {"cmap": colormaps[colours].resampled(max(whole, 1)), "norm": BoundaryNorm(edges, max(whole, 1))}
    picture = axes.imshow(values, extent=_extent(bounds), interpolation="nearest", **drawn)
    beyond = (bool((known < low).any()), bool((known > high).any())) if whole is None else (False, False)
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[beyond]
    bar = figure.colorbar(picture, label=label, shrink=0.85, fraction=0.04, pad=0.02, extend=extend)
    if whole is not None:
        bar.set_ticks([float(n) for n in range(1, whole + 1)])
    bar.ax.tick_params(labelsize=8)
    return figure


def picture_map(
    pixels: NDArray[np.uint8], bounds: Bounds, line: tuple[tuple[float, float], tuple[float, float]] | None = None
) -> Figure:
    """Return a picture (rows, columns, 3; or 4 with alpha) in its coordinates, with a scale and, if given, a ``line`` A to B."""
    figure, axes = _framed(pixels.shape[:2], bounds)
    axes.imshow(pixels, extent=_extent(bounds), interpolation="antialiased")
    _scale_bar(axes, bounds)
    if line is not None:
        (x0, y0), (x1, y1) = line
        for width, colour in ((3.2, "white"), (1.6, "#b2182b")):
            axes.plot([x0, x1], [y0, y1], color=colour, linewidth=width, solid_capstyle="round")
        for x, y, name in ((x0, y0, "A"), (x1, y1, "B")):
            axes.annotate(
                name, (x, y), xytext=(0, 6), textcoords="offset points", ha="center", fontsize=10, fontweight="bold",
                color="#b2182b", bbox={"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
            )  # fmt: skip
    return figure


def _framed(shape: tuple[int, ...], bounds: Bounds) -> tuple[Figure, Axes]:
    figure = new_figure(_WIDTH, float(np.clip(_WIDTH * 0.85 * shape[0] / shape[1] + 0.6, _LEAST, _MOST)))
    axes = figure.add_subplot()
    west, south, east, north = bounds
    axes.set(
        xlabel="easting (m)", ylabel="northing (m)", aspect="equal", facecolor=_EMPTY, xlim=(west, east), ylim=(south, north)
    )
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.tick_params(labelsize=8)
    axes.tick_params(axis="y", labelrotation=90)
    axes.locator_params(nbins=6)
    return figure, axes


def _extent(bounds: Bounds) -> Bounds:
    west, south, east, north = bounds
    return west, east, south, north


def _scale_bar(axes: Axes, bounds: Bounds) -> None:
    west, south, east, north = bounds
    length = round_factor(0.2 * (east - west), most=1e3) if east - west >= 5 else 0.2 * (east - west)
    x, y = west + 0.04 * (east - west), south + 0.04 * (north - south)
    for width, colour in ((5.0, "white"), (2.5, "#222222")):
        axes.plot([x, x + length], [y, y], color=colour, linewidth=width, solid_capstyle="butt")
    axes.annotate(
        f"{length:g} m", (x + length / 2, y), xytext=(0, 5), textcoords="offset points", ha="center", fontsize=8,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
    )  # fmt: skip
