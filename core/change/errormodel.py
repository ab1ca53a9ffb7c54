"""Which error model holds: from stable ground where it can tell, else from what the user says, else not known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..progress import Progress
from .coregistration import Shift, plane_design
from .difference import Stable
from .georeferencing import Georeferenced, georeferenced
from .heights import Heights
from .uncertainty import SAMPLE, ErrorModel, Fitted, Given, Systematic, fit_covariance
from .variogram import Variogram, fit_variogram


def error_model(
    given_range: float | None,
    ground: Stable | None,
    shift: Shift,
    sigma_known: bool,
    steps: tuple[float, float],
    progress: Progress,
) -> tuple[ErrorModel, Variogram | None]:
    """Return how the cells' sigmas divide, and the variogram of the standardised stable ground it was taken from, if any.

    Without a variogram a given sigma counts whole as random and whole as correlated over CORRELATION_RANGE: too much by the
    random part, which is negligible beside the other. Where the range is neither resolved nor given all cells err alike: a bound.
    """
    if not sigma_known:
        return ErrorModel(None, None), None
    told = None if ground is None else _standardised(ground, shift, steps)
    if told is None:
        structures = None if given_range is None else ((1.0, given_range),) if given_range > 0 else ()
        return ErrorModel(1.0, structures), None
    if np.isinf(told.reach):
        if given_range is None:
            progress.warn(
                "STABLE is too small to resolve the range of the correlated error: its unresolved part is taken to be alike in "
                "all cells, which is a bound; draw larger stable areas, or give CORRELATION_RANGE."
            )
        else:
            told = replace(told, structures=tuple((s, given_range if np.isinf(r) else r) for s, r in told.structures))
    return ErrorModel(float(np.sqrt(told.nugget)), tuple((float(np.sqrt(s)), r) for s, r in told.structures)), told


def systematic_error(
    given: float | None,
    shift: Shift,
    ground: Stable | None,
    variogram: Variogram | None,
    before: Heights,
    after: Heights,
    crs: str,
) -> Systematic:
    """Return what is common to all cells: the fitted shift's own error, else REGISTRATION_SIGMA, else the georeferencing's."""
    if shift.method != "none" and ground is not None and variogram is not None:
        return _of_fit(shift, ground, variogram)
    if given is not None or shift.method != "none":
        return Given(given)
    blocks = [georeferenced(h.label, h.file.tags) for h in (before, after)]
    if blocks[0] is None or blocks[1] is None:
        return Given(None)
    return Georeferenced(blocks[0], blocks[1], crs)


def _standardised(ground: Stable, shift: Shift, steps: tuple[float, float]) -> Variogram | None:
    """Return the variogram of residual / sigma on stable ground, None where it is too small."""
    if ground.sigma is None or not (ground.sigma > 0).all():
        return None
    cells = ground.patches or ground
    residual = cells.change - shift.at(cells.x, cells.y)
    assert cells.sigma is not None
    return fit_variogram(cells.row, cells.column, residual / cells.sigma, steps)


def _of_fit(shift: Shift, ground: Stable, variogram: Variogram) -> Fitted:
    # The cells come in random order, so the first are a random sample.
    some = slice(0, SAMPLE)
    x, y = ground.x[some], ground.y[some]
    design = np.ones((len(x), 1)) if len(shift.coefficients) == 1 else plane_design(x, y, shift.centre)
    assert ground.sigma is not None
    variance = float(np.mean(ground.sigma**2))
    covariance = fit_covariance(
        design,
        np.column_stack([x, y]),
        variogram.nugget * variance,
        tuple((sill * variance, reach) for sill, reach in variogram.structures),
        ground.count,
    )
    return Fitted(covariance, shift.centre)
