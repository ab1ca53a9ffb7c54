"""Scale space: extrema of the difference of Gaussians (Lowe 2004), strip by strip so that memory stays bounded.

An octave is an image with its layers of Gaussian blur. It is built in strips of rows that overlap by more than the blur
reaches, so that strips give the same numbers as the whole would, to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Image = NDArray[np.float32]

LAYERS = 3  # scales per octave
SIGMA = 1.6  # blur of an octave's first layer, in its pixels; what blur the photograph has itself is not counted
BORDER = 5  # pixels at the edge of an octave that hold no extremum
_TRUNCATE = 4.0  # sigmas after which a Gaussian is cut
_STRIP = 1 << 21  # pixels of a strip, without its overlap
_OVERLAP = 64  # rows: the blurs of all layers reach 43; those below a descriptor 20, and it 39
_LEAST = 16  # pixels of the shorter side of the last octave
_NEAR = 0.75  # pixels and layers from the pixel it was found at; above a half, or rounding loses extrema between two pixels
_STEPS = 5  # of the search for an extremum between the pixels
_EDGE = 10.0  # ratio of the principal curvatures above which an extremum is an edge


@dataclass(frozen=True)
class Octave:
    """The first Gaussian layer of an octave: ``rows(first, last)`` returns that part of it.

    ``pixel`` is the side of its pixels in those of the image; ``shape`` is rows, columns. The centre of pixel (i, j)
    is at (i, j) times the side, counted from the centre of the image's first pixel.
    """

    pixel: float
    shape: tuple[int, int]
    rows: Callable[[int, int], Image]


@dataclass(frozen=True)
class Strip:
    """Some rows of an octave: Gaussian layers or their differences (layers, rows, columns), valid until the next is asked for.

    ``top`` is the octave's row of the first row; rows ``first`` to ``last`` (exclusive, of the octave) are the strip's own, the
    rest is overlap.
    """

    layers: Image
    top: int
    first: int
    last: int


def octaves(image: NDArray[np.uint8]) -> Iterator[Octave]:
    """Yield the octaves of an image from its own pixels on, each of half the rows and columns of the one before."""
    pixel = 1.0
    base = _blurred(image.astype(np.float32), SIGMA)
    while min(base.shape) >= _LEAST:
        octave = Octave(pixel, base.shape, lambda first, last, base=base: base[first:last])  # type: ignore[misc]
        yield octave
        base = _halved(octave)
        pixel *= 2


def finer_octave(image: NDArray[np.uint8]) -> Octave:
    """Return the octave of twice the rows and columns, made by linear interpolation."""
    height, width = image.shape
    reach = 2 * math.ceil(_TRUNCATE * SIGMA)  # even, so that a part starts on a pixel of the image

    def rows(first: int, last: int) -> Image:
        top, bottom = max(0, first - first % 2 - reach), min(2 * height, last + reach)
        part = image[top // 2 : min(height, bottom // 2 + 2)].astype(np.float32)
        tall = np.empty((2 * len(part), width), np.float32)
        tall[::2] = part
        tall[1:-1:2] = 0.5 * (part[:-1] + part[1:])
        tall[-1] = part[-1]
        wide = np.empty((bottom - top, 2 * width), np.float32)
        tall = tall[: bottom - top]
        wide[:, ::2] = tall
        wide[:, 1:-1:2] = 0.5 * (tall[:, :-1] + tall[:, 1:])
        wide[:, -1] = tall[:, -1]
        return _blurred(wide, SIGMA)[first - top : last - top]

    return Octave(0.5, (2 * height, 2 * width), rows)


def gaussians(octave: Octave) -> Iterator[Strip]:
    """Yield the Gaussian layers 0 to ``LAYERS`` of an octave in strips from the top down."""
    rows = max(_LEAST, _STRIP // octave.shape[1])
    space = np.empty((LAYERS + 1, min(rows + 2 * _OVERLAP, octave.shape[0]), octave.shape[1]), np.float32)
    for strip in _parts(octave, rows):
        yield replace(strip, layers=_stack(strip.layers[0], space))


def differences(octave: Octave) -> Iterator[Strip]:
    """Yield the ``LAYERS + 2`` differences of successive Gaussian layers of an octave in strips from the top down."""
    rows = max(_LEAST, _STRIP // octave.shape[1])
    space = np.empty((LAYERS + 3, min(rows + 2 * _OVERLAP, octave.shape[0]), octave.shape[1]), np.float32)
    for strip in _parts(octave, rows):
        stack = _stack(strip.layers[0], space)
        for lower, upper in pairwise(stack):
            np.subtract(upper, lower, out=lower)
        yield replace(strip, layers=stack[:-1])


def extrema(strip: Strip, least: float) -> NDArray[np.float32]:
    """Return column, row (octave's pixels), layer and contrast (n, 4) of the own extrema of a strip of differences.

    Place, layer and contrast (grey levels) are those of the parabola through the neighbours (Lowe 2004, eq. 3); extrema of
    less than ``least`` grey levels and such on edges are left out. One place may come twice, with the same numbers.
    """
    rows = max(strip.first - strip.top, BORDER), min(strip.last - strip.top, strip.layers.shape[1] - BORDER)
    return np.asarray(_extrema(strip.layers, strip.top, rows[0], rows[1], np.float32(least)))


def sigma_of(layer: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the Gaussian's sigma, in the octave's pixels, of a layer between the layers."""
    return np.float32(SIGMA) * np.exp2(layer / np.float32(LAYERS)).astype(np.float32)


def layer_of(sigma: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the layer between the layers of a Gaussian of ``sigma`` of the octave's pixels."""
    return np.asarray(np.float32(LAYERS) * np.log2(sigma / np.float32(SIGMA)), np.float32)


def _step(layer: int) -> float:
    """Return the sigma of the blur from the layer before to ``layer``."""
    return float(SIGMA * math.sqrt(2 ** (2 * layer / LAYERS) - 2 ** (2 * (layer - 1) / LAYERS)))


def _blurred(image: Image, sigma: float, out: Image | None = None) -> Image:
    side = 2 * math.ceil(_TRUNCATE * sigma) + 1
    return np.asarray(cv2.GaussianBlur(image, (side, side), sigma, dst=out, borderType=cv2.BORDER_REFLECT_101))


def _parts(octave: Octave, rows: int) -> Iterator[Strip]:
    """Yield strips that hold the first layer alone."""
    for first in range(0, octave.shape[0], rows):
        last = min(first + rows, octave.shape[0])
        top = max(0, first - _OVERLAP)
        yield Strip(octave.rows(top, min(last + _OVERLAP, octave.shape[0]))[None], top, first, last)


def _stack(base: Image, space: Image) -> Image:
    """Return a first layer and the layers above it, in ``space``."""
    stack = space[:, : len(base)]
    stack[0] = base
    for i in range(1, len(stack)):
        _blurred(stack[i - 1], _step(i), stack[i])
    return stack


def _halved(octave: Octave) -> Image:
    """Return the next octave's first layer: every second pixel of the layer of twice the blur."""
    out = np.empty(((octave.shape[0] + 1) // 2, (octave.shape[1] + 1) // 2), np.float32)
    for strip in gaussians(octave):
        even = strip.first + strip.first % 2
        rows = strip.layers[LAYERS, even - strip.top : strip.last - strip.top : 2, ::2]
        out[even // 2 : even // 2 + len(rows)] = rows
    return out


@njit(cache=True, nogil=True)
def _mark(before: Any, above: Any, row: Any, below: Any, after: Any, least: Any, out: Any) -> None:
    """Mark the pixels of a row (its ends excepted) that are above or below their six nearest neighbours; vectorised."""
    n = len(row) - 2
    left, right, v = row[:n], row[2 : n + 2], row[1 : n + 1]
    b, u, d, a = before[1 : n + 1], above[1 : n + 1], below[1 : n + 1], after[1 : n + 1]
    for x in range(n):
        # Of equal neighbours the first is the extremum.
        high = (
            (v[x] >= least)
            & (v[x] > left[x])
            & (v[x] >= right[x])
            & (v[x] > u[x])
            & (v[x] >= d[x])
            & (v[x] > b[x])
            & (v[x] >= a[x])
        )
        low = (
            (v[x] <= -least)
            & (v[x] < left[x])
            & (v[x] <= right[x])
            & (v[x] < u[x])
            & (v[x] <= d[x])
            & (v[x] < b[x])
            & (v[x] <= a[x])
        )
        out[x + 1] = (high | low) & (abs(v[x]) >= least)


@njit(cache=True, nogil=True)
def _is_extremum(d: Any, i: int, y: int, x: int) -> bool:
    """Return whether a marked pixel is above or below all of its 26 neighbours."""
    sign = np.float32(1.0) if d[i, y, x] > 0 else np.float32(-1.0)
    v = sign * d[i, y, x]
    for k in range(3):
        for r in range(3):
            for c in range(3):
                other = sign * d[i - 1 + k, y - 1 + r, x - 1 + c]
                at = 9 * k + 3 * r + c
                if other > v or (other == v and at < 13):
                    return False
    return True


@njit(cache=True, nogil=True)
def _extrema(d: Any, top: int, first: int, last: int, least: Any) -> Any:
    out = np.empty((1024, 4), np.float32)
    marked = np.zeros(d.shape[2], np.bool_)
    count = 0
    for i in range(1, d.shape[0] - 1):
        for y in range(first, last):
            _mark(d[i - 1, y], d[i, y - 1], d[i, y], d[i, y + 1], d[i + 1, y], least, marked)
            for x in range(BORDER, d.shape[2] - BORDER):
                if not marked[x] or not _is_extremum(d, i, y, x):
                    continue
                found, column, row, layer, contrast = _refined(d, i, y, x)
                if found and abs(contrast) >= least:
                    if count == len(out):
                        larger = np.empty((2 * count, 4), np.float32)
                        larger[:count] = out
                        out = larger
                    out[count, 0], out[count, 1], out[count, 2], out[count, 3] = column, top + row, layer, contrast
                    count += 1
    return out[:count].copy()


@njit(cache=True, nogil=True, error_model="numpy")
def _refined(d: Any, i: int, y: int, x: int) -> Any:
    """Return whether there is an extremum, and its column, row, layer and contrast."""
    for _ in range(_STEPS):
        v = np.float64(d[i, y, x])
        gx = 0.5 * (np.float64(d[i, y, x + 1]) - d[i, y, x - 1])
        gy = 0.5 * (np.float64(d[i, y + 1, x]) - d[i, y - 1, x])
        gs = 0.5 * (np.float64(d[i + 1, y, x]) - d[i - 1, y, x])
        hxx = np.float64(d[i, y, x + 1]) + d[i, y, x - 1] - 2 * v
        hyy = np.float64(d[i, y + 1, x]) + d[i, y - 1, x] - 2 * v
        hss = np.float64(d[i + 1, y, x]) + d[i - 1, y, x] - 2 * v
        hxy = 0.25 * (np.float64(d[i, y + 1, x + 1]) - d[i, y + 1, x - 1] - d[i, y - 1, x + 1] + d[i, y - 1, x - 1])
        hxs = 0.25 * (np.float64(d[i + 1, y, x + 1]) - d[i + 1, y, x - 1] - d[i - 1, y, x + 1] + d[i - 1, y, x - 1])
        hys = 0.25 * (np.float64(d[i + 1, y + 1, x]) - d[i + 1, y - 1, x] - d[i - 1, y + 1, x] + d[i - 1, y - 1, x])
        # Cramer's rule on the symmetric 3 x 3 system.
        axx, axy, axs = hyy * hss - hys * hys, hxs * hys - hxy * hss, hxy * hys - hxs * hyy
        determinant = hxx * axx + hxy * axy + hxs * axs
        ayy, ays, ass = hxx * hss - hxs * hxs, hxs * hxy - hxx * hys, hxx * hyy - hxy * hxy
        dx = -(axx * gx + axy * gy + axs * gs) / determinant
        dy = -(axy * gx + ayy * gy + ays * gs) / determinant
        ds = -(axs * gx + ays * gy + ass * gs) / determinant
        if not (abs(dx) < 1e3 and abs(dy) < 1e3 and abs(ds) < 1e3):
            break
        if max(abs(dx), abs(dy), abs(ds)) <= _NEAR:
            trace = hxx + hyy
            if ass <= 0 or trace * trace * _EDGE >= (_EDGE + 1) ** 2 * ass:
                break
            return True, x + dx, y + dy, i + ds, v + 0.5 * (gx * dx + gy * dy + gs * ds)
        x, y, i = x + int(np.rint(dx)), y + int(np.rint(dy)), i + int(np.rint(ds))
        inside = 1 <= i < d.shape[0] - 1 and 1 <= y < d.shape[1] - 1 and BORDER <= x < d.shape[2] - BORDER
        if not inside:
            break
    return False, 0.0, 0.0, 0.0, 0.0
