"""Proxies of the environment: requests to this machine never use them, and unusable ones are named."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from urllib.request import getproxies, proxy_bypass

import httpx
import pytest
import requests

from flows.server import startup
from flows.server.proxies import exempt_loopback_from_proxies, find_proxy_defect
from flows.server.startup import ServerDownError, provide_prefect_server

DEAD_PROXY = "http://127.0.0.1:9"
ANSWERING = """
import http.server, sys
class Healthy(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.end_headers()
http.server.HTTPServer(("127.0.0.1", int(sys.argv[1])), Healthy).serve_forever()
"""


@pytest.fixture(autouse=True)
def proxies(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY"):
        monkeypatch.delenv(name.lower(), raising=False)
        monkeypatch.setenv(name, DEAD_PROXY)
    for name in ("no_proxy", "NO_PROXY"):
        monkeypatch.setenv(name, "")  # so that the test's end restores them
        monkeypatch.delenv(name)
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    monkeypatch.setattr("urllib.request._opener", None)  # it would keep these proxies for all tests that follow


def test_the_server_of_a_run_is_reached_past_the_proxy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(startup, "server_command", lambda port: [sys.executable, "-c", ANSWERING, str(port)])
    start = time.monotonic()
    with provide_prefect_server(tmp_path / "prefect") as server:
        server.wait_until_ready()
        assert requests.get(f"{server.url}/health", timeout=5).ok
        assert httpx.get(f"{server.url}/health").is_success
    assert time.monotonic() - start < 60
    assert getproxies()["http"] == DEAD_PROXY  # requests to other machines still use it


@pytest.mark.parametrize("url", ["http://127.0.0.1:4318", "http://localhost:4318", "http://[::1]:4318"])
def test_no_library_sends_a_loopback_request_to_the_proxy(url: str) -> None:
    exempt_loopback_from_proxies()
    assert proxy_bypass(httpx.URL(url).host)
    assert not requests.utils.get_environ_proxies(url, no_proxy=None)
    with httpx.Client() as client:
        assert client._transport_for_url(httpx.URL(url)) is client._transport
        assert client._transport_for_url(httpx.URL("http://example.org")) is not client._transport


@pytest.mark.parametrize(
    ("stated", "both"),
    [
        ({}, "localhost,127.0.0.1,::1"),
        ({"NO_PROXY": " .corp.example , localhost"}, ".corp.example,localhost,127.0.0.1,::1"),
        ({"no_proxy": "a.example", "NO_PROXY": "b.example"}, "a.example,localhost,127.0.0.1,::1"),
    ],
)
def test_stated_exemptions_stay(stated: dict[str, str], both: str) -> None:
    exempt_loopback_from_proxies(stated)
    assert stated == {"no_proxy": both, "NO_PROXY": both}


def test_an_exemption_of_all_hosts_stays() -> None:
    stated = {"NO_PROXY": "*"}
    exempt_loopback_from_proxies(stated)
    assert stated == {"NO_PROXY": "*"}


@pytest.mark.parametrize("proxy", ["socks5://127.0.0.1:9", "127.0.0.1:9:x", "foo://host"])
def test_an_unusable_proxy_is_the_reason_at_once(proxy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert find_proxy_defect() is None
    monkeypatch.setenv("ALL_PROXY", proxy)
    monkeypatch.setattr(startup, "server_command", lambda port: [sys.executable, "-c", ANSWERING, str(port)])
    with provide_prefect_server(tmp_path / "prefect") as server, pytest.raises(ServerDownError, match="ALL_PROXY"):
        server.wait_until_ready()
    assert os.environ["ALL_PROXY"] == proxy
