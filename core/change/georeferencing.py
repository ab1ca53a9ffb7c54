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

Array = NDArray[np.float64]
_FAR = 100.0  # metres between the places whose heights' errors tell tilts and scale
GEOREFERENCING = "STRANDLINE_GEOREFERENCING"  # the tag with which a DSM carries its georeferencing's covariance


@dataclass(frozen=True)
class _Block:
    frame: LocalFrame
    pivot: tuple[float, ...]
    covariance: tuple[float, ...]


@dataclass(frozen=True)
class Georeferenced:
    """The georeferencing of two models of independent flights; a horizontal shift, which tells on slopes only, is left out."""

    before: _Block
    after: _Block
    crs: str  # that of x and y

    def covariance(self, centre: tuple[float, ...]) -> Array:
        """Return the covariance (4, 4) of the difference's level (m), tilts east and north, and scale about ``centre`` (x, y, z).

        Flights that share control points err more alike than the sum of both covariances says.
        """
        return _height_covariance(self.before, self.crs, centre) + _height_covariance(self.after, self.crs, centre)


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
    if len(block.covariance) != 49 or len(block.pivot) != 3:
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
    """Return the covariance (4, 4) of the height's error at ``centre`` and its slopes east, north and up."""
    places = np.asarray(centre) + _FAR * np.vstack([np.zeros(3), np.eye(3)])
    x, y = transformer(crs, block.frame.crs).transform(places[:, 0], places[:, 1])
    east, north, up = (block.frame.from_crs(np.column_stack([x, y, places[:, 2]])) - np.asarray(block.pivot)).T
    # Shift up; a rotation w moves a point by w x r, whose upward part is w_E r_N - w_N r_E; scale lifts by r_U.
    zero = np.zeros(4)
    errors = np.column_stack([zero, zero, zero + 1.0, north, -east, zero, up])
    slopes = np.vstack([errors[0], (errors[1:] - errors[0]) / _FAR])
    return np.asarray(slopes @ np.reshape(block.covariance, (7, 7)) @ slopes.T)
