"""The compilation cache of a user who can write neither the installation nor a home."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

from facade_core.core import numba_cache


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "file").touch()
    monkeypatch.setattr(numba_cache, "PACKAGE_FOLDER", tmp_path / "file")  # nothing can be created below a file
    monkeypatch.setattr(numba_cache._CONFIG, "CACHE_DIR", "")
    monkeypatch.setenv("HOME", str(tmp_path / "file"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path / f"streetloom-kernels-{os.getuid()}"


def test_a_private_temporary_folder_is_the_last_resort(temporary: Path) -> None:
    found = numba_cache.find_cache_folder()
    assert found is not None
    assert found.parent == temporary
    assert temporary.stat().st_mode & 0o777 == 0o700


def test_without_a_home_it_is_used_too(temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", no_home)
    found = numba_cache.find_cache_folder()
    assert found is not None
    assert found.parent == temporary


@pytest.mark.parametrize("kind", ["open", "link", "file"])
def test_a_folder_that_another_user_could_have_made_is_not_used(kind: str, temporary: Path) -> None:
    if kind == "open":
        temporary.mkdir()
        temporary.chmod(0o777)
    elif kind == "link":
        (temporary.parent / "elsewhere").mkdir(mode=0o700)
        temporary.symlink_to(temporary.parent / "elsewhere")
    else:
        temporary.touch()
    assert numba_cache.find_cache_folder() is None


def test_without_any_folder_kernels_are_compiled_and_not_cached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba_cache, "CACHE_FOLDER", None)

    @numba_cache.njit(cache=True)
    def next_number(number: int) -> int:
        return number + 1

    assert next_number(1) == 2
