"""Errors of the push of metrics to a collector."""

from __future__ import annotations

import errno
import os

import pytest
import requests
from prometheus_client import CollectorRegistry, Gauge

from facade_core.core.errors import InputError
from tasks.otlp import describe_request_error, send_metrics

REFUSED = f"HTTPConnectionPool(host='x', port=1): Max retries ( [Errno 111] {os.strerror(errno.ECONNREFUSED)})"


@pytest.fixture
def registry() -> CollectorRegistry:
    registry = CollectorRegistry()
    Gauge("units", "Units.", registry=registry).set(3)
    return registry


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (requests.ConnectionError(REFUSED), "Connection refused"),
        (requests.ConnectionError("HTTPConnectionPool(host='x'): NameResolutionError"), "the host is not found or"),
        (requests.ReadTimeout("HTTPConnectionPool(host='x')"), "no answer in time"),
        (requests.exceptions.SSLError("[SSL: WRONG_VERSION_NUMBER]"), "no connection by TLS"),
        (requests.exceptions.ProxyError("HTTPSConnectionPool"), "the proxy of the environment"),
        (requests.exceptions.InvalidURL("Failed to parse"), "it is no address"),
    ],
)
def test_errors_of_requests_are_put_in_plain_words(error: requests.RequestException, words: str) -> None:
    said = describe_request_error(error)
    assert said.startswith(words)
    assert "Pool" not in said


def test_a_password_in_the_address_is_not_shown(registry: CollectorRegistry, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OTEL_EXPORTER_OTLP_TIMEOUT", "1")
    with pytest.raises(InputError, match=r"--otlp http://127\.0\.0\.1:9: takes no metrics") as raised:
        send_metrics(registry, "http://user:secret@127.0.0.1:9")
    assert "secret" not in str(raised.value)
