"""The Prefect server of a run that does not start, or ends in the middle: the run needs none to finish what it does."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from flows.server import startup as server_module
from flows.server.startup import ServerDownError, provide_prefect_server
from tests.pipeline.runs import PATIENCE_S, ROOT, command, environment
from tests.pipeline.stages import digests_of
from tests.pipeline.test_cluster import wait_until

FULL = "print('x'); raise OSError('database or disk is full')"


@pytest.mark.parametrize(
    ("code", "says"), [(FULL, "OSError: database or disk is full; its log is "), ("", "it ended; its log is ")]
)
def test_a_server_that_dies_at_its_start_says_why_at_once(
    code: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    monkeypatch.setattr(server_module, "server_command", lambda port: [sys.executable, "-c", code])
    with provide_prefect_server(tmp_path / "prefect") as record, pytest.raises(ServerDownError) as down:
        record.wait_until_ready()
    assert str(down.value).startswith(says)
    assert len(str(down.value).splitlines()) == 1


def test_a_server_ends_where_its_guard_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    monkeypatch.setattr(
        server_module, "server_command", lambda port: [sys.executable, "-c", "import time; time.sleep(600)"]
    )
    with provide_prefect_server(tmp_path / "prefect") as record:
        assert record.guard is not None
        guard = psutil.Process(record.guard.pid)

        def own_program() -> bool:
            """Whether its child is no copy of the guard any more."""
            return [child.cmdline() for child in guard.children()] == [server_module.server_command(0)]

        wait_until(own_program)
        children = guard.children()
        record.guard.kill()
        assert psutil.wait_procs(children, timeout=PATIENCE_S)[1] == []


def test_a_server_of_the_users_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PREFECT_API_URL", "http://127.0.0.1:9/api")
    monkeypatch.setattr(server_module, "ANSWER_S", 0)
    with (
        provide_prefect_server(tmp_path) as record,
        pytest.raises(ServerDownError, match=r"^http://127.0.0.1:9/api does not answer$"),
    ):
        record.wait_until_ready()


@pytest.mark.long
def test_the_server_killed_while_a_street_is_done_again(pictured_copy: Path, tmp_path: Path) -> None:
    """The real command: what is asked before the server is there, its loss, and what the run then says, publishes and logs."""
    block, out = pictured_copy / "in" / "block.yaml", pictured_copy / "out"
    digest = digests_of(out)[0]
    with (tmp_path / "said").open("w+") as said:
        process = subprocess.Popen(
            [*command(block, out, 1), "--redo", "street 1"],
            cwd=ROOT,
            env=environment(tmp_path),
            stdout=subprocess.PIPE,
            stderr=said,
            text=True,
        )
        while "streets: " not in (tmp_path / "said").read_text() and process.poll() is None:
            time.sleep(0.05)
        (guard,) = [p for p in psutil.Process(process.pid).children() if "-c" in p.cmdline()]
        (prefect,) = guard.children()
        prefect.kill()
        printed, _ = process.communicate(timeout=PATIENCE_S)
        said.seek(0)
        lines = said.read().splitlines()
    assert (process.returncode, printed[:1]) == (0, "{"), lines
    summary = json.loads(printed)
    assert summary["failures"] == []
    assert summary["units_done"] > 0
    assert summary["atlas_digest"] == digest
    assert lines[0].startswith("streetloom: doing street s1 again")
    assert [line for line in lines if "Prefect" in line] == [
        f"streetloom: the Prefect server was lost (it ended; its log is {out}/prefect/server.log); "
        "the run continues without it, and its record there is incomplete"
    ]
    assert all(line.startswith("streetloom: ") for line in lines), lines
    assert (out / "published" / (out / "current").read_text().strip()).is_dir()
    (log,) = (out / "logs").iterdir()
    logged = [json.loads(line) for line in log.read_text().splitlines()]
    assert {line["unit"] for line in logged if line.get("stage") == "streets"} == {"s1"}
    assert {line["logger"] for line in logged if line["level"] == "warning"} == {"flows.artifacts"}
