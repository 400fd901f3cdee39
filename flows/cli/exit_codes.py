"""How a command ends that cannot go on: one line on stderr, and a code that tells whose fault it is."""

from __future__ import annotations

import errno
import tempfile
import traceback
from datetime import UTC, datetime
from pathlib import Path

from catalogs.imagery.http_client import ServiceUnavailable
from facade_core.core.errors import FacadeError, MachineError

# Of sysexits.h: an error of our own or of the machine; a cluster, or a service of pictures, that is gone for now.
EXIT_UNUSABLE, EXIT_CRASHED, EXIT_UNAVAILABLE = 2, 70, 75
# What a path raises that the user named and may not be written or read.
ACCESS_ERRNOS = {
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
    errno.EEXIST,
    errno.ENAMETOOLONG,
    errno.ENOTDIR,
    errno.EISDIR,
}


def describe_error(error: Exception) -> tuple[int, str]:
    """The exit code for an error that ended a command, and what to say of it in one line."""
    if isinstance(error, FacadeError):
        return _exit_code(error), " ".join(str(error).split())
    if isinstance(error, OSError) and error.errno in ACCESS_ERRNOS and error.filename:
        return EXIT_UNUSABLE, f"{error.filename}: {error.strerror}; mend that or name another place"
    from tasks.engine.outcome import is_machine_fault, machine_error

    if is_machine_fault(error):
        return EXIT_CRASHED, str(machine_error("stopped", error))
    said = " ".join(f"{type(error).__name__}: {error}".split())
    return EXIT_CRASHED, f"stopped by an error of its own ({said}); {_locate_traceback(error)}"


def _exit_code(error: FacadeError) -> int:
    if isinstance(error, ServiceUnavailable):
        return EXIT_UNAVAILABLE
    if not isinstance(error, MachineError):
        return EXIT_UNUSABLE
    from tasks.engine.compute.cluster import ClusterGone

    return EXIT_UNAVAILABLE if isinstance(error, ClusterGone) else EXIT_CRASHED


def _locate_traceback(error: Exception) -> str:
    """Where the traceback is: in the run's log, else in a file of its own."""
    from flows.log_file import find_log

    if (log := find_log(error)) is not None:
        return f"where is in {log}"
    text = "".join(traceback.format_exception(error))
    try:
        folder = Path(tempfile.gettempdir())
        path = folder / f"streetloom-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.log"
        path.write_text(text, encoding="utf-8")
    except OSError:
        return f"where cannot be written; the last of it is {text.strip().splitlines()[-2].strip()}"
    return f"where is in {path}"
