"""Where the command line begins: an interrupt ends it in order from here on, though what it needs is not imported yet."""

import atexit
import os
import sys
from contextlib import suppress

from flows.cli.interrupts import exit_on_signal


def main() -> None:
    exit_on_signal()
    from flows.cli.commands import command_line as commands

    code = 0
    try:
        commands()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    # Not the interpreter's own end: threads of native libraries (Icechunk, Arrow) now and then abort the process while that
    # takes down what they use, and a command that has said its line would end with 134.
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


if __name__ == "__main__":
    main()
