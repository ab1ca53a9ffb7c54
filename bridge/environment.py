"""The environment of the engine: the user's, without what QGIS put there for itself.

QGIS points PROJ, GDAL, Qt and Python at its own files. The engine's packages bring their own, and fail or crash on
another version's.
"""

import ntpath
import os
from collections.abc import Mapping
from typing import Dict

_PREFIXES = ("PROJ_", "GDAL_", "OGR_", "CPL_", "PYTHON", "QT_", "DYLD_", "OSGEO4W_")
_NAMES = ("LD_LIBRARY_PATH", "LD_PRELOAD", "SSL_CERT_FILE", "GEOTIFF_CSV", "VIRTUAL_ENV")


def cleaned(environment: Mapping[str, str]) -> Dict[str, str]:
    """Return ``environment`` as the engine may see it; proxies, temporary folders and the rest of PATH stay."""
    kept = {k: v for k, v in environment.items() if not k.upper().startswith(_PREFIXES) and k.upper() not in _NAMES}
    root = next((v for k, v in environment.items() if k.upper() == "OSGEO4W_ROOT"), "")
    for name in [k for k in kept if k.upper() == "PATH"]:
        places = kept[name].split(os.pathsep)
        kept[name] = os.pathsep.join(p for p in places if not _belongs_to_qgis(p, root))
    return kept


def _belongs_to_qgis(place: str, root: str) -> bool:
    folder = ntpath.normcase(ntpath.normpath(place))
    if root and (folder + "\\").startswith(ntpath.normcase(ntpath.normpath(root)) + "\\"):
        return True
    return "osgeo4w" in folder or ".app\\contents\\macos" in folder
