"""Run by the engine's Python: print every step's request and result as JSON."""

import dataclasses
import json
import typing

from strandline.core.contract import RasterSource, VectorSource
from strandline.core.steps import STEP_IDS, load

KINDS = {
    VectorSource: "vector",
    RasterSource: "raster",
    tuple[RasterSource, ...]: "rasters",
    str: "text",
    int: "integer",
    float: "number",
    bool: "switch",
}


def describe(field, hint):
    arguments = typing.get_args(hint)
    optional = type(None) in arguments
    if optional:
        (hint,) = [a for a in arguments if a is not type(None)]
    literal = typing.get_origin(hint) is typing.Literal
    return {
        "kind": "choice" if literal else KINDS.get(hint, str(hint)),
        "choices": list(typing.get_args(hint)) if literal else None,
        "optional": optional,
        "required": field.default is dataclasses.MISSING,
        "default": None if field.default is dataclasses.MISSING else field.default,
    }


def fields(cls):
    hints = typing.get_type_hints(cls)
    return {f.name: describe(f, hints[f.name]) for f in dataclasses.fields(cls)}


print(json.dumps({step: {"request": fields(load(step).Request), "result": fields(load(step).Result)} for step in STEP_IDS}))
