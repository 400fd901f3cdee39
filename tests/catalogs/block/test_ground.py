"""Tags of a map as ways and areas of the ground."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import geopandas
import pytest
import shapely
from pyproj import CRS

from catalogs.block.ground import build_block_ground, ways_from_tags
from catalogs.block.reader import Block
from catalogs.features import CentrelinesAndGround, GroundFeature
from facade_core.core.types import GroundWay

LINE = shapely.LineString([(0, 0), (40, 0)])
UTM = CRS("EPSG:32635")


def road(**tags: str) -> GroundWay:
    return ways_from_tags("w1", LINE, {key.replace("__", ":"): value for key, value in tags.items()})[0]


@pytest.mark.parametrize(
    ("tags", "width", "assumed"),
    [
        ({"highway": "residential"}, 6.0, True),
        ({"highway": "residential", "oneway": "yes"}, 4.0, True),
        ({"highway": "primary", "lanes": "4"}, 13.6, False),
        ({"highway": "tertiary", "width": "5.5 m"}, 5.5, False),
        ({"highway": "residential", "parking__both": "lane"}, 10.2, True),
        ({"highway": "residential", "parking__lane__left": "perpendicular"}, 11.0, True),
        ({"highway": "residential", "lanes": "soon", "width": "-3"}, 6.0, True),
        ({"width": "5"}, 5.0, False),
    ],
)
def test_width_is_what_tags_say_else_by_class(tags: dict[str, str], width: float, assumed: bool) -> None:
    found = road(**tags)
    assert (found.kind, found.width, found.assumed) == ("road", pytest.approx(width), assumed)


def test_ways_without_a_carriageway_have_none() -> None:
    kinds = {
        name: ways_from_tags("w", LINE, {"highway": name}) for name in ("footway", "pedestrian", "steps", "cycleway")
    }
    assert {name: found[0].kind for name, found in kinds.items()} == {
        "footway": "path", "pedestrian": "path", "steps": "steps", "cycleway": "cycle",
    }  # fmt: skip
    assert ways_from_tags("w", LINE, {"highway": "footway", "footway": "sidewalk"}) == []
    assert ways_from_tags("w", LINE, {"highway": "proposed"}) == []
    assert ways_from_tags("w", LINE, {"railway": "tram", "gauge": "1000"})[0].width == 1.0
    beside = ways_from_tags("w", LINE, {"highway": "primary", "cycleway:right": "track"})
    assert [way.kind for way in beside] == ["road", "cycle"]
    assert beside[1].line.centroid.y < -beside[0].width / 2


def test_surfaces_pavements_and_lanes() -> None:
    assert road(highway="residential", surface="cobblestone").surface == "setts"
    assert road(highway="residential", sidewalk="left").pavement[1] == 0.0
    assert road(highway="residential", sidewalk="no").pavement == (0.0, 0.0)
    assert min(road(highway="residential").pavement) > 0
    assert (road(highway="secondary", lanes="2").lanes, road(highway="residential", lanes="2").lanes) == (2, 0)


def test_crossings_areas_and_what_is_hidden() -> None:
    features = (
        GroundFeature("w1", LINE, {"highway": "residential", "name": "A"}),
        GroundFeature(
            "w2", shapely.LineString([(40, 0), (60, 0)]), {"highway": "residential", "name": "A", "lanes": "3"}
        ),
        GroundFeature("n3", shapely.Point(10, 0.2), {"highway": "crossing"}),
        GroundFeature("n4", shapely.Point(10, 30), {"highway": "crossing"}),
        GroundFeature("n5", shapely.Point(20, 0), {"highway": "crossing", "crossing": "unmarked"}),
        GroundFeature("w6", shapely.box(0, 20, 30, 40), {"leisure": "park"}),
        GroundFeature("w7", shapely.box(500, 500, 600, 600), {"natural": "water"}),
        GroundFeature("w8", LINE, {"highway": "residential", "tunnel": "yes"}),
        GroundFeature("w9", shapely.box(10, 25, 14, 28), {"place": "square", "surface": "sett"}),
    )
    around = shapely.box(-50, -50, 50, 50)
    broken = GroundFeature("w10", shapely.LineString([(1e300, 0), (40, 0)]), {"highway": "residential"})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not build_block_ground([CentrelinesAndGround(None, (), ground=(broken,))], UTM, around, around).ways
    ground = build_block_ground([CentrelinesAndGround(None, (), ground=features[::-1])], UTM, around, around)
    assert [(way.id, way.kind) for way in ground.ways] == [("w1", "road"), ("w2", "road"), ("n3", "crossing")]
    assert [way.width for way in ground.ways[:2]] == [6.0, 6.0]  # the kerb of a street runs on
    assert ground.ways[1].line.bounds[2] == 50.0
    assert ground.ways[2].line.length == pytest.approx(7.0)
    assert [(area.id, area.surface) for area in ground.areas] == [("w6", "grass"), ("w9", "setts")]


@pytest.mark.long
def test_a_block_takes_the_ground_of_further_files(read: Callable[..., Block], folder: Path) -> None:
    square = shapely.box(24.9425, 60.1665, 24.9430, 60.1668)
    geopandas.GeoDataFrame({"kind": ["lawn"]}, geometry=[square], crs=4326).to_file(folder / "areas.geojson")
    before, after = read(), read("ground: {path: [areas.geojson]}")
    assert after.digest != before.digest
    more = [area for area in after.ground.areas if area not in before.ground.areas]
    assert [(area.surface, round(area.outline.area, -1)) for area in more] == [("grass", 930)]
    alone = read("ground: {path: areas.geojson}", streets="")
    assert ([area.surface for area in alone.ground.areas], alone.ground.ways) == (["grass"], ())
