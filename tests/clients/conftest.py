"""Exports that programs of others open, each made once; what `make clients` has not installed is skipped with the reason."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from benchmarks.programs import MissingProgramError
from tasks.export.formats import export_run

Exported = Callable[..., Path]


@contextmanager
def present() -> Iterator[None]:
    """Skips where a program is absent."""
    try:
        yield
    except MissingProgramError as absent:
        pytest.skip(str(absent))


def first(folder: Path) -> Path:
    """The file of an export to open first."""
    return folder / json.loads((folder / "export.json").read_text())["files"][0]


@pytest.fixture(scope="session")
def exported(undisturbed: tuple[Path, dict[str, Any]], common: Path) -> Exported:
    """The folder of an export of the whole run: made by whichever process of the suite asks first, and changed by none."""

    def one(style: str, **options: Any) -> Path:
        if options.get("textures") == "ktx2":
            pytest.importorskip("alktx2", reason="no encoder of KTX2; `make ktx2-setup` installs it")
        name = "-".join([style, *map(str, options.values())])
        with (common / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            folder = common / "exports" / name
            if not folder.is_dir():
                export_run(undisturbed[0], style, folder, **options)
            return folder

    return one


@pytest.fixture(params=["jpeg", "webp", "ktx2", "factored"], scope="module")
def textures(request: pytest.FixtureRequest) -> str:
    return str(request.param)
