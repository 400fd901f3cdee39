"""Chromium, where the machine has one: tests that drive it are skipped elsewhere."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from typing import Any

import pytest

from benchmarks.programs import CHROMIUM, SOFTWARE_GL


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine")
    from playwright.sync_api import sync_playwright

    # inside a container Chromium's own sandbox cannot start; it meets nothing here but the viewer's pages
    arguments = [*SOFTWARE_GL, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=arguments)
        yield started
        started.close()


def wait(page: Any, expression: str) -> None:
    """Until a JavaScript expression is true: the page's policy forbids the browser to be given functions to poll."""
    deadline = time.monotonic() + 300
    while not page.evaluate(expression):
        assert time.monotonic() < deadline, expression
        page.wait_for_timeout(100)
