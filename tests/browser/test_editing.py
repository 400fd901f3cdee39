"""Correcting in the viewer, as somebody with a mouse, and somebody without, does it in Chromium."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from catalogs.block.corrections import Correction, append_corrections_to_file, read_corrections
from tasks.corrections.correction_import import import_corrections
from tasks.engine.store.status import record_run_block_file
from tests.chromium import tab, wait
from tests.pipeline.corrected import made, textured_houses
from tests.pipeline.stages import digests_of
from tests.pipeline.viewed import viewing

pytestmark = pytest.mark.long

FACADE = "b-2"


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return textured_houses(tmp_path_factory.mktemp("edited"))


def copied(once: Path, to: Path) -> Path:
    shutil.copytree(once, to)
    record_run_block_file(to / "out", to / "in" / "block.yaml")
    return to


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    with tab(browser, {"width": 1000, "height": 800}) as opened:
        yield opened


def drag(page: Any, at: tuple[float, float], to: tuple[float, float]) -> None:
    page.mouse.move(*at)
    page.mouse.down()
    page.mouse.move(*((a + b) / 2 for a, b in zip(at, to, strict=True)))
    page.mouse.move(*to)
    page.mouse.up()


def test_boxes_are_edited_by_pointer_and_by_keys_kept_and_done_again(page: Any, once: Path, tmp_path: Path) -> None:
    from axe_playwright_python.sync_playwright import Axe

    folder = copied(once, tmp_path / "edited")
    boxes = page.locator(".boxes .box")

    def place(number: int) -> dict[str, float]:
        names = ("x", "y", "width", "height")
        found = page.locator(f".boxes .box[data-number='{number}']")
        return {name: float(found.get_attribute(name)) for name in names}

    with viewing(folder / "out", "--edit", "--who", "anna") as address:
        page.goto(address)
        wait(page, "document.querySelector('#redo-now') && location.hash === '#/review'")
        assert "token" not in page.url
        page.evaluate(f"location.hash = '#/edit/{FACADE}'")
        boxes.first.wait_for()
        wait(page, "document.querySelector('.boxes image').getBBox().width > 0")
        labels = page.locator("#label option").all_inner_texts()
        assert page.locator(".correcting > .legend span").all_inner_texts() == labels
        count, texels = boxes.count(), page.evaluate("document.querySelector('.boxes').viewBox.baseVal.width")
        assert count > 1
        assert page.is_disabled("#save")

        # by the pointer: one is moved, one is drawn
        page.uncheck("#snap")
        before, shown = place(0), page.locator(".boxes .box[data-number='0']").bounding_box()
        middle = (shown["x"] + shown["width"] / 2, shown["y"] + shown["height"] / 2)
        drag(page, middle, (middle[0] + 0.8 * shown["width"], middle[1]))
        assert place(0)["x"] == pytest.approx(before["x"] + 0.8 * before["width"], abs=0.1)
        assert place(0)["width"] == pytest.approx(before["width"])
        handle = page.locator("[data-edges='s']").bounding_box()
        drag(
            page,
            (handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2),
            (handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2 + 0.2 * shown["height"]),
        )
        assert place(0)["height"] == pytest.approx(1.2 * before["height"], rel=0.1)
        page.click("#undo")
        page.click("#undo")
        assert place(0) == before
        assert page.is_disabled("#save"), "all is undone"
        page.click("#redo")
        assert place(0)["x"] > before["x"]

        # by keys alone: one is added, named, moved to the next line and by a texel; another goes, and comes back
        page.focus(".boxes")
        page.keyboard.press("Escape")
        for key in ("a", "3", "s", "ArrowRight"):
            page.keyboard.press(key)
        assert boxes.count() == count + 1
        assert page.inner_text("#box-said").startswith(f"door, box {count + 1} of {count + 1}: ")
        columns = page.evaluate("[...document.querySelectorAll('.lattice line')].map(l => l.x1.baseVal.value)")
        new = place(count)
        assert min(abs(x - side) for x in columns for side in (new["x"], new["x"] + new["width"])) < 0.01
        page.keyboard.press("s")
        page.keyboard.press("ArrowLeft")
        page.keyboard.press("Shift+ArrowUp")
        moved = place(count)
        assert (moved["x"], moved["height"]) == pytest.approx((new["x"] - 1, new["height"] - 1))
        page.keyboard.press("p")
        page.keyboard.press("Delete")
        assert boxes.count() == count
        page.keyboard.press("Control+z")
        assert boxes.count() == count + 1
        found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        assert [v["id"] for v in found if v["impact"] in ("serious", "critical")] == []

        # kept as an import is
        page.fill("#why", "seen from the street")
        page.keyboard.press("Control+s")
        page.wait_for_selector("text=1 facade and 0 buildings corrected")
        assert page.is_disabled("#save")
        kept = read_corrections(folder / "in" / "block.yaml").by_target[FACADE]["elements"]
        assert (kept.who, kept.why) == ("anna", "seen from the street")
        assert len(kept.value) == count + 1
        doors = [element for element in kept.value if element[0] == "door"]
        assert any(abs(x0 * texels - moved["x"]) < 0.01 for _, x0, *_ in doors)
        assert "anna" in page.inner_text(".correcting li")

        page.click("#redo-now")
        wait(page, "document.querySelector('#redo-said').textContent.includes('units done')")
        assert page.get_attribute("#redo-said", "class") in (None, "")
    other = copied(once, tmp_path / "imported")
    said = {"corrections": [{"facade_id": FACADE, "elements": kept.value}]}
    (other / "said.json").write_text(json.dumps(said))
    import_corrections(other / "out", other / "said.json", who="ben")
    made(other)
    assert digests_of(folder / "out") == digests_of(other / "out") != digests_of(once / "out")


def test_a_completion_is_chosen_undone_completed_again_and_kept(page: Any, once: Path, tmp_path: Path) -> None:
    from axe_playwright_python.sync_playwright import Axe

    folder = copied(once, tmp_path / "completed")
    choices, boxes = page.locator(".completion"), page.locator(".boxes .box")
    places = (
        "JSON.stringify([...document.querySelectorAll('.boxes .box')]"
        ".map((box) => ['number', 'x', 'y'].map((name) => box.dataset[name] ?? box.getAttribute(name))).sort())"
    )

    with viewing(folder / "out", "--edit", "--who", "anna") as address:
        page.goto(address)
        wait(page, "location.hash === '#/review'")
        page.evaluate("location.hash = '#/edit/a-0'")
        boxes.first.wait_for()
        page.uncheck("#snap")
        texels = [
            page.evaluate(f"document.querySelector('.boxes').viewBox.baseVal.{side}") for side in ("width", "height")
        ]
        found = boxes.count()
        page.select_option("#label", "hide")  # what is hidden: the right half
        shown = page.locator(".boxes").bounding_box()
        scale = min(shown["width"] / texels[0], shown["height"] / texels[1])
        middle = shown["x"] + shown["width"] / 2, shown["y"] + shown["height"] / 2
        half = scale * texels[0] / 2, scale * texels[1] / 2
        drag(
            page,
            (middle[0] + 0.05 * half[0], middle[1] - 0.97 * half[1]),
            (middle[0] + 0.97 * half[0], middle[1] + 0.97 * half[1]),
        )
        page.click("#complete")
        choices.first.wait_for()
        assert 2 <= choices.count() <= 5
        before = page.evaluate(places)
        page.click(".completion >> nth=1")
        chosen = page.evaluate(places)
        assert chosen != before
        assert choices.nth(1).get_attribute("aria-pressed") == "true"
        drawn = page.evaluate("document.querySelectorAll('.completion')[1].querySelectorAll('rect').length")
        assert boxes.count() == drawn + 1, "the hidden part stays a box"
        page.click("#undo")
        assert page.evaluate(places) == before
        page.click("#redo")
        assert page.evaluate(places) == chosen
        violations = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        assert [v["id"] for v in violations] == []

        # one box is drawn where nothing was seen: the others are completed again, and it stays
        page.focus(".boxes")
        page.keyboard.press("Escape")
        page.select_option("#label", "door")
        page.focus(".boxes")
        for key in ("a", *["ArrowRight"] * 8):
            page.keyboard.press(key)
        assert page.inner_text("#box-said").startswith("door, box")
        left = float(page.locator(".boxes .held").get_attribute("x"))
        assert left > 0.6 * texels[0]
        assert choices.first.is_disabled()
        page.click("#complete")
        wait(page, "document.querySelector('.completion:enabled') && !document.querySelector('#complete').disabled")
        page.click(".completion >> nth=0")
        page.click("#save")
        page.wait_for_selector("text=1 facade and 0 buildings corrected")
        kept = read_corrections(folder / "in" / "block.yaml")
        elements = kept.value_correction("a-0", "elements")
        assert elements is not None
        assert any(name == "door" and abs(x0 * texels[0] - left) < 0.01 for name, x0, *_ in elements)
        assert len(elements) == boxes.count() - 1
        page.click("#redo-now")
        wait(page, "document.querySelector('#redo-said').textContent.includes('units done')")
        wait(page, "document.querySelector('#completed').textContent.includes('complete again')")
        assert boxes.count() == len(elements) + 1, "the next run has what was chosen"
        assert found


def test_what_is_hidden_and_kept_an_exemplar_a_height_a_roof_and_materials(
    page: Any, once: Path, tmp_path: Path
) -> None:
    from axe_playwright_python.sync_playwright import Axe

    folder = copied(once, tmp_path / "block")
    block = folder / "in" / "block.yaml"
    boxes = page.locator(".boxes .box")
    with viewing(folder / "out", "--edit", "--who", "anna") as address:
        page.goto(address)
        wait(page, "location.hash === '#/review'")
        page.evaluate("location.hash = '#/edit/a-0'")
        page.wait_for_selector("#height")
        assert f"kept in {block.with_suffix('.corrections.jsonl')}" in page.inner_text("#keys")
        before = boxes.count()
        for label in ("hide", "keep"):
            page.focus(".boxes")
            page.keyboard.press("Escape")
            page.select_option("#label", label)
            page.click("text=Add a box")
            wait(page, f"document.querySelector('#box-said').textContent.startsWith('{label}, box')")
        columns = page.evaluate("[...document.querySelectorAll('.lattice line')].map(l => l.x1.baseVal.value)")
        left, wide = (float(boxes.last.get_attribute(name)) for name in ("x", "width"))
        assert min(abs(x - side) for x in columns for side in (left, left + wide)) < 0.01, "a new box is on the lattice"
        page.fill("#height", "8.25")
        page.select_option("#exemplar", "1")
        # its roof and materials too, by pointer and by keys; all is undone as boxes are
        assert page.is_disabled("#roof_height"), "a flat roof has none"
        page.select_option("#roof_shape", "gabled")
        page.fill("#roof_height", "2.5")
        page.focus("#wall_material")
        page.keyboard.press("b")
        assert page.input_value("#wall_material") == "brick"
        page.fill("#wall_colour", "red")
        page.fill("#pick_roof_colour", "#203040")
        assert page.input_value("#roof_colour") == "#203040"
        page.focus("#pick_roof_colour")
        page.keyboard.press("Control+z")
        assert page.input_value("#roof_colour") == ""
        page.keyboard.press("Control+y")
        page.click("#undo")
        page.click("#undo")
        assert (page.input_value("#wall_colour"), page.input_value("#wall_material")) == ("", "brick")
        page.click("#redo")
        page.click("#redo")
        found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        assert [v["id"] for v in found] == []
        page.fill("#wall_colour", "reddish")
        page.click("#save")
        page.wait_for_selector("#saved.failed")
        assert "'reddish' is no colour" in page.inner_text("#saved")
        page.fill("#wall_colour", "red")
        page.click("#save")
        page.wait_for_selector("text=1 facade and 1 building corrected")
        assert page.input_value("#wall_colour") == "#9e4232"
        said = read_corrections(block)
        made_of = {what: said.by_target["a"].pop(what).value for what in list(said.by_target["a"]) if "_" in what}  # type: ignore[attr-defined]
        assert made_of == {
            "roof_shape": "gabled", "roof_height": 2.5, "wall_material": "brick", "wall_colour": "#9e4232",
            "roof_colour": "#203040",
        }  # fmt: skip
        assert {what: len(said.value_correction("a-0", what)) for what in said.by_target["a-0"]} == {
            "hide": 1,
            "keep": 1,
        }
        assert {what: one.value for what, one in said.by_target["a"].items()} == {"height": 8.25, "exemplar": "1"}
        # who comes back finds it so, and takes a box away
        page.evaluate("location.hash = '#/review'")
        page.wait_for_selector("#height", state="detached")
        page.evaluate("location.hash = '#/edit/a-0'")
        page.wait_for_selector("#height")
        assert (boxes.count(), page.input_value("#height"), page.input_value("#exemplar")) == (before + 2, "8.25", "1")
        wait(page, "document.activeElement.classList.contains('boxes')")  # keys are the picture's at once
        page.keyboard.press("p")
        page.keyboard.press("Delete")
        page.select_option("#exemplar", "")
        page.keyboard.press("Control+s")
        wait(page, "document.querySelector('#saved').textContent.includes('corrected in')")
        said = read_corrections(block)
        assert (set(said.by_target["a-0"]), set(said.by_target["a"])) == ({"hide"}, {"height", *made_of})


def test_a_wall_that_is_none_storeys_and_who_holds_another_token(page: Any, once: Path, tmp_path: Path) -> None:
    folder = copied(once, tmp_path / "block")
    copied(once, tmp_path / "another")
    block = folder / "in" / "block.yaml"
    with viewing(tmp_path, "--edit", "--who", "anna") as address:
        # of a folder with several runs one is opened, and there is a way back; a map that comes late does not cover it
        late: list[Any] = []

        def hold(route: Any) -> None:
            late.append(route)

        page.route("**/map_page.js", hold)
        page.goto(address)
        wait(page, "location.hash === '#/map'")
        page.click("nav >> text=Blocks")
        page.wait_for_selector(".block-list tbody tr")
        late[0].continue_()
        page.evaluate("import('./page/map_page.js').then(() => null)")
        assert [name.split()[-1] for name in page.locator(".block-list td:first-child").all_inner_texts()] == [
            "another/out",
            "block/out",
        ]
        page.click("tr:has-text('another/out') a")
        wait(page, "location.hash.endsWith('/review')")
        page.click("nav >> text=Blocks")
        page.wait_for_selector(".block-list tbody tr")
        assert "token" not in page.url
        page.click("tr:has-text('block/out') a")
        wait(page, "location.hash === '#/block/1/review'")
        page.wait_for_selector("#redo-now")
        page.evaluate("location.hash = '#/block/1/edit/a-0'")
        page.click("#not-a-facade")
        page.fill("#storeys", "400")
        page.click("#save")
        page.wait_for_selector("#saved.failed")
        assert "400 is not within 1 and 300" in page.inner_text("#saved")
        assert not read_corrections(block), "all or none"
        page.fill("#storeys", "3")
        page.click("#save")
        page.wait_for_selector("text=1 facade and 1 building corrected")
        said = read_corrections(block)
        assert said.value_correction("a-0", "facade") is False
        assert said.value_correction("a", "levels") == 3
        # somebody else's is not overwritten unseen
        append_corrections_to_file(block, [Correction("a", "levels", 5, who="ben", when="2026-01-02T03:04:05Z")])
        page.fill("#storeys", "4")
        page.click("#save")
        page.wait_for_selector("#saved.failed")
        assert "corrected meanwhile" in page.inner_text("#saved")
        assert read_corrections(block).value_correction("a", "levels") == 5
        page.wait_for_selector("text=levels of a: ben, 2026-01-02")
        page.fill("#storeys", "")
        assert page.is_disabled("#save"), "an empty field says nothing"
        page.fill("#storeys", "4")
        page.click("#save")
        wait(page, "!document.querySelector('#saved').classList.contains('failed')")
        assert read_corrections(block).value_correction("a", "levels") == 4
        page.click("#as-found")
        wait(page, "document.querySelector('#not-a-facade').getAttribute('aria-pressed') === 'false'")
        assert not read_corrections(block), "of its building too"
        base = page.url.partition("#")[0]
        page.evaluate("sessionStorage.setItem('token', 'another')")
        page.goto(f"{base}?again#/block/1/facade/a-0")
        page.wait_for_selector("text=Nothing can be corrected: the token is missing")
        page.wait_for_selector(".stages img")
        assert page.locator("text=Correct it").count() == 0
