"""Start the engine, as ``python -m strandline`` or by the path of this file in a folder of any name."""

import importlib.util
import json
import os
import sys
from pathlib import Path

if sys.version_info < (3, 11):  # noqa: UP036 - whatever the project says, this may be any Python
    # Said as the door expects it, before anything is imported that this Python cannot read.
    _told = "The engine needs Python 3.11 or newer, and {} is {}.{}: run 'Check engine' with INSTALL, or name another Python."
    _text = _told.format(sys.executable, *sys.version_info[:2])
    print(json.dumps({"type": "error", "kind": "MissingDependency", "text": _text}))
    sys.exit(1)

# Work is spread over processes, so each one keeps to a single thread; set before numpy is imported.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

if not __package__:
    # Started by path: give the folder its package name, here and, since they import this file again, in workers.
    _root = Path(__file__).resolve().parent
    sys.path[:] = [p for p in sys.path if p and Path(p).resolve() != _root]
    if "strandline" not in sys.modules:
        _spec = importlib.util.spec_from_file_location(
            "strandline", _root / "__init__.py", submodule_search_locations=[str(_root)]
        )
        _package = importlib.util.module_from_spec(_spec)
        sys.modules["strandline"] = _package
        _spec.loader.exec_module(_package)


def main() -> int:
    """Run the engine's command line."""
    from strandline.core.entry import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
