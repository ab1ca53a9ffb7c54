"""Tie points as a point cloud: LAS or LAZ."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray
from pyproj import CRS

from ..errors import InputError
from ..files import remove_abandoned, require_writable, whole

_STEPS = 2**30  # steps of the file's whole numbers across the extent


def check_cloud(key: str, path: str) -> None:
    """Refuse, before any work, a point cloud that could not be written.

    Raises
    ------
    InputError
        When the name does not end in .laz or .las, or its folder cannot be written to.
    """
    if Path(path).suffix.lower() not in (".laz", ".las"):
        raise InputError(f"{key} {path} must be LAS or LAZ: give a name that ends in .laz.")
    require_writable(path, key)


def write_points(
    path: Path | str,
    xyz: NDArray[np.float64],
    *,
    rays: NDArray[np.integer],
    errors: NDArray[np.float64],
    sigmas: Mapping[str, NDArray[np.float64]] | None = None,
    crs: str | None = None,
) -> None:
    """Write points (n, 3) of a ``crs``, or of a frame whose unit is its own: the file's scale follows their extent.

    ``rays`` (n,), the photographs that see each, is written as "user data" (255 for more), and ``errors`` (n,), the mean
    residual in pixels, as the extra dimension "residual"; ``sigmas`` (n,), in metres, are extra dimensions of their names.
    """
    low, high = xyz.min(axis=0, initial=np.inf), xyz.max(axis=0, initial=-np.inf)
    header = laspy.LasHeader(point_format=6, version="1.4")
    if len(xyz):
        # A power of ten keeps the coordinates readable.
        header.scales = np.full(3, 10.0 ** np.ceil(np.log10(max(float((high - low).max()), 1e-6) / _STEPS)))
        header.offsets = (low + high) / 2
    header.add_extra_dim(laspy.ExtraBytesParams(name="residual", type=np.float32, description="mean residual (px)"))
    for name in sigmas or {}:
        header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=np.float32, description="standard deviation (m)"))
    if crs is not None:
        header.add_crs(CRS.from_user_input(crs))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz.T
    cloud.user_data = np.minimum(rays, 255).astype(np.uint8)
    cloud.residual = errors.astype(np.float32)
    for name, values in (sigmas or {}).items():
        cloud[name] = values.astype(np.float32)
    cloud.return_number = cloud.number_of_returns = np.ones(len(xyz), np.uint8)
    remove_abandoned(path)
    with whole(path) as part:
        cloud.write(str(part), do_compress=Path(path).suffix.lower() == ".laz")
