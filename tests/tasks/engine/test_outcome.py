"""Whose fault an error is, and what is kept of it."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cloudpickle
import icechunk
import numpy as np
import pytest
from zarr.errors import GroupNotFoundError

from facade_core.core.errors import FacadeError, ImageError, MachineError, ModelFileError, StoreError
from tasks.engine import fan_out
from tasks.engine.compute.cluster import ClusterGoneError, WorkersDiedError
from tasks.engine.compute.connect import connect
from tasks.engine.fan_out import process_batch
from tasks.engine.outcome import failure_record, is_machine_fault, machine_error
from tasks.engine.unit import Unit, UnitGroup

cloudpickle.register_pickle_by_value(sys.modules[__name__])

FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/data/x")
# As Icechunk passes it on.
STORE_FULL = "object store error Generic LocalFileSystem error: Unable to copy: No space left on device (os error 28)"


def raised(make: Callable[[], Any]) -> BaseException:
    try:
        make()
    except BaseException as error:
        return error
    raise AssertionError("nothing was raised")


def wrapped(cause: BaseException, outer: Exception) -> BaseException:
    """As a reader raises its own error from another's."""

    def make() -> None:
        try:
            raise cause
        except BaseException as error:
            raise outer from error

    return raised(make)


def while_handling(cause: BaseException, outer: Exception) -> BaseException:
    def make() -> None:
        try:
            raise cause
        except BaseException:
            raise outer  # noqa: B904

    return raised(make)


DENIED = (
    "x object store error: Unable to open file /out/store/chunks/A#1: Permission denied (os error 13) | context: | 0"
)
MACHINES: dict[str, tuple[BaseException, str]] = {
    "full disk": (FULL, "No space left on device; free some space"),
    "quota": (OSError(errno.EDQUOT, "quota"), "Disk quota exceeded; free some space"),
    "disk": (OSError(errno.EIO, "i/o"), "Input/output error; see to the machine"),
    "read only": (OSError(errno.EROFS, "ro"), "Read-only file system; make the output folder writable and run again"),
    "folder of another": (icechunk.IcechunkError(DENIED), "facades a/1: Permission denied; make the output folder"),
    "long": (icechunk.IcechunkError("odd " * 1000), "odd odd"),
    "address space": (ImportError("libx.so: failed to map segment from shared object"), "object; free some memory"),
    "said before": (MachineError("facades a/1: gone; see to it"), "facades a/1: gone; see to it"),
    "open files": (OSError(errno.EMFILE, "many"), "Too many open files; allow more open files (`ulimit -n`) and run"),
    "dead mount": (OSError(errno.ESTALE, "stale"), "Stale file handle"),
    "memory": (MemoryError(), "MemoryError; free some memory"),
    "memory of an array": (
        raised(lambda: np.empty(2**58, np.uint8)),
        "Unable to allocate 256. PiB for an array with shape (288230376151711744,) and data type uint8; free some memory",
    ),
    "no thread": (RuntimeError("can't start new thread"), "free some memory"),
    "store": (StoreError("gone"), "facades a/1: gone; see to"),
    "store without room": (icechunk.IcechunkError(STORE_FULL), "No space left on device; free some space"),
    "array lost": (GroupNotFoundError("a", "b"), "a"),
    "model": (ModelFileError("network.onnx: checksum"), "network.onnx: checksum"),
    "installation": (ImportError("libGL.so.1"), "libGL.so.1"),
    "picture on a dying disk": (wrapped(OSError(errno.EIO, "i/o"), ImageError("a.png: not readable")), "Input/output"),
    "while handling": (while_handling(FULL, ValueError("cannot close")), "No space left"),
    "in a group": (ExceptionGroup("several", [ValueError("x"), MemoryError()]), "free some memory"),
    "cluster": (ClusterGoneError("the cluster went away"), "the cluster went away"),
}
INPUTS: dict[str, BaseException] = {
    "value": ValueError("bad"),
    "missing file": FileNotFoundError(errno.ENOENT, "no such file", "a.png"),
    "file that may not be read": PermissionError(errno.EACCES, "denied", "a.png"),
    "folder for a file": IsADirectoryError(errno.EISDIR, "is a directory", "a.png"),
    "truncated picture": OSError("image file is truncated"),
    "picture": wrapped(OSError("cannot identify"), ImageError("a.png: not a readable image")),
    "unit that takes too much": WorkersDiedError("each of the 2 workers that ran it died"),
}


@pytest.mark.parametrize("name", MACHINES)
def test_the_machines_fault_says_its_cause_and_the_remedy_in_one_line(name: str) -> None:
    error, says = MACHINES[name]
    assert is_machine_fault(error)
    told = machine_error("facades a/1", error)
    assert isinstance(told, MachineError)
    assert says in str(told)
    assert "\n" not in str(told)
    assert str(told).count("facades a/1") <= 1
    assert len(str(told)) < 500
    assert is_machine_fault(wrapped(error, FacadeError("another")))


@pytest.mark.parametrize("name", INPUTS)
def test_the_inputs_fault_sets_a_unit_aside(name: str) -> None:
    assert not is_machine_fault(INPUTS[name])


def test_a_failed_unit_keeps_where_it_failed() -> None:
    record = failure_record("a/1", "key", wrapped(KeyError("inner"), ValueError("outer\nline")))  # type: ignore[arg-type]
    assert record["reason"].startswith(
        "stopped by an error of its own (ValueError: outer line); mend or remove its input"
    )
    assert "KeyError: 'inner'" in record["traceback"]
    assert "raise outer from error" in record["traceback"]


class OddError(Exception):
    """An error that does not survive the way between processes as it is."""

    def __init__(self, one: str, two: Any) -> None:
        super().__init__(f"{one} went wrong")
        self.two = two


def unit(run: Any, fork: Any, units: UnitGroup) -> tuple[Any, dict[int, dict[str, Any]]]:
    index = units[0].index
    if index == 1:
        raise OddError("input", 2)
    if index == 2:
        raise OddError("disk", lambda: 2) from OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    return fork, {index: {"unit": str(index), "status": "done"}}


@pytest.mark.long
@pytest.mark.parametrize("workers", [1, 2])
def test_a_fault_keeps_its_kind_and_place_on_its_way_from_a_worker(
    workers: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: dict[int, dict[str, Any]] = {}
    monkeypatch.setattr(fan_out, "fork_store", lambda store: ("session", "fork"))
    monkeypatch.setattr(fan_out, "commit_units", lambda session, fork, stage, records, message: made.update(records))
    run: Any = SimpleNamespace(store=None)

    def batch(*indices: int) -> list[UnitGroup]:
        return [(Unit(i, f"a/{i}", None, 10**6, digests={"code": str(i)}),) for i in indices]

    with connect(workers, None, str(tmp_path)) as compute:
        outcome = process_batch.fn(run, "toys", "1 of 2", unit, batch(0, 1), compute)
        with pytest.raises(
            MachineError, match=r"^toys a/2: on .*: No space left on device; free some space and run again"
        ):
            process_batch.fn(run, "toys", "2 of 2", unit, batch(2), compute)
    assert outcome.done == 1
    assert set(made) == {0, 1}
    assert "(OddError: input went wrong)" in made[1]["reason"]
    assert 'raise OddError("input", 2)' in made[1]["traceback"]


def test_units_that_wait_for_their_turn_when_a_run_ends_do_not_start(tmp_path: Path) -> None:
    with connect(1, None, str(tmp_path)) as compute:
        waiting = compute.submit(unit, None, "fork", (Unit(0, "a", None),))
    with pytest.raises(MachineError, match="the run has ended"):
        waiting.result()
