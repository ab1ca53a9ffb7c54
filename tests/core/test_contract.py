"""The contract across the door: strict, and the same both ways."""

import json
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pytest
from strandline.core.contract import VectorSource, decode, encode
from strandline.core.errors import InputError
from strandline.core.steps import STEP_IDS, load


@dataclass(frozen=True)
class Inner:
    a: int
    b: float | None = None


@dataclass(frozen=True)
class Outer:
    name: str
    kind: Literal["x", "y"] = "x"
    ratio: float = 0.5
    flag: bool = False
    many: tuple[Inner, ...] = ()
    table: dict[str, Inner] | None = None
    anything: Any = None


def test_there_and_back():
    value = Outer("sand", "y", 2.0, True, (Inner(1), Inner(2, 0.5)), {"k": Inner(3)}, {"free": [1, None]})
    assert decode(Outer, json.loads(json.dumps(encode(value)))) == value


def test_a_whole_number_is_a_number():
    assert isinstance(decode(Outer, {"name": "a", "ratio": 2}).ratio, float)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, "the key name is missing"),
        ({"name": "a", "nme": 1}, "unknown keys nme"),
        ({"name": 1}, "Outer.name: str is expected, not 1"),
        ({"name": "a", "kind": "z"}, "'z' is not one of 'x', 'y'"),
        ({"name": "a", "flag": 1}, "Outer.flag: bool"),
        ({"name": "a", "ratio": True}, "Outer.ratio: float"),
        ({"name": "a", "ratio": "2"}, "Outer.ratio: float"),
        ({"name": "a", "ratio": float("nan")}, "finite"),
        ({"name": "a", "many": [{"a": 1.5}]}, r"Outer.many\[0\].a: int"),
        ({"name": "a", "many": [{"a": True}]}, r"Outer.many\[0\].a: int"),
        ({"name": "a", "many": {}}, "a list is expected"),
        ({"name": "a", "table": {"k": {"a": None}}}, "Outer.table.k.a"),
        ([], "an object is expected"),
    ],
)
def test_what_is_wrong_is_named(data, message):
    with pytest.raises(InputError, match=message):
        decode(Outer, data)


def test_numpy_and_nan():
    assert encode({"a": np.float64(1.5), "b": np.int32(2), "c": math.inf, "d": np.float32("nan"), "e": np.bool_(True)}) == {
        "a": 1.5,
        "b": 2,
        "c": None,
        "d": None,
        "e": True,
    }


def test_what_cannot_cross_is_a_bug():
    with pytest.raises(TypeError, match="cannot cross"):
        encode({"a": object()})


@pytest.mark.parametrize("step", ["createsurvey", "enhance"])
def test_a_step_has_request_result_and_run(step):
    assert step in STEP_IDS
    module = load(step)
    assert callable(module.run)


def test_a_request_of_createsurvey():
    request = decode(load("createsurvey").Request, {"images": "i", "output": "o", "positions": {"path": "p.csv", "layer": "p"}})
    assert request.positions == VectorSource("p.csv", "p")


def test_an_unknown_step():
    with pytest.raises(InputError, match="no step 'fly'"):
        load("fly")
