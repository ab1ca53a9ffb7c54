"""The layer VOLUMES: one row per zone."""

from __future__ import annotations

import shapely

from ..vector import write_layer
from .significance import coverage_factor
from .volumes import Volume
from .zones import Zone


def write_volumes(path: str, zones: list[Zone], volumes: list[Volume], crs: str, confidence: float) -> None:
    """Write the zones (in ``crs``) with their volumes, in the same order, to a GeoPackage; what is not known is NULL."""
    factor = coverage_factor(confidence)
    rows = [_columns(zone.name, volume, factor) for zone, volume in zip(zones, volumes, strict=True)]
    fields = {key: [row[key] for row in rows] for key in rows[0]}
    shapes = [shapely.multipolygons(shapely.get_parts(zone.shape)) for zone in zones]
    write_layer(path, "volumes", crs, fields, shapes, "MultiPolygon")


def _columns(zone: str, volume: Volume, factor: float) -> dict[str, object]:
    sigma, net = volume.sigma.total, volume.net
    interval = None if sigma is None or net is None else factor * sigma
    return {
        "zone": zone,
        "net": net,
        "sigma": sigma,
        "sigma_random": volume.sigma.random,
        "sigma_correlated": volume.sigma.correlated,
        "sigma_systematic": volume.sigma.systematic,
        "low": None if net is None or interval is None else net - interval,
        "high": None if net is None or interval is None else net + interval,
        "erosion": volume.erosion,
        "erosion_sigma": volume.erosion_sigma.total,
        "deposition": volume.deposition,
        "deposition_sigma": volume.deposition_sigma.total,
        "erosion_significant": volume.erosion_significant,
        "deposition_significant": volume.deposition_significant,
        "net_significant": volume.net_significant,
        "area": volume.area,
        "covered_percent": volume.covered_percent,
    }
