"""What is compiled on first use: each part by one of the processes of a machine, and nothing where it was done before."""

from __future__ import annotations

import fcntl
import threading
import time
from pathlib import Path

import pytest

from facade_core import kernel_warmup
from facade_core.core import numba_cache
from tasks.engine.kernel_compilation import compile_kernels_once


@pytest.fixture
def parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Two parts that only note that they were gone through."""
    gone: list[str] = []

    def one() -> None:
        gone.append("one")

    def two() -> None:
        gone.append("two")

    monkeypatch.setattr(kernel_warmup, "WARMUPS", (one, two))
    monkeypatch.setattr(numba_cache, "CACHE_FOLDER", tmp_path)
    return gone


def test_each_part_is_gone_through_once_and_not_again(parts: list[str]) -> None:
    compile_kernels_once()
    compile_kernels_once()
    assert parts == ["one", "two"]


def test_a_part_that_another_process_is_at_is_waited_for_at_the_end(parts: list[str], tmp_path: Path) -> None:
    with (tmp_path / "one.lock").open("a") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        waiting = threading.Thread(target=compile_kernels_once)
        waiting.start()
        while parts != ["two"]:
            time.sleep(0.01)
        assert waiting.is_alive()
        fcntl.flock(other, fcntl.LOCK_UN)
    waiting.join(60)
    assert parts == ["two", "one"]


def test_where_nothing_can_be_kept_nothing_is_compiled_ahead(parts: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba_cache, "CACHE_FOLDER", None)
    compile_kernels_once()
    assert parts == []


def test_the_parts_reach_what_takes_longest_to_compile() -> None:
    from facade_core.facade.layout.statistics import measure_layout
    from facade_core.facade.texture.genetic import _evolve
    from facade_core.street.materials.field_kernels import compute_point_colours

    for part in kernel_warmup.WARMUPS:
        part()
    for kernel in (measure_layout, _evolve, compute_point_colours):
        assert kernel.signatures
