"""Charts have as many texels as a street can show of them, and facades as many as their pictures hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from facade_core.core.types import Building, IngestSettings, Pose, Street
from facade_core.geometry.chart_packing import PreviousChartPlacements
from facade_core.geometry.charts import ChartKind
from facade_core.plan.ingest import BlockInputs, build_plan
from facade_core.plan.plan import Plan
from facade_core.plan.posed_pictures import replace_panoramas


def plan_of(buildings: list[Building], texels_per_metre: float = 32.0) -> Plan:
    street = Street("s", None, shapely.LineString([(-20, -8), (60, -8)]))
    return build_plan(
        BlockInputs(buildings, [street], floor_height=3),
        IngestSettings(
            texels_per_metre=texels_per_metre,
            viewpoint_spacing=6,
            viewpoint_height=2.5,
            visibility_range=40,
            panorama_width=64,
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
        BlockInputs([house("a", 0, 0)], [replace(before.streets[0]), street], floor_height=3),
        IngestSettings(
            texels_per_metre=32,
            viewpoint_spacing=6,
            viewpoint_height=2.5,
            visibility_range=40,
            panorama_width=64,
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


# Before the front of house a, and before that of house b.
CAMERAS = (Pose(6, -8, 2.5, 0.0), Pose(46, -8, 2.5, 0.0))
COARSE, FINE = (256, 512), (4096, 8192)


def plan_with_cameras(plan: Plan, sizes: dict[int, tuple[int, int]]) -> Plan:
    """The plan with cameras by number, and the size of the panorama of each; charts keep their places."""
    before = PreviousChartPlacements(plan.ids, plan.scene.placement)
    return replace_panoramas(plan, [CAMERAS[n] for n in sizes], list(sizes.values()), before)


def test_a_facade_has_what_its_sharpest_picture_holds_up_to_twice_the_density_of_the_block() -> None:
    plan = plan_of([house("a", 0, 0), house("b", 40, 0)], 8.0)
    front = int(np.flatnonzero((plan.scene.charts.building == 0) & (plan.scene.charts.normals()[:, 1] < -0.9))[0])
    assert plan.scene.placement.texels_per_metre[front] == 8
    assert (plan_with_cameras(plan, {0: COARSE}).scene.placement.texels_per_metre == plan.street_density).all()
    shown = plan_with_cameras(plan, {0: (1024, 2048)})
    held = float(shown.sightings.pixels_per_metre[shown.facades.chart[shown.sightings.facade] == front][0])
    for wanted, expected in ((8.9, 8.0), (9.1, 10.0), (12.3, 12.0), (30.0, 16.0)):
        width = 2 * round(1024 * wanted / held)
        raised = plan_with_cameras(plan, {0: (width // 2, width)})
        assert raised.scene.placement.texels_per_metre[front] == expected
        assert densities(raised, "b", ChartKind.WALL)[0, -1] == 8
        assert (raised.street_density == plan.street_density).all()
        assert (raised.scene.charts.texels(raised.scene.placement.texels_per_metre) == texels(raised)).all()


def test_a_picture_moves_no_other_chart_and_what_it_raised_comes_down_without_it() -> None:
    plan = plan_of([house("a", 0, 0), house("b", 40, 0)], 8.0)
    one = plan_with_cameras(plan, {0: FINE})
    changed = np.flatnonzero(one.ids != plan.ids)
    assert len(changed)
    assert set(changed.tolist()) <= set(one.facades.chart[one.sightings.facade].tolist())
    rest = np.setdiff1d(np.arange(len(plan.ids)), changed)
    for both in (
        plan_with_cameras(one, {0: FINE, 1: FINE}),
        plan_with_cameras(one, {1: FINE}),
        plan_with_cameras(one, {}),
    ):
        same = both.ids == one.ids
        assert same[plan.scene.charts.kind != ChartKind.WALL].all()
        for name in ("page", "x", "y", "width", "height"):
            values = [getattr(of.scene.placement, name) for of in (plan, one, both)]
            assert (values[0][rest] == values[1][rest]).all()
            assert (values[1][same] == values[2][same]).all()
    again = plan_with_cameras(plan_with_cameras(one, {0: FINE, 1: FINE}), {0: FINE})
    assert (again.ids == one.ids).all()
    assert (plan_with_cameras(one, {}).ids == plan.ids).all()


def test_pictures_at_most_double_the_texels_of_a_building_and_the_sharpest_go_first() -> None:
    plan = plan_of([house("a", 0, 0)], 8.0)
    poses = [Pose(6, -12, 2.5, 0.0), Pose(16, 5, 2.5, 0.0), Pose(-4, 5, 2.5, 0.0), Pose(6, 16, 2.5, 0.0)]
    raised = replace_panoramas(plan, poses, [FINE] * 4)
    assert {*densities(raised, "a", ChartKind.WALL).values()} > {16.0}
    building = plan.scene.charts.building == 0
    assert texels(plan)[building].prod(axis=1).sum() * 1.4 < texels(raised)[building].prod(axis=1).sum()
    assert texels(raised)[building].prod(axis=1).sum() < texels(plan)[building].prod(axis=1).sum() * 2.05
    walls, held = densities(raised, "a", ChartKind.WALL), {}
    for facade, metre in zip(raised.sightings.facade, raised.sightings.pixels_per_metre, strict=True):
        side = tuple(np.round(raised.scene.charts.normals()[raised.facades.chart[facade], :2]).astype(int).tolist())
        held[side] = max(held.get(side, 0.0), float(metre))
    assert walls[max(held, key=held.__getitem__)] == max(walls.values())


def test_streets_keep_the_density_of_what_they_write_and_small_walls_keep_theirs() -> None:
    plan = plan_of([house("a", 0, 0)], 8.0)
    written = replace(plan, writable=np.ones_like(plan.writable))
    assert (plan_with_cameras(written, {0: FINE}).ids == plan.ids).all()
    small = plan_of([house("a", 0, 0)], 4.0)  # 48 x 36 texels share a chunk with others of the house
    assert (plan_with_cameras(small, {0: FINE}).ids == small.ids).all()


def texels(plan: Plan) -> np.ndarray:
    placement = plan.scene.placement
    return np.column_stack([placement.width, placement.height])
