"""Streets done one by one, in whatever order, end as those of a run of the whole block."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from flows.block import texture_block
from tests.pipeline.stages import digests_of, sooner, write_block

pytestmark = pytest.mark.long


@pytest.fixture(scope="module", autouse=True)
def _sooner() -> Iterator[None]:
    with sooner():
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, tuple[str, dict[str, str]]]:
    """A block file, and the digests of its atlas."""
    folder = tmp_path_factory.mktemp("whole")
    block = write_block(folder / "in")
    texture_block(block, folder / "out", workers=1)
    return block, digests_of(folder / "out")


@pytest.mark.parametrize("order", [("s2",), ("s2", "s1", "s3")])
def test_streets_that_were_done_before_those_that_they_wait_for_are_done_again(
    whole: tuple[Path, tuple[str, dict[str, str]]], tmp_path: Path, order: tuple[str, ...]
) -> None:
    block, wanted = whole
    for only in order:
        texture_block(block, tmp_path / "out", workers=1, only=only)
    assert digests_of(tmp_path / "out") != wanted, "a street was done without those that it reads"
    texture_block(block, tmp_path / "out", workers=1)
    assert digests_of(tmp_path / "out") == wanted
    summary = texture_block(block, tmp_path / "out", workers=1)
    assert summary["units_done"] == 0
