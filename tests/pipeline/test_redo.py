"""A street done again: it alone, and what it changes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from catalogs.block.reader import read_block
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.errors import InputError
from tasks.engine.compute.serial import SerialCompute
from tasks.engine.context import load_run_plan
from tasks.engine.fan_out import process_batch
from tasks.engine.run_key import create_run
from tasks.engine.store.commits import read_newest_journal
from tasks.engine.store.digests import find_differing_units
from tasks.stages.streets.redo import find_streets, schedule_street_redo
from tasks.stages.streets.stage import STREETS
from tests.pipeline.stages import digests_of, redone, started, texture, write_block


def states(out: Path) -> dict[str, str]:
    return {r["unit"]: r["status"] for r in read_newest_journal(out / "store", "streets") if r}


def test_a_street_done_again_is_as_it_was_and_nothing_else_is_done(pictured_copy: Path) -> None:
    """Streets 1 and 2 cross: neither depends on the other."""
    block, out = pictured_copy / "in" / "block.yaml", pictured_copy / "out"
    run = create_run(read_block(block), out)
    digest, before = digests_of(out), started(out)
    assert schedule_street_redo(run, "street 1") == ["s1"]
    assert set(states(out)) == {"s2", "s3"}
    made = texture(block, out)
    assert (made.said or "").startswith("pending: 1 of 3 streets (new), ")
    assert redone(before, out) == {("streets", "s1")}
    assert set(states(out).values()) == {"done"}
    assert digests_of(out) == digest


def test_a_street_that_fails_when_it_is_done_again_leaves_nothing_of_before(pictured_copy: Path) -> None:
    block_file, out = pictured_copy / "in" / "block.yaml", pictured_copy / "out"
    block = read_block(block_file)
    run = create_run(block, out)
    digest, plan = digests_of(out), load_run_plan(run)
    schedule_street_redo(run, "s1")
    group = open_root(open_repository(run.store).readonly_session(BRANCH))
    [unit] = [unit for unit in STREETS.list_units(run, block, plan, group) if unit.name == "s1"]

    def broken(*_: Any) -> None:
        raise ValueError("broken")

    assert process_batch.fn(run, "streets", "1", broken, [[unit]], SerialCompute()).failed
    assert states(out)["s1"] == "failed"
    group = open_root(open_repository(run.store).readonly_session(BRANCH))
    assert find_differing_units(group, plan) == {}
    texture(block_file, out)
    assert digests_of(out) == digest


def test_a_street_is_named_by_its_id_or_name(pictured: Path) -> None:
    block = read_block(pictured / "in" / "block.yaml")
    plan = load_run_plan(create_run(block, pictured / "out"))
    assert find_streets(plan, "s3") == find_streets(plan, "street 3") != find_streets(plan, "s1")
    with pytest.raises(InputError, match=r"no street has the id or name 'street 4'; there is 'street [123]' among 3"):
        find_streets(plan, "street 4")


def test_a_street_of_other_inputs_is_not_done_again_alone(pictured_copy: Path) -> None:
    block = write_block(pictured_copy / "in", texture={"walls": "translate", "texels_per_metre": 4})
    run = create_run(read_block(block), pictured_copy / "out")
    with pytest.raises(InputError, match="changed since it was made; run it without --redo first"):
        schedule_street_redo(run, "s1")
