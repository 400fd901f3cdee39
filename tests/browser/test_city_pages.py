"""A city in the viewer: one map and one model of all of its blocks, in Chromium."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from benchmarks.programs import served
from facade_core.core.json_types import JsonObject
from flows.lock import lock_folder
from tests.chromium import FACADES, MAP, tab, wait
from tests.pipeline.runs import ROOT
from tests.pipeline.small_city import textured_city
from tests.pipeline.viewed import get, viewing

STATE = "document.getElementById('model').dataset"
VIEW = "document.getElementById('model').view"


@pytest.fixture(scope="module")
def city(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    return textured_city(tmp_path_factory.mktemp("town"))


@pytest.fixture(scope="module")
def address(city: tuple[Path, list[str]]) -> Iterator[str]:
    with viewing(city[0]) as place:
        yield place


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    with tab(browser, {"width": 1280, "height": 720}) as opened:
        yield opened


def box(page: Any) -> list[float]:
    """West and south of what the map shows, its width and height, metres."""
    x0, y0, x1, y1 = page.evaluate(f"{MAP}.box()")
    return [x0, y0, x1 - x0, y1 - y0]


def blocks(state: str) -> str:
    return f"{MAP}.drawn().blocks.filter((one) => one.properties.state === '{state}').length"


@pytest.mark.long
def test_the_map_zooms_and_pans_by_pointer_wheel_keys_and_buttons(page: Any, address: str) -> None:
    page.goto(address)
    wait(page, f"{FACADES}.length > 3")
    assert page.evaluate(f"{MAP}.shapes.size") == 3
    assert page.evaluate(blocks("waiting")) == 1
    whole = box(page)
    place = page.locator(".map canvas").bounding_box()
    middle = (place["x"] + place["width"] / 2, place["y"] + place["height"] / 2)
    page.mouse.move(*middle)
    page.mouse.wheel(0, -300)
    wait(page, f"{MAP}.box()[2] - {MAP}.box()[0] < {0.8 * whole[2]} && !{MAP}.engine.isMoving()")
    near = box(page)
    page.mouse.down()
    page.mouse.move(middle[0] + 100, middle[1], steps=4)
    page.mouse.up()
    wait(page, f"{MAP}.box()[0] < {near[0]} && !{MAP}.engine.isMoving()")
    page.focus(".map canvas")
    before = box(page)
    page.keyboard.press("ArrowRight")
    wait(page, f"{MAP}.box()[0] > {before[0]} && !{MAP}.engine.isMoving()")
    page.keyboard.press("+")
    wait(page, f"{MAP}.box()[2] - {MAP}.box()[0] < {0.6 * before[2]} && !{MAP}.engine.isMoving()")
    page.keyboard.press("0")
    assert box(page)[2] == pytest.approx(whole[2], rel=0.01)
    page.click("[aria-label='Zoom in']")
    wait(page, f"{MAP}.box()[2] - {MAP}.box()[0] < {0.6 * whole[2]} && !{MAP}.engine.isMoving()")
    page.click("[aria-label='Show all']")
    # the bar is as long as it says
    metres = float(page.inner_text(".maplibregl-ctrl-scale").split()[0])
    wide = page.locator(".maplibregl-ctrl-scale").bounding_box()["width"]
    assert wide / metres == pytest.approx(place["width"] / box(page)[2], rel=0.1)
    named = f"{MAP}.engine.queryRenderedFeatures({{layers: ['street-names']}}).map((one) => one.properties.name)"
    wait(page, f"{named}.includes('street 1')")
    # tilted, its buildings stand
    page.focus(".map canvas")
    page.keyboard.press("Shift+ArrowUp")
    wait(page, f"{MAP}.engine.queryRenderedFeatures({{layers: ['solids']}}).length > 1")


def test_what_is_found_is_gone_to_and_marked_and_a_facade_opens(page: Any, address: str) -> None:
    page.goto(address)
    wait(page, f"{FACADES}.length > 3")
    whole = box(page)
    page.fill("#filter", "b")
    wait(page, f"{MAP}.box()[2] - {MAP}.box()[0] < {0.8 * whole[2]}")
    wait(page, f"{MAP}.engine.queryRenderedFeatures({{layers: ['marks']}}).length > 0")
    assert "b (building" in page.inner_text(".hits")
    page.select_option("#coloured-by", "height_m")
    wait(page, "document.querySelector('.legend-row:last-child').innerText.includes('height')")
    assert " m" in page.inner_text(".legend-row:last-child")
    options = page.locator("#coloured-by > option").all_inner_texts()
    assert "Floors" in options
    assert "variation_bytes" not in options
    # by the map
    wait(page, f"{FACADES}.some((one) => one.properties.id.startsWith('b-'))")
    at = page.evaluate(f"""(() => {{
      const line = {MAP}.drawn().facades.find((one) => one.properties.id.startsWith('b-')).geometry.coordinates;
      return {MAP}.engine.project([0, 1].map((axis) => (line[0][axis] + line[1][axis]) / 2));
    }})()""")
    place = page.locator(".map canvas").bounding_box()
    page.mouse.click(place["x"] + at["x"], place["y"] + at["y"])
    wait(page, "location.hash.includes('/facade/')")
    page.wait_for_selector(".stages img")
    assert page.inner_text("h2").startswith("Facade b-")
    wait(page, "document.querySelector('.stages img').naturalWidth > 0")
    page.click("text=On the map")
    wait(page, f"{MAP}.engine.queryRenderedFeatures({{layers: ['marks']}}).length > 0")


def test_the_model_streams_within_its_limit_and_a_click_opens_a_facade(page: Any, address: str) -> None:
    page.goto(f"{address}/#/model")
    page.wait_for_selector("#model[data-mode='street']")
    wait(page, f"{STATE}.stands === 'true' && {STATE}.missing === '0' && {STATE}.coming === '0'")
    assert float(page.evaluate(f"{STATE}.overGround")) == pytest.approx(1.7, abs=0.01)
    assert 0 < int(page.evaluate(f"{STATE}.bytes")) <= int(page.evaluate(f"{STATE}.limit"))
    page.keyboard.down("q")
    wait(page, f"Number({STATE}.fps) > 0")
    page.keyboard.up("q")
    assert "frames a second" in page.inner_text(".figures")
    # at rest nothing is drawn
    page.wait_for_timeout(1500)
    drawn = page.evaluate(f"{STATE}.drawn")
    page.wait_for_timeout(1000)
    assert page.evaluate(f"{STATE}.drawn") == drawn

    page.keyboard.press("b")
    wait(page, f"{STATE}.mode === 'bird' && Number({STATE}.y) > 20")
    page.wait_for_timeout(1500)
    shown = page.evaluate(f"{VIEW}.tiles.opened.filter((tiles) => tiles.visibleTiles.size).length")
    assert shown == 2, "both blocks are in the picture"

    # with few bytes, what is out of sight is let go of
    page.keyboard.press("b")
    wait(page, f"{STATE}.mode === 'street' && {STATE}.missing === '0'")
    held = int(page.evaluate(f"{STATE}.bytes"))
    page.evaluate(f"{VIEW}.tiles.limit = 1; {VIEW}.place(1e5, 0, 1e5)")
    wait(page, f"Number({STATE}.bytes) < {held // 4}")
    page.evaluate(f"{VIEW}.tiles.limit = 1e9")

    # before a wall, Enter opens its facade
    page.evaluate("""(() => {
      const { view } = document.getElementById('model'), [east, north] = view.anchor;
      view.place(385010 - east, 0, north - 6671000, 0); view.pitch = 0.05;
    })()""")
    wait(page, f"{STATE}.stands === 'true' && {STATE}.missing === '0' && Math.abs(Number({STATE}.yaw)) < 0.01")
    page.wait_for_timeout(500)
    page.keyboard.press("Enter")
    wait(page, "location.hash.includes('/facade/a-')")
    page.wait_for_selector(".stages img")


def test_a_city_that_is_running_is_followed(page: Any, address: str, city: tuple[Path, list[str]]) -> None:
    out, names = city
    page.goto(f"{address}/#/blocks")
    page.wait_for_selector(".block-list")
    assert "waiting" in page.inner_text(".block-list")
    with lock_folder(out), lock_folder(out / "blocks" / names[-1]):
        page.wait_for_selector("text=1 running")
        page.wait_for_selector("text=the run of the city is in progress")
        page.click("text=Map")
        wait(page, f"{blocks('running')} === 1")
    wait(page, f"{blocks('waiting')} === 1")
    page.click("text=Blocks")
    page.click(".block-list tbody tr:last-child a")
    page.wait_for_selector("progress")
    page.click("#block-pages >> text=To look at")
    wait(page, "document.querySelector('h2').innerText.endsWith('facades to look at')")


@pytest.mark.long
def test_the_page_is_published_as_files(page: Any, city: tuple[Path, list[str]], tmp_path: Path) -> None:
    def publish(to: Path) -> int:
        command = [sys.executable, "-m", "flows", "publish-page", str(city[0]), "--to", str(to)]
        return subprocess.run(command, cwd=ROOT, timeout=600).returncode

    assert publish(tmp_path / "site") == 0
    missing: list[str] = []
    page.on("response", lambda answer: missing.append(answer.url) if answer.status >= 400 else None)
    with served(site=tmp_path / "site") as address:
        page.goto(f"{address}/site/index.html")
        wait(page, f"{FACADES}.length > 3")
        page.click("tbody a >> nth=0")
        page.wait_for_selector(".story img")
        wait(page, "[...document.querySelectorAll('.story img')].every((image) => image.naturalWidth > 0)")
        assert "Streets" not in page.inner_text("header")
        page.click("text=Elevations")
        wait(page, "document.querySelector('.elevation img')?.naturalWidth > 0")
        page.goto(f"{address}/site/index.html#/model")
        wait(page, f"document.getElementById('model') && {STATE}.stands === 'true'")
    assert missing == []
    # written again, but not over other files
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "kept.txt").touch()
    assert publish(tmp_path / "other") == 2
    assert (tmp_path / "other" / "kept.txt").exists()
    assert publish(tmp_path / "site") == 0


@pytest.mark.long
@pytest.mark.parametrize("size", [(390, 844), (1280, 720)])
def test_pages_of_a_city_are_accessible(browser: Any, address: str, size: tuple[int, int]) -> None:
    from axe_playwright_python.sync_playwright import Axe

    described: JsonObject = json.loads(get(f"{address}/api/city"))
    facade = json.loads(get(f"{address}/blocks/0/api/block"))["facades"][0]["id"]
    assert [block["number"] for block in described["blocks"]] == [0, 1, 2]
    with tab(browser, {"width": size[0], "height": size[1]}) as opened:
        for place, there in {
            "map": ".map canvas",
            "map/0": ".map canvas",
            f"block/0/facade/{facade}": ".stages img",
            "blocks": ".block-list",
            "model": "#model[data-mode]",
            "block/0/run": "progress",
        }.items():
            opened.goto(f"{address}/#/{place}")
            opened.wait_for_selector(there, state="attached")
            opened.wait_for_timeout(500)
            found = Axe().run(opened, options={"resultTypes": ["violations"]}).response["violations"]
            assert [(v["id"], v["nodes"][0]["html"]) for v in found] == [], place
            assert opened.evaluate("document.documentElement.scrollWidth") <= size[0], place
            broken = (
                "[...document.querySelectorAll('th')].filter((e) => !e.innerText.includes(' ') && e.clientHeight > 40)"
            )
            assert opened.evaluate(f"{broken}.map((e) => e.innerText)") == [], place
