"""Roofs are assumed where none is stated, say so, and leave stated heights and roofs as they are."""

from __future__ import annotations

from dataclasses import replace

import pytest
from pyproj import CRS
from shapely import Polygon, box

from catalogs.buildings.assembly import assemble_buildings
from catalogs.features import Footprint, Footprints
from facade_core.core.types import Building, Roof

RD = CRS.from_epsg(28992)


def built(*footprints: Footprint) -> tuple[Building, ...]:
    return assemble_buildings([Footprints("EPSG:28992", footprints)], RD, area=None, floor_height=3.0).items


def roof_of(footprint: Footprint) -> Roof:
    roof = built(footprint)[0].roof
    assert roof is not None
    return roof


ROW = Footprint("row", box(0, 0, 14, 30), None, 5, None)


def test_what_is_stated_stays() -> None:
    stated = Roof("hipped", 3.0)
    (house,) = built(replace(ROW, height=12.0, roof=stated))
    assert (house.height, house.roof) == (12.0, stated)
    assert house.roof.confidence == 1.0
    (flat,) = built(replace(ROW, height=12.0, roof=Roof("flat", 0.0)))
    assert (flat.height, flat.roof.shape, flat.roof.confidence) == (12.0, "flat", 1.0)


def test_an_assumed_roof_is_taken_off_a_height_and_stands_on_storeys() -> None:
    (by_height,) = built(replace(ROW, height=18.0, levels=None))
    assert by_height.roof.height > 2
    assert by_height.height + by_height.roof.height == pytest.approx(18.0)
    (by_levels,) = built(ROW)
    assert (by_levels.height, by_levels.roof) == (15.0, by_height.roof)
    assert 0 < by_levels.roof.confidence < 1
    assert built(ROW) == built(ROW)


@pytest.mark.parametrize(
    "footprint",
    [
        replace(ROW, use="warehouse"),
        replace(ROW, year_built=1962),
        replace(ROW, levels=12),
        replace(ROW, outline=box(0, 0, 60, 60)),
        replace(ROW, levels=1, outline=box(0, 0, 20, 20)),
    ],
)
def test_halls_deep_and_later_buildings_are_flat(footprint: Footprint) -> None:
    assert roof_of(footprint).shape == "flat"


def test_ids_choose_among_the_likely_ones() -> None:
    shapes = {roof_of(replace(ROW, id=f"w{number}")).shape for number in range(40)}
    assert shapes == {"gabled", "hipped", "mansard"}
    pitches = [roof_of(replace(ROW, id=f"w{number}")).pitch for number in range(40)]
    assert all(pitch is not None and 24 <= pitch <= 66 for pitch in pitches)


def test_a_stated_height_of_a_roof_is_kept_and_a_shed_is_low() -> None:
    assert roof_of(replace(ROW, roof_height=2.5)).height == 2.5
    shed = Polygon([(0, 0), (6, 0), (6, 4), (0, 4)])
    roof = roof_of(replace(ROW, levels=1, outline=shed))
    assert roof.shape in ("flat", "skillion")
    assert roof.height <= 1.0
