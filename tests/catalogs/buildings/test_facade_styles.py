"""A building takes the facade style that its tags say, and without tags the one of its size."""

from __future__ import annotations

from typing import Any

import pytest
from pyproj import CRS
from shapely import box

from catalogs.buildings.assembly import assemble_buildings
from catalogs.features import Footprint, Footprints
from facade_core.core.facade_styles import FACADE_STYLES
from facade_core.core.types import BuildingFinish, Roof

RD = CRS.from_epsg(28992)
NEIGHBOUR = Footprint("neighbour", box(-20, 0, 0, 10), None, 4, None)
FLAT = Roof("flat", 0.0)


def likely_style(
    width: float, levels: float, *, attached: bool = False, material: str | None = None, **tags: Any
) -> str:
    """Return the style of a building 10 m deep."""
    finish = BuildingFinish(wall_material=material)
    own = Footprint("own", box(0, 0, width, 10), None, levels, None, finish=finish, **tags)
    stated = [own, NEIGHBOUR] if attached else [own]
    items = assemble_buildings([Footprints("EPSG:28992", stated)], RD, area=None, floor_height=3.0).items
    return next(one.facade_style for one in items if one.id == "own")


TAGGED = (
    ("terrace, whole row", 60, 2, {"use": "terrace"}, "brick-terrace"),
    ("house in a row", 6, 2, {"use": "house", "attached": True}, "brick-terrace"),
    ("house", 12, 2, {"use": "house"}, "villa"),
    ("bungalow", 14, 1, {"use": "bungalow"}, "villa"),
    ("low flats mapped as one", 45, 2, {"use": "residential"}, "brick-terrace"),
    ("flats of 1905", 20, 6, {"use": "apartments", "year_built": 1905}, "perimeter-block"),
    ("flats of 1974", 60, 8, {"use": "apartments", "year_built": 1974, "attached": True}, "concrete-slab"),
    ("flats that stand alone", 60, 8, {"use": "apartments"}, "concrete-slab"),
    ("flats in a row", 20, 6, {"use": "apartments", "attached": True}, "perimeter-block"),
    ("office of 1999", 40, 6, {"use": "office", "year_built": 1999, "attached": True}, "office-glass"),
    ("office of 1890", 40, 6, {"use": "office", "year_built": 1890}, "perimeter-block"),
    ("industry", 90, 2, {"use": "industrial"}, "warehouse"),
    ("garages", 30, 1, {"use": "garages"}, "warehouse"),
    ("tall mill", 30, 8, {"use": "industrial", "attached": True}, "perimeter-block"),
    ("glass", 30, 9, {"material": "glass"}, "office-glass"),
    ("sheet metal", 30, 2, {"material": "metal"}, "warehouse"),
    ("wood", 30, 2, {"material": "wood", "attached": True}, "villa"),
    ("brick in a row", 30, 4, {"material": "brick", "attached": True}, "brick-terrace"),
    ("concrete", 30, 6, {"material": "concrete", "attached": True}, "concrete-slab"),
    ("kindergarten", 30, 1, {"use": "public"}, "villa"),
    ("church", 30, 4, {"use": "church"}, "perimeter-block"),
)
BY_SIZE = (
    ("narrow in a row", 6, 3, {"attached": True}, "brick-terrace"),
    ("wide in a row", 25, 5, {"attached": True}, "perimeter-block"),
    ("hall in a yard", 25, 1, {"attached": True}, "warehouse"),
    ("small, alone", 12, 2, {}, "villa"),
    ("hall", 120, 1, {"roof": FLAT}, "warehouse"),
    ("high, alone, flat roof", 50, 9, {"roof": FLAT}, "concrete-slab"),
    ("high, alone, pitched roof", 50, 6, {"roof": Roof("gabled", 4.0)}, "perimeter-block"),
    ("high, alone, of 1912", 50, 6, {"roof": FLAT, "year_built": 1912}, "perimeter-block"),
)


@pytest.mark.parametrize(
    ("width", "levels", "tags", "style"), [one[1:] for one in TAGGED], ids=[one[0] for one in TAGGED]
)
def test_tags_decide(width: float, levels: float, tags: dict[str, Any], style: str) -> None:
    assert likely_style(width, levels, **tags) == style


@pytest.mark.parametrize(
    ("width", "levels", "tags", "style"), [one[1:] for one in BY_SIZE], ids=[one[0] for one in BY_SIZE]
)
def test_size_decides_without_tags(width: float, levels: float, tags: dict[str, Any], style: str) -> None:
    assert likely_style(width, levels, **tags) == style


def test_every_style_is_given() -> None:
    assert {one[-1] for one in TAGGED} == set(FACADE_STYLES)


def test_a_part_counts_its_floors_from_the_ground_and_its_own_building_is_no_neighbour() -> None:
    whole = Footprint("whole", box(0, 0, 40, 20), None, 2, None, use="residential")
    part = Footprint("part", box(0, 0, 20, 20), None, 8, None, is_part=True, min_level=2)
    items = assemble_buildings([Footprints("EPSG:28992", [whole, part])], RD, area=None, floor_height=3.0).items
    assert {one.id: one.facade_style for one in items} == {"part": "concrete-slab", "whole": "brick-terrace"}
