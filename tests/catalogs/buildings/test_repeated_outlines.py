"""Buildings of one file with one outline."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
import shapely
import shapely.affinity
from pyproj import CRS

from catalogs.buildings.assembly import BlockBuildings, assemble_buildings
from catalogs.buildings.repeated_outlines import find_repeated_outlines
from catalogs.features import Footprint, Footprints

BOX = shapely.box(385_000, 6_671_000, 385_012, 6_671_012)


def assemble(*items: Footprint) -> BlockBuildings:
    source = Footprints("EPSG:32635", items)
    return assemble_buildings([source], CRS("EPSG:32635"), area=None, floor_height=3.0)


def footprint(id: str, height: float | None = 9.0, **keys: Any) -> Footprint:
    return Footprint(id, BOX, height, None, None, **keys)


def test_the_highest_of_equal_outlines_is_kept_with_a_note() -> None:
    found = assemble(footprint("a", None), footprint("b", 9.0), footprint("c", 12.0))
    assert [one.id for one in found.items] == ["c"]
    assert found.notes == ("buildings with the outline of another in their file, the highest kept: 2 (a, b)",)


@pytest.mark.parametrize(
    "keys", [{"min_height": 9.0, "height": 20.0}, {"base": 9.0}, {"is_part": True, "height": 12.0}]
)
def test_stacked_buildings_are_kept(keys: dict[str, Any]) -> None:
    found = assemble(footprint("a"), footprint("b", **keys))
    assert not any("outline of another" in note for note in found.notes)


def test_neighbours_are_different() -> None:
    row = [shapely.box(x, 0, x + 6, 12) for x in range(0, 60, 6)]
    inner = shapely.box(0.2, 0.2, 5.8, 11.8)
    assert not find_repeated_outlines([*row, inner], [0] * 11, [0.0] * 11).any()


def test_two_thousand_equal_outlines_take_seconds() -> None:
    start = time.perf_counter()
    repeated = find_repeated_outlines([BOX] * 2000, [0] * 2000, np.arange(2000.0).tolist())
    assert np.flatnonzero(~repeated).tolist() == [1999]
    assert len(assemble(*(footprint(f"b{i}") for i in range(2000))).items) == 1
    assert time.perf_counter() - start < 10.0
