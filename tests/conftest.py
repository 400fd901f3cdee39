"""Shared fixtures: the data folder for tests of real data, and one whole run that many tests look at."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from tests.pipeline.runs import run, write_block

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real data; skips with the reason where it is absent."""
    folder = Path(os.environ.get("STREETLOOM_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no data folder at {folder}; set STREETLOOM_DATA")
    return folder


@pytest.fixture(scope="session")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_block(tmp_path_factory.mktemp("block"))


@pytest.fixture(scope="session")
def undisturbed(block: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """One whole run with two workers that nothing disturbs."""
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    return out, run(block, out, workers=2)
