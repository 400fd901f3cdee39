"""What a run says while it goes on and at its end, in a terminal and elsewhere."""

from __future__ import annotations

import io
import json
import logging
from functools import partial
from pathlib import Path

import pytest
from rich.console import Console

from facade_core.core.errors import InputError, MachineError
from flows import step_reporter
from flows.cli.exit_codes import exit_code_and_message
from flows.console import ProgressLines, print_summary
from flows.log_file import MAX_KEPT_LOGS, find_error_log, log_to_run_folder
from tasks.engine.compute.cluster import ClusterGoneError
from tasks.engine.outcome import log_units
from tasks.engine.progress import StageProgress, begin_stage, report_progress


def test_without_a_terminal_stages_and_their_tenths_are_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    lines: list[str] = []
    monkeypatch.setattr(step_reporter, "ProgressLines", lambda: ProgressLines(clock=lambda: now[0]))
    monkeypatch.setattr(step_reporter, "report_steps", partial(step_reporter.report_steps, lines.append))
    with step_reporter.show_progress():
        begin_stage("facades", 200, 100)
        for unit in range(100):
            now[0] += 30.0
            report_progress("facades", 1, 1 if unit == 3 else 0)
        begin_stage("streets", 116)
        report_progress("streets", earlier=115)
        report_progress("streets", 1)
        begin_stage("publish", 1)
        report_progress("publish", 1)
    assert lines == [
        "facades: 200, 100 of them done before",
        "facades: 120 of 200, 1 failed, about 40 min left",
        "facades: 140 of 200, 1 failed, about 30 min left",
        "facades: 160 of 200, 1 failed, about 20 min left",
        "facades: 180 of 200, 1 failed, about 10 min left",
        "facades: 200 of 200, 1 failed, 100 of them done before, in 50 min",
        "streets: 116",
        "streets: 115 of 116",
        "streets: 116 of 116, 115 of them done before, in 0 s",
        "publish: 1",
        "publish: 1 of 1, in 0 s",
    ]


def test_a_repeated_line_has_the_counts_of_its_time() -> None:
    now = [0.0]
    lines = ProgressLines(clock=lambda: now[0])
    assert lines.update(StageProgress("facades", 100, 200, earlier=100)) == "facades: 200, 100 of them done before"
    assert lines.update(StageProgress("pages", 0, 1)) == "pages: 1"
    now[0] = 20.0
    assert lines.describe() == "facades: 100 of 200, 0:00:20 so far; pages: 0 of 1, 0:00:20 so far"
    assert lines.update(StageProgress("facades", 101, 200, failed=1, earlier=100)) is None, "less than a tenth"
    lines.update(StageProgress("pages", 1, 1))
    now[0] = 140.0
    assert lines.describe() == "facades: 101 of 200, 1 failed, 0:02:20 so far", "too few to estimate from"
    now[0] = 160.0
    assert lines.describe() == "facades: 101 of 200, 1 failed, 0:02:40 so far"
    lines.update(StageProgress("facades", 200, 200, failed=1, earlier=100))
    now[0] = 180.0
    assert lines.describe() == "facades: done; on the next step for 0:00:20"
    assert lines.update(StageProgress("pages", 0, 4)) == "pages: 4", "the stage has begun again"
    now[0] = 190.0
    assert lines.update(StageProgress("pages", 1, 4)) == "pages: 1 of 4, about 30 s left"
    now[0] = 300.0
    assert lines.update(StageProgress("pages", 2, 4)) == "pages: 2 of 4, revised: about 2 min left"
    now[0] = 320.0
    assert lines.update(StageProgress("pages", 3, 4)) == "pages: 3 of 4, about 47 s left"


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (InputError("block.yaml: bad\nkey"), 2, "block.yaml: bad key"),
        (PermissionError(13, "Permission denied", "/x/catalog.json"), 2, "/x/catalog.json: Permission denied; mend"),
        (OSError(30, "Read-only file system", "/x/mine.yaml"), 2, "/x/mine.yaml: Read-only file system; mend"),
        (MachineError("facades a: No space left"), 70, "facades a: No space left"),
        (OSError(28, "No space left on device", "/x"), 70, "No space left on device; free some space and run again"),
        (MemoryError(), 70, "free some memory"),
        (ClusterGoneError("the cluster went away"), 75, "the cluster went away"),
        (KeyError("inner"), 70, "stopped by an error of its own (KeyError: 'inner'); where is in "),
    ],
)
def test_the_code_tells_whose_fault_it_is(error: Exception, code: int, says: str) -> None:
    ended, line = exit_code_and_message(error)
    assert ended == code
    assert says in line
    assert len(line.splitlines()) == 1


def test_a_run_has_a_log_with_its_units_and_what_ended_it(tmp_path: Path) -> None:
    before = logging.getLogger("tasks").level
    failed = {"unit": "a/1", "status": "failed", "reason": "bad", "traceback": "Traceback: here"}
    done = {"unit": "a/2", "status": "done", "seconds": {"read": 0.1}, "worker": "two"}

    def run() -> None:
        with log_to_run_folder(tmp_path, file_only=True):
            with log_to_run_folder(tmp_path):
                log_units("facades", [failed, done])
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError) as ended:
        run()
    log_units("facades", [failed])  # of another run
    (path,) = (tmp_path / "logs").iterdir()
    assert path == find_error_log(ended.value)
    assert find_error_log(ZeroDivisionError()) is None  # of no run
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [(line["level"], line.get("unit")) for line in lines] == [
        ("warning", "a/1"),
        ("debug", "a/2"),
        ("error", None),
    ]
    assert lines[0].items() >= {"stage": "facades", "message": "facades a/1 failed: bad"}.items()
    assert lines[0]["traceback"] == failed["traceback"]
    assert lines[1]["worker"] == "two"
    assert lines[2]["traceback"].startswith("Traceback")
    assert "ZeroDivisionError" in lines[2]["traceback"]
    assert logging.getLogger("tasks").level == before
    assert str(path) in exit_code_and_message(ended.value)[1]


def test_the_logs_of_many_nights_are_bounded(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    names = [f"20250101T{number:06d}Z.jsonl" for number in range(MAX_KEPT_LOGS + 10)]
    for name in (*names, "notes.jsonl"):
        (folder / name).touch()
    with log_to_run_folder(tmp_path):
        log_units("facades", [{"unit": "a", "status": "failed", "reason": "bad"}] * 2)
    left = sorted(path.name for path in folder.glob("2*.jsonl"))
    assert len(left) == MAX_KEPT_LOGS
    assert left[:-1] == names[11:], "the newest stay"
    assert (folder / "notes.jsonl").exists()


def test_a_run_that_logs_nothing_leaves_no_log(tmp_path: Path) -> None:
    with log_to_run_folder(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("is_painted", [True, False])
def test_faces_are_not_missed_on_painted_pictures(is_painted: bool) -> None:
    summary = {
        "block": "demo", "facades_done": 3, "seconds": 2.0, "units_skipped": 0, "failures": [], "refused": [],
        "not_looked_at": 2, "outputs": {"report": "r", "glb": [], "items": "i"}, "out": "out/demo",
    }  # fmt: skip
    written = io.StringIO()
    print_summary(Console(file=written, width=200), summary, is_painted=is_painted)
    assert ("not checked for faces and number plates: 2;" in written.getvalue()) == (not is_painted)
    assert written.getvalue().startswith("demo: 3 facades in 2 s, 0 units done before\n")
