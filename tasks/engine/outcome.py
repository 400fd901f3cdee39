"""Outcomes of units, and the origin of errors: faults of the input reject a unit, faults of the machine end the run."""

from __future__ import annotations

import errno
import logging
import os
import time
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import icechunk
from zarr.errors import BaseZarrError

from catalogs.printable_text import escape_invisible
from facade_core.atlas.journal import Record
from facade_core.core.errors import (
    BUCKET_UNAVAILABLE,
    BucketUnavailableError,
    FacadeError,
    MachineError,
    ModelFileError,
    StoreError,
)
from facade_core.core.zarr_types import is_bucket_unavailable, is_decoding_error

log = logging.getLogger(__name__)

DISK_ERRORS = {errno.ENOSPC, errno.EDQUOT}
MEMORY_ERRORS = {errno.ENOMEM}
OPEN_FILES_ERRORS = {errno.EMFILE, errno.ENFILE}
# Of a disk, a mount, the network or a limit. Not here: what a wrong path or a file's rights in the input raise.
MACHINE_ERRORS = OPEN_FILES_ERRORS | {
    errno.EIO,
    errno.EROFS,
    errno.ESTALE,
    errno.ETIMEDOUT,
    errno.ENOTCONN,
    errno.ECONNRESET,
    errno.ECONNREFUSED,
    errno.EHOSTUNREACH,
    errno.ENETUNREACH,
    errno.ENODEV,
    errno.ENXIO,
    errno.ENOLCK,
}
# Raised by the store, by an installation that lacks something, or for want of memory, whatever they say.
MACHINE_ERROR_TYPES = (
    MachineError,
    StoreError,
    ModelFileError,
    MemoryError,
    ImportError,
    icechunk.IcechunkError,
    BaseZarrError,
)
# How libraries put into words what they do not give a number or a type.
NO_MEMORY_TEXTS = (
    "Insufficient memory",
    "Failed to allocate memory",
    "bad_alloc",
    "can't start new thread",
    "failed to map segment",
)

_MAX_REASON_LENGTH = 300


@dataclass(frozen=True)
class UnitOutcomeCounts:
    """Counts of the done, skipped, failed and rejected units of a task.

    Attributes
    ----------
    done : units that were processed.
    skipped : units that the journal already held as done.
    failed : (unit, reason).
    refused : (unit, reason) of inputs that were set aside, and of units that are done without a rejected picture.
    """

    done: int = 0
    skipped: int = 0
    failed: tuple[tuple[str, str], ...] = ()
    refused: tuple[tuple[str, str], ...] = ()

    @property
    def processed_count(self) -> int:
        """Count the units that are done, skipped or failed."""
        return self.done + self.skipped + len(self.failed)

    def add(self, records: Iterable[Record]) -> UnitOutcomeCounts:
        """Return the outcome with more units, by their journal records."""
        records = list(records)
        failed = tuple((r["unit"], r["reason"]) for r in records if r["status"] == "failed")
        return replace(
            self,
            done=self.done + len(records) - len(failed),
            failed=self.failed + failed,
            refused=self.refused + list_units_with_rejections(records),
        )

    def __add__(self, other: UnitOutcomeCounts) -> UnitOutcomeCounts:
        return UnitOutcomeCounts(
            self.done + other.done,
            self.skipped + other.skipped,
            self.failed + other.failed,
            self.refused + other.refused,
        )


def count_set_aside(set_aside: Iterable[Sequence[str]]) -> UnitOutcomeCounts:
    """Count inputs that were set aside, as (kind, unit, reason)."""
    by_status: dict[str, list[tuple[str, str]]] = {"failed": [], "refused": []}
    for kind, unit, reason in set_aside:
        by_status[set_aside_status(kind)].append((unit, reason))
    return UnitOutcomeCounts(failed=tuple(by_status["failed"]), refused=tuple(by_status["refused"]))


def set_aside_status(kind: str) -> str:
    """Return the status of a kind of input that was set aside: of a whole block nothing is left to show."""
    return "failed" if kind == "block" else "refused"


def list_reasons(units: Iterable[tuple[str, str]]) -> list[dict[str, str]]:
    """List units with their reasons as the summary of a run does."""
    return [{"unit": unit, "reason": reason} for unit, reason in units]


def list_units_with_rejections(records: Iterable[Record | None]) -> tuple[tuple[str, str], ...]:
    """List the units that are done without a rejected picture, as (unit, reason)."""
    return tuple((r["unit"], r["reason"]) for r in records if r and r["status"] == "done" and r.get("reason"))


def failure_record(unit: str, key: str, error: Exception) -> Record:
    """Return the journal record of a unit that failed, with its reason in one line and the traceback."""
    return {
        "unit": unit,
        "key": key,
        "status": "failed",
        "reason": error_reason(error),
        "traceback": "".join(traceback.format_exception(error)),
        "started": time.time(),
    }


def log_units(stage: str, records: Iterable[Record]) -> None:
    """Log units by their journal records: failed ones as warnings with tracebacks, the others for debugging."""
    for record in records:
        unit, reason = (
            escape_invisible(record["unit"]),
            escape_invisible(record.get("reason") or ""),
        )  # a log may end in a terminal
        about = {name: record.get(name) for name in ("unit", "worker", "seconds", "traceback")} | {"stage": stage}
        if record["status"] == "failed":
            log.warning("%s %s failed: %s", stage, unit, reason, extra=about)
        elif record["status"] == "done" and reason:
            log.warning("%s %s: %s", stage, unit, reason, extra=about)
        else:
            log.debug("%s %s done", stage, unit, extra=about)


def error_reason(error: Exception) -> str:
    """Return an error in one line with the remedy."""
    if isinstance(error, FacadeError):
        reason = str(error)
    elif isinstance(error, OSError) and error.strerror and error.filename:
        reason = f"{error.filename} cannot be read or written ({error.strerror}); check that it is there, and its permissions"
    else:
        reason = f"stopped by an error of its own ({type(error).__name__}: {error}"[:_MAX_REASON_LENGTH]
        reason += "); mend or remove its input, or report it with the traceback in the log"
    return " ".join(reason.split())


@contextmanager
def collect_input_errors(errors: list[Exception]) -> Iterator[None]:
    """Append errors of the input raised within to `errors`; faults of the machine pass."""
    try:
        yield
    except Exception as error:
        if is_machine_fault(error):
            raise
        errors.append(error)


def rejection_record_fields(errors: Sequence[Exception], instead: str) -> dict[str, str]:
    """Return the fields of a record that name rejected pictures and the source used instead."""
    if not errors:
        return {}
    return {
        "reason": f"{'; '.join(map(error_reason, errors))}; textured {instead}",
        "traceback": "".join(line for error in errors for line in traceback.format_exception(error)),
    }


def is_machine_fault(error: BaseException) -> bool:
    """Return whether an error, or its cause, is the machine's: the same unit may succeed when retried."""
    return any(_is_machine_error(one) for one in _error_chain(error))


def machine_error(doing: str, error: BaseException) -> MachineError:
    """Build the error for a machine fault: one line with the unit, the cause and the remedy."""
    chain = list(_error_chain(error))
    said = next((one for one in chain if isinstance(one, MachineError)), None)
    if said is not None:
        is_complete = type(said) is not MachineError or str(said).startswith(f"{doing}: ")
        return said if is_complete else MachineError(f"{doing}: {said}")
    if any(map(is_bucket_unavailable, chain)):
        return BucketUnavailableError(f"{doing}: {BUCKET_UNAVAILABLE}")
    number = next((number for one in chain if (number := _error_number(one)) is not None), None)
    if number is None and any(_mentions(one, [os.strerror(errno.EACCES)]) for one in chain):
        number = errno.EACCES
    first = next(filter(_is_machine_error, chain), error)
    if number in DISK_ERRORS:
        remedy = "free some space"
    elif number in MEMORY_ERRORS or any(
        isinstance(one, MemoryError) or _mentions(one, NO_MEMORY_TEXTS) for one in chain
    ):
        remedy = "free some memory, or use fewer workers,"
    elif number in OPEN_FILES_ERRORS:
        remedy = "allow more open files (`ulimit -n`)"
    elif number in (errno.EACCES, errno.EROFS):
        remedy = "make the output folder writable"
    else:
        remedy = "see to the machine, its disks and its network,"
    text = " ".join(str(first).split())[:_MAX_REASON_LENGTH]
    words = os.strerror(number) if number is not None else text or type(first).__name__
    return MachineError(f"{doing}: {words}; {remedy} and run again: finished work is kept")


def is_store_fault(error: BaseException) -> bool:
    """Return whether an error, or its cause, is that a store could not be read or written."""
    store = (StoreError, icechunk.IcechunkError, BaseZarrError)
    return is_damaged_chunk(error) or any(isinstance(one, store) for one in _error_chain(error))


def is_damaged_chunk(error: BaseException) -> bool:
    """Return whether an error, or its cause, is that a chunk of a store cannot be decoded."""
    return any(map(is_decoding_error, _error_chain(error)))


@contextmanager
def convert_machine_faults(doing: str) -> Iterator[None]:
    """Raise faults of the machine as MachineError; other errors pass unchanged."""
    try:
        yield
    except FacadeError:
        raise
    except Exception as error:
        if is_machine_fault(error):
            raise machine_error(doing, error) from error
        raise


def _is_machine_error(error: BaseException) -> bool:
    return (
        isinstance(error, MACHINE_ERROR_TYPES)
        or _error_number(error) is not None
        or _mentions(error, NO_MEMORY_TEXTS)
        or is_decoding_error(error)
    )


def _mentions(error: BaseException, texts: Iterable[str]) -> bool:
    return any(text in str(error) for text in texts)


def _error_number(error: BaseException) -> int | None:
    """Return the error number of a machine fault, from the error or from the words of a library."""
    if isinstance(error, OSError) and error.errno is not None:
        return error.errno if error.errno in DISK_ERRORS | MEMORY_ERRORS | MACHINE_ERRORS else None
    return next(
        (
            number
            for number in sorted(DISK_ERRORS | MEMORY_ERRORS | MACHINE_ERRORS)
            if _mentions(error, [os.strerror(number)])
        ),
        None,
    )


def _error_chain(error: BaseException) -> Iterator[BaseException]:
    """Iterate over an error and everything that it was raised from."""
    seen: set[int] = set()
    waiting: list[BaseException | None] = [error]
    while waiting:
        one = waiting.pop()
        if one is None or id(one) in seen:
            continue
        seen.add(id(one))
        yield one
        waiting += [None if one.__suppress_context__ else one.__context__, one.__cause__]
        if isinstance(one, BaseExceptionGroup):
            waiting += one.exceptions
