"""A street done again: with the later ones that read its texels, or alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalogs.query.execution import query
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.errors import InputError
from tasks.engine.compute.serial import SerialCompute
from tasks.engine.context import load_run_plan
from tasks.engine.store.commits import read_newest_journal
from tasks.engine.store.digests import find_differing_units
from tasks.publish.task import publish_block
from tasks.stages.streets import task
from tasks.stages.streets.redo import find_streets_to_redo, schedule_street_redo, street_read_write_chunks
from tests.pipeline.stages import digests_of, redone, started, texture


def states(out: Path) -> dict[str, str]:
    return {r["unit"]: r["status"] for r in read_newest_journal(out / "store", "streets") if r}


def test_a_street_done_again_alone_leaves_the_others_stale_until_the_next_run(
    left_to_streets_copy: Path,
) -> None:
    """Of the small block's streets two cross, and the second of these reads what the first writes."""
    block, out = left_to_streets_copy / "in" / "block.yaml", left_to_streets_copy / "out"
    made = texture(block, out)
    digest, before = digests_of(out), started(out)
    first, *others = sorted((r for r in read_newest_journal(out / "store", "streets") if r), key=lambda r: r["wave"])
    later = [r["unit"] for r in others if r["wave"] > 0 and set(r["digests"]) & set(first["digests"])]
    assert later
    assert schedule_street_redo(made.run, first["unit"], only=True) == ([first["unit"]], later)
    assert {unit for unit, state in states(out).items() if state == "stale"} == set(later)
    texture(block, out, only=first["unit"])
    assert {unit for unit, state in states(out).items() if state == "stale"} == set(later)
    assert {unit for stage, unit in redone(before, out) if stage == "streets"} == {first["unit"]}
    publish_block.fn(made.run, block)
    assert set(query(out, where="kind = 'street'")["id"]) == set(later)
    texture(block, out)
    assert set(states(out).values()) == {"done"}
    assert {unit for stage, unit in redone(before, out) if stage == "streets"} == {first["unit"], *later}
    assert digests_of(out) == digest
    publish_block.fn(made.run, block)
    assert query(out, where="kind = 'street'").empty


def test_a_street_that_fails_when_it_is_done_again_leaves_nothing_of_before(
    left_to_streets_copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it had written over an earlier street's texels is no longer taken for theirs."""
    block, out = left_to_streets_copy / "in" / "block.yaml", left_to_streets_copy / "out"
    run = texture(block, out).run
    digest, plan = digests_of(out), load_run_plan(run)
    unit = max((r for r in read_newest_journal(out / "store", "streets") if r), key=lambda r: r["wave"])["unit"]
    street = [one.id for one in plan.streets].index(unit)
    schedule_street_redo(run, unit, only=False)

    def broken(*arguments: Any) -> None:
        raise ValueError("broken")

    with monkeypatch.context() as patch:
        patch.setattr(task, "write_street_texels", broken)
        assert task.texture_street.fn(run, street, unit, 0, SerialCompute()).failed
    group = open_root(open_repository(run.store).readonly_session(BRANCH))
    assert find_differing_units(group, plan) == {}
    assert None in read_newest_journal(out / "store", "streets"), "an earlier street is due again"
    texture(block, out)
    assert digests_of(out) == digest


class Blocked:
    """A plan of three streets in three waves on three charts: each writes its own and reads the one before it."""

    class _Cells:
        @staticmethod
        def chunks(chart: int, chunk: int, gutter: int) -> np.ndarray:
            return np.array([[0, 0, chart]])

    def __init__(self) -> None:
        from types import SimpleNamespace as Value

        self.scene = Value(spec=Value(chunk=128, gutter=2), placement=self._Cells())
        self.streets = tuple(Value(id=name, name=None) for name in "abc")
        self.wave = np.arange(3)
        self.writable = np.array([True, True, True])
        self._shown = ([0], [0, 1], [1, 2])

    def charts_of_street(self, street: int) -> np.ndarray:
        return np.array(self._shown[street])


def test_whoever_reads_what_is_written_again_depends_through_others_too() -> None:
    plan: Any = Blocked()
    assert street_read_write_chunks(plan, 1) == ({"0/0/0", "0/0/1"}, {"0/0/0", "0/0/1"})
    assert find_streets_to_redo(plan, "a").dependants == (1, 2)
    assert find_streets_to_redo(plan, "b").dependants == (2,)
    assert find_streets_to_redo(plan, "c").dependants == ()
    with pytest.raises(InputError, match="no street has the id or name 'd'"):
        find_streets_to_redo(plan, "d")
