"""The cross-section of a beach: sand above a datum per metre of beach, and where the profile falls through the datum.

A profile is straight between its nodes, and has no height where one of them has none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .coregistration import robust_fit

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sand:
    """``volume`` (m3 per m) above the datum over the ``covered`` metres; its derivative by the nodes' heights (n,)."""

    volume: float
    weight: Array
    covered: float


@dataclass(frozen=True)
class Crossing:
    """The most seaward place where the profile falls through the datum.

    Its distance (m), the slope there (height per metre seaward, over the scale asked for), the weights (n,) of the nodes'
    heights in the height at that place, and how many such places the profile has.
    """

    distance: float
    slope: float
    weight: Array
    count: int


def sand_above(distance: Array, height: Array, datum: float, start: float, end: float) -> Sand:
    """Return the sand above ``datum`` between the distances ``start`` and ``end``.

    Exact for the profile as drawn: with t from 0 to 1 along a segment of length L, between p and q where it is above the datum,
    the integral is L ((q - p) h0 + (q^2 - p^2) / 2 (h1 - h0)), linear in both heights; that p and q move counts for nothing, as
    the sand has no height there.
    """
    weight = np.zeros(len(height))
    if len(height) < 2:
        return Sand(0.0, weight, 0.0)
    length = np.diff(distance)
    h0, h1 = height[:-1] - datum, height[1:] - datum
    p = np.clip((start - distance[:-1]) / length, 0.0, 1.0)
    q = np.clip((end - distance[:-1]) / length, 0.0, 1.0)
    known = np.isfinite(h0) & np.isfinite(h1)
    covered = float((np.maximum(q - p, 0.0) * length)[known].sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = h0 / (h0 - h1)
        p = np.where((h0 < 0) & (h1 > 0), np.maximum(p, zero), p)
        q = np.where((h0 > 0) & (h1 < 0), np.minimum(q, zero), q)
    sand = known & (np.maximum(h0, h1) > 0) & (q > p)
    right = np.where(sand, length * (q * q - p * p) / 2.0, 0.0)
    left = np.where(sand, length * (q - p), 0.0) - right
    weight[:-1] += left
    weight[1:] += right
    used = weight > 0
    return Sand(float(weight[used] @ (height[used] - datum)), weight, covered)


def seaward_crossing(distance: Array, height: Array, datum: float, start: float, end: float, scale: float) -> Crossing | None:
    """Return the most seaward fall through ``datum`` between ``start`` and ``end``, None when there is none.

    The slope is a robust line's through the nodes within half of ``scale`` about it, three at least.
    """
    h0, h1 = height[:-1] - datum, height[1:] - datum
    with np.errstate(invalid="ignore"):
        falls = np.nonzero((h0 >= 0) & (h1 < 0))[0]
    places = distance[falls] + np.diff(distance)[falls] * h0[falls] / (h0[falls] - h1[falls])
    inside = (places >= start) & (places <= end)
    if not inside.any():
        return None
    place, segment = float(places[inside][-1]), int(falls[inside][-1])
    known = np.isfinite(height)
    near = known & (np.abs(distance - place) <= scale / 2)
    if near.sum() < 3:
        nearest = np.nonzero(known)[0]
        near = np.zeros(len(height), np.bool_)
        near[nearest[np.argsort(np.abs(distance[nearest] - place))[:3]]] = True
    design = np.column_stack([np.ones(int(near.sum())), distance[near] - place])
    slope = float(robust_fit(design, height[near])[1]) if near.sum() > 2 else float(np.diff(height[segment : segment + 2])[0])
    weight = np.zeros(len(height))
    share = (place - distance[segment]) / (distance[segment + 1] - distance[segment])
    weight[segment], weight[segment + 1] = 1.0 - share, share
    return Crossing(place, slope, weight, int(inside.sum()))


def together(*heights: Array) -> list[Array]:
    """Return profiles (n,) with a height only where all have one."""
    known = np.all([np.isfinite(h) for h in heights], axis=0)
    return [np.where(known, h, np.nan) for h in heights]
