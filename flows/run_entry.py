"""Start of a run: loads its block, locks its folder, repairs its store and finds whether work is pending.

The command line does this before a server exists, else the flow does; once per process and folder.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from catalogs.block.reader import Block, read_block
from catalogs.published.folders import Folder, local_run_folder
from catalogs.published.snapshot import find_current_snapshot, link_latest
from facade_core.atlas.journal_cache import cache_journals
from facade_core.core.errors import MachineError
from facade_core.core.json_types import JsonObject
from flows.lock import lock_folder
from flows.log_file import log_to_run_folder
from flows.memory import set_malloc_mmap_threshold
from flows.output_folder import check_output_folder
from tasks.engine.outcome import convert_machine_faults, is_damaged_chunk, is_store_fault
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.engine.store.integrity import mark_store_suspect, repair_store
from tasks.engine.store.status import completion_summary, record_run_block_file


@dataclass
class HeldRun:
    """Run that this process holds.

    Attributes
    ----------
    source : block file.
    block : the loaded block.
    run : settings and folders of the run.
    summary : outcome of the run; set at once where nothing is pending, None until the run ends otherwise.
    """

    source: Path
    block: Block
    run: Run
    summary: JsonObject | None = None


# By output folder.
_open_runs: dict[Folder, HeldRun] = {}


@contextmanager
def open_run(
    source: Path,
    out: Folder,
    *,
    notify: Callable[[str], None],
    prepare: Callable[[Run], None] | None = None,
    file_only: bool = False,
) -> Iterator[HeldRun]:
    """Lock and open the run of a block file in a folder; return the open one where this process already holds it.

    Parameters
    ----------
    source : block file.
    out : folder of the results.
    notify : receives one line for each loss and repair of the store.
    prepare : marks units pending again, after the repair of the store.
    file_only : as of `log_to_run_folder`.

    Yields
    ------
    entry : the open run.

    Raises
    ------
    FacadeError
        The block is invalid, another run holds the folder, or the store is damaged beyond repair.
    """
    source, out = source.resolve(), out.resolve()
    if (entry := _open_runs.get(out)) is not None and entry.source == source:
        yield entry
        return
    set_malloc_mmap_threshold()
    check_output_folder(out)
    block = read_block(source)
    run = create_run(block, out)
    with (
        lock_folder(out),
        log_to_run_folder(local_run_folder(out), file_only=file_only),
        handle_store_and_machine_faults(run),
        cache_journals(run.store),
    ):
        record_run_block_file(out, source)
        for line in repair_store(run):
            notify(line)
        if prepare is not None:
            prepare(run)
        _open_runs[out] = entry = HeldRun(source, block, run, completion_summary(run))
        if entry.summary is not None and (current := find_current_snapshot(out)) is not None:
            link_latest(current)  # somebody may have removed it
        try:
            yield entry
        finally:
            del _open_runs[out]


@contextmanager
def handle_store_and_machine_faults(run: Run) -> Iterator[None]:
    """Raise faults of the machine as machine errors; after a fault of the store, the next run checks it."""
    with convert_machine_faults(run.block):
        try:
            yield
        except Exception as error:
            if is_store_fault(error):
                mark_store_suspect(run.folder)
            if is_damaged_chunk(error):
                raise MachineError(
                    f"{run.store}: a chunk is damaged; run again: the next run finds the damage and makes the lost data again"
                ) from error
            raise
