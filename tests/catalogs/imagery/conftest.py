"""A server of pictures on loopback for every test of fetching."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from benchmarks.imagery_server import Imagery, serving
from catalogs.imagery import http_client
from catalogs.imagery.services import TOKEN_VARIABLE


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Imagery]:
    """Without pictures, which a test gives it. Waits between attempts are short, and there is no token."""
    monkeypatch.setattr(http_client, "SERVICES", replace(http_client.SERVICES, initial_wait_s=0.001))
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    with serving(Imagery(())) as imagery:
        yield imagery
