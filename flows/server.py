"""The Prefect server of a run: the user's own where one is configured, else one that this run starts and stops."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from facade_core.errors import FacadeError
from flows import server_database

START_UP_S = 180
# No analytics, no telemetry: nothing leaves this machine.
QUIET = {
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "PREFECT_CLOUD_ENABLE_ORCHESTRATION_TELEMETRY": "false",
    "DO_NOT_TRACK": "1",
}
# What a server of one run has no use for: schedules, workers, automations, blocks. It starts sooner without, and leaves
# the cores to the run.
SPARE = {
    "PREFECT_SERVER_REGISTER_BLOCKS_ON_START": "false",
    "PREFECT_SERVER_MEMOIZE_BLOCK_AUTO_REGISTRATION": "false",
} | {
    f"PREFECT_SERVER_SERVICES_{service}_ENABLED": "false"
    for service in ("CANCELLATION_CLEANUP", "FOREMAN", "LATE_RUNS", "PAUSE_EXPIRATIONS", "SCHEDULER", "TRIGGERS")
}

# The server must not outlive a run that is killed: the guard holds the read end of a pipe whose other end is this process's,
# and ends the server when the pipe closes, however that came about.
_GUARD = """
import signal, subprocess, sys
server = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL)
signal.signal(signal.SIGTERM, lambda *_: server.terminate())
signal.signal(signal.SIGINT, signal.SIG_IGN)
sys.stdin.buffer.read()
server.terminate()
try:
    server.wait(10)
except subprocess.TimeoutExpired:
    server.kill()
    server.wait()
"""


@contextmanager
def server(home: Path) -> Iterator[Callable[[], None]]:
    """Set PREFECT_API_URL for the block: the user's where set, else of a server on loopback with its data in `home`.

    Settings are read when Prefect is first imported, so this is entered before. The server starts while the block goes on;
    the block is given a function to call before it needs the server, which raises FacadeError with the log's place when
    that does not answer in time.
    """
    os.environ.update(QUIET)
    # what a run raises comes back to the command line, which says it in one line
    os.environ.setdefault("PREFECT_LOGGING_LEVEL", "CRITICAL")
    if os.environ.get("PREFECT_API_URL"):
        yield lambda: None
        return
    home.mkdir(parents=True, exist_ok=True)
    port = _free_port()
    log = home / "server.log"
    laid_out = server_database.lay_out(home)
    saved = dict(os.environ)
    # logs are in the terminal and the journal; sent to a server that ends with the run, the last ones would only fail
    os.environ.update(
        PREFECT_HOME=str(home), PREFECT_API_URL=f"http://127.0.0.1:{port}/api", PREFECT_LOGGING_TO_API_ENABLED="false"
    )
    command = [sys.executable, "-m", "prefect", "server", "start", "--host", "127.0.0.1", "--port", str(port)]
    with log.open("wb") as output:
        guard = subprocess.Popen(
            [sys.executable, "-c", _GUARD, *command],
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=subprocess.STDOUT,
            env=os.environ | SPARE | {"PREFECT_API_URL": "", "PREFECT_UI_ENABLED": "true"},
            start_new_session=True,  # Ctrl-C in a terminal is for the run, which ends the server in order
        )

    def ready() -> None:
        _wait(port, guard, log)
        if not laid_out:
            server_database.keep(home)

    try:
        yield ready
    finally:
        assert guard.stdin is not None
        guard.stdin.close()
        guard.wait()
        os.environ.clear()
        os.environ.update(saved)


def _wait(port: int, guard: subprocess.Popen, log: Path) -> None:
    from urllib.error import URLError
    from urllib.request import urlopen

    deadline = time.monotonic() + START_UP_S
    while time.monotonic() < deadline and guard.poll() is None:
        try:
            with urlopen(f"http://127.0.0.1:{port}/api/health", timeout=5):
                return
        except (URLError, OSError):
            time.sleep(0.2)
    raise FacadeError(f"the Prefect server did not answer; see {log}, or set PREFECT_API_URL to one that runs")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
