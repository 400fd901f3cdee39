"""Lost seconds and their causes on a timetable made by hand; the block has the size that the figures are for."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.orchestration.block import write_block
from benchmarks.orchestration.shares import CAUSES, Unit, lost, units_of, window

# Two workers, a stage and a wave. Worker 1 waits for its first unit until 1, from 5 to 8 for the other worker, then both do
# until 10 for orders and Prefect.
UNITS = [
    Unit("facades", "0", 0.0, 8.0, prepare=2.0, io=1.0),
    Unit("facades", "1", 1.0, 5.0),
    Unit("streets", "0", 10.0, 12.0, prepare=0.5),
    Unit("streets", "1", 10.0, 11.0),
    Unit("streets", "1", 11.5, 12.0),
]
SPANS = [
    ("task", 0.0, 8.0),
    ("orders", 8.5, 9.5),
    ("task", 10.0, 12.6),
    ("commit", 11.0, 11.2),
    ("session", 11.2, 11.4),
    ("commit", 12.0, 12.6),
    ("publish", 12.6, 40.0),
]


def test_every_lost_second_has_one_cause() -> None:
    seconds = lost(UNITS, SPANS, 2)
    assert set(seconds) == set(CAUSES)
    assert seconds == pytest.approx(
        # the last commit, 12 to 12.6, keeps both workers waiting
        {
            "plan": 2,
            "state": 0.5,
            "barrier": 3,
            "commit": 0.2 + 2 * 0.6,
            "session": 0.2,
            "orders": 2,
            "dispatch": 1 + 0.1,
            "prefect": 2,
        }
    )
    start, end = window(UNITS, SPANS)
    computed = sum(u.end - u.start - u.prepare for u in UNITS)
    assert sum(seconds.values()) == pytest.approx(2 * (end - start) - computed)


def test_a_worker_without_any_unit_is_lost_whole() -> None:
    more = {cause: after - lost(UNITS, SPANS, 2)[cause] for cause, after in lost(UNITS, SPANS, 3).items()}
    assert sum(more.values()) == pytest.approx(12.6)
    assert more["barrier"] == pytest.approx(8 + 2)


def test_units_of_a_journal(monkeypatch: pytest.MonkeyPatch) -> None:
    def record(unit: str, started: float, **more: object) -> dict[str, object]:
        seconds = {"prepare": 0.5, "render": 1.0, "write": 0.25}
        return {"unit": unit, "status": "done", "worker": "0", "started": started, "seconds": seconds} | more

    journals = {
        "exemplars": [record("brick", 1.0), None],
        "textures": [],
        "facades": [record("f", 3.0), {"unit": "g", "status": "failed"}],
        "viewpoints": [record("a/b/0", 5.0)],
        "streets": [record("a/b", 7.0, wave=2)],
    }
    monkeypatch.setattr("tasks.store.commits.journal", lambda store, stage: journals[stage])
    assert units_of(Path("store")) == [
        Unit("exemplars", "0", 1.0, 2.75, 0.5, 0.25),
        Unit("facades", "0", 3.0, 4.75, 0.5, 0.25),
        Unit("streets", "0", 7.0, 8.75, 0.5, 0.25),
        Unit("streets", "0", 5.0, 6.75, 0.5, 0.25),
    ]


def test_the_block_is_of_the_size_it_is_named_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    from catalogs.block import read_block
    from facade_core.geometry.walls import STREET
    from tasks.stages.planning import plan_of

    monkeypatch.setattr("tasks.examples.demo.EXEMPLARS", 1)
    block = read_block(write_block(tmp_path, quick=False))
    # what panoramas show is coarser; facades and viewpoints are the same
    plan = plan_of(replace(block, texture=replace(block.texture, panorama_width=256)))
    assert 190 <= (plan.facades.role == STREET).sum() <= 230  # with those of parts of buildings
    assert 95 <= len(plan.viewpoints) <= 105
