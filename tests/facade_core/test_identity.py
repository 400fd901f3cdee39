"""What charts and views are, whatever else is built in a block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import shapely

from facade_core.core.types import Building, BuildingFinish, IngestSettings, Pose, Street
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.walls import WallRole
from facade_core.imagery.rectify.panorama import find_sightings
from facade_core.plan.identity import chart_ids, serialise_finish
from facade_core.plan.ingest import BlockInputs, build_plan
from facade_core.plan.plan import Plan


def house(name: str, x: float, y: float, height: float = 8.0) -> Building:
    return Building(id=name, footprint=shapely.box(x, y, x + 10, y + 8), height=height, height_source="height")


EAST, NORTH = 385_000.0, 6_671_000.0
HOUSES = [house("a", EAST, NORTH + 5), house("b", EAST + 20, NORTH - 14), house("c", EAST, NORTH + 205)]
STREETS = [
    Street("1", None, shapely.LineString([(EAST, NORTH), (EAST + 30, NORTH)])),
    Street("2", None, shapely.LineString([(EAST, NORTH + 200), (EAST + 30, NORTH + 200)])),
]


def plan(
    houses: list[Building], streets: list[Street] = STREETS, last: Plan | None = None, poses: Sequence[Pose] = ()
) -> Plan:
    from facade_core.geometry.chart_packing import PreviousChartPlacements

    return build_plan(
        BlockInputs(houses, streets, poses=poses, panorama_sizes=[(256, 512)] * len(poses), floor_height=3.2),
        IngestSettings(
            texels_per_metre=4,
            viewpoint_spacing=6.0,
            viewpoint_height=2.5,
            visibility_range=25.0,
            panorama_width=128,
            walls="exemplar",
        ),
        previous=PreviousChartPlacements(last.ids, last.scene.placement) if last else None,
    )


@pytest.fixture(scope="module")
def before() -> Plan:
    return plan(HOUSES)


def looks(found: Plan) -> dict[str, list[str]]:
    return {
        street.id: [found.view_digests[v.id] for v in found.street_viewpoints(index)]
        for index, street in enumerate(found.streets)
    }


def of(found: Plan, building: str) -> set[int]:
    rows = found.scene.charts.building == found.scene.names.index(building)
    return set(found.ids[rows].tolist())


def test_ids_tell_charts_apart_and_are_the_same_again(before: Plan) -> None:
    assert len(set(before.ids.tolist())) == len(before.ids)
    again = plan(HOUSES)
    np.testing.assert_array_equal(again.ids, before.ids)
    assert again.view_digests == before.view_digests


def test_a_building_raised_is_new_and_only_those_who_see_it_look_at_something_else(before: Plan) -> None:
    raised = plan([HOUSES[0], replace(HOUSES[1], height=9.0), HOUSES[2]])
    assert not of(raised, "b") & of(before, "b")
    for name in "ac":
        assert of(raised, name) == of(before, name)
    assert all(one != other for one, other in zip(looks(raised)["1"], looks(before)["1"], strict=True))
    assert looks(raised)["2"] == looks(before)["2"]


def test_order_and_far_away_neighbours_do_not_matter(before: Plan) -> None:
    more = plan([house("0", EAST - 900, NORTH + 700), *reversed(HOUSES)], list(reversed(STREETS)))
    for name in "abc":
        assert of(more, name) == of(before, name)
    assert looks(more) == looks(before)


def test_a_centreline_near_is_seen_and_one_far_away_is_not(before: Plan) -> None:
    near = Street("3", None, shapely.LineString([(EAST + 15, NORTH + 20), (EAST + 15, NORTH + 24)]))
    found = looks(plan(HOUSES, [*STREETS, near]))
    assert found["1"] != looks(before)["1"]
    assert found["2"] == looks(before)["2"]


def test_charts_of_others_keep_their_places(before: Plan) -> None:
    raised = plan([HOUSES[0], replace(HOUSES[1], height=9.0), HOUSES[2]], last=before)
    at = {i: k for k, i in enumerate(before.ids.tolist())}
    stayed = [(k, at[i]) for k, i in enumerate(raised.ids.tolist()) if i in at]
    assert len(stayed) > 10
    one, other = raised.scene.placement, before.scene.placement
    for name in ("page", "x", "y"):
        new, old = np.array(stayed).T
        np.testing.assert_array_equal(getattr(one, name)[new], getattr(other, name)[old])


def test_things_are_found_by_their_boxes(before: Plan) -> None:
    low = np.array([EAST - 1, NORTH + 206, 1.0])
    found = before.scene_objects.digests_in_box(low, low + 2)
    assert found == [f"{int(before.scene_objects.digest[2]):016x}"]
    above = low + np.array([0, 0, 50])
    assert before.scene_objects.digests_in_box(above, above + 2) == []


def test_things_within_a_box_are_those_whose_boxes_meet_it(before: Plan) -> None:
    things = before.scene_objects
    first, last = things.low.min(axis=0), things.high.max(axis=0)
    rng = np.random.default_rng(4)
    corners = [rng.uniform(first - 5, last + 5) for _ in range(80)] + [
        *things.high,
        *things.low,
    ]  # boxes that touch too
    for low in corners:
        high = low + rng.uniform(0, 30, 3)
        meet = (things.low <= high).all(axis=1) & (things.high >= low).all(axis=1)
        assert things.digests_in_box(low, high) == sorted(f"{digest:016x}" for digest in things.digest[meet].tolist())
    assert len(things.digests_in_box(first, np.array([*last[:2], np.inf]))) == len(things.digest)


def test_panoramas_of_facades_are_those_of_all_poses() -> None:
    rng = np.random.default_rng(5)
    middle = np.array([EAST, NORTH])
    poses = [Pose(*(middle + rng.uniform(-400, 400, 2)), 2.5, float(rng.uniform(0, 360))) for _ in range(60)]
    found = plan(HOUSES, poses=poses)
    wanted = [
        (facade, one.panorama, one.seen_share, one.pixels_per_metre)
        for facade, (chart, role) in enumerate(zip(found.facades.chart.tolist(), found.facades.role, strict=True))
        for one in find_sightings(
            found.scene,
            chart,
            found.poses,
            [(256, 512)] * len(poses),
            max_distance=150.0 if role == WallRole.STREET else 40.0,
        )
        if role == WallRole.STREET or one.seen_share >= 0.3
    ]
    shown = found.sightings
    columns = (shown.facade, shown.panorama, shown.seen, shown.pixels_per_metre)
    assert list(zip(*(column.tolist() for column in columns), strict=True)) == wanted
    assert 5 < len(wanted) < len(poses) * len(found.facades)
    assert [len(shown.panoramas_showing(facade)) for facade in range(len(found.facades))] == [
        sum(one[0] == facade for one in wanted) for facade in range(len(found.facades))
    ]


def test_chart_ids_of_stated_finishes_are_pinned() -> None:
    """Stores keep chart ids: another text of a finish would move every chart of such a building."""
    finish = BuildingFinish((200, 180, 160), None, "brick", 'it\'s "slate"')
    assert serialise_finish(finish) == (
        "Finish(wall_colour=(200, 180, 160), roof_colour=None, wall_material='brick', roof_material='it\\'s \"slate\"')"
    )
    wall = Charts(
        kind=np.array([ChartKind.WALL], np.uint8),
        surface=np.zeros(1, np.int32),
        building=np.zeros(1, np.int32),
        origin=np.array([[10.0, 20.0, 9.0]]),
        axis_u=np.array([[1.0, 0.0, 0.0]]),
        axis_v=np.array([[0.0, 0.0, -1.0]]),
        size=np.array([[12.0, 9.0]]),
    )
    assert chart_ids(wall, np.ones(1), ["a"], [finish]).tolist() == [15778953747266423147]
    assert chart_ids(wall, np.ones(1), ["a"]).tolist() == [7553044966866980659]
