"""Whom the viewer lets write, asked raw as no client library would."""

from __future__ import annotations

import http.client
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from facade_core.core.errors import InputError
from flows.viewer.app import create_application, serve
from flows.viewer.background_run import describe_outcome
from flows.viewer.editing import MAX_BODY_BYTES, TOKEN_HEADER, EditorUser
from tasks.viewing.run_view import RunReader

HERE = "http://127.0.0.1:PORT"
ADDRESSES = ("/edit/corrections", "/edit/completions", "/edit/redo", "/edit/decisions")


def served(out: Path, editor: EditorUser | None) -> Iterator[int]:
    import socket

    import uvicorn

    listening = socket.create_server(("127.0.0.1", 0))
    server = uvicorn.Server(
        uvicorn.Config(create_application(RunReader(out), "127.0.0.1", "127.0.0.1", editor), log_level="warning")
    )
    thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
    thread.start()
    try:
        yield listening.getsockname()[1]
    finally:
        server.should_exit = True
        thread.join(120)


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    photos = tmp_path_factory.mktemp("photos")
    yield from served(tmp_path_factory.mktemp("out"), EditorUser("anna", photos, "right"))


def ask(port: int, method: str, path: str, headers: dict[str, str], body: bytes = b"{}") -> tuple[int, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=300)
    try:
        stated = {name: value.replace("PORT", str(port)) for name, value in headers.items()}
        connection.request(method, path, body if method == "POST" else None, stated)
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


REFUSED: dict[str, tuple[dict[str, str], int]] = {
    "no token": ({"Origin": HERE}, 403),
    "another token": ({TOKEN_HEADER: "wrong", "Origin": HERE}, 403),
    "a token as a cookie": ({"Cookie": f"{TOKEN_HEADER}=right", "Origin": HERE}, 403),
    "a page of another site": ({TOKEN_HEADER: "right", "Origin": "http://evil.example"}, 403),
    "a page of another port": ({TOKEN_HEADER: "right", "Origin": "http://127.0.0.1:9"}, 403),
    "a page in a sandbox": ({TOKEN_HEADER: "right", "Origin": "null"}, 403),
    "no origin": ({TOKEN_HEADER: "right"}, 403),
    "a name made to point here": (
        {TOKEN_HEADER: "right", "Host": "evil.example", "Origin": "http://evil.example"},
        400,
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_who_may_not_write(case: str, port: int) -> None:
    headers, status = REFUSED[case]
    for address in ADDRESSES:
        assert ask(port, "POST", address, headers)[0] == status, address


def test_what_is_no_correction_is_refused_in_one_line(port: int) -> None:
    mine = {TOKEN_HEADER: "right", "Origin": HERE}
    for body, status in (
        (b"{", 400),
        (b"[" * 100_000, 400),
        (b"[]", 400),
        (b'{"corrections": 1}', 400),
        (b" " * (MAX_BODY_BYTES + 1), 413),
    ):
        code, said = ask(port, "POST", "/edit/corrections", mine, body)
        assert code == status, body[:20]
        assert "\n" not in json.loads(said)["reason"]
    for body in (b"[]", b"{}", b'{"decisions": [{"photo": "a.jpg", "facade": 1, "decided": true, "stood": ["", ""]}]}'):
        assert ask(port, "POST", "/edit/decisions", mine, body)[0] == 400, body
    assert ask(port, "GET", "/edit/corrections", mine)[0] == 405
    for address in ("/edit/state", "/edit/matches", "/edit/photo?name=a.jpg"):
        assert ask(port, "GET", address, {TOKEN_HEADER: "wrong"})[0] == 403, address
    assert json.loads(ask(port, "GET", "/edit/state", {TOKEN_HEADER: "right"})[1])["who"] == "anna"


def test_without_edit_nothing_can_be_written(tmp_path: Path) -> None:
    for port in served(tmp_path, None):
        for method, address in (
            ("GET", "/edit/state"),
            ("GET", "/edit/matches"),
            ("GET", "/edit/photo?name=a"),
            *(("POST", address) for address in ADDRESSES),
        ):
            assert ask(port, method, address, {TOKEN_HEADER: "right", "Origin": HERE})[0] == 404, address


def test_an_editor_is_served_on_loopback_alone_and_told_the_token(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^--host 0\.0\.0\.0: what --edit writes is for this machine") as refused:
        serve(RunReader(tmp_path), "0.0.0.0", 0, print, EditorUser("anna"))
    assert "\n" not in str(refused.value)
    said: list[Any] = []

    def ready(*what: Any) -> None:
        said.extend(what)
        raise KeyboardInterrupt

    editor = EditorUser("anna")
    with pytest.raises(KeyboardInterrupt):
        serve(RunReader(tmp_path), "localhost", 0, ready, editor)
    assert said[0].endswith(f"/#/token/{editor.token}")
    assert editor.token != EditorUser("anna").token
    assert len(editor.token) >= 32


def test_a_redo_with_nothing_due_says_so() -> None:
    summary: dict[str, Any] = {"units_done": 0, "units_skipped": 680, "failures": [], "refused": []}
    assert describe_outcome(summary) == "there is nothing to do: all 680 units were done before"
    assert describe_outcome(summary | {"units_done": 2}) == "2 units done, 680 were done before"
    assert describe_outcome(summary | {"failures": [{"unit": "a-0", "reason": "bad"}]}).endswith("a-0: bad")


def test_half_a_character_is_refused(port: int) -> None:
    headers = {TOKEN_HEADER: "right", "Origin": HERE}
    for body in (
        b'{"corrections": [{"facade_id": "\\ud800"}]}',
        b'{"corrections": [], "why": "\\udfff"}',
        b'"\\ud800"',
    ):
        for path in ADDRESSES:
            status, answer = ask(port, "POST", path, headers, body)
            assert (status, json.loads(answer)) == (
                400,
                {"reason": "what is sent holds half a character; write it anew"},
            )


def test_a_request_that_is_cut_off_leaves_no_traceback(port: int, caplog: pytest.LogCaptureFixture) -> None:
    import socket
    import time

    head = (
        f"POST /edit/corrections HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\n"
        f"{TOKEN_HEADER}: right\r\nContent-Type: application/json\r\nContent-Length: 5000\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", port)) as connection:
        connection.sendall(head.encode() + b'{"corr')
        time.sleep(0.2)
    time.sleep(0.5)
    assert ask(port, "GET", "/", {})[0] == 200
    assert not [record for record in caplog.records if record.exc_info]
