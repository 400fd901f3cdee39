"""Chromium, where the machine has one: tests that drive it are skipped elsewhere."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest

from benchmarks.programs import MissingProgramError, chromium

# The page's map, its engine, and the facades that it has drawn.
MAP = "document.querySelector('.map')?.map"
FACADES = "(document.querySelector('.map')?.map.engine.queryRenderedFeatures({layers: ['facades']}) ?? [])"


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with ExitStack() as stack:
        try:
            started = stack.enter_context(chromium(stack.enter_context(sync_playwright())))
        except MissingProgramError as absent:
            pytest.skip(str(absent))
        yield started


@contextmanager
def tab(browser: Any, viewport: dict[str, int]) -> Iterator[Any]:
    """A page so large, {"width", "height"}, on whose scripts no error may be left when it is closed."""
    opened = browser.new_page(viewport=viewport)
    opened.set_default_timeout(300_000)
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    yield opened
    opened.close()
    assert errors == []


def wait(page: Any, expression: str) -> None:
    """Until a JavaScript expression is true: the page's policy forbids the browser to be given functions to poll."""
    deadline = time.monotonic() + 300
    while not page.evaluate(expression):
        assert time.monotonic() < deadline, expression
        page.wait_for_timeout(100)
