"""Entry point of the command line, which handles interrupts while the heavy imports are under way."""

import atexit
import logging
import os
import sys
from contextlib import suppress

from flows.cli.interrupts import REPEAT_MESSAGE, exit_on_signal

# Packages whose messages are printed where no handler takes them.
_OWN_PACKAGES = ("flows", "tasks", "catalogs", "facade_core", "streetloom")


def main() -> None:
    """Run the command line and exit the process with its code."""
    exit_on_signal(REPEAT_MESSAGE)
    _keep_library_warnings_off_terminal()
    from flows.cli.first_run import refuse_closed_streams, refuse_python_without_checks
    from flows.server.proxies import exempt_loopback_from_proxies

    refuse_closed_streams()
    refuse_python_without_checks()
    exempt_loopback_from_proxies()
    from flows.cli.commands import command_line as commands

    code = 0
    try:
        commands()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    # Skip the interpreter's shutdown: threads of native libraries (Icechunk, Arrow) sometimes abort the process during it,
    # and a successful command would exit with 134.
    atexit._run_exitfuncs()  # noqa: SLF001
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def _keep_library_warnings_off_terminal() -> None:
    """Keep warnings of libraries, also in worker processes, off the terminal: notes and faults name what they mean."""
    os.environ.setdefault("PYTHONWARNINGS", "ignore")
    logging.captureWarnings(capture=True)
    logging.getLogger("py.warnings").propagate = False
    assert logging.lastResort is not None, "Python's default"
    logging.lastResort.addFilter(lambda record: record.name.partition(".")[0] in _OWN_PACKAGES)


if __name__ == "__main__":
    main()
