"""Building parts and underground buildings of Overture Maps."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import geopandas
import pytest
import shapely

from catalogs.block.reader import Block, read_block

EAST, NORTH = 385_000.0, 6_671_000.0
BUILDINGS = {"id": ["08a", "08b"], "height": [9.0, 12.0], "has_parts": [True, False], "is_underground": [False, False]}
PARTS = {
    "id": ["p1", "p2"],
    "building_id": ["08a", "08a"],
    "height": [9.0, 21.0],
    "min_height": [None, 9.0],
    "is_underground": [False, False],
}


def box(x: float, width: float = 20.0) -> shapely.Polygon:
    return shapely.box(EAST + x, NORTH, EAST + x + width, NORTH + 15)


def write(path: Path, columns: Mapping[str, Any], *outlines: shapely.Polygon) -> None:
    table = geopandas.GeoDataFrame(columns, geometry=list(outlines), crs="EPSG:32635").to_crs(4326)
    if path.suffix == ".parquet":
        table.to_parquet(path)
    elif path.suffix == ".gpkg":
        table.to_crs(3067).to_file(path)
    else:
        table.to_file(path)


def read(folder: Path, *names: str) -> Block:
    block = {"name": "b", "crs": "EPSG:32635", "buildings": {"path": list(names)}, "texture": {"walls": "translate"}}
    (folder / "block.yaml").write_text(json.dumps(block))
    return read_block(folder / "block.yaml")


def heights(block: Block) -> dict[str, tuple[float, float]]:
    """Return lower and upper end by id, the roof included."""
    return {
        one.id: (one.raised, round(one.height + (one.roof.height if one.roof else 0.0), 1)) for one in block.buildings
    }


@pytest.mark.parametrize("suffix", [".parquet", ".geojson", ".gpkg"])
@pytest.mark.parametrize("is_reversed", [False, True])
def test_parts_of_a_second_file_replace_their_building(tmp_path: Path, suffix: str, is_reversed: bool) -> None:
    write(tmp_path / "building.parquet", BUILDINGS, box(0), box(30))
    write(tmp_path / f"building_part{suffix}", PARTS, box(0), box(2, 8))
    names = ["building.parquet", f"building_part{suffix}"]
    block = read(tmp_path, *(names[::-1] if is_reversed else names))
    assert heights(block) == {"p1": (0, 9), "p2": (9, 21), "08b": (0, 12)}
    assert {one.part_of for one in block.buildings} == {"08a", None}
    assert not any("parts" in note for note in block.notes)


def test_parts_in_the_file_of_their_buildings(tmp_path: Path) -> None:
    columns = {key: [*BUILDINGS.get(key, [None] * 2), *PARTS.get(key, [None] * 2)] for key in {**BUILDINGS, **PARTS}}
    write(tmp_path / "both.parquet", columns, box(0), box(30), box(0), box(2, 8))
    assert heights(read(tmp_path, "both.parquet")) == {"p1": (0, 9), "p2": (9, 21), "08b": (0, 12)}


def test_missing_parts_are_noted(tmp_path: Path) -> None:
    write(tmp_path / "building.parquet", BUILDINGS, box(0), box(30))
    block = read(tmp_path, "building.parquet")
    assert heights(block) == {"08a": (0, 9), "08b": (0, 12)}
    assert any(note.startswith("buildings whose parts are missing") and "08a" in note for note in block.notes)


def test_openstreetmap_parts_of_a_second_file(tmp_path: Path) -> None:
    write(tmp_path / "a.geojson", {"id": ["w1"], "building": ["yes"], "height": [9.0]}, box(0))
    parts = {"id": ["w2"], "building_part": ["yes"], "height": [20.0]}
    write(tmp_path / "b.geojson", parts, box(0, 8))
    assert heights(read(tmp_path, "a.geojson", "b.geojson")) == {"w1": (0, 9), "w2": (0, 20)}


def test_numbers_of_another_district_are_no_parts(tmp_path: Path) -> None:
    write(tmp_path / "a.gpkg", {"id": ["1", "2"], "height": [9.0, 12.0]}, box(0), box(30))
    write(tmp_path / "b.gpkg", {"id": ["7", "8"], "building_id": ["1", "2"], "height": [5.0, 6.0]}, box(60), box(90))
    assert [one.part_of for one in read(tmp_path, "a.gpkg", "b.gpkg").buildings] == [None] * 4


@pytest.mark.parametrize("suffix", [".parquet", ".geojson", ".gpkg"])
@pytest.mark.parametrize("stated", [True, "true", 1])
def test_underground_buildings_are_set_aside(tmp_path: Path, suffix: str, stated: Any) -> None:
    underground = [type(stated)(0) if not isinstance(stated, str) else "false", stated]
    write(tmp_path / f"b{suffix}", {"id": ["a", "garage"], "is_underground": underground}, box(0), box(30))
    block = read(tmp_path, f"b{suffix}")
    assert [one.id for one in block.buildings] == ["a"]
    assert "buildings under ground set aside: 1 (garage)" in block.notes
