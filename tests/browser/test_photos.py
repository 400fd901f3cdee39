"""Deciding in Chromium which walls photos show, by pointer and by keys alone; the next run has them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from benchmarks.matching import photo_of
from benchmarks.painter.street_truth import synthetic_street
from catalogs.block.reader import read_block
from facade_core.core.types import Pose
from tasks.matching.match_table import (
    COLUMNS,
    TABLE,
    FacadeCandidate,
    MatchTable,
    format_match_row,
    read_match_table,
    write_match_table,
)
from tests.chromium import FACADES, MAP, tab, wait
from tests.pipeline.corrected import HOUSES, STREET, made
from tests.pipeline.stages import EAST, NORTH, write_block
from tests.pipeline.viewed import get, viewing

pytestmark = pytest.mark.long

FRONTS = ("a-0", "b-2")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two houses, textured without a photo; three photos, of which one is sure, and one is of no wall here."""
    folder = tmp_path_factory.mktemp("photos")
    write_block(folder / "in", buildings=HOUSES, streets=STREET)
    made(folder)
    street = synthetic_street(4, seed=2, occluders=0, texels_per_metre=14.0)
    (folder / "taken").mkdir()
    for number, chart in enumerate(street.charts[:3]):
        photo, *_ = photo_of(street, chart, np.random.default_rng(number))
        Image.fromarray(photo).save(folder / "taken" / f"IMG_{number}.jpg", quality=90)
    pose = Pose(EAST + 14.0, NORTH - 4.0, None, 350.0)
    rows = [
        format_match_row(
            "IMG_0.jpg",
            None,
            [FacadeCandidate("b-2", 0.52, "seen"), FacadeCandidate("a-0", 0.41, "seen too")],
            pose,
            has_heading=True,
        ),
        format_match_row("IMG_1.jpg", "b-2", [FacadeCandidate("b-2", 0.93, "before it")], pose, has_heading=False),
        format_match_row("IMG_2.jpg", None, [], pose, has_heading=False),
    ]
    write_match_table(MatchTable(folder / "in" / TABLE, COLUMNS, tuple(rows)))
    return folder


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    with tab(browser, {"width": 1100, "height": 900}) as opened:
        yield opened


def said(folder: Path) -> dict[str, tuple[str, str]]:
    return {
        match.photo: (match.facade, match.decided_by) for match in read_match_table(folder / "in" / TABLE).matches()
    }


def test_photos_find_their_walls_by_pointer_and_by_keys_and_the_run_has_them(page: Any, folder: Path) -> None:
    from axe_playwright_python.sync_playwright import Axe

    block = folder / "in" / "block.yaml"
    with viewing(folder / "out", "--edit", "--who", "anna", "--photos", str(folder / "taken")) as address:
        base = address.partition("/#")[0]
        page.goto(address)
        page.wait_for_selector(".photos")
        assert page.url == f"{base}/#/photos"
        assert page.inner_text("h2") == "Photo IMG_0.jpg", "one that is left to a person comes first"
        assert "photo 1 of 3, 2 left to you" in page.inner_text("#left")
        wait(page, "document.querySelector('#photo').naturalWidth === 1280")
        wait(page, "[...document.querySelectorAll('.candidate img')].every(i => i.naturalWidth > 0)")
        marks = page.evaluate(f"{MAP}.drawn().marks.map((one) => [one.properties.kind, one.properties.name])")
        assert sorted(name for kind, name in marks if kind == "sign") == ["1", "2"]
        assert {"here", "looks"} <= {kind for kind, _ in marks}
        assert "52 %" in page.inner_text(".candidate >> nth=0")
        assert "Seen too." in page.inner_text(".candidate >> nth=1")
        found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        assert [v["id"] for v in found] == []

        # by the pointer: a candidate, a wall of the map, and back
        page.click(".candidate >> nth=0")
        assert page.is_checked("#wall-0")
        wait(page, f"{FACADES}.some((one) => one.properties.id === 'a-0')")
        at = page.evaluate(f"""(() => {{
          const [a, b] = {MAP}.drawn().facades.find((one) => one.properties.id === 'a-0').geometry.coordinates;
          return {MAP}.engine.project([(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]);
        }})()""")
        page.locator(".photos .map canvas").click(position=at)
        assert page.is_checked("#wall-1")
        page.click("#undo")
        page.click("#undo")
        assert page.locator(".candidate input:checked").count() == 0
        page.click("#redo")
        assert page.is_checked("#wall-0")

        # two photos of one wall are refused, and nothing is written
        page.click("#save")
        page.wait_for_selector("#saved.failed")
        assert "shows b-2 already" in page.inner_text("#saved")
        assert not read_block(block).photos
        assert said(folder)["IMG_0.jpg"] == ("", "")

        # by keys alone: the other candidate; the next photo shows no wall of the block; undone, and done again
        page.locator(".photos").focus()
        page.keyboard.press("2")
        assert page.is_checked("#wall-1")
        page.keyboard.press("n")
        wait(page, "document.querySelector('h2').innerText === 'Photo IMG_2.jpg'")
        assert "No wall of the block is likely" in page.inner_text(".photos fieldset")
        page.keyboard.press("0")
        assert page.is_checked("#none")
        page.keyboard.press("p")
        wait(page, "document.querySelector('h2').innerText === 'Photo IMG_0.jpg'")
        page.keyboard.press("Control+z")
        wait(page, "document.querySelector('h2').innerText === 'Photo IMG_2.jpg'")
        assert not page.is_checked("#none")
        page.keyboard.press("Control+y")
        assert page.is_checked("#none")
        assert page.inner_text("#save") == "Save, and take 2 photos"
        page.keyboard.press("Control+s")
        page.wait_for_selector("text=2 photos taken into the block")
        assert page.is_disabled("#save")
        assert said(folder) == {"IMG_0.jpg": ("a-0", "anna"), "IMG_1.jpg": ("b-2", ""), "IMG_2.jpg": ("", "anna")}
        taken = read_block(block)
        assert not taken.photos_rectified
        assert {name: path.read_bytes() for name, path in taken.photos.items()} == {
            "a-0": (folder / "taken" / "IMG_0.jpg").read_bytes(),
            "b-2": (folder / "taken" / "IMG_1.jpg").read_bytes(),
        }
        assert page.locator("tr[aria-current]").inner_text().split("\t") == ["IMG_2.jpg", "–", "decided by anna"]

        page.click("#redo-now")
        wait(page, "document.querySelector('#redo-said').textContent.includes('units done')")
        for facade in FRONTS:
            stages = json.loads(get(f"{base}/api/facade", id=facade))["stages"]
            assert "rectified" in [stage["stage"] for stage in stages]

        # of what was decided elsewhere meanwhile the next save tells, and nothing of it is saved over, nor undone
        table = read_match_table(folder / "in" / TABLE)
        write_match_table(
            MatchTable(
                table.path,
                table.columns,
                tuple({**row, "by": row["by"] if row["facade"] else ""} for row in table.rows),
            )
        )
        page.locator(".photos").focus()
        page.keyboard.press("p")
        wait(page, "document.querySelector('h2').innerText === 'Photo IMG_0.jpg'")
        page.keyboard.press("0")
        page.keyboard.press("Control+s")
        wait(page, "document.querySelector('#left').textContent.startsWith('decided by anna')")
        assert said(folder) == {"IMG_0.jpg": ("", "anna"), "IMG_1.jpg": ("b-2", ""), "IMG_2.jpg": ("", "")}
        assert page.is_disabled("#save")
        page.keyboard.press("Control+z")
        page.keyboard.press("Control+s")
        wait(page, "document.querySelector('#left').textContent.startsWith('decided by anna')")
        assert said(folder) == {"IMG_0.jpg": ("a-0", "anna"), "IMG_1.jpg": ("b-2", ""), "IMG_2.jpg": ("", "")}

        # what was decided elsewhere meanwhile is not overwritten
        table = read_match_table(folder / "in" / TABLE)
        write_match_table(MatchTable(table.path, table.columns, tuple({**row, "by": "ben"} for row in table.rows)))
        page.keyboard.press("0")
        page.keyboard.press("Control+s")
        page.wait_for_selector("#saved.failed")
        assert "meanwhile" in page.inner_text("#saved")
        assert said(folder)["IMG_0.jpg"] == ("a-0", "ben")
        page.set_viewport_size({"width": 390, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
