"""What two DSMs say in their tags about the georeferencing of their surveys: how far one may stand off the other in height."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contract import decode
from ..errors import InputError
from ..frames import LocalFrame, transformer
from .terms import height_terms

Array = NDArray[np.float64]
_FAR = 100.0  # metres between the places whose heights' errors tell the terms
_RIGID, _BENT = 7, 10  # numbers of a similarity; with the three by which a block bends
GEOREFERENCING = "STRANDLINE_GEOREFERENCING"  # the tag with which a DSM carries its georeferencing's covariance


@dataclass(frozen=True)
class _Block:
    """``covariance``, row by row: 7x7 of a similarity (shift, rotations, scale), or 10x10 with the height's E^2, E N and N^2."""

    frame: LocalFrame
    pivot: tuple[float, ...]
    covariance: tuple[float, ...]

    @property
    def matrix(self) -> Array:
        """The covariance (10, 10); a similarity's bending is not known, and does not count."""
        count = _BENT if len(self.covariance) == _BENT**2 else _RIGID
        matrix = np.zeros((_BENT, _BENT))
        matrix[:count, :count] = np.reshape(self.covariance, (count, count))
        return matrix

    def heights(self, crs: str, centre: tuple[float, ...]) -> Array:
        """Return the covariance (7, 7) of the coefficients of this one model's ``height_terms`` about ``centre`` in ``crs``."""
        return _height_covariance(self, crs, centre)


@dataclass(frozen=True)
class Georeferenced:
    """The georeferencing of two models of independent flights; a horizontal shift, which tells on slopes only, is left out."""

    before: _Block
    after: _Block
    crs: str  # that of x and y

    def covariance(self, centre: tuple[float, ...]) -> Array:
        """Return the covariance (7, 7) of the coefficients of the difference's ``height_terms`` about ``centre`` (x, y, z).

        Level (m), tilts east and north, height's scale, and bending in x^2, xy and y^2 (1/m) of the CRS, whose north need not be
        the frame's. Flights that share control points err more alike than the sum of both covariances says.
        """
        return _height_covariance(self.before, self.crs, centre) + _height_covariance(self.after, self.crs, centre)

    @property
    def bends(self) -> bool:
        """Whether both say how far they may be bent: a similarity's covariance does not."""
        return all(bool(np.diag(block.matrix)[_RIGID:].any()) for block in (self.before, self.after))


def georeferenced(label: str, tags: dict[str, str]) -> _Block | None:
    """Return the georeferencing that a DSM's tags carry, None when they do not.

    Raises
    ------
    InputError
        When the tag is there but damaged.
    """
    data = _tag(label, tags)
    if data is None:
        return None
    try:
        block = decode(_Block, {key: data[key] for key in ("frame", "pivot", "covariance")})
    except (KeyError, InputError) as error:
        raise _damaged(label, error) from error
    if len(block.covariance) not in (_RIGID**2, _BENT**2) or len(block.pivot) != 3:
        return None
    return block


def require_one_reference(before: dict[str, str], after: dict[str, str]) -> None:
    """Refuse two DSMs of which one says that its heights are ellipsoidal and the other orthometric, tens of metres apart.

    Raises
    ------
    InputError
        When their tags disagree.
    """
    tags = [_tag(label, tags) or {} for label, tags in (("BEFORE", before), ("AFTER", after))]
    kinds = [tag.get("heights", "unknown") for tag in tags]
    if set(kinds) >= {"ellipsoidal", "orthometric"}:
        raise InputError(f"BEFORE has {kinds[0]} heights and AFTER {kinds[1]} ones: georeference one of the surveys again.")


def _tag(label: str, tags: dict[str, str]) -> dict[str, Any] | None:
    text = tags.get(GEOREFERENCING)
    if not text:
        return None
    try:
        data = json.loads(text)
    except ValueError as error:
        raise _damaged(label, error) from error
    if not isinstance(data, dict):
        raise _damaged(label, "not an object")
    return data


def _damaged(label: str, why: object) -> InputError:
    return InputError(f"{label}: the tag {GEOREFERENCING} is damaged ({why}): export the DSM again.")


def _height_covariance(block: _Block, crs: str, centre: tuple[float, ...]) -> Array:
    """Return the covariance (7, 7) of the coefficients of the terms about ``centre`` in the block's error in height.

    The error at a place is linear in the ten numbers and quadratic in the place, so a fit to places about ``centre`` is exact but
    for the CRS's own bend against the frame (some 1e-6 of the numbers' effects).
    """
    steps = np.array([(i, k, 0.0) for i in (-1, 0, 1) for k in (-1, 0, 1)] + [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    places = np.asarray(centre) + _FAR * steps
    x, y = transformer(crs, block.frame.crs).transform(places[:, 0], places[:, 1])
    east, north, up = (block.frame.from_crs(np.column_stack([x, y, places[:, 2]])) - np.asarray(block.pivot)).T
    # Shift up; a rotation w moves a point by w x r, whose upward part is w_E r_N - w_N r_E; scale lifts by r_U; then bending.
    zero = np.zeros(len(places))
    errors = np.column_stack([zero, zero, zero + 1.0, north, -east, zero, up, east * east, east * north, north * north])
    # Fitted in units of _FAR, so that the terms are alike in size.
    units = _FAR ** np.array([0, 1, 1, 1, 2, 2, 2])
    terms = height_terms(steps[:, 0], steps[:, 1], steps[:, 2], (0.0, 0.0, 0.0))
    fitted = np.linalg.lstsq(terms, errors, rcond=None)[0] / units[:, None]
    return np.asarray(fitted @ block.matrix @ fitted.T)
