"""The way into a run: its block read, its folder held, its store mended and looked at. It is walked once, by whoever comes
first: the command line, before a server is there, or the flow."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catalogs.block.reader import Block, read_block
from catalogs.published.folders import Folder, local_folder
from facade_core.atlas.journal_cache import cache_journals
from flows.lock import lock_folder
from flows.log_file import log_to
from flows.memory import release_large_allocations
from tasks.engine.outcome import is_store_fault, raise_machine_errors
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.engine.store.integrity import mark_suspect, repair_store
from tasks.engine.store.status import finished_summary, record_source


@dataclass
class OpenRun:
    """A run that this process is in.

    source: its block file.
    summary: what it came to: at once where nothing is due, else when it is done; None before.
    """

    source: Path
    block: Block
    run: Run
    summary: dict[str, Any] | None = None


# By output folder.
_open_runs: dict[Folder, OpenRun] = {}


@contextmanager
def open_run(
    source: Path,
    out: Folder,
    *,
    notify: Callable[[str], None],
    prepare: Callable[[Run], None] | None = None,
    file_only: bool = False,
) -> Iterator[OpenRun]:
    """Enter a run of a block file in a folder, unless this process is in it already; then it goes on as it is.

    tell: is told what was lost and mended, a line each. before: makes units due again, once the store is mended. alone: as of
    `log_to`.
    Raises what `read_block`, `locked` and `mend` raise.
    """
    source, out = source.resolve(), out.resolve()
    if (entry := _open_runs.get(out)) is not None and entry.source == source:
        yield entry
        return
    release_large_allocations()
    block = read_block(source)
    run = create_run(block, out)
    with lock_folder(out), log_to(local_folder(out), file_only=file_only), mark_suspect_on_error(run), cache_journals(run.store):
        record_source(out, source)
        for line in repair_store(run):
            notify(line)
        if prepare is not None:
            prepare(run)
        _open_runs[out] = entry = OpenRun(source, block, run, finished_summary(run))
        try:
            yield entry
        finally:
            del _open_runs[out]


@contextmanager
def mark_suspect_on_error(run: Run) -> Iterator[None]:
    """A fault of the machine ends the run as one, and one of the store is looked into by the next run."""
    with raise_machine_errors(run.block):
        try:
            yield
        except Exception as error:
            if is_store_fault(error):
                mark_suspect(run.folder)
            raise
