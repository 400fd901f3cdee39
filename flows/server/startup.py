"""Prefect server of a run: the user's own if configured, else a temporary server of this run."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from flows.server import database as server_database
from flows.server.proxies import exempt_loopback_from_proxies, find_proxy_defect

# Seconds until a server of this run must answer.
START_UP_S = 120
# Seconds until the user's server must answer.
ANSWER_S = 10
LOG_NAME = "server.log"
# The last line of a traceback.
ERROR_LINE = re.compile(r"[\w.]*(Error|Exception|Exit)\w*(:|$)")
# No analytics, no telemetry: nothing leaves this machine.
TELEMETRY_OFF = {
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "PREFECT_CLOUD_ENABLE_ORCHESTRATION_TELEMETRY": "false",
    "DO_NOT_TRACK": "1",
}
# Services that the server of one run does not need: schedules, workers, automations, blocks. Without them it starts
# faster and leaves the cores to the run.
UNUSED_SERVICES_OFF = {
    "PREFECT_SERVER_REGISTER_BLOCKS_ON_START": "false",
    "PREFECT_SERVER_MEMOIZE_BLOCK_AUTO_REGISTRATION": "false",
} | {
    f"PREFECT_SERVER_SERVICES_{service}_ENABLED": "false"
    for service in ("CANCELLATION_CLEANUP", "FOREMAN", "LATE_RUNS", "PAUSE_EXPIRATIONS", "SCHEDULER", "TRIGGERS")
}

# The server must not outlive a killed run. The guard reads a pipe from this process and ends the server when the pipe
# closes. If the server ends, the guard ends; if the guard is killed, Linux ends the server.
_GUARD = """
import ctypes, signal, subprocess, sys, threading
PARENT_DEATH_SIGNAL = 1
def follow():
    ctypes.CDLL(None).prctl(PARENT_DEATH_SIGNAL, signal.SIGTERM)
server = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL, preexec_fn=follow)
signal.signal(signal.SIGTERM, lambda *_: server.terminate())
signal.signal(signal.SIGINT, signal.SIG_IGN)
def watch():
    sys.stdin.buffer.read()
    server.terminate()
    try:
        server.wait(10)
    except subprocess.TimeoutExpired:
        server.kill()
threading.Thread(target=watch, daemon=True).start()
server.wait()
"""


class ServerDownError(Exception):
    """Error of an unavailable Prefect server, with the reason; a run can continue without its record there."""


@dataclass(frozen=True)
class PrefectServer:
    """Server that records a run.

    Attributes
    ----------
    url : address of its API.
    home : folder of its data and log.
    guard : process that stops the server with this run; None for the user's server.
    has_database : the database existed before the server started.
    """

    url: str
    home: Path
    guard: subprocess.Popen[bytes] | None = None
    has_database: bool = True

    def wait_until_ready(self) -> None:
        """Wait until the server answers.

        Raises
        ------
        ServerDown
            The server has ended, or does not answer in time.
        """
        timeout_s = START_UP_S if self.guard else ANSWER_S
        deadline = time.monotonic() + timeout_s
        if defect := find_proxy_defect():
            raise ServerDownError(defect)
        while not (answers := self.is_answering()) and time.monotonic() < deadline and not self._ended():
            time.sleep(0.2)
        if not answers:
            raise ServerDownError(self.describe_failure())
        if not self.has_database:
            server_database.cache_database(self.home)

    def is_answering(self) -> bool:
        """Return True if the health check succeeds."""
        from urllib.error import URLError
        from urllib.request import urlopen

        if self._ended():
            return False
        try:
            with urlopen(f"{self.url}/health", timeout=5):
                return True
        except (URLError, OSError, ValueError):
            return False

    def is_request_error(self, error: BaseException | None) -> bool:
        """Return True if an error comes from a request to the server: an error response, or no response."""
        import httpx

        while error is not None and not isinstance(error, httpx.HTTPError):
            error = error.__cause__ or error.__context__
        return error is not None

    def describe_failure(self) -> str:
        """Return the reason why the server does not answer, in a few words."""
        if self.guard is None:
            return f"{self.url} does not answer"
        if not self._ended():
            return f"it does not answer; its log is {self.home / LOG_NAME}"
        try:
            lines = (self.home / LOG_NAME).read_text(errors="replace").splitlines()
        except OSError:
            lines = []
        errors = [line.strip() for line in lines if ERROR_LINE.match(line)]
        return (
            f"{errors[-1][:200]}; its log is {self.home / LOG_NAME}"
            if errors
            else f"it ended; its log is {self.home / LOG_NAME}"
        )

    def _ended(self) -> bool:
        return self.guard is not None and self.guard.poll() is not None


@contextmanager
def provide_prefect_server(home: Path) -> Iterator[PrefectServer]:
    """Set PREFECT_API_URL for the block: the user's where set, else of a new server on loopback.

    Prefect loads its settings at its first import, so enter this context before. The server starts while the block
    continues; call `wait_until_ready` before the first use.

    Parameters
    ----------
    home : folder of the data of a new server.

    Raises
    ------
    OSError
        The server process cannot be started.
    """
    exempt_loopback_from_proxies()
    os.environ.update(TELEMETRY_OFF)
    # the command line prints errors of the run in one line
    for logger in ("LOGGING_LEVEL", "LOGGING_ROOT_LEVEL", "INTERNAL_LOGGING_LEVEL"):
        os.environ.setdefault(f"PREFECT_{logger}", "CRITICAL")
    if url := os.environ.get("PREFECT_API_URL"):
        yield PrefectServer(url, home)
        return
    home.mkdir(parents=True, exist_ok=True)
    port = find_free_port()
    laid_out = server_database.restore_database(home)
    saved = dict(os.environ)
    url = f"http://127.0.0.1:{port}/api"
    # logs are in the terminal and the run's own file; the last ones could not reach a server that ends with the run.
    # A retry of a request to this server would not succeed either.
    os.environ.update(
        PREFECT_HOME=str(home),
        PREFECT_API_URL=url,
        PREFECT_LOGGING_TO_API_ENABLED="false",
        PREFECT_CLIENT_MAX_RETRIES="1",
    )
    with (home / LOG_NAME).open("wb") as output:
        guard = subprocess.Popen(
            [sys.executable, "-c", _GUARD, *server_command(port)],
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=subprocess.STDOUT,
            env=os.environ
            | UNUSED_SERVICES_OFF
            | {"PREFECT_API_URL": "", "PREFECT_UI_ENABLED": "true", "no_proxy": "*", "NO_PROXY": "*"},
            start_new_session=True,  # Ctrl-C in a terminal goes to the run only, which ends the server
        )
    try:
        yield PrefectServer(url, home, guard, laid_out)
    finally:
        assert guard.stdin is not None
        guard.stdin.close()
        guard.wait()
        os.environ.clear()
        os.environ.update(saved)


def server_command(port: int) -> list[str]:
    """Return the command line that starts a Prefect server on a port of loopback."""
    return [sys.executable, "-m", "prefect", "server", "start", "--host", "127.0.0.1", "--port", str(port)]


def find_free_port() -> int:
    """Return a port on loopback for a server that is about to start.

    For the next minute Linux gives the port to no other socket without a fixed port, because this side has just closed a
    connection there. A server can bind it, as servers set SO_REUSEADDR.
    """
    with socket.create_server(("127.0.0.1", 0)) as listening, socket.create_connection(listening.getsockname()):
        listening.accept()[0].close()
        return int(listening.getsockname()[1])
