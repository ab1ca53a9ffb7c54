"""Imports point one way: provider -> algorithms -> bridge; core imports only core and libraries."""

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
#: What each part of the QGIS side may import from the plugin.
MAY_IMPORT = {
    "provider": {"provider", "algorithms", "bridge", "i18n"},
    "algorithms": {"algorithms", "bridge", "i18n"},
    "bridge": {"bridge", "i18n"},
    "i18n": {"i18n"},
}
#: Besides the standard library.
QGIS_LIBRARIES = {"qgis", "osgeo"}
#: A library, and where alone it may be imported.
RESERVED = {
    "rasterio": ("core/raster.py",),
    "pyogrio": ("core/vector.py",),
    "pycolmap": ("core/tiepoints/", "core/orientation/"),
    "pyceres": ("core/tiepoints/", "core/orientation/"),
}
# Python 3.9 has no list of its modules by version; what the plugin uses of 3.11's is in 3.9's too.
STANDARD = set(getattr(sys, "stdlib_module_names", ()))


def files(*tops):
    return [p for top in tops for p in sorted((ROOT / top).rglob("*.py"))]


def imports(path):
    """Yield (module, line): absolute as written, the plugin's own as "strandline.part..."."""
    package = ("strandline", *path.relative_to(ROOT).parent.parts)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno
        elif isinstance(node, ast.ImportFrom):
            if not node.level:
                yield node.module, node.lineno
                continue
            base = package[: len(package) - node.level + 1]
            names = [node.module] if node.module else [alias.name for alias in node.names]
            for name in names:
                yield ".".join((*base, name)), node.lineno


@pytest.mark.parametrize("part", sorted(MAY_IMPORT))
def test_the_qgis_side_imports_downwards_and_only_qgis_and_the_standard_library(part):
    wrong = []
    for path in files(part):
        for module, line in imports(path):
            words = module.split(".")
            allowed = words[1] in MAY_IMPORT[part] if words[0] == "strandline" else words[0] in STANDARD | QGIS_LIBRARIES
            if not allowed:
                wrong.append(f"{path.relative_to(ROOT)}:{line} imports {module}")
    assert not wrong


def test_core_imports_neither_qgis_nor_the_qgis_side():
    wrong = []
    for path in files("core"):
        for module, line in imports(path):
            words = module.split(".")
            if words[0] in QGIS_LIBRARIES or (words[0] == "strandline" and words[1] != "core"):
                wrong.append(f"{path.relative_to(ROOT)}:{line} imports {module}")
    assert not wrong


@pytest.mark.parametrize("library", sorted(RESERVED))
def test_a_library_stays_in_its_room(library):
    places = RESERVED[library]
    strays = [
        f"{name}:{line}"
        for path in files("core")
        for name in [path.relative_to(ROOT).as_posix()]
        for module, line in imports(path)
        if module.split(".")[0] == library and not name.startswith(places)
    ]
    assert not strays


def test_the_qgis_side_is_python_3_9():
    for path in [ROOT / "__init__.py", *files(*MAY_IMPORT)]:
        ast.parse(path.read_text(encoding="utf-8"), feature_version=(3, 9))


def test_the_entry_can_tell_an_old_python_what_it_needs():
    ast.parse((ROOT / "__main__.py").read_text(encoding="utf-8"), feature_version=(3, 9))


def test_no_pickle_crosses_a_survey():
    strays = [str(p) for p in files("core") for module, _ in imports(p) if module.split(".")[0] in ("pickle", "joblib", "dill")]
    assert not strays


def unready_for_qt6(text):
    """Yield (line, what) for what Qt 6 has no more: enumerators named without their enumeration, ``exec_``, resources of pyrcc.

    QVariant is spared: QGIS gives its types back on Qt 6, and QGIS 3.22 knows no others for its fields.
    """
    tree = ast.parse(text)
    scopes = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Attribute):
            continue
        if node.attr in ("exec_", "print_", "qInitResources"):
            yield node.lineno, node.attr
        owner = node.value.id if isinstance(node.value, ast.Name) else ""
        bare = id(node) not in scopes and id(node) not in called
        if owner.startswith("Q") and owner != "QVariant" and node.attr[:1].isupper() and bare:
            yield node.lineno, f"{owner}.{node.attr}"


def test_the_qgis_side_is_ready_for_qt6():
    wrong = [
        f"{path.relative_to(ROOT)}:{line} {what}"
        for path in [ROOT / "__init__.py", *files(*MAY_IMPORT)]
        for line, what in unready_for_qt6(path.read_text(encoding="utf-8"))
    ]
    assert not wrong


def test_what_is_not_ready_for_qt6_is_seen():
    def seen(text):
        return [what for _, what in unready_for_qt6(text)]

    assert seen("a = Qt.AlignLeft") == ["Qt.AlignLeft"]
    assert seen("dialog.exec_()") == ["exec_"]
    assert seen("x(QgsProcessing.TypeRaster | 1)") == ["QgsProcessing.TypeRaster"]
    assert seen("a = Qt.AlignmentFlag.AlignLeft; QVariant.Int; QgsWkbTypes.Type.Point; Qt.Key(3)") == []
