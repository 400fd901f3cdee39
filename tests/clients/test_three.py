"""Exports in three.js: a tileset by 3d-tiles-renderer, a model by its own loader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import geopandas as gpd
import pytest

from benchmarks.clients.browser import in_three
from tests.clients.conftest import Exported, first, present

PLACES = [(x, y) for x in range(16, 256, 24) for y in range(16, 256, 24)]


@pytest.mark.long
def test_every_tile_opens_and_a_facade_answers(
    textures: str, browser: Any, exported: Exported, undisturbed: tuple[Path, dict[str, Any]]
) -> None:
    tiles = exported("3dtiles", textures=textures)
    items = gpd.read_parquet(undisturbed[1]["outputs"]["items"]).set_index("id")
    with present(), in_three(browser, tiles) as shown:
        told = shown("figures()")
        assert told["failed"] == []
        assert told["bare"] == [], "every part shows a picture"
        models = [path.name for path in (tiles / "tiles").glob("*.glb")]
        # a far level that the near one replaces at once is left out
        far = sum(name.startswith("far") for name in models)
        assert len(models) - far <= told["models"] <= len(models)
        assert told["textures"] > 0
        assert told["compressed"] == (told["pictures"] if textures == "ktx2" else 0)
        assert shown("colours()") > 500
        found = [row for x, y in PLACES if (row := shown(f"picked({x}, {y})"))]
        facades = [row for row in found if row["kind"] == "facade"]
        assert facades
        for facade in facades:
            row = items.loc[facade["id"]]
            assert facade["floors"] == row.floors
            assert facade["quality"] == row.quality
            assert facade["building"] == row.building
            assert facade["height_m"] == pytest.approx(row.height_m)
        assert shown.said == []


@pytest.mark.long
def test_tiles_in_the_crs_of_the_block_open(browser: Any, exported: Exported) -> None:
    with present(), in_three(browser, exported("3dtiles", crs="native")) as shown:
        told = shown("figures()")
        assert told["failed"] == []
        assert told["bare"] == []
        assert shown("colours()") > 500
        assert any(row and row["kind"] == "facade" for row in (shown(f"picked({x}, {y})") for x, y in PLACES))
        assert shown.said == []


@pytest.mark.parametrize("lit", [False, True])
def test_a_model_opens_with_its_pictures(browser: Any, exported: Exported, lit: bool) -> None:
    with present(), in_three(browser, first(exported("glb", lit=lit))) as shown:
        told = shown("figures()")
        assert told["failed"] == []
        assert told["models"] == 1
        assert told["pictures"] >= 1 + lit, "normals too"
        assert told["bare"] == []
        assert shown("colours()") > 500
        assert shown.said == []
