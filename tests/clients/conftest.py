"""Programs of others that open what is exported: their packages lie where `make clients` puts them; elsewhere tests of them are
skipped."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.programs import PACKAGES


def package(name: str) -> Path:
    """The folder of an installed npm package; skips where it is absent."""
    if not (PACKAGES / name).is_dir():
        pytest.skip(f"the npm package {name} is not installed; `make clients` does that")
    return PACKAGES / name
