"""Buildings that begin below their ground are cut off at it, parts of one building together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from catalogs.buildings.buried_feet import cut_buried_feet
from facade_core.core.types import Building, BuildingPassage, ElevationRaster, Roof

HOUSE = Building("a", shapely.box(0, 0, 10, 10), 12.0, "stated", base=0.0, roof=Roof("gabled", 3.0))


def ground(height: float, slope: float = 0.0) -> ElevationRaster:
    east = np.arange(-50.0, 51.0)
    return ElevationRaster(-50.0, 50.0, 1.0, np.tile(height + slope * east, (101, 1)).astype(np.float32))


def test_the_part_below_the_lowest_ground_is_cut_off_and_the_roof_stays() -> None:
    (cut,), (note,) = cut_buried_feet([HOUSE], ground(3.5, 0.1))
    assert cut == replace(HOUSE, base=pytest.approx(3.4, abs=0.11), height=pytest.approx(8.6, abs=0.11))
    assert note == "buildings that begin below their ground cut off at it: 1 (a)"
    assert cut_buried_feet([cut], ground(3.5, 0.1)) == ((cut,), ())


@pytest.mark.parametrize("height", [0.4, 10.0])
def test_a_shallow_foot_and_a_building_below_the_ground_stay(height: float) -> None:
    assert cut_buried_feet([HOUSE], ground(height)) == ((HOUSE,), ())


def test_no_ground_no_cut() -> None:
    assert cut_buried_feet([HOUSE], None) == ((HOUSE,), ())


@pytest.mark.parametrize(
    "other",
    [
        replace(HOUSE, raised=2.0),
        replace(HOUSE, base=None),
        replace(HOUSE, passages=(BuildingPassage(shapely.box(0, 4, 10, 6), 3.0),)),
    ],
)
def test_what_has_no_foot_of_its_own_stays_with_its_whole_building(other: Building) -> None:
    part = replace(other, id="a/2", part_of="a")
    assert cut_buried_feet([HOUSE, part], ground(3.5)) == ((HOUSE, part), ())


def test_parts_have_one_foot() -> None:
    parts = [
        replace(HOUSE, id=f"a/{n}", footprint=shapely.box(10 * n, 0, 10 * n + 10, 10), part_of="a") for n in (1, 2)
    ]
    cut, (note,) = cut_buried_feet([HOUSE, *parts], ground(2.0, 0.06))
    assert [one.base for one in cut] == pytest.approx([1.94] * 3, abs=0.07)
    assert [one.height for one in cut] == pytest.approx([10.06] * 3, abs=0.07)
    assert note.endswith(": 3 (a, a/1, a/2)")
