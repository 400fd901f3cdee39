"""Whom the viewer answers, asked raw as no client library would."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from facade_core.core.errors import InputError
from flows.viewer.app import HEADERS, create_application, serve
from flows.viewer.guard import HostGuard, create_guard
from tasks.viewing.run_view import RunReader


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """The port of a viewer's page."""
    import uvicorn

    listening = socket.create_server(("127.0.0.1", 0))
    app = create_application(RunReader(tmp_path_factory.mktemp("out")), "127.0.0.1", "127.0.0.1")
    server = uvicorn.Server(uvicorn.Config(app, log_level="warning"))
    thread = threading.Thread(target=server.run, args=([listening],))
    thread.start()
    yield listening.getsockname()[1]
    server.should_exit = True
    thread.join(120)


def ask(port: int, *headers: tuple[str, str]) -> tuple[int, dict[str, str]]:
    """Status and headers (lower case) of the answer to a GET with exactly these headers."""
    with socket.create_connection(("127.0.0.1", port), timeout=300) as connection:
        lines = "".join(f"{name}: {value}\r\n" for name, value in headers)
        connection.sendall(f"GET / HTTP/1.1\r\n{lines}\r\n".encode())
        answer = b""
        while b"\r\n\r\n" not in answer and (part := connection.recv(65536)):
            answer += part
    first, *others = answer.partition(b"\r\n\r\n")[0].decode().split("\r\n")
    return int(first.split()[1]), {k.lower(): v for k, v in (line.split(": ", 1) for line in others)}


CASES: dict[str, tuple[list[tuple[str, str]], bool]] = {
    "its own name": ([("Host", "127.0.0.1:PORT")], True),
    "the loopback's other name": ([("Host", "LocalHost:PORT")], True),
    "its own page": ([("Host", "127.0.0.1:PORT"), ("Origin", "http://127.0.0.1:PORT")], True),
    "a name made to point here": ([("Host", "evil.example:PORT")], False),
    "that name's own page": ([("Host", "evil.example:PORT"), ("Origin", "http://evil.example:PORT")], False),
    "a page of another site": ([("Host", "127.0.0.1:PORT"), ("Origin", "http://evil.example")], False),
    "a page of another port": ([("Host", "127.0.0.1:PORT"), ("Origin", "http://127.0.0.1:9")], False),
    "a page by another scheme": ([("Host", "127.0.0.1:PORT"), ("Origin", "https://127.0.0.1:PORT")], False),
    "a page in a sandbox": ([("Host", "127.0.0.1:PORT"), ("Origin", "null")], False),
    "two origins": (
        [("Host", "127.0.0.1:PORT"), ("Origin", "http://127.0.0.1:PORT"), ("Origin", "http://evil.example")],
        False,
    ),
    "an ending that fits": ([("Host", "127.0.0.1.evil.example:PORT")], False),
    "a user of another host": ([("Host", "127.0.0.1:80@evil.example")], False),
    "an address that is not served": ([("Host", "192.0.2.7:PORT")], False),
    "two names": ([("Host", "127.0.0.1:PORT"), ("Host", "evil.example")], False),
    "no name": ([], False),
}


@pytest.mark.parametrize("case", CASES)
def test_who_may_ask(case: str, page: int) -> None:
    headers, allowed = CASES[case]
    status, _ = ask(page, *[(name, value.replace("PORT", str(page))) for name, value in headers])
    assert status == 200 if allowed else status in (400, 403)


def test_every_answer_binds_the_browser(page: int) -> None:
    for host in ("127.0.0.1", "evil.example"):
        _, said = ask(page, ("Host", host))
        assert {name: said[name.lower()] for name in HEADERS} == HEADERS
        assert "frame-ancestors 'none'" in said["content-security-policy"]
        assert "script-src 'self';" in said["content-security-policy"]


def test_names_of_a_viewer_on_all_addresses() -> None:
    everywhere = create_guard("0.0.0.0", "0.0.0.0")
    for host in ("192.0.2.7:8", "[2001:db8::1]:8", "localhost", socket.gethostname()):
        assert everywhere.refusal([host], []) is None, host
    for host in ("evil.example", "", "192.0.2.7.evil.example", "[evil]"):
        assert everywhere.refusal([host], []), host
    assert HostGuard(("one.example",)).refusal(["192.0.2.7"], [])


@pytest.mark.parametrize(
    ("host", "address", "told"),
    [("127.0.0.1", "http://127.0.0.1:", None), ("0.0.0.0", "http://127.0.0.1:", "without a password")],
)
def test_what_a_host_needs_is_said(host: str, address: str, told: str | None, tmp_path: Path) -> None:
    said: list[Any] = []

    def ready(*what: Any) -> None:
        said.extend(what)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        serve(RunReader(tmp_path), host, 0, ready)
    assert said[0].startswith(address)
    assert (told in said[1] and f"--host {host}" in said[1]) if told else said[1] is None


def test_a_host_that_is_not_here_is_refused(tmp_path: Path) -> None:
    for host in ("no.such.host.invalid", "192.0.2.7"):
        with pytest.raises(InputError, match=f"^--host {host}") as refused:
            serve(RunReader(tmp_path), host, 0, print)
        assert "\n" not in str(refused.value)
