"""One Ctrl-C, or one SIGTERM, ends a command at once: every unit is committed whole, so there is nothing to wind down."""

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
    """Exit with 128 + signal and one line as soon as the interpreter heeds a signal; until `end_on_interrupt` takes over."""
    for number in TERMINATING_SIGNALS:
        signal.signal(number, lambda received, _: _exit_with_message(received, message))


@contextmanager
def unwind_on_signal() -> Iterator[None]:
    """What is within ends on a signal as on an error, so that it takes away what it began; then exit as `end_early` does."""

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
    """Exit with 128 + signal and one line. Call once, from the main thread.

    An exception raised by a handler can be swallowed wherever it lands (a garbage collector's callback of a library is
    enough), which leaves a run that hangs; and none is called while a library computes. So handlers do nothing, and a thread
    that reads the signals' wake-up socket exits: the pipes to the server's guard and to the workers close, and they follow.
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
