"""An index of tiles as a city's source: STAC or a table, paths relative to it, those alone that meet the area."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import geopandas as gpd
import pystac
import pytest
import shapely

from catalogs.city.keys import validate_city_settings
from catalogs.city.tile_index import tile_files_in_area
from facade_core.core.errors import InputError

BOXES = {"a": (24.90, 60.16, 24.92, 60.17), "b": (24.92, 60.16, 24.94, 60.17)}


@pytest.fixture
def tiles(tmp_path: Path) -> Path:
    (tmp_path / "tiles").mkdir()
    for name in BOXES:
        (tmp_path / "tiles" / f"{name}.city.json").write_text("{}")
    return tmp_path


def write_table(folder: Path, name: str, **columns: list) -> Path:
    columns = columns or {"location": [f"tiles/{one}.city.json" for one in BOXES]}
    frame = gpd.GeoDataFrame(columns, geometry=[shapely.box(*box) for box in BOXES.values()], crs="EPSG:4326")
    path = folder / name
    frame = frame.to_crs("EPSG:32635")
    frame.to_parquet(path) if name.endswith(".parquet") else frame.to_file(path)
    return path


def write_stac(folder: Path) -> Path:
    """A catalogue with a collection that has an item for each tile, each in a folder of its own."""
    extent = pystac.Extent(
        pystac.SpatialExtent([list(BOXES["a"])]), pystac.TemporalExtent([[datetime(2026, 1, 1, tzinfo=UTC), None]])
    )
    catalog, collection = pystac.Catalog("c", "tiles"), pystac.Collection("t", "tiles", extent)
    catalog.add_child(collection)
    for name, box in BOXES.items():
        item = pystac.Item(
            name, shapely.geometry.mapping(shapely.box(*box)), list(box), datetime(2026, 1, 1, tzinfo=UTC), {}
        )
        href = (folder / "tiles" / f"{name}.city.json").as_posix()
        item.add_asset("city", pystac.Asset(href, roles=["data"]))
        item.add_asset("preview", pystac.Asset("preview.png", roles=["thumbnail"]))
        collection.add_item(item)
    catalog.normalize_hrefs((folder / "stac").as_posix())
    catalog.make_all_asset_hrefs_relative()
    catalog.save(pystac.CatalogType.SELF_CONTAINED)
    return folder / "stac" / "catalog.json"


def test_every_kind_of_index_names_the_same_tiles(tiles: Path) -> None:
    stac = write_stac(tiles)
    items = [json.loads(path.read_text()) for path in sorted((tiles / "stac").rglob("?.json"))]
    for item in items:
        item["assets"]["city"]["href"] = f"./tiles/{item['id']}.city.json"
        item["links"] = []
    (tiles / "items.json").write_text(json.dumps({"type": "FeatureCollection", "features": items}))
    indexes = [
        stac, tiles / "stac" / "t" / "collection.json", tiles / "items.json", write_table(tiles, "i.parquet"),
        write_table(tiles, "i.gpkg"), write_table(tiles, "i.geojson"),
    ]  # fmt: skip
    for index in indexes:
        found = tile_files_in_area(index, None)
        assert [path.name for path in found] == ["a.city.json", "b.city.json"], index
        assert tile_files_in_area(index, [24.93, 60.161, 24.935, 60.162]) == found[1:], index


def test_a_city_reads_the_files_of_its_index(tiles: Path) -> None:
    write_table(tiles, "i.parquet")
    values = {
        "name": "c", "area": [24.93, 60.161, 24.935, 60.162],
        "buildings": {"tiles": "i.parquet", "crs": "EPSG:32635"}, "streets": {"path": "s.gpkg"},
    }  # fmt: skip
    whole = validate_city_settings(values, tiles / "city.yaml")
    assert not isinstance(whole, str)
    assert whole.block_keys.buildings.path == ["tiles/b.city.json"]
    assert whole.block_keys.buildings.crs == "EPSG:32635"
    assert whole.tile_indexes == (tiles / "i.parquet",)


@pytest.mark.parametrize(
    ("locations", "area", "said"),
    [
        (["https://example.org/a.json", "b"], None, "not on this machine"),
        (["tiles/a.city.json", "tiles/none.city.json"], None, "none.city.json is not there"),
        (
            ["tiles/a.city.json", "tiles/b.city.json"],
            [0, 0, 1, 1],
            "none of its 2 tiles meets 0 0 1 1; they lie within",
        ),
    ],
)
def test_what_cannot_be_used_is_said_in_a_line(tiles: Path, locations: list[str], area: list | None, said: str) -> None:
    with pytest.raises(InputError, match=said) as raised:
        tile_files_in_area(write_table(tiles, "i.parquet", location=locations), area)
    assert "\n" not in str(raised.value)


def test_an_index_that_is_none_is_said_in_a_line(tiles: Path) -> None:
    (tiles / "cut.json").write_text('{"stac_version": ')
    (tiles / "bad.json").write_text('{"stac_version": "1.1.0", "type": "Catalog"}')
    (tiles / "bad.parquet").write_bytes(b"PAR1")
    write_table(tiles, "nameless.parquet", tile=["a", "b"])
    for name in ("absent.json", "cut.json", "bad.json", "bad.parquet", "nameless.parquet"):
        with pytest.raises(InputError, match=name) as raised:
            tile_files_in_area(tiles / name, None)
        assert "\n" not in str(raised.value)
