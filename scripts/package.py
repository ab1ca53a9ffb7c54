"""Make dist/strandline-VERSION.zip: what a QGIS user needs, the same bytes for the same content.

python3 scripts/package.py [FOLDER]
"""

import configparser
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FILES = ("metadata.txt", "__init__.py", "__main__.py", "icon.svg", "requirements.txt", "LICENSE", "README.md")
FOLDERS = ("provider", "algorithms", "bridge", "core", "models", "i18n")
KINDS = (".py", ".model3")
EPOCH = (2020, 1, 1, 0, 0, 0)


def main(folder: Path) -> Path:
    """Write the zip into ``folder`` and return its path."""
    content = {name: (ROOT / name).read_bytes() for name in FILES if (ROOT / name).is_file()}
    for top in FOLDERS:
        for path in (ROOT / top).rglob("*"):
            if path.suffix in KINDS and "__pycache__" not in path.parts:
                content[path.relative_to(ROOT).as_posix()] = path.read_bytes()
    content.update(_translations())
    target = folder / f"strandline-{_version()}.zip"
    folder.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as package:
        for name in sorted(content):
            entry = zipfile.ZipInfo(f"strandline/{name}", EPOCH)
            entry.compress_type, entry.external_attr, entry.create_system = zipfile.ZIP_DEFLATED, 0o644 << 16, 3
            package.writestr(entry, content[name])
    return target


def _version() -> str:
    metadata = configparser.ConfigParser(interpolation=None)
    metadata.read(ROOT / "metadata.txt", encoding="utf-8")
    return metadata["general"]["version"]


def _translations() -> "dict[str, bytes]":
    sources = sorted((ROOT / "i18n").glob("*.ts"))
    tool = shutil.which("lrelease") or shutil.which("lrelease-qt5") or shutil.which("lrelease", path="/usr/lib/qt5/bin")
    if sources and not tool:
        print("lrelease is not installed: the package will speak English only.", file=sys.stderr)
        return {}
    compiled = {}
    with tempfile.TemporaryDirectory() as folder:
        for source in sources:
            words = Path(folder) / f"{source.stem}.qm"
            subprocess.run([str(tool), "-silent", str(source), "-qm", str(words)], check=True)
            compiled[f"i18n/{words.name}"] = words.read_bytes()
    return compiled


if __name__ == "__main__":
    print(main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "dist"))
