"""The viewer as a user meets it: a real server over a real run's folder, and Chromium where the machine has one."""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from PIL import Image

from facade_core.atlas.journal import read_journal, write_record
from facade_core.atlas.store import BRANCH, commit, open_repository
from flows.lock import locked
from tasks.viewing import Reader
from tests.pipeline.runs import ROOT, environment

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


@contextmanager
def viewing(out: Path) -> Iterator[str]:
    """The address of a viewer of a run's folder."""
    process = subprocess.Popen(
        [sys.executable, "-m", "flows", "view", str(out), "--port", "0", "--no-open"],
        cwd=ROOT,
        env=environment(out.parent),
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        yield process.stdout.readline().split()[0]
    finally:
        process.terminate()
        process.wait(20)


@pytest.fixture(scope="module")
def address(undisturbed: tuple[Path, dict[str, Any]]) -> Iterator[str]:
    with viewing(undisturbed[0]) as place:
        yield place


def get(address: str, **parameters: Any) -> bytes:
    query = f"?{urllib.parse.urlencode(parameters)}" if parameters else ""
    with urllib.request.urlopen(address + query, timeout=60) as answer:
        return bytes(answer.read())


def refusal(address: str, host: str | None = None, **parameters: Any) -> tuple[int, bytes]:
    request = urllib.request.Request(f"{address}?{urllib.parse.urlencode(parameters)}")
    if host:
        request.add_header("Host", host)
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(request, timeout=60)
    return refused.value.code, refused.value.read()


def test_the_map_holds_every_facade_with_its_columns(address: str, undisturbed: tuple[Path, dict[str, Any]]) -> None:
    import pyarrow.parquet as pq

    block = json.loads(get(f"{address}/api/block"))
    items = {row["id"]: row for row in pq.read_table(undisturbed[1]["outputs"]["items"]).to_pylist()}
    assert {facade["id"] for facade in block["facades"]} == set(items)
    for facade in block["facades"]:
        item = items[facade["id"]]
        for column in block["columns"]:
            if column["name"] in facade:
                assert facade[column["name"]] == pytest.approx(item[column["name"]], abs=0.06), column["name"]
        (x0, y0), (x1, y1) = facade["line"]
        assert np.hypot(x1 - x0, y1 - y0) == pytest.approx(facade["width_m"], abs=0.05)
    assert len(block["viewpoints"]) == undisturbed[1]["viewpoints"] == len(block["seen"])
    seen = {number for numbers in block["seen"] for number in numbers}
    assert seen == set(range(len(block["facades"])))


def test_every_stage_of_a_facade_is_a_picture(address: str) -> None:
    block = json.loads(get(f"{address}/api/block"))
    photos = [facade["id"] for facade in block["facades"] if facade.get("photo")]
    others = [facade["id"] for facade in block["facades"] if not facade.get("photo")]
    assert photos
    assert others
    for facade in (photos[0], others[0]):
        stages = [stage["stage"] for stage in json.loads(get(f"{address}/api/facade", id=facade))["stages"]]
        assert {"parse", "lattice", "layout", "texture", "level-0", "sample", "street"} <= set(stages)
        assert ({"rectified", "hidden"} <= set(stages)) == (facade in photos)
        assert ("source" in stages) == (facade in others)
        for stage in stages:
            image = np.asarray(Image.open(io.BytesIO(get(f"{address}/picture/facade", id=facade, stage=stage))))
            assert image.ndim == 3
            assert image.std() > 5, stage


def test_the_street_grows_with_its_viewpoints(address: str) -> None:
    block = json.loads(get(f"{address}/api/block"))
    street = block["viewpoints"][0]["street"]
    own = [number for number, viewpoint in enumerate(block["viewpoints"]) if viewpoint["street"] == street]

    def unreached(viewpoint: int) -> float:
        image = np.asarray(Image.open(io.BytesIO(get(f"{address}/picture/grown", viewpoint=viewpoint))).convert("RGB"))
        return float((np.abs(image.astype(int) - (226, 222, 214)).max(axis=2) < 8).mean())

    shares = [unreached(viewpoint) for viewpoint in (own[0], own[len(own) // 2], own[-1])]
    assert shares[0] > shares[1] > shares[2]
    assert unreached(own[0]) == pytest.approx(shares[0], abs=0.002)  # backwards too


def test_what_is_not_there_and_who_may_not_ask(address: str) -> None:
    assert refusal(f"{address}/api/facade", id="../../store") == (404, json.dumps({"reason": (
        "no facade ../../store in this block; its page lists those there are")}, separators=(",", ":")).encode())  # fmt: skip
    assert refusal(f"{address}/picture/panorama", viewpoint="-1")[0] == 404
    assert refusal(f"{address}/picture/facade", id="x", stage="texture")[0] == 404
    assert refusal(f"{address}/page/../app.py")[0] == 404
    assert refusal(f"{address}/api/block", host="other.example")[0] == 400


def test_a_folder_without_a_run_is_refused_in_one_line(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "flows", "view", str(tmp_path)], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "no run has written here" in done.stderr


def test_what_is_stale_has_not_failed(undisturbed: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    shutil.copytree(undisturbed[0] / "store", tmp_path / "store")
    session = open_repository(tmp_path / "store").writable_session(BRANCH)
    group = zarr.open_group(session.store)
    record = read_journal(group, "streets")[0]
    assert record is not None
    write_record(group, "streets", 0, record | {"status": "stale", "reason": "another was done again"})
    commit(session, "a street that is out of date")
    said = Reader(tmp_path).view().progress()
    streets = next(stage for stage in said["stages"] if stage["name"] == "streets")
    assert (streets["done"], streets["failed"], streets["stale"]) == (streets["total"] - 1, 0, 1)
    assert said["failures"] == []
    assert said["stale"] == [{"stage": "streets", "unit": record["unit"], "reason": "another was done again"}]


def test_one_run_in_a_folder_is_opened(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    with viewing(undisturbed[0].parent) as place:
        assert json.loads(get(f"{place}/api/block"))["block"] == undisturbed[1]["block"]


@pytest.fixture(scope="module")
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
    deadline = time.monotonic() + 90
    while not page.evaluate(expression):
        assert time.monotonic() < deadline, expression
        page.wait_for_timeout(100)


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    opened = browser.new_page(viewport={"width": 900, "height": 700})
    opened.set_default_timeout(90_000)
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    yield opened
    opened.close()
    assert errors == []


def test_map_facade_and_street_in_a_browser(page: Any, address: str) -> None:
    page.goto(address)
    page.wait_for_selector("line.facade")
    count = page.locator("line.facade").count()
    assert count == page.locator("tbody tr").count() > 3
    page.select_option("#coloured-by", "floors")
    assert "from" in page.locator(".legend").inner_text()
    page.fill("#filter", "Kasarmikatu")
    assert 0 < page.locator("tbody tr").count() < count

    page.locator("tbody a").first.click()
    page.wait_for_selector(".stages img")
    first = page.locator("h2").inner_text()
    page.keyboard.press("ArrowRight")
    wait(page, f"document.querySelector('h2').innerText !== {json.dumps(first)}")
    wait(page, "[...document.querySelectorAll('.stages img')].slice(0, 3).every(i => i.complete && i.naturalWidth)")

    page.click("text=Streets")
    page.wait_for_selector("#panorama")
    before = page.get_attribute("#panorama", "src")
    page.focus("#step")
    page.keyboard.press("ArrowRight")
    wait(page, f"document.getElementById('panorama').getAttribute('src') !== {json.dumps(before)}")
    assert page.evaluate("document.activeElement.id") == "step"
    wait(page, "['panorama', 'grown'].every(id => document.getElementById(id).naturalWidth > 0)")


def test_pages_are_accessible_and_fit_a_phone(browser: Any, address: str) -> None:
    from axe_playwright_python.sync_playwright import Axe

    opened = browser.new_page(viewport={"width": 390, "height": 800})
    opened.set_default_timeout(90_000)
    facade = json.loads(get(f"{address}/api/block"))["facades"][0]["id"]
    for place, there in {
        "map": "line.facade",
        f"facade/{facade}": ".stages img",
        "street": "#step",
        "run": "progress",
    }.items():
        opened.goto(f"{address}/#/{place}")
        opened.wait_for_selector(there)
        found = Axe().run(opened, options={"resultTypes": ["violations"]}).response["violations"]
        assert [v["id"] for v in found if v["impact"] in ("serious", "critical")] == [], place
        assert opened.evaluate("document.documentElement.scrollWidth") <= 390, place
    opened.close()


def test_the_block_in_3d_is_not_blank(browser: Any, address: str) -> None:
    opened = browser.new_page(viewport={"width": 480, "height": 420})
    opened.goto(f"{address}/#/model")
    frame = opened.frame_locator("#model")
    frame.locator("canvas").first.wait_for(timeout=120_000)
    colours = 0
    for _ in range(20):  # the model travels after the canvas is there, and software draws it slowly
        opened.wait_for_timeout(3000)
        image = Image.open(io.BytesIO(frame.locator("canvas").first.screenshot(timeout=120_000))).convert("RGB")
        colours = len(image.quantize(64).getcolors() or [])
        if colours > 24:
            break
    opened.close()
    assert colours > 24


def test_a_run_that_goes_on_is_followed_and_a_failure_says_why(
    page: Any, undisturbed: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(undisturbed[0], out, ignore=shutil.ignore_patterns("prefect"))
    with viewing(out) as address:
        page.goto(f"{address}/#/run")
        page.wait_for_selector("text=The run has ended")
        session = open_repository(out / "store").writable_session(BRANCH)
        group = zarr.open_group(session.store)
        record = read_journal(group, "facades")[0]
        assert record is not None
        reason = "the photo is cut off; replace it"
        write_record(group, "facades", 0, {"unit": record["unit"], "key": "x", "status": "failed", "reason": reason})
        commit(session, "a facade that fails")
        page.wait_for_selector("text=The run was cut off; run the block again to go on")
        with locked(out):
            page.wait_for_selector("text=The run is going on")
        page.wait_for_selector("text=1 failed")
        page.click(f"text={record['unit']}")
        page.wait_for_selector(f"text=Failed: {reason}")
