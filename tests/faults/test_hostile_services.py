"""Services that never end: redirects with endless bodies, headers byte by byte, answers for another box."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from threading import Event, Thread

import pytest

from catalogs.features import Fault
from catalogs.imagery import http_client
from catalogs.imagery.box_search import search_boxes_by_quarters
from catalogs.imagery.http_client import HttpClient, RequestRejectedError, ServiceUnavailableError
from catalogs.imagery.settings import SERVICES
from catalogs.imagery.stac import _box_search


@contextmanager
def serving(answer: Callable[[socket.socket, Event], None]) -> Iterator[str]:
    """The address of a server that answers each request so, until the client closes or the block ends."""
    over = Event()
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.1)

        def serve() -> None:
            while not over.is_set():
                with suppress(TimeoutError):
                    connection = server.accept()[0]
                    Thread(target=reply, args=(connection,), daemon=True).start()

        def reply(connection: socket.socket) -> None:
            with connection, suppress(OSError):
                connection.recv(1 << 16)
                answer(connection, over)

        thread = Thread(target=serve)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.getsockname()[1]}"
        finally:
            over.set()
            thread.join()


def test_the_body_of_a_redirect_is_not_read() -> None:
    sent = [0]

    def redirect(connection: socket.socket, over: Event) -> None:
        connection.sendall(b"HTTP/1.1 302 Found\r\nLocation: /there\r\n\r\n")
        while not over.is_set():
            sent[0] += connection.send(b"x" * 65536)

    with serving(redirect) as address, pytest.raises(RequestRejectedError, match="leads to another address 5 times"):
        HttpClient(sleep=lambda _: None).fetch_text(f"{address}/x")
    assert sent[0] < 50_000_000, "no more than fits the sockets of six requests"


@pytest.mark.parametrize("start", [b"", b"HTTP/1.1 200 OK\r\nContent-Length: 100000\r\n\r\n"])
def test_an_answer_byte_by_byte_ends(start: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_client, "SERVICES", replace(SERVICES, total_timeout_s=0.3, max_attempts=2))

    def trickle(connection: socket.socket, over: Event) -> None:
        connection.sendall(start)
        while not over.is_set():
            connection.send(b"H")
            time.sleep(0.02)

    with serving(trickle) as address, pytest.raises(ServiceUnavailableError, match="too slow"):
        HttpClient(sleep=lambda _: None).fetch_text(f"{address}/x")


def test_a_service_that_ignores_the_box_is_asked_once() -> None:
    asked = []

    class Client:
        def search(self, **query: object) -> Client:
            asked.append(query["bbox"])
            return self

        def pages_as_dicts(self) -> list[dict[str, object]]:
            points = [{"coordinates": [24.0 + number / 100, 60.0]} for number in range(SERVICES.limit_multiple)]
            return [{"features": [{"id": str(n), "geometry": point} for n, point in enumerate(points)]}]

        def get_self_href(self) -> str:
            return "http://a.example/"

    search = _box_search(Client(), None)  # type: ignore[arg-type]
    found = list(search_boxes_by_quarters([(24.0, 59.99, 24.01, 60.01)], search))
    assert len(asked) == 1
    (fault,) = [one for one in found if isinstance(one, Fault)]
    assert "ignores the box: 97 of its pictures lie elsewhere" in fault.reason
    assert len(found) == 4
