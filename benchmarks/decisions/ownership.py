"""0003: writes that two writers of one shard, or of one chunk, lose without an error."""

from __future__ import annotations

import multiprocessing
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from benchmarks.timing import figures
from facade_core.atlas.store import commit, open_repository
from facade_core.core.errors import StoreError

CHUNK = 64
SIDE = 4  # chunks along a side of the array, which is one shard


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Share of writes kept when two processes write disjoint chunks side by side, and when two forks write one chunk."""
    rounds = 10 if quick else 40
    with tempfile.TemporaryDirectory() as folder:
        return {
            "rounds": rounds,
            "two_processes_disjoint_chunks": {
                "sharded_kept": _processes(Path(folder) / "sharded", rounds, shard=True),
                "unsharded_kept": _processes(Path(folder) / "unsharded", rounds, shard=False),
            },
            "two_writers_of_one_chunk": _forks(Path(folder) / "forks", rounds),
        }


def _processes(store: Path, rounds: int, *, shard: bool) -> float:
    """Share of the chunks that hold what their process wrote last, over all rounds."""
    side = CHUNK * SIDE
    array = zarr.create_array(
        store, shape=(side, side), chunks=(CHUNK, CHUNK), shards=(side, side) if shard else None, dtype="uint16"
    )
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(3)
    writers = [context.Process(target=_write_every_other, args=(str(store), w, rounds, barrier)) for w in range(2)]
    for writer in writers:
        writer.start()
    kept = 0
    for number in range(1, rounds + 1):
        barrier.wait()  # both begin
        barrier.wait()  # both are done
        kept += int((np.asarray(array[::CHUNK, ::CHUNK]) == number).sum())
        barrier.wait()  # counted
    for writer in writers:
        writer.join()
    return figures(kept / (rounds * SIDE * SIDE))


def _write_every_other(store: str, writer: int, rounds: int, barrier: Any) -> None:
    array = zarr.open_array(store, mode="r+")
    for number in range(1, rounds + 1):
        barrier.wait()
        for chunk in range(writer, SIDE * SIDE, 2):
            row, column = (CHUNK * i for i in divmod(chunk, SIDE))
            array[row : row + CHUNK, column : column + CHUNK] = number
        barrier.wait()
        barrier.wait()


def _forks(store: Path, rounds: int) -> dict[str, Any]:
    """Two writers of different texels of one chunk: forks of one session merged, and sessions committed in turn."""
    repository = open_repository(store, create=True)
    session = repository.writable_session("main")
    zarr.group(store=session.store).create_array("a", shape=(rounds, CHUNK), chunks=(1, CHUNK), dtype="uint8")
    commit(session, "array")

    def texel(store: Any, number: int, writer: int) -> None:
        group: Any = zarr.open_group(store)
        group["a"][number, writer] = 1

    for number in range(rounds):
        session = repository.writable_session("main")
        forks = [session.fork(), session.fork()]
        for writer, fork in enumerate(forks):
            texel(fork.store, number, writer)
        session.merge(*forks)
        commit(session, f"merged {number}")
    final: Any = zarr.open_group(repository.readonly_session("main").store, mode="r")
    merged = figures(float(np.asarray(final["a"][:, :2]).mean()))

    refused = 0
    for number in range(rounds):
        sessions = [repository.writable_session("main") for _ in range(2)]
        for writer, one in enumerate(sessions):
            texel(one.store, number, 2 + writer)
        commit(sessions[0], f"first {number}")
        try:
            commit(sessions[1], f"second {number}")
        except StoreError:
            refused += 1
    return {"merged_forks_kept": merged, "second_commit_refused": figures(refused / rounds)}
