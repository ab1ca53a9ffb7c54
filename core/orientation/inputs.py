"""What the user gave to ``georeference``, read, checked and in one CRS."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from ..block import Block
from ..contract import VectorSource
from ..errors import InputError
from ..frames import projected_crs
from ..survey import Survey
from ..vector import polygons
from .control import Control, Given, control_from, given_from_layers
from .gcpfiles import read_gcp_file
from .gnss import Gnss, gnss_of
from .heights import HeightPlan, Kind, kind_of_crs, plan_heights, stated_kind, undulation, undulation_of_crs
from .plausible import check_unit, level_of, refuse_absurd


@dataclass(frozen=True, kw_only=True)
class GroundRequest:
    """What a step asks of the ground and of GNSS. Sigmas in metres, ``sigma_mark`` in pixels.

    ``marks`` has the columns gcp, image, x, y: pixels from the CORNER of the top-left pixel (ODM's file counts from its
    centre and is brought to that). ``check`` is names separated by commas; ``lever_arm`` three numbers from the projection
    centre to the antenna (right, forward, up; m); ``geoid`` the path of a raster or a number (m).
    """

    gcps: VectorSource | None = None
    name_field: str | None = None
    height_field: str | None = None
    role_field: str | None = None
    sigma_h: float = 0.01
    sigma_v: float = 0.02
    sigma_h_field: str | None = None
    sigma_v_field: str | None = None
    marks: VectorSource | None = None
    gcp_file: str | None = None
    check: str | None = None
    sigma_mark: float = 0.5
    use_gnss: bool = True
    lever_arm: str | None = None
    gcp_heights: Literal["ellipsoidal", "orthometric", "unknown"] = "unknown"
    gnss_heights: Literal["ellipsoidal", "orthometric", "unknown"] = "unknown"
    geoid: str | None = None
    crs: str | None = None


@dataclass(frozen=True)
class Inputs:
    """All that the user gave, read, checked and in the survey's CRS (WKT2).

    ``focal_change`` is the oriented focal length over the photographs' own, minus 1 (median); 0 when the files do not tell.
    """

    crs: str
    control: Control
    gnss: Gnss
    heights: HeightPlan
    focal_change: float
    warnings: tuple[str, ...]
    ignore: shapely.Geometry | None = None


def read_given(request: GroundRequest) -> Given | None:
    """Read the control as it was given, None for none.

    Raises
    ------
    InputError
        When a layer, table or file cannot be used.
    """
    if request.gcp_file:
        return read_gcp_file(request.gcp_file)
    if request.gcps is None:
        return None
    return given_from_layers(
        request.gcps,
        request.marks,
        name_field=request.name_field,
        height_field=request.height_field,
        role_field=request.role_field,
        sigma_h_field=request.sigma_h_field,
        sigma_v_field=request.sigma_v_field,
    )


def gather(request: GroundRequest, ignore: VectorSource | None, survey: Survey, given: Given | None, block: Block) -> Inputs:
    """Bring control, positions and the polygons to ignore into the survey's CRS, with heights of one kind.

    Raises
    ------
    InputError
        When something does not fit together.
    """
    crs = _crs(request, survey, given)
    control = Control()
    stated: Kind = request.gcp_heights
    kind_notes: tuple[str, ...] = ()
    if given is not None:
        given = given.in_crs_of(crs)
        control = control_from(
            given, crs, survey.photographs, sigma_h=request.sigma_h, sigma_v=request.sigma_v, check=request.check
        )
        stated, kind_notes = stated_kind(request.gcp_heights, given.crs, given.where)
        check_unit(block, control)
    photographs = survey.photographs if request.use_gnss else ()
    gnss = gnss_of(block.views, photographs, crs, request.lever_arm)
    warnings = [*control.notes, *kind_notes, *gnss.notes]
    plan, gnss, told = _levelled(request, given, stated, control, gnss, crs)
    warnings += told
    if plan.comparable:
        plan, told = _compared(plan, (stated, request.gnss_heights), control, gnss, block, survey)
        warnings += told
    ignored = shapely.union_all(polygons(ignore, crs)) if ignore is not None else None
    return Inputs(crs, control, gnss, plan, _focal_change(survey, block), tuple(warnings), ignored)


def _levelled(
    request: GroundRequest, given: Given | None, stated: Kind, control: Control, gnss: Gnss, crs: str
) -> tuple[HeightPlan, Gnss, list[str]]:
    """Bring GNSS heights to the GCPs' kind, by GEOID or by the grid of the GCPs' vertical CRS."""
    geoid, why = request.geoid, ""
    rise: NDArray[np.float64] | None = None
    differ = {stated, request.gnss_heights} == {"ellipsoidal", "orthometric"}
    if not geoid and differ and len(gnss) and given is not None and given.crs and kind_of_crs(given.crs) == "orthometric":
        try:
            rise = undulation_of_crs(given.crs, gnss.coordinates, crs)
        except InputError as error:
            why = f" ({str(error).split(':', maxsplit=1)[0]})"
    plan = plan_heights(
        stated,
        request.gnss_heights,
        geoid=bool(geoid) or rise is not None,
        with_gcps=bool(control.points),
        with_gnss=len(gnss) > 0,
    )
    told = []
    if plan.sign:
        if not geoid:
            told.append(f"GNSS heights were brought to those of {control.where} by PROJ's grid for its vertical CRS.")
        rise = plan.sign * (undulation(geoid, gnss.coordinates, crs) if geoid else np.asarray(rise))
        gnss = replace(gnss, coordinates=gnss.coordinates + np.stack([0 * rise, 0 * rise, rise], axis=1))
    elif geoid:
        told.append("GEOID changes nothing here: no GNSS heights have to be brought to another kind.")
    if not plan.comparable:
        told.append(
            f"GNSS and GCP heights are of different kinds and there is no GEOID{why}: GNSS heights are used for differences "
            "only, and ALTI_GNSS is not determined."
        )
    return plan, gnss, told


def _compared(
    plan: HeightPlan, kinds: tuple[Kind, Kind], control: Control, gnss: Gnss, block: Block, survey: Survey
) -> tuple[HeightPlan, list[str]]:
    """Look whether GNSS heights lie where the GCPs' do; where not, take them for differences only and say what to set."""
    level = level_of(block, control, gnss, survey.photographs)
    if level is None or not level.differs:
        return plan, []
    refuse_absurd(level, control.where)
    apart = f"{abs(level.above):.1f} m {'above' if level.above > 0 else 'below'} those of {control.where}"
    if plan.sign:
        cause = "although GEOID has been applied: check its values, GCP_HEIGHTS and GNSS_HEIGHTS"
    elif "unknown" in kinds:
        cause = (
            "as heights above the ellipsoid do against heights above the sea, or a drone's barometer: set GCP_HEIGHTS and "
            "GNSS_HEIGHTS to what they are, and give GEOID if they differ"
        )
    else:
        cause = f"although both are said to be {kinds[0]}: correct GCP_HEIGHTS or GNSS_HEIGHTS, or expect a drone's barometer"
    text = f"GNSS heights lie {apart}, {cause}"
    if level.unit:
        text += f"; they would agree if the heights of {control.where} were in {level.unit}"
    if any(not p.check and p.marks for p in control.points):
        # A wrong level of GNSS must not bend a block that a GCP can level; without one it is all there is.
        return replace(plan, comparable=False), [
            f"{text}; until then GNSS heights are used for differences only, and ALTI_GNSS is not determined."
        ]
    return plan, [f"{text}."]


def _focal_change(survey: Survey, block: Block) -> float:
    known = {p.name: p.focal for p in survey.photographs}
    changes = [v.camera.brown()[0] / focal - 1.0 for v in block.views if (focal := known.get(v.name))]
    return float(np.median(changes)) if changes else 0.0


def _crs(request: GroundRequest, survey: Survey, given: Given | None) -> str:
    for text in (request.crs, survey.crs):
        if text:
            return projected_crs(text).to_wkt()
    if given is not None and given.crs:
        return projected_crs(given.crs).to_wkt()
    if given is not None and given.borrows_crs:
        raise InputError(f"{given.where} names no CRS, and the survey has none, for its photographs have no positions: give CRS.")
    raise InputError("The survey has no CRS, for its photographs have no positions, and there are no GCPs: give CRS and GCPS.")
