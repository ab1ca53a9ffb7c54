"""What residuals say of points and marks after an adjustment: good, doubtful or bad, by what was predicted for them."""

import math
from typing import Any, Dict, NamedTuple, Optional

from qgis.core import NULL, QgsVectorLayer

from .marks import Mark

GOOD, DOUBTFUL, BAD, UNKNOWN = "good", "doubtful", "bad", "unknown"
COLOURS = {GOOD: "#4fd16b", DOUBTFUL: "#ffb43a", BAD: "#ff5252", UNKNOWN: "#59c3ff"}
_POINT_LIMITS = (2.0, 3.0)  # of a standardised residual
_MARK_LIMITS = (2.45, 3.7)  # radii in sigmas of an axis that hold 95 % and 99.9 % of a normal distribution in the plane
_MARK_SIGMA = 0.5  # px, of a mark set by eye; the SIGMA_MARK that 'Georeference' takes unless told otherwise
CIRCLE = _MARK_LIMITS[0]  # the error circle drawn holds 95 %


class Prediction(NamedTuple):
    """Where a point should be seen (px), with the sigma of an axis (px), None when it is not known."""

    x: float
    y: float
    sigma: Optional[float]


class Residual(NamedTuple):
    """What the adjustment left at a ground point: metres, its role, the number of marks, and the judgement."""

    east: Optional[float]
    north: Optional[float]
    up: Optional[float]
    role: str
    marks: int
    pixels: Optional[float]
    judgement: str

    @property
    def plan(self) -> Optional[float]:
        """The horizontal distance (m)."""
        return None if self.east is None or self.north is None else math.hypot(self.east, self.north)


def offset(mark: Mark, prediction: Prediction) -> float:
    """Return how far (px) a mark lies from where it should."""
    return math.hypot(mark.x - prediction.x, mark.y - prediction.y)


def judge_mark(mark: Optional[Mark], prediction: Optional[Prediction]) -> str:
    """Compare a mark with its prediction, whose sigma joins that of marking."""
    if mark is None or prediction is None or prediction.sigma is None:
        return UNKNOWN
    return _judged(offset(mark, prediction) / math.hypot(prediction.sigma, _MARK_SIGMA), _MARK_LIMITS)


def read_residuals(layer: QgsVectorLayer) -> Dict[str, Residual]:
    """Return the residuals by the points' names from the layer that 'Georeference' writes."""
    found = {}
    for feature in layer.getFeatures():
        row = {field.name(): _plain(value) for field, value in zip(feature.fields(), feature.attributes())}
        found[str(row["name"])] = Residual(
            row["dE"], row["dN"], row["dU"], str(row["role"]), int(row["marks"] or 0), row["marks_px"], _judge_point(row)
        )
    return found


def _judge_point(row: Dict[str, Any]) -> str:
    """Judge a control point as it is predicted when left out, a check point by what was predicted for it."""
    if row.get("blunder"):
        return BAD
    if row.get("loo_dE") is not None and row.get("loo_sigma_h"):
        plan, up = _length(row, "loo_"), row["loo_dU"]
        sigma_h, sigma_v = row["loo_sigma_h"], row["loo_sigma_v"]
    elif row.get("dE") is not None:
        plan, up = _length(row, ""), row["dU"]
        sigmas = [row.get(name) for name in ("sigma_dE", "sigma_dN")]
        known = all(sigmas) and row.get("sigma_dU")
        sigma_h = math.hypot(*sigmas) / math.sqrt(2.0) if known else row.get("sigma_h")
        sigma_v = row["sigma_dU"] if known else row.get("sigma_v")
    else:
        return UNKNOWN
    if not sigma_h or not sigma_v:
        return UNKNOWN
    # A plan residual of sigma_h in both axes is as usual as a height residual of sigma_v.
    return _judged(max(plan / (sigma_h * math.sqrt(2.0)), abs(up or 0.0) / sigma_v), _POINT_LIMITS)


def _length(row: Dict[str, Any], prefix: str) -> float:
    return math.hypot(row[f"{prefix}dE"], row[f"{prefix}dN"])


def _judged(ratio: float, limits: "tuple[float, float]") -> str:
    return GOOD if ratio <= limits[0] else DOUBTFUL if ratio <= limits[1] else BAD


def _plain(value: Any) -> Any:
    return None if value is None or value == NULL or (isinstance(value, float) and math.isnan(value)) else value
