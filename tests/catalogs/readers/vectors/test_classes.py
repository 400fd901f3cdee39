"""Ground in the words and columns of many maps: files of every format, layers, classes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import geopandas
import pytest
import shapely
from pyproj import CRS
from shapely import LineString, Point

from catalogs.block.ground import build_block_ground
from catalogs.features import CentrelinesAndGround
from catalogs.readers.formats import read_centrelines, read_ground_features
from catalogs.readers.vectors.ground_classes import osm_ground_tags
from facade_core.core.errors import InputError
from facade_core.core.types import MappedGround

METRIC = "EPSG:3067"
SUFFIXES = [".gpkg", ".geojson", ".parquet", ".shp", ".fgb"]
EAST, NORTH = 385_000.0, 6_672_000.0
AROUND = shapely.box(EAST - 500, NORTH - 500, EAST + 500, NORTH + 500)


def at(shape: Any) -> Any:
    return shapely.affinity.translate(shape, EAST, NORTH)


def written(path: Path, shapes: list[Any], layer: str | None = None, **columns: list[Any]) -> Path:
    frame = geopandas.GeoDataFrame(columns, geometry=[at(shape) for shape in shapes], crs=METRIC)
    if path.suffix == ".geojson":
        frame = frame.to_crs(4326)
    if path.suffix == ".parquet":
        frame.to_parquet(path)
    else:
        frame.to_file(path, **({"layer": layer} if layer else {}))
    return path


def drawn(*sources: CentrelinesAndGround) -> MappedGround:
    return build_block_ground(sources, CRS(METRIC), AROUND, None)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_columns_of_streets_are_read_of_every_format(suffix: str, tmp_path: Path) -> None:
    path = written(
        tmp_path / f"roads{suffix}",
        [LineString([(0, 0), (90, 0)]), LineString([(0, 50), (90, 50)]), LineString([(0, 90), (90, 90)])],
        road_class=["collector", "local", "Fietspad"],
        breedte=[9.5, None, None],
        lanes=[2, None, None],
        verharding=["asfalt", "Klinkers", None],
        sidewalk_left=["no", "yes", None],
        parking_right=["yes", None, None],
        cycleway_both=["no", "yes", None],
    )
    found = read_centrelines(path)
    assert len(found.items) == 2  # no camera travels the cycle path
    ways = {(way.kind, round(way.line.centroid.y - NORTH)): way for way in drawn(found).ways}
    main, local = ways["road", 0], ways["road", 50]
    assert (main.width, main.lanes, main.rank, main.surface, main.assumed) == (9.5, 2, 5, "asphalt", False)
    assert main.pavement[0] == 0.0 < main.pavement[1]
    assert main.parking == (0.0, 2.1)
    assert (local.rank, local.surface, local.assumed) == (3, "slabs", True)
    assert sorted(place for kind, place in ways if kind == "cycle") == [46, 54, 90]


AREAS = [
    ("Grünfläche", "grass"),
    ("parking_lot", "asphalt"),
    ("Watervlakte", "water"),
    ("squares", "slabs"),
    ("erf", "slabs"),
    ("beach", "gravel"),
    ("residential", None),
]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_areas_by_a_column_of_classes(suffix: str, tmp_path: Path) -> None:
    boxes = [shapely.box(20 * i, 0, 20 * i + 10, 10) for i in range(len(AREAS))]
    path = written(tmp_path / f"cover{suffix}", boxes, landcover=[word for word, _ in AREAS])
    found = drawn(read_ground_features(path)).areas
    expected = {20 * i: surface for i, (_, surface) in enumerate(AREAS) if surface}
    assert {round(area.outline.bounds[0] - EAST): area.surface for area in found} == expected


def test_layers_say_what_their_features_are(tmp_path: Path) -> None:
    path = tmp_path / "city.gpkg"
    written(path, [LineString([(0, 0), (90, 0)])], "streets", name=["A"])
    written(path, [shapely.box(0, 10, 30, 40)], "parks", note=["x"])
    written(path, [Point(45, 0)], "crossings", note=["x"])
    written(path, [shapely.box(50, 10, 80, 40)], "buildings", height=[9.0])
    found = read_centrelines(path)
    assert [piece.name for piece in found.items] == ["A"]
    ground = drawn(found)
    assert sorted(way.kind for way in ground.ways) == ["crossing", "road"]
    assert [area.surface for area in ground.areas] == ["grass"]
    again = drawn(read_centrelines(written(tmp_path / "one.gpkg", [LineString([(0, 0), (90, 0)])], name=["A"])),
                  read_ground_features(written(tmp_path / "park.shp", [shapely.box(0, 10, 30, 40)], id=["7"])))  # fmt: skip
    assert [area.outline for area in again.areas] == [area.outline for area in ground.areas]
    with pytest.raises(InputError, match="holds nothing of the ground"):
        read_ground_features(written(tmp_path / "halls.gpkg", [shapely.box(0, 0, 9, 9)], height=[3.0]))


def test_what_two_files_call_the_same_is_two_things(tmp_path: Path) -> None:
    one, two = (
        written(tmp_path / name, [shapely.box(x, 0, x + 9, 9)], id=["1"], leisure=["park"])
        for name, x in (("a.gpkg", 0), ("b.gpkg", 50))
    )
    areas = drawn(read_ground_features(one), read_ground_features(two)).areas
    assert len({area.id for area in areas}) == len(areas) == 2


@pytest.mark.parametrize(
    ("tags", "highway"),
    [
        ({"class": "S1400"}, "residential"),
        ({"class": "S1720"}, "steps"),
        ({"highway": "primary_link", "class": "alley"}, "primary_link"),
        ({"class": "unknown\nwoonerf"}, "living_street"),
        ({"class": "nothing of the kind"}, None),
        ({"class": "secondary", "railway": "rail"}, None),
    ],
)
def test_classes_of_streets(tags: dict[str, str], highway: str | None) -> None:
    assert osm_ground_tags(tags).get("highway") == highway


def test_one_way_and_tunnels_in_other_words() -> None:
    assert osm_ground_tags({"oneway": "FT"})["oneway"] == "yes"
    assert osm_ground_tags({"oneway": "B"})["oneway"] == "B"
    assert osm_ground_tags({"tunnel": "F", "parking:left": "true"}) == {"tunnel": "no", "parking:left": "lane"}
    assert osm_ground_tags({"class": "tram"}) == {"railway": "tram"}


def test_roads_of_the_french_map(tmp_path: Path) -> None:
    columns = {
        "NATURE": ["Route à 1 chaussée", "Escalier", "Sentier"],
        "NOM_VOIE_G": ["R DE RIVOLI", None, None],
        "SENS": ["Sens direct", "Double sens", None],
    }
    lines = [at(LineString([(0, y), (50, y)])) for y in (0, 10, 20)]
    geopandas.GeoDataFrame(columns, geometry=lines, crs=METRIC).to_file(tmp_path / "s.shp")
    found = read_centrelines(tmp_path / "s.shp")
    assert [item.name for item in found.items] == ["R DE RIVOLI"]
    assert [one.tags.get("highway") for one in found.ground] == ["unclassified", "steps", "path"]
    assert [one.tags.get("oneway") == "yes" for one in found.ground] == [True, False, False]
