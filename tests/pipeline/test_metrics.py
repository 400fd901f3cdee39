"""What a monitoring system is told of runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from click.testing import CliRunner
from opentelemetry.proto.collector.metrics.v1.metrics_service_pb2 import ExportMetricsServiceRequest
from prometheus_client.parser import text_string_to_metric_families as parsed

from flows.cli.commands import command_line
from tasks.engine.store.commits import read_newest_journal
from tasks.stages.order import STAGE_NAMES


def test_metrics_are_those_of_the_journal(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    out, summary = undisturbed
    said = CliRunner().invoke(command_line, ["metrics", str(out)], catch_exceptions=False)
    assert said.exit_code == 0
    samples = [sample for family in parsed(said.output) for sample in family.samples]
    told = {
        (sample.labels["stage"], sample.labels["state"]): sample.value
        for sample in samples
        if sample.name == "streetloom_units"
    }
    records = [
        (stage, record) for stage in STAGE_NAMES for record in read_newest_journal(out / "store", stage) if record
    ]
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


@contextmanager
def collector(status: int = 200) -> Iterator[tuple[str, list[tuple[str, bytes]]]]:
    """The address of what listens as a collector does, and path and body of each request that it got."""
    got: list[tuple[str, bytes]] = []

    class Answers(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            got.append((self.path, self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(status)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *said: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Answers) as server:
        thread = Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}", got
        finally:
            server.shutdown()
            thread.join()


def test_a_collector_gets_what_is_printed(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    out, _ = undisturbed
    printed = CliRunner().invoke(command_line, ["metrics", str(out)], catch_exceptions=False).output
    families = {family.name: family for family in parsed(printed)}
    with collector() as (address, got):
        said = CliRunner().invoke(command_line, ["metrics", str(out), "--otlp", address], catch_exceptions=False)
    [(path, body)] = got
    assert path == "/v1/metrics"
    [sent] = ExportMetricsServiceRequest.FromString(body).resource_metrics
    attributes = {one.key: one.value.string_value for one in sent.resource.attributes}
    assert attributes["service.name"] == "streetloom"
    [scope] = sent.scope_metrics
    found = {
        (metric.name, *sorted((one.key, one.value.string_value) for one in point.attributes)): point.as_double
        for metric in scope.metrics
        for point in metric.gauge.data_points
    }
    assert found == {
        (name, *sorted(sample.labels.items())): sample.value
        for name, family in families.items()
        for sample in family.samples
    }
    assert {metric.name: metric.description for metric in scope.metrics} == {
        name: family.documentation for name, family in families.items()
    }
    assert said.output == f"{address}: took {len(found)} values of 1 run\n"


@pytest.mark.parametrize(("status", "why"), [(None, "Connection refused"), (401, "Unauthorized")])
def test_a_collector_that_takes_none_is_told_of_in_one_line(
    undisturbed: tuple[Path, dict[str, Any]], status: int | None, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OTEL_EXPORTER_OTLP_TIMEOUT", "1")
    with collector(status or 200) as (address, _):
        if status is not None:
            said = CliRunner().invoke(command_line, ["metrics", str(undisturbed[0]), "--otlp", address])
    if status is None:  # nobody listens there any more
        said = CliRunner().invoke(command_line, ["metrics", str(undisturbed[0]), "--otlp", address])
    assert said.exit_code == 2
    [line] = said.stderr.splitlines()
    assert line.startswith(f"streetloom: --otlp {address}: takes no metrics (")
    assert why in line


def test_an_address_of_no_collector_is_refused(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    said = CliRunner().invoke(command_line, ["metrics", str(undisturbed[0]), "--otlp", "collector:4318"])
    assert said.exit_code == 2
    assert "such as http://127.0.0.1:4318" in said.stderr


def test_a_folder_without_runs_is_refused(tmp_path: Path) -> None:
    said = CliRunner().invoke(command_line, ["metrics", str(tmp_path)])
    assert said.exit_code == 2
    assert "holds no run" in str(said.exception) or "holds no run" in said.output
