"""Long work is never silent: steps are repeated, and a city tells what runs between the ends of its blocks."""

from __future__ import annotations

import re
import threading
from dataclasses import asdict
from functools import partial
from pathlib import Path

import pytest

from catalogs.block.reader import read_block
from facade_core.core import numba_cache
from flows import city_progress
from flows.city import _next_result
from flows.city_options import CityOptions
from flows.city_progress import CityProgress
from flows.cli.city import _describe_estimate_use
from flows.cli.first_run import note_first_run, note_large_block
from flows.step_reporter import report_steps, show_progress
from tasks.city.block_counts import BlockCounts
from tasks.city.block_process import block_output_path
from tasks.city.city_log import BlockResult, CityLog
from tasks.city.cost import load_cost_model
from tasks.engine.progress import begin_stage, report_progress
from tests.pipeline.stages import write_block


def test_a_step_is_told_as_it_begins_and_again_while_it_lasts() -> None:
    lines: list[str] = []
    repeated = threading.Event()

    def tell(line: str) -> None:
        lines.append(line)
        if "so far" in line:
            repeated.set()

    with report_steps(tell, interval=0.05) as notify:
        notify("reading the map")
        assert repeated.wait(20)
    assert lines[0] == "reading the map"
    assert lines[1].startswith("reading the map: ")
    lines.clear()
    repeated.clear()
    with report_steps(tell, interval=0.05, announce=False) as notify:
        notify("reading the map")
        assert repeated.wait(20)
    assert lines[0].startswith("reading the map: "), "a short step is not told"


def test_a_long_unit_is_reported_again_while_it_lasts(monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[str] = []
    repeated = threading.Event()

    def tell(line: str) -> None:
        lines.append(line)
        if "1 of 30" in line:
            repeated.set()

    monkeypatch.setattr("flows.step_reporter.report_steps", partial(report_steps, tell, 0.05))
    with show_progress():
        begin_stage("ingest", 30)
        report_progress("ingest", 1)  # less than a tenth
        assert repeated.wait(20)
    assert lines[0] == "ingest: 30"
    assert re.match(r"ingest: 1 of 30, 0:00:\d\d so far$", lines[-1])


def city_log_with(names: str) -> CityLog:
    counts = asdict(BlockCounts(100, 50, 20, 10, 5.0, megapixels=1.0))
    return CityLog("town", blocks={n: BlockResult() for n in names}, told={n: counts for n in names})


def test_progress_names_what_runs_and_what_is_left(tmp_path: Path) -> None:
    now = [0.0]
    log = city_log_with("abcd")
    progress = CityProgress(tmp_path, log, list("abcd"), CityOptions(at_once=1), clock=lambda: now[0])
    progress.running += ["a", "b"]
    printed = block_output_path(tmp_path, "b")
    printed.parent.mkdir()
    printed.write_text("streetloom: first\nstreetloom: streets: 10 of 69, about 20 s left\n")
    now[0] = 300.0
    done = round(100 * load_cost_model().counted.facades)
    progress.end_block("a", log.with_result("a", BlockResult(0, summary={"facades_done": done})))
    line = progress.describe()
    assert f"1 of 4 blocks, {done} of about 4" in line
    assert "running b (streets: 10 of 69, about 20 s left)" in line
    assert re.search("about 1[45] min left", line), "three more blocks at the pace of the first"


def test_a_city_tells_its_progress_while_it_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from concurrent.futures import Future
    from queue import SimpleQueue

    lines: list[str] = []
    monkeypatch.setattr("flows.city.PROGRESS_INTERVAL_S", 0.02)
    ended: SimpleQueue[tuple[str, Future[BlockResult]]] = SimpleQueue()
    future: Future[BlockResult] = Future()

    def tell(line: str) -> None:
        lines.append(line)
        if len(lines) == 2:
            ended.put(("a", future))

    monkeypatch.setattr("flows.city.print_status", tell)
    progress = CityProgress(tmp_path, city_log_with("a"), ["a"], CityOptions(), running=["a"])
    assert _next_result(ended, progress) == ("a", future)
    assert all("running a" in line for line in lines)
    assert city_progress.PROGRESS_INTERVAL_S <= 30


def test_a_large_block_is_told_to_be_a_city(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_block(tmp_path)
    block = read_block(file)
    note_large_block(block, file, 2)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("flows.cli.first_run.MAX_BLOCK_FACADES", 5)
    note_large_block(block, file, 2)
    (line,) = capsys.readouterr().err.splitlines()
    assert re.match(r"streetloom: about \d+ facades, \d+ s with 2 workers; above 5 facades use `streetloom city ", line)


def test_a_first_run_tells_that_it_compiles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(numba_cache, "CACHE_FOLDER", tmp_path)
    note_first_run()
    assert "compiling kernels, first run only" in capsys.readouterr().err
    (tmp_path / f"compiled-{numba_cache.code_digest('facade_core.kernel_warmup')}").touch()
    note_first_run()
    assert capsys.readouterr().err == ""


def test_a_run_tells_its_share_of_the_estimate() -> None:
    used = _describe_estimate_use({"processor_hours": 0.5, "processor_hours_taken": 0.25})
    assert used == "15 min of one processor, 50% of the 30 min that were estimated"
