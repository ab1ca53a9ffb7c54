"""What tests of both sides share. Nothing here imports QGIS or the engine."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real photographs and surfaces; a test that asks for it fails without it."""
    folder = Path(os.environ.get("STRANDLINE_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.fail(f"the shared data is missing: {folder} (STRANDLINE_DATA names another place)")
    return folder
