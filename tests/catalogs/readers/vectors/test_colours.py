"""Colours and materials as they are tagged."""

from __future__ import annotations

import pytest
from shapely import box

from catalogs.readers.vectors import osm
from catalogs.readers.vectors.colours import NAMED_COLOURS, parse_building_finish, parse_colour
from facade_core.core.types import BuildingFinish


@pytest.mark.parametrize(
    ("text", "colour"),
    [
        ("#a0522d", (160, 82, 45)),
        ("A0522D", (160, 82, 45)),
        ("#fff", (238, 238, 238)),
        ("red", NAMED_COLOURS["red"]),
        ("dark_red; white", NAMED_COLOURS["darkred"]),
        ("beige", (238, 238, 220)),
        ("sort of red", None),
        ("", None),
        ("#12345", None),
    ],
)
def test_a_colour_is_read_or_none(text: str, colour: tuple[int, int, int] | None) -> None:
    assert parse_colour(text) == colour


def test_materials_give_a_colour_where_none_is_stated() -> None:
    tags = {"building": "yes", "building:material": "brick", "roof:material": "copper", "roof:colour": "#808080"}
    found = osm.parse_footprint("w1", box(0, 0, 10, 10), tags, [], is_lonlat=False)
    assert found is not None
    assert found.finish.wall_material == "brick"
    assert found.finish.wall_colour is not None
    assert found.finish.wall_colour[0] > found.finish.wall_colour[2] + 40, "bricks are red"
    assert (found.finish.roof_material, found.finish.roof_colour) == ("copper", (128, 128, 128))
    assert parse_building_finish({}) == BuildingFinish()
