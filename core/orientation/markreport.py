"""What ``predictmarks`` found, as rows, in a sentence, and as a page with pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..report.html import Report
from .control import GroundPoint
from .marks import listed
from .prediction import Prediction
from .refining import PICTURE, Refine, Search, Sight
from .targets import Found

_BLUE, _RED, _GREY = (60, 140, 255), (255, 60, 40), (150, 150, 150)
_BIG = 2  # pictures are drawn at twice their size, for thin lines
_POINTS = 60  # ground points with pictures, so that the page stays small enough to send
_CAPTION = (
    "Blue circle: where the point is predicted, one sigma wide, with the searched circle dashed around it. Red cross: the mark "
    "that was found and taken; grey cross: the best of what was found, not taken. Where the circle "
    "is wide only the surroundings of the mark are shown."
)


@dataclass(frozen=True)
class Marking:
    """Predictions, and by their index what was ``found`` there, what of it is ``taken``, and what other marks contradict."""

    refine: Refine
    points: tuple[GroundPoint, ...]
    images: tuple[str, ...]
    predictions: tuple[Prediction, ...]
    found: Mapping[int, Found]
    taken: Mapping[int, Found]
    contradicted: frozenset[int]
    pictures: Mapping[int, tuple[Search, Sight]]
    told: tuple[str, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Return the table's rows."""
        rows = []
        for key, p in enumerate(self.predictions):
            row: dict[str, Any] = {"gcp": self.points[p.point].name, "image": self.images[p.view]}
            if self.refine == "none" and p.inside:
                rows.append({**row, "x": float(p.pixel[0]), "y": float(p.pixel[1]), "sigma": p.sigma, "score": None})
            elif key in self.taken:
                mark = self.taken[key]
                rows.append({**row, "x": mark.x, "y": mark.y, "sigma": mark.sigma, "score": mark.score})
        return rows

    def sought(self) -> list[int]:
        """Return the predictions inside their photograph, and those outside at which a mark was taken all the same."""
        return [k for k, p in enumerate(self.predictions) if p.inside or k in self.taken]

    def offsets(self, point: int | None = None) -> NDArray[np.float64]:
        """Return marks minus predictions (n, 2), in pixels, of one point or all."""
        chosen = [k for k in self.taken if point is None or self.predictions[k].point == point]
        return np.array([[self.taken[k].x, self.taken[k].y] - self.predictions[k].pixel for k in chosen]).reshape(-1, 2)


def verdict(marking: Marking) -> str:
    """Return one sentence for the analyst."""
    sought = marking.sought()
    sigma = np.array([marking.predictions[k].sigma for k in sought])
    known = f", to {_pixels(float(np.nanmedian(sigma)))} (median sigma)" if np.isfinite(sigma).any() else ""
    seen = {marking.predictions[k].point for k in sought}
    text = f"{len(seen)} of {len(marking.points)} ground points are predicted at {len(sought)} places{known}"
    if marking.refine == "none":
        return f"{text}; these are no measurements: correct each mark by eye, or use REFINE, before you georeference with them."
    missed = [k for k in sought if k not in marking.taken]
    text += f"; {len(marking.taken)} marks were found"
    if len(marking.taken):
        text += f", {_pixels(float(np.median(np.hypot(*marking.offsets().T))))} from there (median)"
    if missed:
        names = list(dict.fromkeys(marking.points[marking.predictions[k].point].name for k in missed))
        text += f"; {len(missed)} were not, and are not in the table ({listed(names)})"
    return text + "."


def write_report(path: Path, copy: str | None, marking: Marking) -> None:
    """Write the page."""
    page = Report("Predict marks", verdict(marking))
    for text in marking.told:
        page.warning(text)
    page.heading("Ground points")
    page.table(
        ["name", "photographs", "sigma of the prediction (px)", "marks found", "offset (px)", "offset / sigma", "score, least"],
        [_row(marking, i) for i in range(len(marking.points))],
    )
    page.text(
        "A sigma is that of one axis, from the georeferencing's own covariance, the point's survey, and a third of a pixel for "
        "the pose. Offsets, found minus predicted, are root mean squares of an axis; beside the sigma they ought to be about 1."
    )
    if marking.refine != "none":
        _missed(page, marking)
    _pictures(page, marking)
    page.save(path, copy)


def _row(marking: Marking, point: int) -> list[Any]:
    sought = [k for k in marking.sought() if marking.predictions[k].point == point]
    taken = [k for k in sought if k in marking.taken]
    sigma = float(np.median([marking.predictions[k].sigma for k in sought])) if sought else None
    offset = ratio = least = None
    if taken:
        shifts = marking.offsets(point)
        offset = float(np.sqrt(np.mean(shifts**2)))
        sigmas = np.array([marking.predictions[k].sigma for k in marking.taken if marking.predictions[k].point == point])
        ratio = float(np.sqrt(np.mean((shifts / sigmas[:, None]) ** 2)))
        least = min(marking.taken[k].score for k in taken)
    marks = None if marking.refine == "none" else len(taken)
    return [marking.points[point].name, len(sought), sigma, marks, offset, ratio, least]


def _missed(page: Report, marking: Marking) -> None:
    missed = [k for k in marking.sought() if k not in marking.taken]
    if not missed:
        return
    page.heading("Not found")
    rows = []
    for k in missed:
        p, found = marking.predictions[k], marking.found.get(k)
        why = "nothing like a target" if found is None else "not like one enough"
        if k in marking.contradicted:
            why = "contradicts the point's other marks, or is another point's too"
        score = None if found is None else found.score
        rows.append([marking.points[p.point].name, marking.images[p.view], *map(float, p.pixel), p.sigma, score, why])
    page.table(["name", "photograph", "x (px)", "y (px)", "sigma (px)", "best score", "why"], rows)


def _pictures(page: Report, marking: Marking) -> None:
    if not marking.pictures:
        return
    page.heading("Pictures")
    page.text(_CAPTION)
    for point in range(min(len(marking.points), _POINTS)):
        keys = [k for k in marking.pictures if marking.predictions[k].point == point]
        if not keys:
            continue
        strip = np.concatenate([_drawn(marking, k) for k in keys], axis=1)
        images = ", ".join(marking.images[marking.predictions[k].view] for k in keys)
        page.picture(strip, f"{marking.points[point].name}: {images}")


def _drawn(marking: Marking, key: int) -> NDArray[np.uint8]:
    search, sight = marking.pictures[key]
    assert sight.picture is not None
    side = PICTURE * _BIG
    canvas = np.full((side, side + 4, 3), 255, np.uint8)
    grey = cv2.resize(sight.picture, None, fx=_BIG, fy=_BIG, interpolation=cv2.INTER_LINEAR)[:side, :side]
    canvas[: grey.shape[0], : grey.shape[1]] = grey[:, :, None]

    def place(x: float, y: float) -> tuple[int, int]:
        factor = sight.scale * _BIG
        return round((x - sight.corner[0]) * factor), round((y - sight.corner[1]) * factor)

    centre, sigma = place(search.x, search.y), marking.predictions[key].sigma
    if np.isfinite(sigma):
        cv2.circle(canvas, centre, max(3, round(sigma * sight.scale * _BIG)), _BLUE, 2, cv2.LINE_AA)
    radius = round(search.radius * sight.scale * _BIG)
    for turn in range(0, 360, 20):
        cv2.ellipse(canvas, centre, (radius, radius), 0, turn, turn + 8, _BLUE, 1, cv2.LINE_AA)
    found = marking.found.get(key)
    if found is not None:
        colour = _RED if key in marking.taken else _GREY
        cv2.drawMarker(canvas, place(found.x, found.y), colour, cv2.MARKER_CROSS, 28, 1, cv2.LINE_AA)
        cv2.putText(canvas, f"{found.score:.2f}", (8, side - 10), cv2.FONT_HERSHEY_SIMPLEX, 0.7, colour, 2, cv2.LINE_AA)
    canvas[:, side:] = 255
    return canvas


def _pixels(value: float) -> str:
    return f"{value:.2g} px" if value < 100 else f"{value:.0f} px"
