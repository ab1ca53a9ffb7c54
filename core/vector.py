"""Vector layers and tables on disk. This module alone knows pyogrio."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import pyogrio.errors
import shapely
from numpy.typing import NDArray
from pyproj import CRS

from .contract import VectorSource
from .errors import InputError
from .files import remove_abandoned, require_writable, whole
from .frames import transformer


@dataclass(frozen=True)
class Layer:
    """Features in columns: ``ids`` (n,), ``fields`` by name (n,), ``geometry`` (n,) of shapely or None for a table."""

    name: str
    ids: NDArray[Any]
    fields: dict[str, NDArray[Any]]
    geometry: NDArray[Any] | None
    crs: str | None

    def __len__(self) -> int:
        """Return the number of features."""
        return len(self.ids)

    def text(self, field: str) -> list[str]:
        """Return a column as stripped text; NULL is an empty string.

        Raises
        ------
        InputError
            When there is no such field.
        """
        return ["" if _is_null(v) else _plain(v) for v in self._column(field)]

    def numbers(self, field: str) -> NDArray[np.float64]:
        """Return a column as numbers (n,); NULL and empty text are NaN. Numbers may come as text, as from CSV.

        Raises
        ------
        InputError
            When there is no such field, or a value is not a number.
        """
        values = np.full(len(self), np.nan)
        for i, value in enumerate(self._column(field)):
            if _is_null(value) or (isinstance(value, str) and not value.strip()):
                continue
            try:
                values[i] = number_of(value) if isinstance(value, str) else float(value)
            except (TypeError, ValueError):
                values[i] = np.nan
            if np.isnan(values[i]):
                raise InputError(f"{self.name}: {value!r} in the field {field} is not a number.")
        return values

    def _column(self, field: str) -> NDArray[Any]:
        for name, column in self.fields.items():
            if name.casefold() == field.casefold():
                return column
        raise InputError(f"{self.name} has no field {field!r}; it has {', '.join(self.fields) or 'none'}.")


def number_of(text: str) -> float:
    """Return the number that a text holds, with a decimal point or a decimal comma; NaN when it holds none.

    >>> number_of(" 12,5 "), number_of("1e3"), number_of("1,234.5")
    (12.5, 1000.0, nan)
    """
    text = text.strip()
    if text.count(",") == 1 and "." not in text:
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        return float("nan")


def read_layer(source: VectorSource) -> Layer:
    """Read a layer or table whole; its own CRS is replaced by the one ``source`` names.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    try:
        meta, ids, wkb, columns = pyogrio.raw.read(source.path, layer=source.layer or None, return_fids=True)
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError, ValueError) as error:
        raise InputError(f"The layer {source.layer} of {source.path} cannot be read: {error}.") from error
    geometry = None if wkb is None else shapely.from_wkb(wkb)
    fields = dict(zip((str(f) for f in meta["fields"]), columns, strict=True))
    name = source.layer or Path(source.path).stem
    return Layer(name, np.asarray(ids), fields, geometry, source.crs or meta.get("crs"))


def in_crs(layer: Layer, crs: str) -> NDArray[Any]:
    """Return the layer's geometries (n,) in ``crs``; z stays as it is.

    Raises
    ------
    InputError
        When the layer has no geometry or no CRS, or no reliable transformation is known.
    """
    if layer.geometry is None:
        raise InputError(f"{layer.name} is a table without geometry: give a layer.")
    if not layer.crs:
        raise InputError(f"The layer {layer.name} has no CRS: set it in the layer's properties.")
    source, target = CRS.from_user_input(layer.crs), CRS.from_user_input(crs)
    if source == target or not len(layer):
        return layer.geometry
    change = transformer(source, target)

    def moved(points: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = change.transform(points[:, 0], points[:, 1])
        return np.column_stack([x, y, points[:, 2:]])

    return np.asarray(shapely.transform(layer.geometry, moved, include_z=bool(shapely.has_z(layer.geometry).any())))


def polygons(source: VectorSource, crs: str) -> list[Any]:
    """Return a layer's polygons in ``crs``, valid and not empty.

    Raises
    ------
    InputError
        When a feature is not a polygon, or none is left.
    """
    layer = read_layer(source)
    shapes = [shapely.make_valid(shapely.force_2d(g)) for g in in_crs(layer, crs) if g is not None and not g.is_empty]
    if not shapes:
        raise InputError(f"The layer {layer.name} has no polygons.")
    if any(shapely.get_dimensions(g) != 2 for g in shapes):
        raise InputError(f"The layer {layer.name} has features that are not polygons.")
    return shapes


def check_destination(path: str) -> None:
    """Refuse, before any work, a layer that could not be written.

    Raises
    ------
    InputError
        When the name does not end in .gpkg or its folder cannot be written to.
    """
    target = Path(path)
    if target.suffix.lower() != ".gpkg":
        raise InputError(f"The layer {path} must be a GeoPackage: give a name that ends in .gpkg.")
    require_writable(path, "layer")


def write_layer(
    path: str,
    layer: str,
    crs: str | None,
    fields: Mapping[str, Sequence[Any] | NDArray[Any]],
    geometry: Sequence[Any] | None,
    kind: str = "Point",
    *,
    modified: str | None = None,
) -> None:
    """Write a GeoPackage layer; None in ``fields`` becomes NULL. ``kind`` is "Point", "Point Z", "MultiPolygon" ...

    A column of numbers with None in it is float; of text, text. A column of nothing but None is float. ``modified`` (such as
    "2024-01-01T00:00:00.000Z") is noted in the file in place of the time, for files that are to be the same every time.
    """
    names, data, masks = list(fields), [], []
    for values in fields.values():
        column, mask = _typed(list(values))
        data.append(column)
        masks.append(mask)
    remove_abandoned(path)
    with whole(path) as part:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": modified})
        try:
            pyogrio.raw.write(
                part,
                geometry=None if geometry is None else np.asarray(shapely.to_wkb(np.asarray(geometry, object), flavor="iso")),
                field_data=data,
                field_mask=masks,
                fields=np.array(names, object),
                geometry_type=None if geometry is None else kind,
                crs=CRS.from_user_input(crs).to_wkt() if crs else None,
                layer=layer,
                driver="GPKG",
                dataset_options={"VERSION": "1.3"},  # 1.4 makes older GDAL, of QGIS 3.22 for one, complain
            )
        except (pyogrio.errors.DataSourceError, pyogrio.errors.FeatureError) as error:
            raise InputError(f"The layer {path} cannot be written ({error}): is there room on its disk?") from error


def _typed(values: list[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    mask = np.array([_is_null(v) for v in values], bool)
    kept = [v for v, empty in zip(values, mask, strict=True) if not empty]
    if kept and all(isinstance(v, str) for v in kept):
        return np.array(["" if m else v for v, m in zip(values, mask, strict=True)], object), mask
    if kept and all(isinstance(v, (bool, np.bool_)) for v in kept):
        return np.array([bool(v) and not m for v, m in zip(values, mask, strict=True)]), mask
    if kept and all(isinstance(v, (int, np.integer)) for v in kept):
        return np.array([0 if m else int(v) for v, m in zip(values, mask, strict=True)], np.int64), mask
    return np.array([np.nan if m else float(v) for v, m in zip(values, mask, strict=True)], float), mask


def _is_null(value: Any) -> bool:
    return value is None or (isinstance(value, (float, np.floating)) and bool(np.isnan(value)))


def _plain(value: Any) -> str:
    if isinstance(value, (float, np.floating)) and float(value).is_integer():
        return str(int(value))
    return str(value).strip()
