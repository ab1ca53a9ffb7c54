"""Clouds of tie points from above and in perspective, several of them within the same limits so that they compare."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from .html import new_figure
from .relief import heights_drawn, hillshade, round_factor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_DRAWN = 20000  # points of the richest cloud that are drawn; the others are thinned by the same factor
_OUTLIERS = 0.003  # share of points beyond each side of the frame
_RELIEF = 0.25  # of the shorter side: how high heights should look
_GRID = 160  # cells of the surface that gives points their light, along the longer side
_AZIMUTH, _ALTITUDE = -65.0, 28.0  # degrees, where the eye of the perspective is
_LONG = 0.35  # height over width below which panels stand one below the other
_DISTANCE = 2.4  # of the eye, in diagonals of the block
_SAND = ("#22577a", "#6f9aa0", "#e6d6a6", "#d0a665", "#96683c")  # from low to high
_RAYS = ("#d7301f", "#fdae61", "#74add1", "#313695")  # 2, 3, 4, 5 and more


@dataclass(frozen=True)
class Cloud:
    """Tie points (n, 3), height last and up, the rays (n,) of each, and the projection centres (m, 3) of the photographs."""

    points: Array
    rays: NDArray[np.integer]
    centres: Array


@dataclass(frozen=True)
class _Frame:
    low: Array  # (3,)
    high: Array
    step: int  # every how many points are drawn


def levelled(points: Array, centres: Array, looking: Array) -> tuple[Array, Array]:
    """Return points and centres of a free frame turned so that height is up and the block's length runs to the right.

    Down is the mean of the directions (m, 3) that the photographs are ``looking`` in. The origin is the centres' mean.
    """
    down = looking.mean(axis=0)
    down /= np.linalg.norm(down)
    middle = centres.mean(axis=0)
    across = centres - middle
    across = across - np.outer(across @ down, down)
    right = np.linalg.svd(across, full_matrices=False)[2][0]
    right = right - (right @ down) * down
    if np.linalg.norm(right) < 0.5:  # all photographs from one place
        right = np.cross(down, np.eye(3)[int(np.argmin(np.abs(down)))])
    right /= np.linalg.norm(right)
    right = right if right @ (centres[-1] - centres[0]) >= 0 else -right
    turn = np.stack([right, np.cross(-down, right), -down])
    return (points - middle) @ turn.T, (centres - middle) @ turn.T


def exaggeration(clouds: Mapping[str, Cloud | None]) -> float:
    """Return the round factor by which heights are best multiplied in the perspective of these clouds."""
    frame = _frame(clouds)
    size = frame.high - frame.low
    return round_factor(_RELIEF * float(size[:2].min()) / max(float(size[2]), 1e-12), most=20.0)


def cloud_from_above(
    clouds: Mapping[str, Cloud | None], *, unit: str = "m", colour: Literal["height", "rays"] = "height"
) -> Figure:
    """Return a figure of clouds seen from above, coloured by height or by rays; None is a case that has no cloud.

    All are drawn in the frame of the one with the most points and thinned by the same factor, so that the eye can compare them.
    """
    frame = _frame(clouds)
    low, high = frame.low[:2], frame.high[:2]
    centres = np.concatenate([cloud.centres[:, :2] for cloud in clouds.values() if cloud is not None])
    low, high = np.minimum(low, centres.min(axis=0)), np.maximum(high, centres.max(axis=0))
    margin = 0.04 * float((high - low).max())
    low, high = low - margin, high + margin
    figure, panels = _panels(clouds, float((high - low)[1] / (high - low)[0]))
    for axes, (name, cloud) in zip(panels, clouds.items(), strict=True):
        axes.set_title(_title(name, cloud), fontsize=10)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.tick_params(labelsize=8)
        if cloud is None:
            continue
        points, rays = cloud.points[:: frame.step], cloud.rays[:: frame.step]
        size = _dot_size(axes, len(points))
        if colour == "rays":
            colours: Any = np.asarray(_RAYS)[np.clip(rays, 2, 5) - 2]
        else:
            colours = _colours(points[:, 2], frame, _light(points, frame, 1.0))
        axes.scatter(points[:, 0], points[:, 1], c=colours, s=size, linewidths=0)
        _draw_photographs(axes, cloud.centres)
    if colour == "rays":
        _ray_legend(panels[0])
    else:
        _height_bar(figure, panels, frame, unit)
    return figure


def cloud_in_perspective(clouds: Mapping[str, Cloud | None], *, unit: str = "m") -> Figure:
    """Return a figure of clouds in perspective, coloured by height and lit from the upper left; None is a case without a cloud.

    Heights of the ground are multiplied by ``exaggeration(clouds)``. The photographs (triangles) float above it, at their true
    height or, where that would leave the ground no room, at a tenth to a half of it. The figure tells both.
    """
    frame, factor = _frame(clouds), exaggeration(clouds)
    richest = max(filter(None, clouds.values()), key=lambda cloud: len(cloud.points))
    base = _box(frame, factor)
    lift = _lift(richest, frame)
    highest = _lifted(richest.centres, frame, factor, lift)
    bounds = _project(np.concatenate([base, highest]), frame, factor)
    low, high = bounds[:, :2].min(axis=0), bounds[:, :2].max(axis=0)
    margin = 0.02 * float((high - low).max())
    figure, panels = _panels(clouds, float((high - low)[1] / (high - low)[0]))
    for axes, (name, cloud) in zip(panels, clouds.items(), strict=True):
        axes.set_title(_title(name, cloud), fontsize=10)
        axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin), aspect="equal")
        axes.set_axis_off()
        ring = _project(base[[0, 1, 3, 2, 0]], frame, factor)
        axes.fill(ring[:, 0], ring[:, 1], color="#f4f1ea", zorder=0)
        axes.plot(ring[:, 0], ring[:, 1], color="#bbb6a8", linewidth=0.8, zorder=0)
        if cloud is not None:
            _draw_perspective(axes, cloud, frame, factor, lift)
    size = frame.high - frame.low
    lowest = max(panels, key=lambda axes: (-axes.get_position().y0, -axes.get_position().x0))
    lowest.text(
        0.0,
        0.0,
        f"Base {size[0]:.3g} x {size[1]:.3g}, relief {size[2]:.2g} ({unit}); {heights_drawn(factor)}; "
        f"photographs at {'their' if lift == 1 else f'{lift:g} of their'} height.",
        fontsize=8,
        color="#555555",
        transform=lowest.transAxes,
    )
    _height_bar(figure, panels, frame, unit)
    return figure


def _draw_perspective(axes: Axes, cloud: Cloud, frame: _Frame, factor: float, lift: float) -> None:
    points = cloud.points[:: frame.step]
    points = points[np.all((points >= frame.low) & (points <= frame.high), axis=1)]
    light = _light(points, frame, factor)
    seen = _project(_raised(points, frame, factor), frame, factor)
    order = np.argsort(-seen[:, 2], kind="stable")  # the farthest first
    near = (np.median(seen[:, 2]) / seen[order, 2]) ** 2 if len(seen) else np.zeros(0)
    colours = _colours(points[order, 2], frame, light[order])
    axes.scatter(seen[order, 0], seen[order, 1], c=colours, s=0.8 * _dot_size(axes, len(points)) * near, linewidths=0, zorder=1)
    top = _project(_lifted(cloud.centres, frame, factor, lift), frame, factor)
    _draw_photographs(axes, top)


def _draw_photographs(axes: Axes, places: Array) -> None:
    size = 5.0 if len(places) <= 100 else 3.0
    axes.plot(
        places[:, 0], places[:, 1], "^", color="black", markersize=size, markeredgecolor="white", markeredgewidth=0.12 * size
    )


def _frame(clouds: Mapping[str, Cloud | None]) -> _Frame:
    """Return the box that holds all but the outliers of the richest cloud."""
    richest = max((c for c in clouds.values() if c is not None), key=lambda cloud: len(cloud.points))
    low, high = np.quantile(richest.points, [_OUTLIERS, 1 - _OUTLIERS], axis=0)
    high = np.maximum(high, low + 1e-9)
    return _Frame(low, high, max(1, -(-len(richest.points) // _DRAWN)))


def _light(points: Array, frame: _Frame, factor: float) -> Array:
    """Return the light on the surface that points (n, 3) lie on, 0..1, with heights multiplied by ``factor``."""
    size = (frame.high - frame.low)[:2]
    cell = float(size.max()) / _GRID
    shape = tuple(int(n) for n in np.maximum(np.ceil(size[::-1] / cell), 2))
    column = np.clip(((points[:, 0] - frame.low[0]) / cell).astype(np.int64), 0, shape[1] - 1)
    row = np.clip(((frame.high[1] - points[:, 1]) / cell).astype(np.int64), 0, shape[0] - 1)
    total, weight = np.zeros(shape), np.zeros(shape)
    np.add.at(total, (row, column), np.clip(points[:, 2], frame.low[2], frame.high[2]) - frame.low[2])
    np.add.at(weight, (row, column), 1.0)
    # Wide enough to average the noise of single points, and to bridge cells without any.
    sigma = 1.5 * max(1.0, float(np.sqrt(weight.size / max(1, len(points)))))
    total, weight = (cv2.GaussianBlur(a, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE) for a in (total, weight))
    surface = total / np.maximum(weight, 1e-9)
    return np.asarray(hillshade(surface, cell, factor)[row, column], np.float64)


def _colours(heights: Array, frame: _Frame, light: Array) -> Array:
    place = (heights - frame.low[2]) / (frame.high[2] - frame.low[2])
    flat = np.sin(np.radians(45.0))
    colours = np.asarray(_sand()(np.clip(place, 0, 1)), np.float64)
    colours[:, :3] = np.clip(colours[:, :3] * (1.0 + 0.7 * (light / flat - 1.0))[:, None], 0, 1)
    return colours


def _sand() -> Colormap:
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("sand", _SAND)


def _raised(points: Array, frame: _Frame, factor: float) -> Array:
    return np.column_stack([points[:, :2], frame.low[2] + factor * (points[:, 2] - frame.low[2])])


def _lift(cloud: Cloud, frame: _Frame) -> float:
    """Return the round fraction of their height, up to 1, at which the photographs float a third of the ground's length above."""
    size = frame.high - frame.low
    height = float(np.median(cloud.centres[:, 2])) - float(frame.low[2] + frame.high[2]) / 2
    return min((m for m in (0.1, 0.2, 0.5, 1.0) if m * height > 0.3 * size[:2].max()), default=1.0)


def _lifted(centres: Array, frame: _Frame, factor: float, lift: float) -> Array:
    """Return photographs at ``lift`` times their height above the middle of the exaggerated ground."""
    middle = float(frame.low[2] + frame.high[2]) / 2
    height = frame.low[2] + factor * (middle - frame.low[2]) + lift * (centres[:, 2] - middle)
    return np.column_stack([centres[:, :2], height])


def _box(frame: _Frame, factor: float) -> Array:
    """Return the corners (8, 3) of the frame with heights exaggerated, the base first."""
    x, y = (frame.low[0], frame.high[0]), (frame.low[1], frame.high[1])
    corners = [[a, b, c] for c in (frame.low[2], frame.high[2]) for b in y for a in x]
    return _raised(np.array(corners), frame, factor)


def _project(points: Array, frame: _Frame, factor: float) -> Array:
    """Return picture x, y and depth (n, 3) of points, seen by an eye that looks at the middle of the frame."""
    azimuth, altitude = np.radians(_AZIMUTH), np.radians(_ALTITUDE)
    size = (frame.high - frame.low) * [1, 1, factor]
    middle = frame.low + size / 2
    back = np.array([np.cos(azimuth) * np.cos(altitude), np.sin(azimuth) * np.cos(altitude), np.sin(altitude)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    distance = _DISTANCE * float(np.linalg.norm(size))
    seen = (points - middle) @ np.stack([right, np.cross(back, right), -back]).T
    depth = seen[:, 2] + distance
    return np.column_stack([seen[:, :2] * distance / depth[:, None], depth])


def _panels(clouds: Mapping[str, Cloud | None], aspect: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with a panel a cloud, two in a row unless they are long; ``aspect`` is a panel's height over its width."""
    columns = min(2, len(clouds)) if aspect > _LONG else 1
    rows = -(-len(clouds) // columns)
    width = 8.6 / columns
    figure = new_figure(9.4, float(rows * (np.clip(width * aspect, 1.2, 8.0) + 0.45)) + 0.3)
    panels = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for empty in panels[len(clouds) :]:
        empty.set_axis_off()
    return figure, panels[: len(clouds)]


def _title(name: str, cloud: Cloud | None) -> str:
    count = "not oriented" if cloud is None else f"{len(cloud.points):,} points"
    return f"{name}: {count}" if name else count


def _dot_size(axes: Axes, count: int) -> float:
    """Return the area (points squared) of one of ``count`` dots such that they fill the panel but do not hide each other."""
    box = axes.get_window_extent()
    area = box.width * box.height * (72.0 / axes.figure.dpi) ** 2
    return float(np.clip(0.5 * area / max(1, count), 0.4, 14.0))


def _height_bar(figure: Figure, panels: list[Axes], frame: _Frame, unit: str) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    mappable = ScalarMappable(Normalize(float(frame.low[2]), float(frame.high[2])), _sand())
    bar = figure.colorbar(mappable, ax=panels, shrink=0.7, fraction=0.03, pad=0.02)
    bar.set_label(f"height ({unit})", fontsize=8)
    bar.ax.tick_params(labelsize=8)


def _ray_legend(axes: Axes) -> None:
    for colour, name in zip(_RAYS, ("2 rays", "3", "4", "5 and more"), strict=True):
        axes.plot([], [], "o", color=colour, markersize=4, label=name)
    axes.legend(loc="upper right", fontsize=7, framealpha=0.9)
