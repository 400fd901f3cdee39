"""Charts have as many texels as a street can show of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from facade_core.core.types import Building, Street
from facade_core.geometry.charts import ChartKind
from facade_core.plan.ingest import BlockInputs, IngestSettings, build_plan
from facade_core.plan.plan import Plan


def plan_of(buildings: list[Building], texels_per_metre: float = 32.0) -> Plan:
    street = Street("s", None, shapely.LineString([(-20, -8), (60, -8)]))
    return build_plan(
        BlockInputs(buildings, [street]),
        IngestSettings(
            texels_per_metre=texels_per_metre,
            viewpoint_spacing=6,
            viewpoint_height=2.5,
            visibility_range=40,
            panorama_width=64,
            floor_height=3,
            walls="exemplar",
        ),
    )


def house(name: str, x: float, y: float) -> Building:
    return Building(name, shapely.box(x, y, x + 12, y + 10), 9.0, "height")


def densities(plan: Plan, building: str, kind: int) -> dict[tuple[int, int], float]:
    """By the outward normal's sides, rounded."""
    charts, placement = plan.scene.charts, plan.scene.placement
    own = (charts.building == plan.scene.names.index(building)) & (charts.kind == kind)
    normal = np.round(charts.normals()[:, :2]).astype(int)
    return {tuple(normal[c].tolist()): float(placement.texels_per_metre[c]) for c in np.flatnonzero(own)}


def test_near_fronts_are_finest_and_what_turns_its_back_coarsest() -> None:
    plan = plan_of([house("a", 0, 0), house("far", 0, 30)])
    walls = densities(plan, "a", ChartKind.WALL)
    assert walls[0, -1] == 32
    assert walls[0, 1] == 8
    assert densities(plan, "far", ChartKind.WALL)[0, -1] == 16  # 38 m from the street
    assert set(densities(plan, "a", ChartKind.ROOF).values()) == {8.0}
    placement, charts = plan.scene.placement, plan.scene.charts
    assert (placement.texels_per_metre[charts.kind == ChartKind.GROUND].max()) == 32
    texels = np.column_stack([placement.width, placement.height])
    assert (np.abs(texels - (charts.size.T * placement.texels_per_metre).T) <= 1).all()


def test_party_walls_are_coarse_and_other_houses_change_nothing() -> None:
    alone = densities(plan_of([house("a", 0, 0)]), "a", ChartKind.WALL)
    assert alone[1, 0] == 32
    beside = densities(plan_of([house("a", 0, 0), house("b", 12, 0)]), "a", ChartKind.WALL)
    assert beside[1, 0] == 8
    before = densities(plan_of([house("a", 0, 0), house("hides", 13, 0)]), "a", ChartKind.WALL)
    assert before == alone


def test_what_is_coarse_already_stays() -> None:
    assert set(plan_of([house("a", 0, 0)], 12.0).scene.placement.texels_per_metre.tolist()) == {12.0}
    assert set(plan_of([house("a", 0, 0)], 20.0).scene.placement.texels_per_metre.tolist()) == {20.0, 10.0}


def test_ids_tell_densities_apart() -> None:
    """A street that comes near makes a wall finer, and its texels due."""
    before = plan_of([house("a", 0, 0)])
    street = Street("t", None, shapely.LineString([(-20, 18), (60, 18)]))
    after = build_plan(
        BlockInputs([house("a", 0, 0)], [replace(before.streets[0]), street]),
        IngestSettings(
            texels_per_metre=32,
            viewpoint_spacing=6,
            viewpoint_height=2.5,
            visibility_range=40,
            panorama_width=64,
            floor_height=3,
            walls="exemplar",
        ),
    )
    back, now = (
        next(
            (int(number), float(density))
            for number, density, normal, kind in zip(
                plan.ids,
                plan.scene.placement.texels_per_metre,
                plan.scene.charts.normals(),
                plan.scene.charts.kind,
                strict=True,
            )
            if kind == ChartKind.WALL and normal[1] > 0.9
        )
        for plan in (before, after)
    )
    assert back[1] == 8
    assert now[1] == 32
    assert back[0] != now[0]
