"""What the user gave to ``georeference``, read, checked and in one CRS."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from ..block import Block
from ..errors import InputError
from ..frames import projected_crs
from ..survey import Survey
from ..vector import polygons
from .control import Control, Given, control_from, given_from_layers
from .gcpfiles import read_gcp_file
from .gnss import Gnss, gnss_of
from .heights import HeightPlan, plan_heights, undulation

if TYPE_CHECKING:
    from .georeference import Request


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


def read_given(request: Request) -> Given | None:
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


def gather(request: Request, survey: Survey, given: Given | None, block: Block) -> Inputs:
    """Bring control and positions into the survey's CRS, with heights of one kind.

    Raises
    ------
    InputError
        When something does not fit together.
    """
    crs = _crs(request, survey, given)
    control = Control()
    if given is not None:
        control = control_from(
            given, crs, survey.photographs, sigma_h=request.sigma_h, sigma_v=request.sigma_v, check=request.check
        )
    photographs = survey.photographs if request.use_gnss else ()
    gnss = gnss_of(block.views, photographs, crs, request.lever_arm)
    warnings = [*control.notes, *gnss.notes]
    plan = plan_heights(
        request.gcp_heights,
        request.gnss_heights,
        geoid=bool(request.geoid),
        with_gcps=bool(control.points),
        with_gnss=len(gnss) > 0,
    )
    if plan.sign and request.geoid:
        rise = plan.sign * undulation(request.geoid, gnss.coordinates, crs)
        gnss = replace(gnss, coordinates=gnss.coordinates + np.stack([0 * rise, 0 * rise, rise], axis=1))
    elif request.geoid:
        warnings.append("GEOID changes nothing here: no GNSS heights have to be brought to another kind.")
    if not plan.comparable:
        warnings.append(
            "GNSS and GCP heights are of different kinds and there is no GEOID: GNSS heights are used for differences only, and "
            "ALTI_GNSS is not determined."
        )
    ignore = shapely.union_all(polygons(request.ignore, crs)) if request.ignore is not None else None
    return Inputs(crs, control, gnss, plan, _focal_change(survey, block), tuple(warnings), ignore)


def _focal_change(survey: Survey, block: Block) -> float:
    known = {p.name: p.focal for p in survey.photographs}
    changes = [v.camera.brown()[0] / focal - 1.0 for v in block.views if (focal := known.get(v.name))]
    return float(np.median(changes)) if changes else 0.0


def _crs(request: Request, survey: Survey, given: Given | None) -> str:
    for text in (request.crs, survey.crs):
        if text:
            return projected_crs(text).to_wkt()
    if given is not None and given.crs:
        return projected_crs(given.crs).to_wkt()
    raise InputError("The survey has no CRS, for its photographs have no positions, and there are no GCPs: give CRS and GCPS.")
