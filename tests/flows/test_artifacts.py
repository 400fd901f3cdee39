"""What a run tells the Prefect UI, without a server: the calls are recorded."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from flows import artifacts
from tasks.city.city_log import BlockResult, CityLog


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> dict[str, tuple[Any, str]]:
    """key -> (data, description) of every artifact that is made."""
    made: dict[str, tuple[Any, str]] = {}

    def record(data: Any, *, key: str, description: str, **more: Any) -> None:
        made[key] = (data, description)

    for name in ("create_link_artifact", "create_markdown_artifact", "create_table_artifact"):
        monkeypatch.setattr(artifacts, name, record)
    monkeypatch.setattr(artifacts, "read_newest_journal", lambda store, stage: [])
    return made


def test_the_viewer_is_named_with_its_address_and_command(told: dict[str, tuple[Any, str]], tmp_path: Path) -> None:
    artifacts.publish_viewer_link(cast(Any, SimpleNamespace(out=f"{tmp_path}/my run", block="Große Straße")))
    ((key, (address, description)),) = told.items()
    assert (key, address) == ("gro-e-stra-e-viewer", "http://127.0.0.1:8710/")
    assert f"`streetloom view '{tmp_path}/my run'`" in description


def test_facades_are_a_table_failed_ones_first(told: dict[str, tuple[Any, str]], tmp_path: Path) -> None:
    columns: dict[str, list[Any]] = dict.fromkeys(artifacts.FACADE_COLUMNS, [None] * 3) | {
        "id": ["f1", "f2", "w9"],
        "kind": ["facade", "facade", "building"],
        "status": ["done", "failed", "failed"],
        "reason": [None, "too dark", "no roof"],
        "floors": [4, 5, None],
        "quality": ["good", None, None],
    }
    pq.write_table(pa.table(columns), tmp_path / "items.parquet")
    run = SimpleNamespace(out=str(tmp_path), block="demo", store=tmp_path / "store")
    summary = {
        "facades_done": 1,
        "units_done": 2,
        "units_skipped": 0,
        "failures": [{"unit": "f2", "reason": "too dark"}],
        "refused": [{"unit": "w9", "reason": "no roof"}],
        "outputs": {"report": str(tmp_path / "r.html"), "glb": [], "items": str(tmp_path / "items.parquet")},
    }
    artifacts.publish_outcome(cast(Any, run), summary)
    rows, description = told["demo-facades"]
    assert [(row["id"], row["status"]) for row in rows] == [("f2", "failed"), ("f1", "done")]
    assert [row["quality"] for row in rows] == [None, "good"]
    assert description.startswith("2 facades, failed ones first")
    assert told["demo-failures"][0] == [*summary["failures"], *summary["refused"]]
    assert "http://127.0.0.1:8710/" in told["demo-outputs"][0]


def test_blocks_of_a_city_are_a_table_those_that_want_somebody_first(told: dict[str, tuple[Any, str]]) -> None:
    done = BlockResult(0, summary={"facades_done": 7, "facades_failed": 0, "viewpoints": 3}, seconds=90.0)
    blocks = {
        "x0": done,
        "x1": BlockResult(),
        "x2": BlockResult(70, reason="the disk is full"),
        "x3": BlockResult(1),
        "x4": BlockResult(75),
    }
    artifacts.publish_block_table(CityLog("My town", blocks=blocks))
    rows, description = told["my-town-blocks"]
    assert [row["block"] for row in rows] == ["x2", "x3", "x4", "x1", "x0"]
    assert rows[0]["reason"] == "the disk is full"
    assert (rows[-1]["facades"], rows[-1]["minutes"]) == (7, 1.5)
    assert description == "5 blocks: 1 failed, 1 done in part, 1 left, 1 due, 1 done"
