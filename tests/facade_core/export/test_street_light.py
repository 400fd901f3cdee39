"""Lamps and lit windows shine on ground and walls at night."""

from __future__ import annotations

import numpy as np

from facade_core.core.street_objects import OBJECT_KIND_NAMES, PlacedObjects
from facade_core.export.lighting.settings import STREET_LIGHT
from facade_core.export.lighting.street_light import (
    NO_EMITTERS,
    Emitters,
    join_emitters,
    lamp_emitters,
    street_light,
    window_emitters,
)
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene

# South of the first house, whose front is at y = 6671990.
FRONT, COURT = (386010.0, 6671987.0, 6.0), (386010.0, 6672003.0, 6.0)


def lamp(position: tuple[float, float, float]) -> Emitters:
    return Emitters(np.array([position]), np.array([[0.0, 0, -1]]), np.array([STREET_LIGHT.lamp_power]))


def lit_points(scene: Scene, kind: ChartKind, emitters: Emitters) -> np.ndarray:
    """The middles of lit texels, of a metre."""
    found = [np.zeros((0, 3))]
    for chart in np.flatnonzero(scene.charts.kind == kind).tolist():
        wide, high = np.ceil(scene.charts.size[chart]).astype(int).tolist()
        light = street_light(scene, chart, emitters, (high, wide))
        if light is not None:
            y, x = np.nonzero(light.max(axis=2) > 1e-3)
            sides = scene.charts.size[chart] / (wide, high)
            found.append(scene.charts.points(chart, (x + 0.5) * sides[0], (y + 0.5) * sides[1]))
    return np.concatenate(found)


def test_a_lamp_lights_its_side_of_a_house(houses: Scene) -> None:
    ground, walls = (lit_points(houses, kind, lamp(FRONT)) for kind in (ChartKind.GROUND, ChartKind.WALL))
    assert len(ground)
    assert ground[:, 1].max() < 6671991, "not the court behind it"
    assert np.linalg.norm(ground[:, :2] - FRONT[:2], axis=1).max() < STREET_LIGHT.reach_m
    assert len(walls)
    assert (np.abs(walls[:, 1] - 6671990) < 0.1).all(), "the fronts alone"
    assert walls[:, 2].max() < FRONT[2] + 0.6, "nothing above it: it shines down"
    assert not len(lit_points(houses, ChartKind.WALL, NO_EMITTERS))


def test_light_falls_with_distance_and_adds_up(houses: Scene) -> None:
    (chart,) = np.flatnonzero(houses.charts.kind == ChartKind.GROUND)[:1].tolist()
    shape = tuple(np.ceil(houses.charts.size[chart][::-1]).astype(int).tolist())
    one, two = (street_light(houses, chart, lamp((*FRONT[:2], z)), shape) for z in (4.0, 8.0))
    both = street_light(houses, chart, join_emitters([lamp((*FRONT[:2], z)) for z in (4.0, 8.0)]), shape)
    assert one is not None
    assert two is not None
    np.testing.assert_allclose(both, one + two, atol=1e-6)
    assert 3 < one.max() / two.max() < 5, "four times as much from half the height"


def test_windows_at_the_foot_light_the_ground_before_them(houses: Scene) -> None:
    charts = houses.charts
    fronts = [c for c in np.flatnonzero(charts.kind == ChartKind.WALL).tolist() if charts.normals()[c, 1] < -0.9]
    light = np.zeros((120, 200, 3), np.float32)
    light[:20] = 1
    assert not len(window_emitters(charts, fronts[0], light).position), "the top floor is too high"
    light[90:] = 1
    found = window_emitters(charts, fronts[0], light)
    assert (found.position[:, 2] < charts.origin[fronts[0], 2] - 7).all()
    area = charts.size[fronts[0]].prod() * 30 / 120
    np.testing.assert_allclose(found.power[:, 0].sum(), area, rtol=0.1)
    ground = lit_points(houses, ChartKind.GROUND, found)
    assert len(ground)
    assert ground[:, 1].max() < 6671991


def test_lanterns_hang_at_the_end_of_their_arms() -> None:
    kind = np.array([OBJECT_KIND_NAMES.index("bench"), OBJECT_KIND_NAMES.index("street_lamp")], np.int32)
    size, place = np.array([[2, 1, 1], [0.5, 1.6, 6.0]]), np.array([[0.0, 0, 0], [10, 20, 1]])
    two = PlacedObjects(("a", "b"), kind, kind * 0, place, np.array([0.0, 90]), size, np.ones(2, bool))
    found = lamp_emitters(two)
    np.testing.assert_allclose(found.position, [[10 + 1.6 - STREET_LIGHT.lantern_m, 20, 7]])
    assert found.normal.tolist() == [[0, 0, -1]]
