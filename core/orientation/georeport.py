"""What ``georeference`` shows: its report and its layers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..report.html import Report, new_figure
from ..vector import write_layer
from . import adjustmentreport
from .accuracy import Doming
from .findings import predicted, verdict
from .observations import Seen
from .solution import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .georeference import Result
    from .inputs import Inputs

Array = NDArray[np.float64]

_CAPTION = (
    "Arrows lead from the given to the computed place, pale bars show the height's error (upwards: computed too high), both "
    "enlarged as the title says. Open symbols could not be used."
)


def report(solution: Solution, inputs: Inputs, result: Result, dome: Doming | None, told: list[str]) -> Report:
    """Return the report page; ``told`` are the findings."""
    page = Report("Georeference", verdict(solution, result))
    for text in told:
        page.warning(text)
    middle, edge = predicted(solution)
    page.heading("Accuracy")
    page.table(
        ["", "points", "plan (m)", "height (m)"],
        [
            ["control points, residuals", result.control_count - len(solution.single), result.plani_control, result.alti_control],
            ["check points", result.check_count, result.plani_check, result.alti_check],
            ["  as predicted for these", _known(solution.predicted), *_rms_sigma(solution.predicted)],
            ["control points, each left out", _count(solution.loo), result.plani_loo, result.alti_loo],
            ["  as predicted for these", _count(solution.loo), *_rms_sigma(solution.loo_sigma)],
            ["GNSS positions", len(solution.gnss_errors), result.plani_gnss, result.alti_gnss],
            ["predicted sigma, amid the control", None, *middle],
            ["predicted sigma, edge of the ground that three photographs see", None, *edge],
        ],
    )
    page.text(
        "Plan is the root mean square of the horizontal distance, height of the vertical. Predicted sigmas are of the "
        "georeferencing alone, common to all that is measured in the block; they travel on to the surface model."
    )
    page.text(_basis(solution, inputs))
    if dome is not None:
        judged = "beyond chance and a ground pixel" if dome.significant else "no more than chance, or less than a ground pixel"
        page.text(
            f"Doming: {dome.amplitude:+.3g} m with a sigma of {dome.sigma:.2g} m, {judged}. It is how much a radially quadratic "
            "height error rises from the middle of the points to the outermost of them; shift and tilt are taken out."
        )
    if solution.seen or len(inputs.gnss):
        page.heading("Residuals")
        page.figure(_map(solution, inputs), _CAPTION)
    if solution.seen:
        page.table(
            [
                "name",
                "role",
                "marks",
                "dE (m)",
                "dN (m)",
                "dU (m)",
                "plan (m)",
                "left out: plan (m)",
                "left out: dU (m)",
                "marks (px)",
            ],
            [_row(solution, i) for i in range(len(solution.seen))],
        )
    if len(inputs.gnss):
        page.heading("GNSS")
        names = [solution.block.views[i].name for i in inputs.gnss.view]
        page.table(
            ["photograph", "dE (m)", "dN (m)", "dU (m)"],
            [[n, *map(float, e)] for n, e in zip(names, solution.gnss_errors, strict=True)],
        )
    if solution.method == "adjustment":
        adjustmentreport.add(page, solution)
    return page


def write_layers(residuals: str | None, photos: str | None, solution: Solution, inputs: Inputs) -> None:
    """Write the residuals at the ground points' given places, and the projection centres, as GeoPackages in the CRS."""
    if residuals:
        write_layer(
            residuals,
            "residuals",
            inputs.crs,
            _residual_fields(solution),
            _points([s.point.coordinates for s in solution.seen]),
            "Point Z",
        )
    if photos:
        block = solution.block
        centres = solution.frame.to_crs(np.array([v.centre for v in block.views]))
        errors = np.full((len(centres), 3), np.nan)
        errors[inputs.gnss.view] = solution.gnss_errors
        fields: dict[str, Any] = {"name": [v.name for v in block.views], "height": centres[:, 2], **_components(errors)}
        if solution.centre_sigma is not None:
            sigmas = solution.centre_sigma
            fields |= {"sigma_h": np.hypot(sigmas[:, 0], sigmas[:, 1]) / np.sqrt(2), "sigma_v": sigmas[:, 2]}
        write_layer(photos, "photos", inputs.crs, fields, _points(list(centres)), "Point Z")


def _residual_fields(solution: Solution) -> dict[str, Any]:
    seen = solution.seen
    blunders = {b.name for b in solution.blunders}
    marks_px = [None if s.found is None else _rms_pixels(s) for s in seen]
    return {
        "name": [s.point.name for s in seen],
        "role": [_role(s, solution) for s in seen],
        "marks": [s.marks for s in seen],
        **_components(solution.errors),
        "plani": np.hypot(solution.errors[:, 0], solution.errors[:, 1]),
        "sigma_h": [s.point.sigma_h for s in seen],
        "sigma_v": [s.point.sigma_v for s in seen],
        **_sigmas(solution),
        "loo_dE": solution.loo[:, 0],
        "loo_dN": solution.loo[:, 1],
        "loo_dU": solution.loo[:, 2],
        "marks_px": marks_px,
        "loo_sigma_h": np.hypot(solution.loo_sigma[:, 0], solution.loo_sigma[:, 1]) / np.sqrt(2),
        "loo_sigma_v": solution.loo_sigma[:, 2],
        "blunder": [s.point.name in blunders for s in seen],
    }


def _sigmas(solution: Solution) -> dict[str, Array]:
    """Return the predicted sigmas of check points' errors; a similarity tells none."""
    sigmas = np.full((len(solution.seen), 3), np.nan) if solution.predicted is None else solution.predicted
    return {f"sigma_{name}": values for name, values in _components(sigmas).items()}


def _components(errors: Array) -> dict[str, Array]:
    return {"dE": errors[:, 0], "dN": errors[:, 1], "dU": errors[:, 2]}


def _points(coordinates: list[Array]) -> list[Any]:
    return list(shapely.points(np.array(coordinates, float).reshape(-1, 3)))


def _row(solution: Solution, index: int) -> list[Any]:
    seen, error, left = solution.seen[index], solution.errors[index], solution.loo[index]
    pixels = None if seen.found is None else _rms_pixels(seen)
    plan = float(np.hypot(error[0], error[1]))
    return [
        seen.point.name,
        _role(seen, solution),
        seen.marks,
        *map(float, error),
        plan,
        float(np.hypot(*left[:2])),
        float(left[2]),
        pixels,
    ]


def _rms_pixels(seen: Seen) -> float | None:
    if seen.found is None:
        return None
    return float(np.sqrt(np.mean(np.sum(seen.found.residuals[seen.found.used] ** 2, axis=1))))


def _role(seen: Seen, solution: Solution) -> str:
    role = "check" if seen.point.check else "control"
    if seen.point.name in solution.single:
        return f"{role}, one mark"
    return role if seen.found is not None else f"{role}, not used"


def _map(solution: Solution, inputs: Inputs) -> Figure:
    figure = new_figure(9.0, 7.0)
    axes = figure.add_subplot()
    block = solution.block
    ground = solution.frame.to_crs(block.points[:: max(1, len(block.points) // 4000)])
    origin = ground.mean(axis=0)
    axes.plot(*(ground - origin)[:, :2].T, ",", color="#c9a45c", label="tie points")
    places = np.array([s.point.coordinates for s in solution.seen], float).reshape(-1, 3) - origin
    groups = [
        ("control", "#1f5fa8", "^", places, solution.errors, np.array([not s.point.check for s in solution.seen], bool)),
        ("check", "#c2452d", "o", places, solution.errors, np.array([s.point.check for s in solution.seen], bool)),
        ("GNSS", "#5a7d4f", ".", inputs.gnss.coordinates - origin, solution.gnss_errors, np.ones(len(inputs.gnss), bool)),
    ]
    shown = np.concatenate([e[m] for *_, e, m in groups])
    shown = shown[np.isfinite(shown[:, 0])]
    extent = float(np.ptp(ground[:, :2], axis=0).max())
    longest = float(np.percentile(np.hypot(shown[:, 0], shown[:, 1]), 90)) if len(shown) else 0.0
    grow = _round_down(0.08 * extent / longest) if longest > 0 else 1.0
    for label, colour, symbol, at, errors, members in groups:
        if not members.any():
            continue
        arrows = members & np.isfinite(errors[:, 0])
        bare = members & ~arrows
        axes.plot(at[arrows, 0], at[arrows, 1], symbol, color=colour, label=label, markersize=6)
        axes.plot(at[bare, 0], at[bare, 1], symbol, color=colour, markersize=6, fillstyle="none", alpha=0.6)
        axes.vlines(at[arrows, 0], at[arrows, 1], at[arrows, 1] + grow * errors[arrows, 2], color=colour, alpha=0.3, linewidth=4)
        options: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "color": colour, "width": 0.003}
        axes.quiver(at[arrows, 0], at[arrows, 1], grow * errors[arrows, 0], grow * errors[arrows, 1], **options)
    for seen, at in zip(solution.seen, places, strict=True):
        axes.annotate(seen.point.name, at[:2], xytext=(5, 5), textcoords="offset points", fontsize=8)
    axes.set(xlabel=f"easting - {origin[0]:.0f} m", ylabel=f"northing - {origin[1]:.0f} m", aspect="equal")
    axes.set_title(f"Errors enlarged {grow:g} times", fontsize=10)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure


def _round_down(value: float) -> float:
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(d for d in (1, 2, 5) if d * power <= value * (1 + 1e-9)))


def _basis(solution: Solution, inputs: Inputs) -> str:
    if solution.method == "adjustment":
        based = {
            "control": "Tie points and control points were adjusted together.",
            "control and GNSS": "Tie points, control points and GNSS positions were adjusted together, an error that all "
            "positions share included.",
            "GNSS": "Tie points and GNSS positions were adjusted together; there are no control points.",
        }[solution.based_on]
        return f"{based} Heights are {inputs.heights.kind}."
    based = {
        "control": "The similarity rests on the control points alone; GNSS positions are compared with it and do not enter it.",
        "control and GNSS": "The control points do not suffice: GNSS positions give shape and tilt, GCPs the level.",
        "GNSS": "There are no control points: the similarity rests on the GNSS positions of the projection centres.",
    }[solution.based_on]
    return f"{based} Heights are {inputs.heights.kind}. Scale {solution.similarity.scale:.6g} m per unit of the free frame."


def _known(sigmas: Array | None) -> int:
    return 0 if sigmas is None else _count(sigmas)


def _rms_sigma(sigmas: Array | None) -> tuple[float | None, float | None]:
    if sigmas is None:
        return None, None
    good = sigmas[np.isfinite(sigmas[:, 0])]
    if not len(good):
        return None, None
    return float(np.sqrt(np.mean(np.sum(good[:, :2] ** 2, axis=1)))), float(np.sqrt(np.mean(good[:, 2] ** 2)))


def _count(errors: Array) -> int:
    return int(np.isfinite(errors[:, 0]).sum())
