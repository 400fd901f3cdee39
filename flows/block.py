"""The flow of one city block: ingest, facades, streets in waves, publish."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from prefect import flow
from prefect.futures import wait
from prefect.task_runners import ThreadPoolTaskRunner

from catalogs.block import Block, read_block
from tasks.compute import Compute, connect
from tasks.exemplars import prepare_exemplars
from tasks.facades import choose, process_facades
from tasks.imagery import imagery_of
from tasks.ingest import Outline, ingest_block
from tasks.outcome import Outcome
from tasks.progress import begin_stage
from tasks.publish import publish_block
from tasks.run import Run, run_of
from tasks.streets import texture_street
from tasks.textures import keep_textures

# Facades in one Prefect task: its overhead is milliseconds, and what a killed task repeats is its unfinished buildings.
BATCH = 24


@flow(
    name="city-block",
    flow_run_name="{block_file.stem}",
    task_runner=ThreadPoolTaskRunner(max_workers=8),  # type: ignore[arg-type]
)
def city_block(block_file: Path, out: Path, workers: int = 2, dask: str | None = None) -> dict[str, Any]:
    """Texture the block of `block_file` into `out`; resumes by itself. Returns the run's summary."""
    block = read_block(block_file)
    run = run_of(block, out)
    with connect(workers, dask) as compute:
        outline = ingest_block(run, block)
        textures = keep_textures(run, outline.textured, block.textures, compute)
        facades = _facades(run, block, outline, compute)
        streets = _streets(run, outline, compute)
        published = publish_block(run)
    aside = Outcome(failed=tuple((unit, reason) for _, unit, reason in outline.set_aside))
    outcome = textures + facades + streets + aside
    return published | {
        "out": str(out),
        "units_skipped": outcome.skipped + (1 if outline.skipped else 0),
        "units_done": outcome.done + (0 if outline.skipped else 1),
        "failures": [{"unit": unit, "reason": reason} for unit, reason in outcome.failed],
    }


def _facades(run: Run, block: Block, outline: Outline, compute: Compute) -> Outcome:
    exemplars = prepare_exemplars(run, block.exemplars, compute)
    chosen = choose(run, block.photos) if run.walls == "exemplar" else {}
    panoramas = [[(block.panoramas[p].path, pose) for p, pose in shown] for shown in outline.panoramas]
    imagery = imagery_of(outline.facades, block.photos, panoramas, outline.own, chosen)
    batches: list[list[tuple[int, ...]]] = [[]]
    for building in outline.buildings:
        if sum(map(len, batches[-1])) >= BATCH:
            batches.append([])
        batches[-1].append(building)
    begin_stage("facades", len(outline.facades))
    futures = [
        process_facades.submit(
            run, f"{i + 1} of {len(batches)}", batch, outline.facades, imagery, block.textures, compute
        )
        for i, batch in enumerate(batches)
        if batch
    ]
    return sum((future.result() for future in futures), exemplars)


def _streets(run: Run, outline: Outline, compute: Compute) -> Outcome:
    begin_stage("viewpoints", sum(outline.viewpoints))
    outcome = Outcome()
    for wave in outline.waves:
        futures = [
            texture_street.submit(run, street, compute, compute.workers[i % len(compute.workers)])
            for i, street in enumerate(wave)
        ]
        wait(futures)  # the next wave reads what this one wrote
        outcome = sum((future.result() for future in futures), outcome)
    return outcome
