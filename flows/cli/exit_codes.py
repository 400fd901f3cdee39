"""Exit code and one-line message for an error that ends a command."""

from __future__ import annotations

import errno
import tempfile
import traceback
from datetime import UTC, datetime

from catalogs.imagery.http_client import ServiceUnavailableError
from facade_core.core.errors import BucketUnavailableError, FacadeError, MachineError

# Invalid input; then from sysexits.h: internal or machine error; cluster or imagery service unavailable.
EXIT_UNUSABLE = 2
EXIT_CRASHED = 70
EXIT_UNAVAILABLE = 75
# Errors of a path that the user cannot read or write.
ACCESS_ERRNOS = {
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
    errno.EEXIST,
    errno.ENAMETOOLONG,
    errno.ENOTDIR,
    errno.EISDIR,
}


def exit_code_and_message(error: Exception) -> tuple[int, str]:
    """Return the exit code and the one-line message for an error that ended a command."""
    if isinstance(error, FacadeError):
        return _exit_code(error), " ".join(str(error).split())
    if isinstance(error, OSError) and error.errno in ACCESS_ERRNOS and error.filename:
        return EXIT_UNUSABLE, f"{error.filename}: {error.strerror}; mend that or name another place"
    from tasks.engine.outcome import is_machine_fault, machine_error

    if is_machine_fault(error):
        fault = machine_error("stopped", error)
        return _exit_code(fault), str(fault)
    message = " ".join(f"{type(error).__name__}: {error}".split())
    return EXIT_CRASHED, f"stopped by an error of its own ({message}); {_locate_traceback(error)}"


def _exit_code(error: FacadeError) -> int:
    if isinstance(error, ServiceUnavailableError | BucketUnavailableError):
        return EXIT_UNAVAILABLE
    if not isinstance(error, MachineError):
        return EXIT_UNUSABLE
    from tasks.engine.compute.cluster import ClusterGoneError

    return EXIT_UNAVAILABLE if isinstance(error, ClusterGoneError) else EXIT_CRASHED


def _locate_traceback(error: Exception) -> str:
    """Return the location of the traceback: the run's log, else a new file."""
    from flows.log_file import find_error_log

    if (log := find_error_log(error)) is not None:
        return f"where is in {log}"
    text = "".join(traceback.format_exception(error))
    try:
        # a new file that others cannot foresee or read
        handle, path = tempfile.mkstemp(prefix=f"streetloom-{datetime.now(UTC):%Y%m%dT%H%M%SZ}-", suffix=".log")
        with open(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(text)
    except OSError:
        return f"where cannot be written; the last of it is {text.strip().splitlines()[-2].strip()}"
    return f"where is in {path}"
