"""What a monitoring system is told of runs."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from prometheus_client.parser import text_string_to_metric_families as parsed

from flows.cli.commands import main
from tasks.kinds.order import STAGES
from tasks.store.commits import journal


def test_metrics_are_those_of_the_journal(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    out, summary = undisturbed
    said = CliRunner().invoke(main, ["metrics", str(out)], catch_exceptions=False)
    assert said.exit_code == 0
    samples = [sample for family in parsed(said.output) for sample in family.samples]
    told = {
        (sample.labels["stage"], sample.labels["state"]): sample.value
        for sample in samples
        if sample.name == "streetloom_units"
    }
    records = [(stage, record) for stage in STAGES for record in journal(out / "store", stage) if record]
    assert Counter(told) == Counter((stage, record["status"]) for stage, record in records)
    assert told["facades", "failed"] == 0, "it is there before anything failed"
    assert told["facades", "done"] == summary["facades_done"]
    seconds = sum(sample.value for sample in samples if sample.name == "streetloom_unit_seconds")
    assert seconds == pytest.approx(sum(sum(record.get("seconds", {}).values()) for _, record in records))
    values = {sample.name: sample.value for sample in samples}
    assert values["streetloom_store_bytes"] > 10_000
    assert values["streetloom_snapshots"] > 1
    assert values["streetloom_published"] == 1
    assert {sample.labels["run"] for sample in samples} == {out.name}


def test_a_folder_without_runs_is_refused(tmp_path: Path) -> None:
    said = CliRunner().invoke(main, ["metrics", str(tmp_path)])
    assert said.exit_code == 2
    assert "holds no run" in str(said.exception) or "holds no run" in said.output
