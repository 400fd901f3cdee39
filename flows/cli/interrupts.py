"""Handling of SIGINT and SIGTERM: the first one ends a command at once, because every unit is committed atomically."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

TERMINATING_SIGNALS = (signal.SIGINT, signal.SIGTERM)
INTERRUPTED_MESSAGE = "interrupted; what is done is kept, run the same command to go on"
UNDONE_MESSAGE = "interrupted; nothing of it is left"


def exit_on_signal(message: str = INTERRUPTED_MESSAGE) -> None:
    """Install handlers that exit with 128 + signal and one line, for use until `exit_on_signal_from_thread`."""
    for number in TERMINATING_SIGNALS:
        signal.signal(number, lambda received, _: _exit_with_message(received, message))


@contextmanager
def unwind_on_signal() -> Iterator[None]:
    """Raise KeyboardInterrupt on a signal within the block, so that cleanup runs; then exit as `exit_on_signal` does."""

    def stop(received: int, _: object) -> NoReturn:
        raise KeyboardInterrupt(received)

    for number in TERMINATING_SIGNALS:
        signal.signal(number, stop)
    try:
        yield
    except KeyboardInterrupt as interrupt:
        _exit_with_message(interrupt.args[0] if interrupt.args else signal.SIGINT, UNDONE_MESSAGE)
    exit_on_signal()


def exit_on_signal_from_thread() -> None:
    """Exit with 128 + signal and one line, from a thread. Call once, from the main thread.

    An exception in a handler can be swallowed, for example in a garbage collector's callback of a library, and the run
    hangs; and Python calls no handler while a library computes. So the handlers do nothing, and a thread that reads the
    signals' wake-up socket exits. This closes the pipes to the server's guard and to the workers, which then end.
    """
    import socket
    import threading

    read, write = socket.socketpair()
    write.setblocking(False)
    for number in TERMINATING_SIGNALS:
        signal.signal(number, lambda *_: None)
    signal.set_wakeup_fd(write.fileno(), warn_on_full_buffer=False)

    def watch() -> None:
        with write:  # keeps the descriptor open as long as the thread runs
            while (number := read.recv(1)[0]) not in TERMINATING_SIGNALS:
                continue
        _exit_with_message(number, INTERRUPTED_MESSAGE)

    threading.Thread(target=watch, daemon=True, name="interrupts").start()


def _exit_with_message(number: int, message: str) -> NoReturn:
    show_cursor = "\x1b[?25h" if sys.stderr and sys.stderr.isatty() else ""
    os.write(2, f"{show_cursor}\nstreetloom: {message}\n".encode())
    os._exit(128 + number)
