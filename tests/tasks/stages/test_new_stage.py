"""A stage as docs/how-to/stage.md has it: its inputs, a function of them, what is written, and an entry in the order."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from icechunk import ForkSession

from catalogs.block import read_block
from facade_core.atlas.journal import journal_path, read_journal
from facade_core.atlas.store import open_root
from facade_core.atlas.stored_files import PICTURES, digest_stored_file, write_stored_file
from tasks.engine import stage as engine
from tasks.engine.compute.connect import SerialCompute
from tasks.engine.fan_out import process_batch
from tasks.engine.inputs import INPUTS_PENDING, SETTINGS_CHANGED, input_field
from tasks.engine.pending import find_pending_units
from tasks.engine.pending_reasons import pending_reasons
from tasks.engine.stage import Stage, UnitOutline
from tasks.engine.store.commits import commit_units, fork_store, open_newest_root
from tasks.engine.store.integrity import find_lost_units
from tasks.engine.unit import Unit
from tasks.stages import order
from tasks.stages.shared.scene_view import StoredCharts, store_charts
from tests.pipeline import stages as whole_runs
from tests.pipeline.stages import texture, write_block


@dataclass(frozen=True)
class MeanInputs:
    charts: StoredCharts = input_field(INPUTS_PENDING)
    digits: int = input_field(SETTINGS_CHANGED)
    page: int = field(default=0)


def compute_mean(inputs: MeanInputs) -> float:
    return round(float(np.mean(inputs.charts.store["atlas/colour"][inputs.page])), inputs.digits)


def write_mean(atlas: Any, unit: Unit[MeanInputs], result: float) -> dict[str, object]:
    path, data = f"{PICTURES}/mean-{unit.inputs.page}", str(result).encode()
    write_stored_file(atlas.group, path, data, "mean colour of a page")
    return {"mean": result, "files": {path: digest_stored_file(data)}}


def mean_stage(digits: int) -> Stage:
    def inputs(run: Any, block: Any, plan: Any, group: Any) -> list[Unit[MeanInputs]]:
        records = read_journal(group, "pages")
        keys = {f"{number:016x}": str(records[0] and records[0]["key"]) for number in plan.ids.tolist()}
        charts = store_charts(run, plan, range(len(plan.ids)), keys)
        return [Unit(0, "0000", MeanInputs(charts, digits), memory=10**6)]

    outline = [UnitOutline("0000")]
    return Stage("means", "mean", lambda block, plan: outline, inputs, compute_mean, write_mean, forecast=None)


@pytest.fixture
def means(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The stage among the others, with the code of the pages: a stage has a folder, and this one is in a test."""
    digest = engine.stage_code_digest
    stages = [mean_stage(1), mean_stage(2)]
    in_order = (*order.STAGES_IN_ORDER, stages[0])
    for module in (order, whole_runs):
        monkeypatch.setattr(module, "STAGES_IN_ORDER", in_order)
    monkeypatch.setattr(engine, "stage_code_digest", lambda stage: digest("pages" if stage == "means" else stage))
    engine.all_stages.cache_clear()
    yield stages
    engine.all_stages.cache_clear()


def test_a_new_stage_runs_resumes_and_is_repaired(means: list[Stage], tmp_path: Path) -> None:
    block_file = write_block(tmp_path / "in", buildings={"a": (0, 0, 20, 10, 8.0)}, streets={"1": [(-5, -5), (25, -5)]})
    run = texture(block_file, tmp_path / "out").run
    block, (first, finer) = read_block(block_file), means
    assert journal_path("means") in open_newest_root(run)
    group = open_newest_root(run)
    (record,) = read_journal(group, "means")
    assert record is not None
    assert record["status"] == "done"
    assert not find_pending_units(run, block, first).pieces, "it is done"
    due = find_pending_units(run, block, finer)
    (unit,) = due.pieces[0]
    assert pending_reasons([record], [unit]) == {0: "block's settings changed"}
    outcome = process_batch.fn(run, "means", "1", finer.function, due.pieces, SerialCompute())
    assert (outcome.done, outcome.failed) == (1, ())
    session, fork = fork_store(run.store)
    _lose_file(fork)
    commit_units(session, fork, "means", {}, "lost")
    session, _ = fork_store(run.store)
    assert find_lost_units(session) == {"means": [0]}


def _lose_file(fork: ForkSession) -> None:
    del open_root(fork)[f"{PICTURES}/mean-0"]
