"""What a bundle adjustment starts from: cameras, tie points, ground control and positions, and what they leave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import bundle
from .cameras import Cameras, Rays
from .gnss import offsets
from .interior import Interior
from .sightings import Sighting

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Control:
    """A sighting of a point surveyed at ``ground`` (3,) of the local frame with ``covariance`` (3, 3)."""

    sighting: Sighting
    ground: Array
    covariance: Array


@dataclass(frozen=True)
class Positions:
    """Antennas (g, 3) of the local frame in the views ``view`` (g,), with sigmas (g, 3), and the lever to them (3,).

    ``shared`` (3,) is the prior sigma of an error that all have in common, inf for a free one, 0 for none.
    """

    view: NDArray[np.int64]
    antenna: Array
    sigma: Array
    lever: Array
    shared: Array

    def __len__(self) -> int:
        """Return the number of positions."""
        return len(self.view)


@dataclass(frozen=True)
class Network:
    """All that is adjusted: approximate cameras, what is known of their interiors, tie points (p, 3) and their rays."""

    cameras: Cameras
    interiors: tuple[Interior, ...]
    ties: Rays
    points: Array


def antennas(cameras: Cameras, positions: Positions) -> Array:
    """Return where the cameras put the antennas (g, 3)."""
    centres, turns = cameras.centre[positions.view], cameras.rotation[positions.view]
    return np.asarray(centres + offsets(turns, positions.lever))


def tie_residuals(network: Network) -> Array:
    """Return observed minus computed (m, 2) of the tie points' rays, NaN where a point cannot be seen."""
    ties = network.ties
    return np.asarray(bundle.intersect(ties.arrays, np.ones(len(ties.view)), network.points, network.cameras.arrays, 0)[1])
