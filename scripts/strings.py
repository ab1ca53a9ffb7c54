"""Collect the literal arguments of tr() into i18n/*.ts; translations that stand are kept.

pylupdate files module-level calls under the class they stand in; ``i18n.tr`` looks all of them up under one name.
"""

import ast
import xml.etree.ElementTree as ET
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LANGUAGES = ("fr",)
CONTEXT = "Strandline"


def collect() -> "list[str]":
    """Return every text of the QGIS side once, in the order of files and lines.

    Raises
    ------
    ValueError
        When tr() is given something that cannot be collected.
    """
    found = []
    for top in ("provider", "algorithms", "bridge"):
        for path in sorted((ROOT / top).glob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "tr":
                    (argument,) = node.args
                    if not (isinstance(argument, ast.Constant) and isinstance(argument.value, str)):
                        raise ValueError(f"{path}:{node.lineno}: tr() takes one literal text")
                    found.append((path, node.lineno, node.col_offset, argument.value))
    return list(dict.fromkeys(text for *_, text in sorted(found)))


def merge(path: Path, language: str, texts: "list[str]") -> int:
    """Write ``texts`` to ``path``; return how many have no translation yet."""
    known = {}
    if path.is_file():
        for message in ET.parse(path).iter("message"):
            known[message.findtext("source")] = message.findtext("translation") or ""
    root = ET.Element("TS", version="2.1", language=language, sourcelanguage="en")
    context = ET.SubElement(root, "context")
    ET.SubElement(context, "name").text = CONTEXT
    for text in texts:
        message = ET.SubElement(context, "message")
        ET.SubElement(message, "source").text = text
        translation = ET.SubElement(message, "translation")
        translation.text = known.get(text) or None
        if not translation.text:
            translation.set("type", "unfinished")
    ET.indent(root, " ")
    body = ET.tostring(root, encoding="unicode")
    path.write_text(f'<?xml version="1.0" encoding="utf-8"?>\n<!DOCTYPE TS>\n{body}\n', encoding="utf-8")
    return sum(not known.get(text) for text in texts)


if __name__ == "__main__":
    words = collect()
    for language in LANGUAGES:
        missing = merge(ROOT / "i18n" / f"strandline_{language}.ts", language, words)
        print(f"{language}: {len(words)} texts, {missing} not translated")
