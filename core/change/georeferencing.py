"""What two DSMs say in their tags about the georeferencing of their surveys."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..contract import decode
from ..errors import InputError
from ..frames import LocalFrame, transformer

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

    def sigma(self, x: float, y: float, before: float, after: float) -> float | None:
        """Return the propagated sigma of both shifts, tilts and scales at the zone's mean place."""
        variance = sum(
            _height_variance(block, self.crs, x, y, height) for block, height in ((self.before, before), (self.after, after))
        )
        return float(np.sqrt(variance))


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


def _height_variance(block: _Block, crs: str, x: float, y: float, height: float) -> float:
    x, y = transformer(crs, block.frame.crs).transform(x, y)
    local = block.frame.from_crs(np.array([[x, y, height]]))[0]
    east, north, up = local - np.asarray(block.pivot)
    # Shift up; a rotation w moves a point by w x r, whose upward part is w_E r_N - w_N r_E; scale lifts by r_U.
    g = np.array([0.0, 0.0, 1.0, north, -east, 0.0, up])
    return float(max(0.0, g @ np.reshape(block.covariance, (7, 7)) @ g))
