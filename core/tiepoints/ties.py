"""How each photograph is tied to the others, and which are tied weakly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..photographs.listing import some
from ..survey import Photograph
from .features import read_features
from .matching import PairMatches
from .pairs import Pair
from .statistics import CELLS, cell_counts

_WEAK_MATCHES = 200  # fewer verified matches with its best partner than this, and a photograph is weakly tied
_WEAK_COVERAGE = 30.0  # percent of the cells
SCALES = np.geomspace(0.5, 64.0, 57)  # pixels, edges of the histogram of scales


@dataclass(frozen=True)
class Ties:
    """What ties each of n photographs.

    ``features`` (n,) are counts, ``matched`` the indices of the features that are matched in some pair, ``pairs`` (n,) the
    photographs that each shares verified matches with, ``best`` (n,) the matches with the one it shares most with and
    ``partner`` (n,) its index, -1 for none. ``cells`` (n, CELLS, CELLS) count matched features, ``scales`` (2, bins of
    ``SCALES``) the features of all photographs by their scale, those in no pair and the matched.
    """

    features: NDArray[np.int64]
    matched: tuple[NDArray[np.int64], ...]
    pairs: NDArray[np.int64]
    best: NDArray[np.int64]
    partner: NDArray[np.int64]
    cells: NDArray[np.int64]
    scales: NDArray[np.int64]

    @property
    def matches(self) -> NDArray[np.int64]:
        """The number of matched features (n,)."""
        return np.array([len(m) for m in self.matched], np.int64)

    @property
    def coverage(self) -> NDArray[np.float64]:
        """The percentage of cells with a matched feature (n,)."""
        return 100.0 * np.count_nonzero(self.cells, axis=(1, 2)) / CELLS**2

    def weak(self) -> dict[int, str]:
        """Return the photographs that are weakly tied, and why."""
        return {i: why for i in range(len(self.features)) if (why := self._weakness(i))}

    def _weakness(self, i: int) -> str:
        if not self.features[i]:
            return "no features were found in it"
        if not self.pairs[i]:
            return "it shares verified matches with no other"
        why, covered = [], 100.0 * np.count_nonzero(self.cells[i]) / CELLS**2
        if self.best[i] < _WEAK_MATCHES:
            why.append(f"{self.best[i]} matches with its best partner (fewer than {_WEAK_MATCHES})")
        if covered < _WEAK_COVERAGE:
            why.append(f"matches on {covered:.0f} % of it (less than {_WEAK_COVERAGE:.0f} %)")
        if self.pairs[i] == 1 and len(self.pairs) > 2:
            why.append("tied to one other only")
        return "; ".join(why)


def count_ties(photographs: Sequence[Photograph], features: Sequence[Path], pairs: Mapping[Pair, PairMatches]) -> Ties:
    """Return what ties the photographs; ``features`` are files of ``write_features``, which are read one at a time."""
    count = len(photographs)
    partners, best, partner = np.zeros(count, np.int64), np.zeros(count, np.int64), np.full(count, -1, np.int64)
    parts: list[list[NDArray[Any]]] = [[np.zeros(0, np.int64)] for _ in range(count)]
    for (i, j), pair in pairs.items():
        for a, b, mine in ((i, j, pair.matches[:, 0]), (j, i, pair.matches[:, 1])):
            parts[a].append(mine)
            partners[a] += 1
            if len(mine) > best[a]:
                best[a], partner[a] = len(mine), b
    matched = tuple(np.unique(np.concatenate(part)).astype(np.int64) for part in parts)
    found = np.zeros(count, np.int64)
    cells = np.zeros((count, CELLS, CELLS), np.int64)
    scales = np.zeros((2, len(SCALES) - 1), np.int64)
    for i, (photograph, path) in enumerate(zip(photographs, features, strict=True)):
        one = read_features(path)
        found[i] = len(one)
        cells[i] = cell_counts(one.xy[matched[i]], photograph.width, photograph.height)
        tied = np.zeros(len(one), bool)
        tied[matched[i]] = True
        for k, chosen in enumerate((~tied, tied)):
            scales[k] += np.histogram(np.clip(one.scale[chosen], SCALES[0], SCALES[-1]), bins=SCALES)[0]
    return Ties(found, matched, partners, best, partner, cells, scales)


def name_weak(photographs: Sequence[Photograph], ties: Ties) -> str:
    """Return a sentence that names the photographs that are weakly tied, nothing when there are none."""
    names = [photographs[i].name for i in ties.weak()]
    return f"Weakly tied: {some(names)}. Their orientation may be uncertain or fail; the report says why." if names else ""
