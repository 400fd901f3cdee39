"""The flow of one city block: ingest, poses, facades, streets in waves, publish."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

from prefect import flow, get_run_logger
from prefect.futures import PrefectFuture, wait
from prefect.runtime import flow_run
from prefect.states import Completed, State
from prefect.task_runners import ThreadPoolTaskRunner

from catalogs.block import Block, read_block
from catalogs.yaml_files import read_yaml
from flows.artifacts import failed, tell_outcome, tell_progress, tell_viewer
from flows.console import console
from flows.lock import locked
from tasks.compute import Compute, connect
from tasks.demo import NAME, write_demo
from tasks.due import what_is_due
from tasks.exemplars import exemplars_due
from tasks.facades import choose, facades_due
from tasks.fan_out import AT_ONCE, Stage, batches, process_batch
from tasks.ingest import Outline, ingest_block
from tasks.outcome import Outcome
from tasks.poses import poses_due
from tasks.progress import begin_stage
from tasks.publish import publish_block
from tasks.run import Run, run_of
from tasks.standing import nothing_due
from tasks.streets import chosen_streets, texture_street
from tasks.textures import textures_due
from tasks.units.memory import street_memory

# Tasks on their way at once; they only wait for workers, of which a cluster may have many.
THREADS = 64


def flow_run_name() -> str:
    """The block and the date for which the run was scheduled: what the UI lists runs by."""
    block_file = flow_run.parameters.get("block_file")
    name = NAME
    if block_file is not None:
        try:
            name = read_yaml(Path(block_file))["name"]
        except (ValueError, TypeError, KeyError):  # the run itself will say what is wrong with the file
            name = Path(block_file).stem
    return f"{name} {flow_run.scheduled_start_time:%Y-%m-%d %H:%M}"


@flow(
    name="city-block",
    description="Texture a city block: facades, streets, atlas, model and catalogue. Resumes by itself.",
    flow_run_name=flow_run_name,
    task_runner=ThreadPoolTaskRunner(max_workers=THREADS),  # type: ignore[arg-type]
)
def city_block(
    block_file: Path | None = None,
    out: Path | None = None,
    workers: int = 2,
    dask: str | None = None,
    only: str | None = None,
) -> dict[str, Any] | State:
    """Texture the block of `block_file` into `out`; resumes by itself. Returns the run's summary.

    Args:
        block_file: the block; the embedded demo where there is none.
        out: folder for the results; out/NAME of the block file where there is none.
        workers: local processes.
        dask: address of a Dask scheduler to use instead, such as tcp://127.0.0.1:8786.
        only: id or name of the one street to texture; all without.
    """
    out = out or Path("out") / (block_file.stem if block_file else "demo")
    with locked(out):
        source = (block_file or write_demo(out / "input")).resolve()
        block = read_block(source)
        run = run_of(block, out)
        tell_viewer(run)
        summary = nothing_due(run)
        if summary is None:
            with tell_progress(block.name):
                summary = _texture(run, block, source, workers, dask, only)
        tell_outcome(run, summary)
    if summary["failures"]:
        # not Failed: everything else is done and published, and a retry would change nothing
        return Completed(name="UnitsFailed", message=failed(summary), data=summary)
    return summary


def _texture(run: Run, block: Block, source: Path, workers: int, dask: str | None, only: str | None) -> dict[str, Any]:
    # a local cluster starts beside the ingest; one that is named may not be there, which is said at once
    ingest = ingest_block.submit(run, block) if dask is None else None
    with connect(workers, dask, run.out) as compute:
        outline = ingest.result() if ingest else ingest_block(run, block)
        run = replace(run, ingested=outline.ingested)
        if told := what_is_due(run, block, outline):
            console.print(f"streetloom: {told}", highlight=False, markup=False, soft_wrap=True)
        outcome = _process(run, textures_due(run, outline.textured, block.textures), compute)
        outcome += _process(run, poses_due(run, [panorama.path for panorama in block.panoramas]), compute)
        outcome += _process(run, exemplars_due(run, block.exemplars), compute)
        outcome += _facades(run, block, outline, compute)
        outcome += _streets(run, outline, compute, only)
        published = publish_block(run, source)
    outcome += Outcome(failed=tuple((unit, reason) for _, unit, reason in outline.set_aside))
    return published | {
        "out": run.out,
        "units_skipped": outcome.skipped + (1 if outline.skipped else 0),
        "units_done": outcome.done + (0 if outline.skipped else 1),
        "failures": [{"unit": unit, "reason": reason} for unit, reason in outcome.failed],
    }


def _process(run: Run, stage: Stage, compute: Compute) -> Outcome:
    """All batches of a stage, AT_ONCE on their way at a time."""
    if not stage.total:
        return Outcome()
    begin_stage(stage.name, stage.total, stage.skipped)
    outcome = Outcome(skipped=stage.skipped)
    due = list(batches(stage.work, compute))
    submitted: deque[PrefectFuture[Outcome]] = deque()
    for number, batch in enumerate(due, 1):
        if len(submitted) == AT_ONCE:
            outcome += submitted.popleft().result()
        task = process_batch.with_options(name=stage.name)
        submitted.append(task.submit(run, stage.name, f"{number} of {len(due)}", stage.function, batch, compute))
    for future in submitted:
        outcome += future.result()
    _log(stage.name, outcome)
    return outcome


def _facades(run: Run, block: Block, outline: Outline, compute: Compute) -> Outcome:
    imagery = choose(run, block, outline)
    due = facades_due(run, outline.buildings, outline.facades, outline.texels, imagery, block.textures)
    return _process(run, due, compute)


def _streets(run: Run, outline: Outline, compute: Compute, only: str | None) -> Outcome:
    chosen = chosen_streets(run, only)
    waves = [[s for s in wave if chosen is None or s in chosen] for wave in outline.waves]
    begin_stage("viewpoints", sum(outline.viewpoints[s] for wave in waves for s in wave))
    outcome = Outcome()
    network = run.panorama_width**2 // 2 if run.translator == "neural" else 0
    for wave in waves:
        futures = []
        for street in wave:
            memory = street_memory(*outline.windows[street], network=network)
            futures.append(texture_street.submit(run, street, outline.streets[street], memory, compute))
        wait(futures)  # the next wave reads what this one wrote
        outcome = sum((future.result() for future in futures), outcome)
    _log("streets", outcome)
    return outcome


def _log(stage: str, outcome: Outcome) -> None:
    log = get_run_logger()
    log.info("%s: %d done, %d done before, %d failed", stage, outcome.done, outcome.skipped, len(outcome.failed))
    for unit, reason in outcome.failed:
        log.warning("%s: %s failed: %s", stage, unit, reason)
