"""More units fail than a block allows, a broken exemplar for one: what is current stays, and it is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import zarr

from catalogs.block.reader import read_block
from catalogs.block.settings import replace_settings
from facade_core.atlas.journal import write_record
from facade_core.atlas.store import BRANCH, commit, open_repository
from facade_core.core.errors import BlockFileError
from tasks.engine.outcome import failure_record
from tasks.engine.run import Run
from tasks.engine.store.commits import read_newest_journal
from tasks.publish.task import publish_block
from tests.pipeline.stages import texture, write_block


def fail(run: Run, stage: str, count: int) -> None:
    session = open_repository(run.store).writable_session(BRANCH)
    group = zarr.open_group(session.store)
    records = read_newest_journal(run.store, stage)
    for index, record in enumerate(records[:count]):
        assert record
        digests = {"digests": record["digests"]} if "digests" in record else {}
        write_record(group, stage, index, failure_record(record["unit"], record["key"], ValueError("broken")) | digests)
    commit(session, "broken")


def test_what_is_current_stays_where_too_many_units_failed(tmp_path: Path) -> None:
    block = write_block(tmp_path / "block", texture={"walls": "translate"})
    run = texture(block, tmp_path / "out").run
    out = Path(run.out)
    fail(run, "facades", 4)  # of 6, with 3 streets
    bad = publish_block.fn(run, block)
    assert bad["withheld"].startswith(
        "4 of 9 units failed, more than the block's failed_limit of 20% allows: what is current stays as it was; look at "
    )
    assert Path(bad["outputs"]["report"]).is_file()
    assert str(bad["outputs"]["report"]) in bad["withheld"]
    assert not (out / "current").exists()
    assert "withheld" not in publish_block.fn(
        replace(run, settings=replace_settings(run.settings, failed_limit=0.5)), block
    )
    assert (out / "current").read_text().strip() == Path(bad["outputs"]["report"]).parts[-3]


def test_the_limit_is_a_key_of_the_block_and_changes_no_result(tmp_path: Path) -> None:
    digests = set()
    for number, limit in enumerate((0.2, 0.5)):
        block = read_block(write_block(tmp_path / "block", failed_limit=limit))
        digests.add(block.digest)
        assert block.settings.failed_limit == (0.2, 0.5)[number]
    assert len(digests) == 1
    with pytest.raises(BlockFileError, match="failed_limit"):
        read_block(write_block(tmp_path / "block", failed_limit=1.5))
