"""Handling of SIGINT and SIGTERM: the first one ends a command at once, because every unit is committed atomically."""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

TERMINATING_SIGNALS = (signal.SIGINT, signal.SIGTERM)
INTERRUPTED_MESSAGE = "interrupted; finished work is kept, run the same command to go on"
UNDONE_MESSAGE = "interrupted; nothing of it is left"
# Of commands that keep nothing on the way, and of all before they begin.
REPEAT_MESSAGE = "interrupted; run the same command again"
# Seconds for cleanup after a signal.
MAX_UNWIND_S = 5.0


def exit_on_signal(message: str = INTERRUPTED_MESSAGE) -> None:
    """Exit with 128 + signal and one line at the first signal, also while a library computes.

    Python calls no handler while C code runs. So a thread, which reads the signals' wake-up socket, exits too. This closes the
    pipes to the server's guard and to the workers, which then end. Call from the main thread; libraries may replace
    handlers, and a second call restores them.
    """
    _watcher.message, _watcher.unwinds = message, False
    _watcher.start()
    for number in TERMINATING_SIGNALS:
        signal.signal(number, lambda received, _: _exit_with_message(received, message))


@contextmanager
def unwind_on_signal() -> Iterator[None]:
    """Raise KeyboardInterrupt on a signal within the block, so that cleanup runs; then exit as `exit_on_signal` does.

    Cleanup that does not end within MAX_UNWIND_S, because a library computes, is given up.
    """

    def stop(received: int, _: object) -> NoReturn:
        raise KeyboardInterrupt(received)

    _watcher.message, _watcher.unwinds = INTERRUPTED_MESSAGE, True
    _watcher.start()
    for number in TERMINATING_SIGNALS:
        signal.signal(number, stop)
    try:
        yield
    except KeyboardInterrupt as interrupt:
        _exit_with_message(interrupt.args[0] if interrupt.args else signal.SIGINT, UNDONE_MESSAGE)
    exit_on_signal()


class _SignalWatcher:
    """Thread that exits at a signal.

    Attributes
    ----------
    message : last line of the command.
    unwinds : the main thread cleans up first.
    """

    def __init__(self) -> None:
        self.message, self.unwinds = INTERRUPTED_MESSAGE, False
        self._sockets: tuple[socket.socket, socket.socket] | None = None

    def start(self) -> None:
        """Start the thread once, and make signals wake it."""
        if self._sockets is None:
            self._sockets = socket.socketpair()
            self._sockets[1].setblocking(False)
            threading.Thread(target=self._watch, args=(self._sockets[0],), daemon=True, name="interrupts").start()
        signal.set_wakeup_fd(self._sockets[1].fileno(), warn_on_full_buffer=False)

    def _watch(self, woken: socket.socket) -> None:
        while (number := woken.recv(1)[0]) not in TERMINATING_SIGNALS:
            continue
        if self.unwinds:
            time.sleep(MAX_UNWIND_S)
        _exit_with_message(number, self.message)


_watcher = _SignalWatcher()
_exiting = threading.Lock()


def _exit_with_message(number: int, message: str) -> NoReturn:
    if _exiting.acquire(blocking=False):  # the handler and the thread both come here
        show_cursor = "\x1b[?25h" if sys.stderr and sys.stderr.isatty() else ""
        os.write(2, f"{show_cursor}\nstreetloom: {message}\n".encode())
        os._exit(128 + number)
    while True:  # the other one exits
        time.sleep(1.0)
