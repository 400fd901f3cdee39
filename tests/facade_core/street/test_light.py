"""Light that is laid over finished surfaces: at the feet of walls, and of a sun."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from benchmarks.materials.plain import camera_tones
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.types import Building, Street, Sun
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.ambient import ambient_light
from facade_core.street.lighting.light import SceneLight
from facade_core.street.lighting.sun import sunlight_share
from facade_core.street.materials.field import MaterialField
from facade_core.street.materials.relief import relief_shadow_share
from facade_core.street.materials.settings import MATERIAL_FIELD
from facade_core.street.surfaces import ChartLight, KnownTexture, finish_chart

STREET = Street("s", None, shapely.LineString([(-20, -12), (40, -12)]))
DENSITY = 8.0
SOUTH = Sun(180.0, 45.0)


@pytest.fixture(scope="module")
def scene() -> Scene:
    houses = [
        Building("a", shapely.box(0, 0, 20, 10), 10.0, "height"),
        Building("b", shapely.box(-45, 0, -25, 10), 10.0, "height"),
    ]
    charts, mesh, _ = build_block_surfaces(
        houses, [STREET], terrain=build_terrain([], None), ground_margin=45, largest=35
    )
    placement = pack_charts(charts.size, DENSITY, charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY, page=1024), names=("a", "b"))


def at(scene: Scene, chart: int, place: tuple[float, float, float]) -> tuple[int, int] | None:
    """The texel of a chart at a place of the world; None beside it."""
    row, column = scene.charts.coordinates(np.array([chart]), np.array([place]))[0][::-1] * DENSITY
    inside = 0 <= row < scene.placement.height[chart] and 0 <= column < scene.placement.width[chart]
    return (int(row), int(column)) if inside else None


def on_ground(scene: Scene, place: tuple[float, float]) -> tuple[int, tuple[int, int]]:
    for chart in np.flatnonzero(scene.charts.kind == ChartKind.GROUND).tolist():
        if texel := at(scene, chart, (*place, 0.0)):
            return chart, texel
    raise AssertionError(place)


def test_shadows_fall_away_from_the_sun_and_end_where_its_height_says(scene: Scene) -> None:
    def seen(place: tuple[float, float], sun: Sun) -> float:
        chart, texel = on_ground(scene, place)
        return float(sunlight_share(scene, chart, sun)[texel])

    for sun, shaded, free in (
        (SOUTH, (10, 15), (10, -5)),
        (Sun(0.0, 45.0), (10, -5), (10, 15)),
        (Sun(90.0, 45.0), (-5, 5), (25, 5)),
    ):
        assert seen(shaded, sun) == 0
        assert seen(free, sun) == pytest.approx(np.sqrt(0.5), abs=1e-3)
    # the roof's edge, 10 m up, has its shadow 10 m behind the house; the sun is a disk
    edge = [seen((10, 20 + d), SOUTH) for d in (-1.2, 0.0, 1.2)]
    assert edge[0] == 0
    assert 0.1 < edge[1] < 0.6
    assert edge[2] == pytest.approx(np.sqrt(0.5), abs=1e-3)
    assert seen((10, 16), Sun(180.0, 70.0)) > 0.9


def test_walls_face_the_sun_or_not(scene: Scene) -> None:
    north = scene.charts.normals()[:, 1]
    walls = (scene.charts.kind == ChartKind.WALL) & (scene.charts.building == 0)
    (front,), (back,) = (np.flatnonzero(walls & (sense * north < -0.9)) for sense in (1, -1))
    assert sunlight_share(scene, int(front), SOUTH).min() == pytest.approx(np.sqrt(0.5), abs=1e-3)
    assert not sunlight_share(scene, int(back), SOUTH).any()
    sunny = SceneLight(scene, MaterialField(scene, [STREET], seed=1).reflectance, SOUTH)
    light, shade = (sunny.factor(int(wall))[8].mean(axis=0) for wall in (front, back))
    assert (light > 1.3 * shade).all()
    assert shade[2] > shade[0], "what is in the shade is lit by the sky"


def test_photos_are_not_lit_and_materials_are_as_their_factor_says(scene: Scene) -> None:
    materials = MaterialField(scene, [STREET], seed=1).without_light()
    chart = int(np.flatnonzero(scene.charts.kind == ChartKind.WALL)[0])
    size = scene.placement.shape(chart)

    def known(rank: int) -> KnownTexture:
        def read(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
            colour = np.full((*size, 3), 200 if rank >= Provenance.INPAINTED else 0, np.uint8)
            return colour[rows, columns], np.full(size, rank, np.uint8)[rows, columns]

        return KnownTexture(read, ())

    bare, _ = finish_chart(scene, materials, chart, known(Provenance.UNSEEN))
    np.testing.assert_array_equal(bare, materials.chart_raster(chart))
    for sun in (None, SOUTH):
        light = SceneLight(scene, materials.reflectance, sun)
        for rank in (Provenance.INPAINTED, Provenance.PHOTO):
            photo, _ = finish_chart(scene, materials, chart, known(rank), light=ChartLight(light))
            assert (photo == 200).all()
        lit, _ = finish_chart(scene, materials, chart, known(Provenance.UNSEEN), light=ChartLight(light))
        expected = bare * light.factor(chart) / MATERIAL_FIELD.typical_grey
        assert np.abs(lit - camera_tones(expected)).max() <= 1.6


def test_courts_corners_and_feet_of_walls_are_darker_than_open_places() -> None:
    """A court of 6 m between walls of 12 m, and the ground in front, under an overcast sky."""
    ring = shapely.box(0, 0, 20, 20).difference(shapely.box(7, 7, 13, 13))
    charts, mesh, _ = build_block_surfaces(
        [Building("ring", ring, 12.0, "height")],
        [STREET],
        terrain=build_terrain([], None),
        ground_margin=60,
        largest=200,
    )
    placement = pack_charts(charts.size, DENSITY, charts.building, page=1024, chunk=128, gutter=2)
    court = Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY, page=1024), names=("ring",))
    black, white = np.zeros((len(charts), 3)), np.full((len(charts), 3), 0.8)

    def light(place: tuple[float, float], reflectance: np.ndarray = black) -> float:
        chart, (row, column) = on_ground(court, place)
        grid = ambient_light(court, chart, reflectance, None)
        height, width = court.placement.shape(chart)
        return float(grid[round(row / height * (len(grid) - 1)), round(column / width * (grid.shape[1] - 1)), 1])

    assert light((-50, 10)) == pytest.approx(1, abs=0.03)
    assert light((10, 10)) < 0.25
    assert light((10, 10), white) > light((10, 10)) + 0.1, "white walls send light down"
    assert light((10, -0.5)) == pytest.approx(0.5, abs=0.15)
    assert light((10, -0.5)) < light((10, -4)) - 0.1 < light((10, -15)) - 0.2
    # black surfaces: a level place in the middle of a square court sees this share of the sky
    half, high = 3.0, 12.0
    slope = half / np.hypot(half, high)
    seen = 4 / np.pi * slope * np.arctan(half / np.hypot(half, high))
    assert light((10, 10)) == pytest.approx(seen, abs=0.03)


def test_relief_casts_shadows_away_from_the_sun_and_none_where_a_picture_has_them() -> None:
    labels = np.full((120, 120), FacadeClass.WALL, np.uint8)
    labels[20:60, 40:80] = FacadeClass.BALCONY
    labels[80:110, 40:80] = FacadeClass.WINDOW
    colour = np.full((120, 120, 3), 160, np.uint8)
    towards = np.array([-0.5, -0.7, 0.5])  # up and to the left
    shadow = relief_shadow_share(colour, labels, 20.0, towards, 0.6)
    assert shadow[62:66, 55:75].min() > 0.8, "below the slab of a balcony"
    assert shadow[62:66, 82:84].min() > 0.5, "and to its right"
    assert not shadow[62:66, 20:36].any()
    assert shadow[81, 45:75].min() > 0.5, "under the head of a window"
    assert not shadow[100, 60:75].any()
    assert not shadow[:10].any()
    colour[62:66, 55:75] = 92  # as the shade is already
    assert relief_shadow_share(colour, labels, 20.0, towards, 0.6)[62:66, 55:75].max() < 0.15
