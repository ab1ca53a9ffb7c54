"""The contract across the door: JSON objects to frozen dataclasses and back, strictly.

A step's request is a frozen dataclass whose fields are the algorithm's parameter keys in lower case; its
result likewise holds the output keys. Nothing unknown is accepted, nothing missing is guessed.
"""

from __future__ import annotations

import dataclasses
import math
import types
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from .errors import InputError

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class VectorSource:
    """A vector layer or table in a file; ``crs`` is the layer's own as WKT2 (None for a table)."""

    path: str
    layer: str
    crs: str | None = None


@dataclasses.dataclass(frozen=True)
class RasterSource:
    """A raster file; ``crs`` is what the user's layer says (WKT2), None to take the file's.

    Of a raster among several also the layer's ``name``, and its ``date`` (ISO 8601) where its temporal range is set.
    """

    path: str
    crs: str | None = None
    name: str | None = None
    date: str | None = None


def decode(cls: type[T], data: Any) -> T:
    """Return the dataclass ``cls`` made from the JSON object ``data``.

    Raises
    ------
    InputError
        When a key is unknown or missing or a value has the wrong type or is not among the choices.
    """
    value: T = _dataclass(cls, data, cls.__name__)
    return value


def encode(value: Any) -> Any:
    """Return ``value`` (dataclasses, mappings, sequences, scalars) as JSON data; NaN and infinity become None."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: encode(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(k): encode(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [encode(v) for v in value]
    if hasattr(value, "item") and not isinstance(value, (str, bytes)):  # a numpy scalar
        return encode(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError(f"{type(value).__name__} cannot cross the door")


def _dataclass(cls: Any, data: Any, where: str) -> Any:
    if not isinstance(data, dict):
        raise InputError(f"{where}: an object is expected, not {data!r}.")
    fields = {f.name: f for f in dataclasses.fields(cls)}
    unknown = sorted(set(data) - set(fields))
    if unknown:
        raise InputError(f"{where}: unknown keys {', '.join(unknown)}; known are {', '.join(fields)}.")
    hints = get_type_hints(cls)
    values = {}
    for name, field in fields.items():
        if name in data:
            values[name] = _value(hints[name], data[name], f"{where}.{name}")
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise InputError(f"{where}: the key {name} is missing.")
    return cls(**values)


def _value(hint: Any, data: Any, where: str) -> Any:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        if data is None and type(None) in arguments:
            return None
        (hint,) = [a for a in arguments if a is not type(None)]
        return _value(hint, data, where)
    if origin is Literal:
        if data not in arguments:
            raise InputError(f"{where}: {data!r} is not one of {', '.join(map(repr, arguments))}.")
        return data
    if origin is tuple:
        if not isinstance(data, list):
            raise InputError(f"{where}: a list is expected, not {data!r}.")
        return tuple(_value(arguments[0], item, f"{where}[{i}]") for i, item in enumerate(data))
    if origin is dict:
        if not isinstance(data, dict):
            raise InputError(f"{where}: an object is expected, not {data!r}.")
        return {k: _value(arguments[1], v, f"{where}.{k}") for k, v in data.items()}
    if dataclasses.is_dataclass(hint):
        return _dataclass(hint, data, where)
    if hint is Any:
        return data
    if hint is float and isinstance(data, int) and not isinstance(data, bool):
        return float(data)
    if not isinstance(data, hint) or (hint is int and isinstance(data, bool)):
        raise InputError(f"{where}: {hint.__name__} is expected, not {data!r}.")
    if isinstance(data, float) and not math.isfinite(data):
        raise InputError(f"{where}: a finite number is expected, not {data!r}.")
    return data
