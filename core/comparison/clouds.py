"""The tie-point clouds of all cases in one frame, so that they compare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..block import Block
from ..errors import NotEnoughData
from ..georef import FOLDER, Georef
from ..orientation.similarity import umeyama
from ..orientation.sparse import read_block
from ..report.cloud import Cloud, levelled
from ..survey import Survey
from .cases import Array, Outcome


def case_blocks(outcomes: Sequence[Outcome]) -> dict[str, Block]:
    """Return the oriented block of each case that has one, in its free frame."""
    return {o.case: read_block(o.survey / "model") for o in outcomes if o.oriented}


def case_clouds(outcomes: Sequence[Outcome], blocks: Mapping[str, Block]) -> tuple[dict[str, Cloud | None], str]:
    """Return the clouds, None for cases without, and the unit of their frame.

    It is that of the ground in metres where all cases reached it; else the levelled frame of the richest case, to which the
    others are fitted by their projection centres.
    """
    if all(o.ground for o in outcomes if o.oriented):
        return _on_the_ground(outcomes, blocks), "m"
    richest = max(blocks, key=lambda case: len(blocks[case].points))
    reference = blocks[richest]
    centres = _centres(reference)
    looking = np.array([v.rotation[2] for v in reference.views])
    points, upright = levelled(reference.points, centres, looking)
    order = {o.case: {name: i for i, name in enumerate(o.names)} for o in outcomes}
    exposure = {order[richest][v.name]: c for v, c in zip(reference.views, upright, strict=True)}
    clouds: dict[str, Cloud | None] = dict.fromkeys((o.case for o in outcomes), None)
    for case, block in blocks.items():
        if case == richest:
            clouds[case] = Cloud(points, reference.rays, upright)
            continue
        own = {order[case][v.name]: v.centre for v in block.views}
        common = sorted(set(own) & set(exposure))
        try:
            fit = umeyama(
                np.array([own[i] for i in common]).reshape(-1, 3), np.array([exposure[i] for i in common]).reshape(-1, 3)
            )
        except NotEnoughData:
            continue  # too small a block to be laid over the other
        clouds[case] = Cloud(fit.apply(block.points), block.rays, fit.apply(_centres(block)))
    return clouds, "units of the free frame"


def _on_the_ground(outcomes: Sequence[Outcome], blocks: Mapping[str, Block]) -> dict[str, Cloud | None]:
    clouds: dict[str, Cloud | None] = dict.fromkeys((o.case for o in outcomes), None)
    origin: Array | None = None
    for case in blocks:
        survey = Survey.open(next(o.survey for o in outcomes if o.case == case))
        frame, block = Georef.read(survey).frame, read_block(survey.folder / FOLDER)
        points, centres = frame.to_crs(block.points), frame.to_crs(_centres(block))
        if origin is None:  # the height is kept
            origin = np.array([*np.round(np.median(points[:, :2], axis=0)), 0.0])
        clouds[case] = Cloud(points - origin, block.rays, centres - origin)
    return clouds


def _centres(block: Block) -> Array:
    return np.array([v.centre for v in block.views])
