"""What cannot be meant by a request, said before any work."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..raster import check_destination

if TYPE_CHECKING:
    from .dsmdifference import Request


def validate(request: Request) -> None:
    """Refuse, before any work, what cannot be meant."""
    if not 0.0 < request.confidence < 1.0:
        raise InputError(f"CONFIDENCE is {request.confidence:g}: give a number between 0 and 1, such as 0.95.")
    for name in ("before_sigma", "after_sigma", "registration_sigma", "horizontal_sigma", "correlation_range"):
        value = getattr(request, name)
        if value is not None and value < 0:
            raise InputError(f"{name.upper()} is {value:g}: give metres that are not negative.")
    for side in ("before", "after"):
        if getattr(request, f"{side}_sigma") is not None and getattr(request, f"{side}_precision") is not None:
            raise InputError(f"{side.upper()}_SIGMA and {side.upper()}_PRECISION are both given: give one of them.")
    if request.coregister in ("vertical", "plane", "horizontal") and request.stable is None:
        raise InputError(f"COREGISTER={request.coregister} needs STABLE: draw polygons on ground that has not moved.")
    sources = (request.before, request.after, request.before_precision, request.after_precision)
    inputs = {Path(s.path).resolve() for s in sources if s}
    outputs = [p for p in (request.output, request.significant, request.volumes, request.output_html_file) if p]
    if len({Path(p).resolve() for p in outputs}) < len(outputs):
        raise InputError("Two outputs have the same name: give each its own.")
    for path in outputs:
        if Path(path).resolve() in inputs:
            raise InputError(f"The output {path} is also an input: choose another name.")
    for raster in (request.output, request.significant):
        if raster:
            check_destination(raster)
    if request.volumes and Path(request.volumes).suffix.lower() != ".gpkg":
        raise InputError(f"The layer {request.volumes} must be a GeoPackage: give a name that ends in .gpkg.")
