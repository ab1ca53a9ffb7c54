"""What ``georeference`` tells the analyst, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..block import Block
from .accuracy import Doming
from .blunders import TOO_FEW_TO_TELL, Blunder
from .solution import FOCAL_ASTRAY, Solution, WrongMark

if TYPE_CHECKING:
    from .georeference import Result
    from .inputs import Inputs

_EDGE_WARNING = 3.0  # times the sigma amid the control; beyond it lies what control at the edges would mend
_EDGE_MATTERS = 2.0  # ground pixels: about what a single height from five photographs is uncertain by
_HEIGHT_MATTERS = 1.5  # ground pixels: less is what RTK gives at best
_WELL_SEEN = 3  # rays of a tie point
_SAMPLE = 5000  # tie points, enough for a percentile
_NARROW = np.radians(2.0)
_LEVELS_DIFFER = 5.0  # m; geoids lie tens of metres from the ellipsoid
_PLANS_DIFFER = 20.0  # m; no receiver is that wrong on average, but another datum is


def verdict(solution: Solution, result: Result) -> str:
    """Return one sentence for the analyst."""
    counts = []
    if result.control_count:
        counts.append(_points(result.control_count, "control point"))
    if "GNSS" in solution.based_on:
        counts.append(f"the GNSS positions of {_points(len(solution.gnss_errors), 'photograph')}")
    how = "a bundle adjustment" if solution.method == "adjustment" else "a similarity"
    text = f"Georeferenced by {how} on {' and '.join(counts)}"
    if result.plani_check is not None:
        text += f"; {_points(result.check_count, 'check point')}, off by {_pair(result.plani_check, result.alti_check)}"
    elif result.plani_loo is not None:
        text += f"; left out one by one, the control points are off by {_pair(result.plani_loo, result.alti_loo)}"
    elif result.plani_control is not None:
        text += f"; the control points themselves are off by {_pair(result.plani_control, result.alti_control)}"
    elif result.plani_gnss is not None:
        text += f"; they are off by {_pair(result.plani_gnss, result.alti_gnss)}, and no independent point checks the result"
    suspicious = [b.name for b in solution.blunders] + [f"{m.gcp} in {m.image}" for m in solution.wrong_marks]
    if suspicious:
        text += f"; suspicious: {', '.join(dict.fromkeys(suspicious))}"
    return text + "."


def findings(solution: Solution, inputs: Inputs, dome: Doming | None) -> list[str]:
    """Return what the analyst must know before using the result, a sentence each."""
    told = [*inputs.warnings, *solution.notes]
    told += [_blunder_sentence(b, solution) for b in solution.blunders]
    told += [_mark_sentence(m) for m in solution.wrong_marks]
    told += [
        f"The GNSS position of {b.name} is off by {b.error:.3g} m in {_where(b)}, {b.ratio:.1f} times its sigma: "
        "it has little weight."
        for b in solution.gnss_blunders
    ]
    for seen in solution.seen:
        name = seen.point.name
        if name in solution.single:
            told.append(
                f"{name} has one mark, which takes part; nothing but the block checks it, and it has no residual on the ground."
            )
            continue
        if seen.found is None:
            few = f"it has {seen.marks} mark{'s' * (seen.marks != 1)} in oriented photographs, and needs two"
            told.append(f"{name} is not used: {few if seen.marks < 2 else 'its marks do not meet in a point; check them'}.")
            continue
        if seen.wrong and solution.method == "similarity":
            told.append(f"The mark of {name} in {', '.join(seen.wrong)} contradicts its other marks and is left out: check it.")
        elif not seen.found.agree and solution.method == "similarity":
            worst = float(np.linalg.norm(seen.found.residuals, axis=1).max())
            told.append(f"The marks of {name} do not agree with each other (up to {worst:.1f} px): check them.")
        if seen.found.angle < _NARROW:
            degrees = np.degrees(seen.found.angle)
            told.append(f"The rays to {name} meet at {degrees:.1f} degrees only, which leaves its height uncertain.")
    told += _factor_sentences(solution)
    middle, edge = predicted(solution)
    if inputs.gnss.declared:
        told += _height_sentence(solution, middle[1], edge[1])
    matters = _EDGE_MATTERS * ground_pixel(solution.block)
    if any(e > max(_EDGE_WARNING * m, matters) for m, e in zip(middle, edge, strict=True)):
        told.append(
            "The georeferencing is weak away from its points: sigma at the edge of the ground that "
            f"{_WELL_SEEN} photographs see is {_pair(*edge)}, amid the points {_pair(*middle)}; put control near the edges, or "
            "keep to the ground amid it."
        )
    if solution.height_doubt > 0 and abs(inputs.focal_change) > FOCAL_ASTRAY:
        told.append(
            f"The orientation changed the focal length by {100 * inputs.focal_change:+.0f} %, and without control points heights "
            f"rest on it: they may be off by {_metres(solution.height_doubt)}; give a control point, or a calibration."
        )
    elif solution.height_doubt > 0:
        told.append(
            "Without control points heights rest on the focal length, which vertical views of flat ground hardly determine: a "
            f"doubt of {_metres(solution.height_doubt)} is added; one control point or tilted photographs remove it."
        )
    if solution.based_on == "GNSS" and not inputs.gnss.declared:
        told.append(
            "The photographs' GNSS carries no sigma: the whole block may be shifted by metres (more in height), which no "
            "residual shows; without control points do not compare it with another date before co-registration."
        )
    level = float(np.mean(solution.gnss_errors[:, 2])) if len(inputs.gnss) and solution.based_on != "GNSS" else 0.0
    if abs(level) > _LEVELS_DIFFER and inputs.heights.comparable:
        told.append(
            f"GNSS heights are {-level:+.1f} m off the block's on average: they may be heights of another kind (see "
            "GCP_HEIGHTS, GNSS_HEIGHTS and GEOID)."
        )
    apart = float(np.hypot(*np.mean(solution.gnss_errors[:, :2], axis=0))) if len(inputs.gnss) else 0.0
    if apart > _PLANS_DIFFER and solution.based_on != "GNSS":
        told.append(f"GNSS positions are {apart:.0f} m off the block's in plan: is the CRS of the ground points the right one?")
    if dome is not None and dome.significant:
        told.append(
            f"Height errors form a dome of {dome.amplitude:+.3g} m (sigma {dome.sigma:.2g} m) from the middle to the outermost "
            "point: the camera's distortion is not well determined."
        )
    return told


def predicted(solution: Solution) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the georeferencing's predicted sigmas (plan, height; m) amid its control, and at the edge of the well-seen ground.

    The ground ends where the tie points of three photographs or more end: a footprint reaches far beyond, where nothing is
    measured. The edge stands for the two per cent of them that are known worst.
    """
    block = solution.block
    well = block.points[block.rays >= _WELL_SEEN] if np.any(block.rays >= _WELL_SEEN) else block.points
    ground = well[:: max(1, len(well) // _SAMPLE)]
    middle = np.array([*solution.common.pivot[:2], np.median(ground[:, 2])])
    covariance = solution.common.uncertainty(np.concatenate([middle[None], ground]))
    plan = np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1])
    height = np.sqrt(covariance[:, 2, 2])
    edge = float(np.percentile(plan[1:], 98)), float(np.percentile(height[1:], 98))
    return (float(plan[0]), float(height[0])), edge


def ground_pixel(block: Block) -> float:
    """Return the median size of a pixel on the ground, in the block's units."""
    sizes = []
    for index, view in enumerate(block.views):
        points = block.points[block.observed_point[block.observed_view == index]]
        if len(points):
            depth = np.median(points @ view.rotation[2] + view.translation[2])
            sizes.append(float(depth) / view.camera.brown()[0])
    return float(np.median(sizes))


def _factor_sentences(solution: Solution) -> list[str]:
    factor = solution.estimated_factor
    if solution.based_on == "GNSS" or factor is None or factor < 9.0:
        return []
    return [
        f"The control points fit {np.sqrt(factor):.0f} times worse than their sigmas say: these are too small, or the block is "
        "bent; the predicted sigmas follow the fit, not the sigmas given."
    ]


def _height_sentence(solution: Solution, middle: float, edge: float) -> list[str]:
    """Say it when nothing on the ground holds the heights of an adjustment, and what they are then known to."""
    if solution.method == "similarity" or solution.based_on != "GNSS":
        return []
    if middle < _HEIGHT_MATTERS * ground_pixel(solution.block):
        return []
    held = any(camera.origin == "held" for camera in solution.cameras)
    what = "the GNSS positions alone" if held else "GNSS positions and the focal length that the photographs tell"
    return [
        f"Without control points heights rest on {what}, and are known to {_metres(middle)} (sigma) in the middle of the block "
        f"and {_metres(edge)} at its edge; one control point, the CALIBRATION of a survey with control points, or tilted "
        "photographs make them better."
    ]


def _mark_sentence(mark: WrongMark) -> str:
    times = f", {mark.ratio:.1f} times its sigma" if np.isfinite(mark.ratio) else ""
    return (
        f"The mark of {mark.gcp} in {mark.image} is off by {mark.error:.1f} px{times}: it is kept with next to no weight; "
        "correct it or remove it."
    )


def _blunder_sentence(blunder: Blunder, solution: Solution) -> str:
    seen = solution.seen
    check = any(s.point.name == blunder.name and s.point.check for s in seen)
    control = sum(not s.point.check and s.found is not None for s in seen)
    text = f"{blunder.name} is off by {blunder.error:.3g} m in {_where(blunder)}, {blunder.ratio:.1f} times its predicted sigma: "
    if check:
        return text + "check its coordinates and marks."
    if solution.method == "similarity" and control <= TOO_FEW_TO_TELL:
        return text + f"with {control} control points it could be another of them; check the coordinates and marks of all."
    return text + "it is kept with next to no weight; check its coordinates and marks."


def _where(blunder: Blunder) -> str:
    return "plan" if blunder.part == "plan" else "height"


def _pair(plan: float | None, height: float | None) -> str:
    return f"{_metres(plan)} in plan" + ("" if height is None else f" and {_metres(height)} in height")


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} m" if abs(value) < 1 else f"{value:.2f} m"


def _points(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' * (count != 1)}"
