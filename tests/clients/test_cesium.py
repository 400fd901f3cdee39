"""3D Tiles in CesiumJS: every tile opens, a click is answered with the catalogue's row, a column colours what it says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import geopandas as gpd
import numpy as np
import pytest

from benchmarks.clients.browser import Opened, in_cesium
from tests.clients.conftest import Exported, present

pytestmark = pytest.mark.long

SIDE = 256
# Of a view's places, those of a grid are asked.
PLACES = [(x, y) for x in range(24, SIDE, 32) for y in range(24, SIDE, 32)]


@dataclass(frozen=True)
class View:
    """A tileset in CesiumJS; rows: what the places that show something answer."""

    shown: Opened
    tiles: Path
    rows: dict[tuple[int, int], dict[str, Any]]

    def colours(self) -> np.ndarray:
        return np.array(self.shown(f"pixels({[list(place) for place in self.rows]})"))


@pytest.fixture(scope="module")
def view(textures: str, browser: Any, exported: Exported) -> Iterator[View]:
    tiles = exported("3dtiles", textures=textures)
    with present(), in_cesium(browser, tiles, side=SIDE) as shown:
        found = {place: shown(f"picked({place[0]}, {place[1]}, 'featureId_0')") for place in PLACES}
        yield View(shown, tiles, {place: row for place, row in found.items() if row})
    assert shown.said == []


def test_every_tile_opens_and_answers(view: View, undisturbed: tuple[Path, dict[str, Any]]) -> None:
    told = view.shown("figures()")
    assert told["failed"] == []
    assert told["loaded"] == len(list((view.tiles / "tiles").glob("*.glb")))
    assert told["textures"] > 0
    items = gpd.read_parquet(undisturbed[1]["outputs"]["items"]).set_index("id")
    found = view.rows.values()
    assert {one["kind"] for one in found} >= {"ground", "roof", "facade"}
    assert {one["building"] for one in found if one["kind"] == "roof"} <= set(items.building.dropna())
    for facade in [one for one in found if one["kind"] == "facade"]:
        row = items.loc[facade["id"]]
        assert facade["floors"] == row.floors
        assert facade["quality"] == row.quality
        assert facade["height_m"] == pytest.approx(row.height_m)


@pytest.mark.parametrize("textures", ["jpeg"], indirect=True, scope="module")
@pytest.mark.parametrize("column", ["floors", "quality", "status", "kind"])
def test_a_column_colours_what_it_says(view: View, column: str) -> None:
    plain = view.colours().astype(int)
    asked = next(row[column] for row in view.rows.values() if row["kind"] == "facade")
    said = np.array([row.get(column) == asked for row in view.rows.values()])
    value = f"'{asked}'" if isinstance(asked, str) else asked
    for condition, red in (("===", said), ("!==", ~said)):
        rule = f"${{{column}}} {condition} {value}"
        view.shown(f"""coloured([["{rule}", "color('#ff0000')"], ["true", "color('#0000ff')"]])""")
        coloured = view.colours()
        assert ((coloured[:, 0] > coloured[:, 2]) == red).mean() >= 0.8, "but for places at edges"
    view.shown("coloured(null)")
    assert (np.abs(view.colours() - plain).max(axis=1) < 8).mean() >= 0.8


def test_windows_of_a_night_shine_where_nothing_else_does(browser: Any, exported: Exported) -> None:
    tiles = exported("3dtiles", night=True)
    with present(), in_cesium(browser, tiles, side=SIDE) as shown:
        told = shown("figures()")
        assert told["failed"] == []
        assert told["loaded"] == len(list((tiles / "tiles").glob("*.glb")))
        dark, lit = shown("bright(false)"), shown("bright(true)")
        assert 0 < dark < lit / 4
    assert shown.said == []
