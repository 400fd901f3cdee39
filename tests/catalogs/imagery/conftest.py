"""A server of pictures on loopback for every test of fetching."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.imagery_server import Imagery, serving
from catalogs.imagery.services import TOKEN_VARIABLE


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Imagery]:
    """Without pictures, which a test gives it. Waits between attempts are short, and there is no token."""
    monkeypatch.setattr("catalogs.imagery.http_client.INITIAL_WAIT_S", 0.001)
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    with serving(Imagery(())) as imagery:
        yield imagery
