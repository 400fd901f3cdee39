"""Walls under a roof are facades as under a flat one; the gables on them are none."""

from __future__ import annotations

import shapely

from facade_core.core.types import Building, IngestSettings, Roof, Street
from facade_core.plan.ingest import BlockInputs, build_plan

HOUSE = Building("h", shapely.box(0, 0, 9, 20), 6.0, "levels", 2)
STREETS = [
    Street("along", None, shapely.LineString([(-8, -20), (-8, 40)])),
    Street("before", None, shapely.LineString([(-20, -8), (30, -8)])),
]


def facades(roof: Roof) -> set[tuple[str, float, int]]:
    house = Building(HOUSE.id, HOUSE.footprint, HOUSE.height, HOUSE.height_source, HOUSE.levels, roof=roof)
    plan = build_plan(
        BlockInputs([house], STREETS, floor_height=3.0),
        IngestSettings(
            texels_per_metre=8.0,
            viewpoint_spacing=8.0,
            viewpoint_height=2.5,
            visibility_range=40.0,
            panorama_width=128,
            walls="exemplar",
        ),
    ).facades
    return {
        (id, round(float(high), 3), int(floors))
        for id, high, floors in zip(plan.id, plan.height, plan.floors, strict=True)
    }


def test_facades_do_not_depend_on_the_roof() -> None:
    flat = facades(Roof("flat", 0.0))
    assert len(flat) >= 2, "one at each street"
    assert facades(Roof("gabled", 4.0, pitch=42.0)) == flat
    assert facades(Roof("gabled", 4.0)) == flat
