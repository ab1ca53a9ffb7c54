"""Tie points as a point cloud in the free frame: LAS or LAZ."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray

from ..files import remove_abandoned, whole

_STEPS = 2**30  # steps of the file's whole numbers across the extent


def write_points(path: Path | str, xyz: NDArray[np.float64], *, rays: NDArray[np.integer], errors: NDArray[np.float64]) -> None:
    """Write points (n, 3) of a frame whose unit is its own, so that the file's scale follows their extent.

    ``rays`` (n,), the photographs that see each, is written as "user data" (255 for more), and ``errors`` (n,), the mean
    residual in pixels, as the extra dimension "residual".
    """
    low, high = xyz.min(axis=0, initial=np.inf), xyz.max(axis=0, initial=-np.inf)
    header = laspy.LasHeader(point_format=6, version="1.4")
    if len(xyz):
        # A power of ten keeps the coordinates readable.
        header.scales = np.full(3, 10.0 ** np.ceil(np.log10(max(float((high - low).max()), 1e-6) / _STEPS)))
        header.offsets = (low + high) / 2
    header.add_extra_dim(laspy.ExtraBytesParams(name="residual", type=np.float32, description="mean residual (px)"))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz.T
    cloud.user_data = np.minimum(rays, 255).astype(np.uint8)
    cloud.residual = errors.astype(np.float32)
    cloud.return_number = cloud.number_of_returns = np.ones(len(xyz), np.uint8)
    remove_abandoned(path)
    with whole(path) as part:
        cloud.write(str(part), do_compress=Path(path).suffix.lower() == ".laz")
