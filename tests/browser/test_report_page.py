"""The report in Chromium, from its file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.chromium import wait
from tests.faults.hostile_names import hostile_block

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def hostile(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    with hostile_block(tmp_path_factory.mktemp("hostile")) as block:
        yield block


def test_names_that_attack_it_do_nothing_and_its_policy_forbids_nothing_that_it_needs(
    browser: Any, hostile: SimpleNamespace
) -> None:
    page = browser.new_page()
    page.set_default_timeout(300_000)
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("dialog", lambda dialog: said.append(dialog.message))
    page.on("request", lambda request: said.append(request.url) if not request.url.startswith("file:") else None)
    report: Path = hostile.published / "report" / "index.html"
    page.goto(report.as_uri(), wait_until="load")
    page.click("td a")
    page.wait_for_load_state("load")
    assert page.evaluate("getComputedStyle(document.body).maxWidth") == "1320px"
    shown = "[...document.images].filter(image => image.naturalWidth > 0).length"
    wait(page, f"{shown} > 3")  # those further down are loaded when they come near
    page.close()
    assert said == []
