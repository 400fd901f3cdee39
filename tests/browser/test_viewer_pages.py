"""The viewer as a user meets it: its pages in Chromium, served from a real run's folder."""

from __future__ import annotations

import io
import json
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from facade_core.atlas.journal import read_journal, write_record
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from facade_core.atlas.stored_files import digest_stored_file, earlier_picture_path, write_stored_file
from flows.lock import lock_folder
from tests.chromium import FACADES, MAP, tab, wait
from tests.pipeline.viewed import get, viewing

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def address(undisturbed: tuple[Path, dict[str, Any]]) -> Iterator[str]:
    with viewing(undisturbed[0]) as place:
        yield place


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    with tab(browser, {"width": 900, "height": 700}) as opened:
        yield opened


def test_map_facade_and_street_in_a_browser(page: Any, address: str) -> None:
    page.goto(address)
    wait(page, f"{FACADES}.length > 3")
    count = page.evaluate(f"{MAP}.drawn().facades.length")
    assert page.input_value("#coloured-by") == "evidence"
    assert {"in a style", "assumed"} <= set(page.locator(".legend span").all_inner_texts())
    assert count == page.locator("tbody tr").count() > 3
    page.select_option("#coloured-by", "occluded")
    assert "%" in page.locator(".legend").inner_text()
    page.fill("#filter", "Kasarmikatu")
    assert 0 < page.locator("tbody tr").count() < count

    page.locator("tbody a").first.click()
    page.wait_for_selector(".stages img")
    story = [one.get_attribute("class") for one in page.locator(".story figure").all()]
    assert story[-3:] == ["parse", "layout", "texture"]
    assert page.locator("details td").count() == 4 * page.locator("details tbody tr").count() > 40
    assert page.get_attribute("text=In 3D", "href").startswith("#/model/0/")
    first = page.locator("h2").inner_text()
    page.keyboard.press("ArrowRight")
    wait(page, f"document.querySelector('h2').innerText !== {json.dumps(first)}")
    wait(page, "[...document.querySelectorAll('.stages img')].slice(0, 3).every(i => i.complete && i.naturalWidth)")

    page.click("text=Elevations")
    page.wait_for_selector(".elevation img")
    block = json.loads(get(f"{address}/api/block"))
    fronts = [facade for facade in block["facades"] if facade["role"] == "street"]
    assert page.locator(".elevation img").count() == len(fronts)
    widths = page.evaluate(
        "Object.fromEntries([...document.querySelectorAll('.elevation img')].map((i) => [i.alt, i.width]))"
    )
    assert widths == {f"Facade {facade['id']}": pytest.approx(8 * facade["width_m"], abs=1) for facade in fronts}
    page.click("text=To look at")
    wait(page, "document.querySelector('h2').innerText.endsWith('facades to look at')")
    listed = json.loads(get(f"{address}/api/block"))["to_look_at"]
    assert page.locator("figure").count() == len(listed)
    assert page.locator("h2").inner_text().startswith(f"{len(listed)} of {count} ")

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
    opened.set_default_timeout(300_000)
    facade = json.loads(get(f"{address}/api/block"))["facades"][0]["id"]
    for place, there in {
        "map": ".map canvas",
        "elevations": ".elevation img",
        "review": "nav a[aria-current][href='#/review']",
        f"facade/{facade}": ".stages img",
        "street": "#step",
        "model": "#model[data-mode]",
        "run": "progress",
    }.items():
        opened.goto(f"{address}/#/{place}")
        opened.wait_for_selector(there, state="attached")
        found = Axe().run(opened, options={"resultTypes": ["violations"]}).response["violations"]
        assert [v["id"] for v in found if v["impact"] in ("serious", "critical")] == [], place
        assert opened.evaluate("document.documentElement.scrollWidth") <= 390, place
    # on the page of the run: words and numbers are not broken
    assert opened.evaluate(
        "[...document.querySelectorAll('td.name, td.number')].every(cell => {"
        "  const range = document.createRange(); range.selectNodeContents(cell); return range.getClientRects().length === 1; })"
    )
    opened.close()


def test_the_block_in_3d_opens_on_a_street_and_is_walked_through(page: Any, address: str) -> None:
    page.goto(f"{address}/#/model")
    page.wait_for_selector("#model")
    wait(page, "document.getElementById('model').dataset.stands === 'true'")  # software draws slowly

    def said() -> dict[str, Any]:
        values = page.evaluate("({...document.getElementById('model').dataset})")
        return {key: value if key in ("mode", "stands", "engine") else float(value) for key, value in values.items()}

    begun = said()
    assert begun["mode"] == "street"
    assert begun["overGround"] == pytest.approx(1.7, abs=0.01)
    assert abs(begun["pitch"]) < 0.2
    wait(page, "document.querySelector('.note').textContent === ''")
    deadline = time.monotonic() + 120  # for what is loaded to be drawn
    while len((image := seen(page)).quantize(64).getcolors() or []) <= 24:
        assert time.monotonic() < deadline, "nothing is drawn"
    sky, ground = (
        np.asarray(image)[rows, 300:600].reshape(-1, 3).mean(axis=0) for rows in (slice(8, 60), slice(-60, -8))
    )
    assert np.abs(sky - ground).max() > 20

    def walk(*keys: str) -> dict[str, Any]:
        """Hold keys until the walker stands still or has gone 30 m."""
        start = before = said()
        for key in keys:
            page.keyboard.down(key)
        while True:
            page.wait_for_timeout(2500)
            now = said()
            gone, step = (np.hypot(now["x"] - at["x"], now["z"] - at["z"]) for at in (start, before))
            if step < 0.05 or gone > 30:
                break
            before = now
        for key in keys:
            page.keyboard.up(key)
        return now

    page.keyboard.down("w")
    wait(page, f"document.getElementById('model').dataset.z !== '{begun['z']:.3f}'")
    page.keyboard.up("w")
    ahead = said()
    moved = np.array([ahead["x"] - begun["x"], ahead["z"] - begun["z"]])
    assert moved @ [np.sin(begun["yaw"]), -np.cos(begun["yaw"])] > 0.9 * np.linalg.norm(moved) > 0
    # walls stand at the side of a street, and stop who walks into them
    left, right = walk("a", "Shift"), walk("d", "Shift")
    assert min(np.hypot(at["x"] - ahead["x"], at["z"] - ahead["z"]) for at in (left, right)) < 25
    assert right["overGround"] == pytest.approx(1.7, abs=0.01)

    page.click("#shade")
    mesh = "document.getElementById('model').view.tiles.opened[0].group.getObjectByProperty('isMesh', true)"
    wait(page, f"{mesh}.geometry.attributes.color")
    assert page.locator(".controls .legend span").all_inner_texts() == [
        "pictured",
        "completed",
        "in a style",
        "assumed",
    ]
    page.click("#bird")
    wait(page, f"Number(document.getElementById('model').dataset.y) > {begun['y'] + 15}")
    assert said()["mode"] == "bird"
    page.keyboard.press("b")
    wait(page, "Math.abs(Number(document.getElementById('model').dataset.overGround) - 1.7) < 0.01")
    assert said()["mode"] == "street"


def seen(page: Any) -> Image.Image:
    return Image.open(io.BytesIO(page.locator("#model").screenshot())).convert("RGB")


def test_a_run_that_goes_on_is_followed_and_a_failure_says_why(
    page: Any, undisturbed: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    from axe_playwright_python.sync_playwright import Axe

    out = tmp_path / "out"
    shutil.copytree(undisturbed[0], out, ignore=shutil.ignore_patterns("prefect"))
    with viewing(out) as address:
        page.goto(f"{address}/#/run")
        page.wait_for_selector("text=The run has ended")
        session = open_repository(out / "store").writable_session(BRANCH)
        group = open_root(session)
        record = read_journal(group, "facades")[0]
        assert record is not None
        reason = "the photo is cut off; replace it"
        write_record(group, "facades", 0, {"unit": record["unit"], "key": "x", "status": "failed", "reason": reason})
        commit(session, "a facade that fails")
        page.wait_for_selector("text=The run was interrupted; run the block again to resume")
        with lock_folder(out):
            page.wait_for_selector("text=The run is in progress")
        # what changed between two captures, of another: coloured and listed alone, and where, beside how it was
        other = read_journal(group, "facades")[1]
        assert other is not None
        picture = io.BytesIO()
        Image.new("RGB", (8, 6), (200, 60, 30)).save(picture, "WEBP")
        change = {"changed": 0.4, "compared": 0.9, "capture_date": "2024-05-17", "capture_date_before": "2021-03-01"}
        change |= {"change_map": ["-95", "000"], "before_file": earlier_picture_path(7)}
        change |= {"before_digest": digest_stored_file(picture.getvalue())}
        session = open_repository(out / "store").writable_session(BRANCH)
        write_stored_file(open_root(session), earlier_picture_path(7), picture.getvalue(), "as it was before")
        write_record(open_root(session), "facades", 1, {**other, **change})  # type: ignore[typeddict-item]
        commit(session, "a facade that changed")
        page.wait_for_selector("text=1 failed")
        page.click("nav >> text=Map")
        page.check("#changed-only")
        page.wait_for_selector(f"tbody tr:only-child >> text={other['unit']}")
        assert page.evaluate(f"{MAP}.drawn().facades.filter((one) => one.properties.opacity === 1).length") == 1
        assert page.input_value("#coloured-by") == "changed"
        page.click(f"tbody >> text={other['unit']}")
        page.wait_for_selector("text=Changed: 40 % of what both captures show, which counts as changed")
        assert "2021-03-01 to 2024-05-17; both show 90 %" in page.inner_text(".changes")
        assert page.locator(".changes rect").count() == 6 + 4, "the map and its legend"
        wait(page, "document.querySelector('.changes img').naturalWidth === 8")
        found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        assert [v["id"] for v in found] == []
        page.goto(f"{address}/#/run")
        page.click(f"text={record['unit']}")
        page.wait_for_selector(f"text=Failed: {reason}")
