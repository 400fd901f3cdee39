"""3D Tiles in CesiumJS: every tile opens, a click is answered with the catalogue's row, a column colours what it says."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import geopandas as gpd
import pytest

from benchmarks.programs import served
from tasks.export.formats import export
from tests.clients.conftest import package

SIDE = 256
# Of a view's places, those of a grid are asked.
PLACES = [(x, y) for x in range(48, SIDE, 32) for y in range(48, SIDE, 32)]


@pytest.fixture(scope="module", params=["jpeg", "webp", "ktx2"])
def opened(
    request: pytest.FixtureRequest,
    browser: Any,
    undisturbed: tuple[Path, dict[str, Any]],
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Any]:
    cesium = package("cesium") / "Build" / "Cesium"
    if request.param == "ktx2":
        pytest.importorskip("alktx2", reason="no encoder of KTX2; `make ktx2-setup` installs it")
    tiles = export(undisturbed[0], "3dtiles", tmp_path_factory.mktemp("tiles") / "3d", textures=request.param).path
    with served(pages=Path(__file__).parent, tiles=tiles, cesium=cesium) as address:
        page = browser.new_page(viewport={"width": SIDE, "height": SIDE})
        said: list[str] = []
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on(
            "request", lambda one: said.append(one.url) if not one.url.startswith((address, "data:", "blob:")) else None
        )
        page.goto(f"{address}/pages/cesium.html")
        page.evaluate("start(1)")
        deadline = time.monotonic() + 240
        while not page.evaluate("shown.ready"):
            assert time.monotonic() < deadline, page.evaluate("figures()")
            page.wait_for_timeout(200)
        yield page, tiles, undisturbed[0]
        page.close()
        assert said == []


def test_every_tile_opens_and_answers(opened: Any) -> None:
    page, tiles, out = opened
    told = page.evaluate("figures()")
    assert told["failed"] == []
    assert told["loaded"] == len(list((tiles / "tiles").glob("*.glb")))
    assert told["textures"] > 0
    snapshot = (out / "current").read_text().strip()
    items = gpd.read_parquet(out / "published" / snapshot / "items.parquet").set_index("id")
    found = [one for x, y in PLACES if (one := page.evaluate(f"picked({x}, {y}, 'featureId_0')"))]
    assert {one["kind"] for one in found} >= {"ground", "roof"}
    buildings = set(items.building.dropna())
    assert {one["building"] for one in found if one["kind"] == "roof"} <= buildings
    facades = [one for one in found if one["kind"] == "facade"]
    for facade in facades:
        row = items.loc[facade["id"]]
        assert facade["floors"] == row.floors
        assert facade["quality"] == row.quality
        assert facade["height_m"] == pytest.approx(row.height_m)


def test_a_column_colours_what_it_says(opened: Any) -> None:
    page, _, _ = opened
    page.evaluate("""coloured([["${kind} === 'ground'", "color('#0000ff')"], ["true", "color('#ff0000')"]])""")
    right = asked = 0
    for x, y in PLACES:
        if one := page.evaluate(f"picked({x}, {y}, 'featureId_0')"):
            red, _, blue = page.evaluate(f"pixel({x}, {y})")
            asked += 1
            right += (blue > red) == (one["kind"] == "ground")
    page.evaluate("coloured(null)")
    assert asked > 5
    assert right >= 0.9 * asked, "but for places at edges"
