"""Both ends of the door agree, and what users have saved keeps working."""

import json
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
KEYS = json.loads((HERE / "stable_keys.json").read_text())
#: checkengine's parameters steer the installation, which happens before there is an engine.
WITHOUT_REQUEST = {"checkengine"}
#: What a parameter's type may become in a request.
KINDS = {
    "boolean": {"switch"},
    "enum": {"choice"},
    "string": {"text"},
    "field": {"text"},
    "file": {"text"},
    "crs": {"text"},
    "source": {"vector"},
    "raster": {"raster"},
    "multilayer": {"rasters"},
    "sink": {"text"},
    "rasterDestination": {"text"},
    "fileDestination": {"text"},
    "folderDestination": {"text"},
}


@pytest.fixture(scope="session")
def contract():
    python = ROOT / ".engine" / "bin" / "python"
    told = subprocess.run([python, HERE / "dump_contract.py"], capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    return json.loads(told.stdout)


def steps(qgis):
    return {a.name(): a for a in qgis.providerById("strandline").algorithms() if a.name() in KEYS}


def test_every_step_of_the_engine_has_an_algorithm(qgis, contract):
    assert set(contract) == set(steps(qgis)) == set(KEYS)


@pytest.mark.parametrize("name", sorted(KEYS))
def test_shape(algorithm, name):
    made = algorithm(name)
    assert re.fullmatch("[a-z0-9]+", made.name())
    assert type(made).__module__.endswith(f".algorithms.{name}")
    assert (ROOT / "algorithms" / f"{name}.py").is_file()
    assert made.displayName()
    assert made.shortHelpString()
    assert re.fullmatch("[a-z0-9]+", made.groupId())
    assert made.group()
    assert made.outputDefinitions()
    unexplained = [d.name() for d in made.parameterDefinitions() if len(d.help()) < 10]
    assert not unexplained
    assert all(re.fullmatch("[A-Z0-9_]+", d.name()) for d in (*made.parameterDefinitions(), *made.outputDefinitions()))


@pytest.mark.parametrize("name", sorted(KEYS))
def test_keys_never_change(algorithm, name):
    made = algorithm(name)
    assert {
        "parameters": {d.name(): d.type() for d in made.parameterDefinitions()},
        "outputs": {d.name(): d.type() for d in made.outputDefinitions()},
    } == KEYS[name]


@pytest.mark.parametrize("name", sorted(set(KEYS) - WITHOUT_REQUEST))
def test_parameters_are_the_request(algorithm, contract, name):
    from qgis.core import QgsProcessingParameterDefinition, QgsProcessingParameterNumber

    request = contract[name]["request"]
    made = algorithm(name)  # owns the definitions
    definitions = {d.name().lower(): d for d in made.parameterDefinitions()}
    assert set(definitions) == set(request)
    for key, definition in definitions.items():
        field, kind = request[key], definition.type()
        if kind == "number":
            whole = definition.dataType() == QgsProcessingParameterNumber.Type.Integer
            assert field["kind"] == ("integer" if whole else "number"), key
        else:
            assert field["kind"] in KINDS[kind], key
        if kind == "enum":
            assert definition.usesStaticStrings()
            assert definition.options() == field["choices"], key
        optional = bool(definition.flags() & QgsProcessingParameterDefinition.Flag.FlagOptional)
        assert optional == field["optional"], key
        if not field["required"] and not definition.isDestination():
            assert definition.defaultValue() == field["default"], key


@pytest.mark.parametrize("name", sorted(KEYS))
def test_outputs_are_the_result(algorithm, contract, name):
    made = algorithm(name)
    result = set(contract[name]["result"])
    outputs = {d.name().lower() for d in made.outputDefinitions()}
    written_by_qgis = {d.name().lower() for d in made.destinationParameterDefinitions()}
    assert outputs - result <= written_by_qgis
    if name not in WITHOUT_REQUEST:
        assert result - outputs == set()


@pytest.mark.parametrize("name", sorted(KEYS))
def test_an_instance_is_new_and_equal(algorithm, name):
    first, second = algorithm(name), algorithm(name)
    assert first is not second
    assert first.id() == second.id() == f"strandline:{name}"


def test_version_is_one():
    metadata = (ROOT / "metadata.txt").read_text()
    core = (ROOT / "core" / "__init__.py").read_text()
    version = re.search(r"^version=(.+)$", metadata, re.MULTILINE).group(1)
    assert f'__version__ = "{version}"' in core
    for line in ("hasProcessingProvider=yes", "qgisMinimumVersion=3.22", "qgisMaximumVersion=4.99", "supportsQt6=yes"):
        assert line in metadata.splitlines()
