"""Which error model holds: from stable ground and the georeferencings, else from what the user says, else not known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..progress import Progress
from ..raster import Grid
from .coregistration import LEAST, Method, Shift, fit_shift
from .difference import Stable
from .georeferencing import Georeferenced, georeferenced
from .heighterror import HeightError, from_both, from_georeferencing, from_plane, from_stable
from .heights import Heights
from .uncertainty import ErrorModel, Fitted, Given, Systematic
from .variogram import Variogram, fit_variogram
from .zones import Zone


def height_error(
    method: Method | None,
    ground: Stable | None,
    models: tuple[Heights, Heights],
    grid: Grid,
    zones: list[Zone],
    progress: Progress,
) -> tuple[Shift, HeightError | None]:
    """Return what to take off the difference, and what is known of the error that it corrects; None: nothing.

    ``method`` None takes off what is expected: of stable ground and georeferencings together where both DSMs carry theirs, else
    of stable ground alone. Another method is carried out as asked, and what it leaves stays known.

    Raises
    ------
    NotEnoughData
        When stable ground does not determine what is asked for.
    """
    steps = (grid.step_north, grid.cell)
    prior = _prior(models, grid.crs)
    level = None if ground is None or method == "none" else fit_shift("vertical", ground.x, ground.y, ground.change)
    if ground is None or (method == "none" and (prior is None or len(ground.change) < LEAST)):
        west, south, east, north = grid.bounds
        centre = ((west + east) / 2, (south + north) / 2, 0.0)
        return Shift("none"), None if prior is None else from_georeferencing(prior, centre)
    applied = level if method == "vertical" else None if method is None else fit_shift(method, ground.x, ground.y, ground.change)
    if prior is not None:
        known = from_both(ground, prior, steps, progress)
    elif applied is not None and method == "plane":
        known = from_plane(ground, applied, steps)
    else:
        assert level is not None
        known = from_stable(ground, level, zones, steps, progress)
    shift = applied or known.shift
    if method is not None and known.exceeded_by(shift):
        progress.warn(
            f"COREGISTER={method} leaves an error that STABLE shows ({known.shift.describe()}): "
            "set COREGISTER to auto to take it off."
        )
    return shift, known


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


def systematic_error(given: float | None, applied: Shift, known: HeightError | None) -> Systematic:
    """Return what is common to all cells: what is not known of the height error, and what is known of it but left in.

    ``given``, REGISTRATION_SIGMA, counts where nothing is taken off, where nothing else is known, and for an unknown tilt.
    """
    if known is None or known.covariance is None or (applied.method == "none" and given is not None):
        return Given(given)
    return Fitted(known.covariance, known.shift.centre, known.left_by(applied), (given or 0.0) if known.free else 0.0)


def _prior(models: tuple[Heights, Heights], crs: str) -> Georeferenced | None:
    before, after = (georeferenced(h.label, h.file.tags) for h in models)
    return None if before is None or after is None else Georeferenced(before, after, crs)


def _standardised(ground: Stable, shift: Shift, steps: tuple[float, float]) -> Variogram | None:
    """Return the variogram of residual / sigma on stable ground, None where it is too small."""
    if ground.sigma is None or not (ground.sigma > 0).all():
        return None
    cells = ground.patches or ground
    residual = cells.change - shift.at(cells.x, cells.y, cells.height)
    assert cells.sigma is not None
    return fit_variogram(cells.row, cells.column, residual / cells.sigma, steps)
