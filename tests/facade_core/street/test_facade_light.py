"""Light and stains of facades that were made of exemplars, against plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from benchmarks.materials.plain import camera_tones, noise
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.types import Building, Street, Sun
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.geometry.settings import DAYLIGHT
from facade_core.street.lighting.ambient import ambient_light
from facade_core.street.lighting.light import NO_TONES, SceneLight, apply_light, invert_tones
from facade_core.street.lighting.settings import AMBIENT
from facade_core.street.materials.field import MaterialField
from facade_core.street.materials.settings import MATERIAL_FIELD, STAINS
from facade_core.street.materials.stains import stain_strengths, stain_tones, stain_weights, wall_brightness_deviations
from facade_core.street.surfaces import ChartLight, KnownTexture, finish_chart

STREET = Street("s", None, shapely.LineString([(-20, -6), (60, -6)]))
NOON = Sun(180.0, 45.0)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A house north of a street, another one south of it, of which the north side is in the shade, and one by itself."""
    houses = [
        Building("north", shapely.box(0, 0, 40, 10), 15.0, "height"),
        Building("south", shapely.box(0, -22, 40, -12), 15.0, "height"),
        Building("alone", shapely.box(140, 0, 180, 10), 15.0, "height"),
    ]
    charts, mesh, _ = build_block_surfaces(
        houses, [STREET], terrain=build_terrain([], None), ground_margin=60, largest=200
    )
    placement = pack_charts(charts.size, 16.0, charts.building, page=2048, chunk=128, gutter=2)
    return Scene(
        mesh, charts, placement, AtlasSpec(placement.pages, 16.0, page=2048), names=("north", "south", "alone")
    )


def side(scene: Scene, building: int, north: float) -> int:
    charts = scene.charts
    (found,) = np.flatnonzero(
        (charts.kind == ChartKind.WALL) & (charts.building == building) & (charts.normals()[:, 1] * north > 0.9)
    )
    return int(found)


def total(scene: Scene, chart: int, sun: Sun | None = NOON) -> np.ndarray:
    reflectance = MaterialField(scene, [STREET], seed=1).reflectance
    return ambient_light(scene, chart, reflectance, sun).mean(axis=2)


def test_walls_in_the_shade_are_not_even(scene: Scene) -> None:
    shaded = total(scene, side(scene, 1, 1))
    middle = shaded[:, shaded.shape[1] // 2]
    assert middle[0] > 1.15 * middle[-1], "lighter above, where more of the sky is seen"
    overcast = [total(scene, side(scene, house, 1), None).mean(axis=1) for house in (1, 2)]
    assert (overcast[1] > overcast[0]).all()
    np.testing.assert_array_equal(shaded, total(scene, side(scene, 1, 1)))


def test_light_is_that_of_many_rays(scene: Scene) -> None:
    """The denoised grid against the mean of 4,000 rays at one place, without reflections."""
    chart = side(scene, 1, 1)
    grid = ambient_light(scene, chart, np.zeros((len(scene.charts), 3)), None)[..., 1]
    charts, rng = scene.charts, np.random.default_rng(1)
    for row, column in ((4, 20), (15, 40), (25, 60)):
        share = np.array([[column / (grid.shape[1] - 1), row / (grid.shape[0] - 1)]])
        place = charts.points_at_shares(np.array([chart]), share)[0, 0] + DAYLIGHT.ray_lift_m * charts.normals()[chart]
        radius, turn = np.sqrt(rng.random(4000)), 2 * np.pi * rng.random(4000)
        along = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)], axis=1)
        rays = along @ np.stack([charts.axis_u[chart], charts.axis_v[chart], charts.normals()[chart]])
        far = scene.caster.cast(place, rays)[0] > AMBIENT.occluder_range_m
        truth = np.where(far, np.where(rays[:, 2] >= 0, 1.0, MATERIAL_FIELD.ground_albedo), 0.0).mean()
        assert grid[row, column] == pytest.approx(truth, abs=0.05)


def test_a_sunlit_house_across_the_street_lights_more_than_a_shaded_one(scene: Scene) -> None:
    chart = side(scene, 1, 1)
    assert total(scene, chart).mean() > 1.15 * total(scene, chart, Sun(0.0, 5.0)).mean()


def test_coloured_walls_colour_the_light(scene: Scene) -> None:
    red = np.tile([0.6, 0.1, 0.1], (len(scene.charts), 1))
    light = ambient_light(scene, side(scene, 1, 1), red, None).mean(axis=(0, 1))
    assert light[0] > 1.1 * light[2]


def test_stains_give_an_even_wall_what_photographs_have_and_one_that_has_it_nothing() -> None:
    even = np.full((240, 400, 3), 150, np.uint8)
    labels = np.full((240, 400), FacadeClass.WALL, np.uint8)
    tones = stain_tones(even, labels, 16.0, (30.0, -12.0), seed=4)
    step = 1 / STAINS.stain_density
    x = 30 + step * (np.arange(tones.shape[1]) + 0.5)
    y = -12 + step * (np.arange(tones.shape[0]) + 0.5)
    found = wall_brightness_deviations(
        (150 * tones).round().astype(np.uint8), np.ones(tones.shape, bool), STAINS.stain_density
    )
    assert found == pytest.approx(STAINS.photo_deviations, rel=0.4)
    # narrow cells are meant over an eighth of a metre: nearly as at its middle
    points = 1 + stain_strengths(labels, tones.shape) * sum(
        weight * noise(x[None, :] / wide + 0 * y[:, None], y[:, None] / tall + 0 * x[None, :], 4 + 121 + number)
        for number, ((wide, tall), weight) in enumerate(zip(STAINS.noise_cells_m, stain_weights(None), strict=True))
    )
    assert np.abs(points - tones).max() < 0.1 * np.abs(tones - 1).max() + 0.01
    stained = (even * np.kron(tones, np.ones((2, 2)))[..., None]).astype(np.uint8)
    again = stain_tones(stained, labels, 16.0, (30.0, -12.0), seed=5)
    assert np.abs(again - 1).mean() < 0.6 * np.abs(tones - 1).mean()
    assert wall_brightness_deviations(even[..., 0], np.zeros(labels.shape, bool), 16.0) is None


def test_noise_of_a_weight_gives_the_deviations_that_are_said() -> None:
    for number, gives in enumerate(STAINS.noise_deviations):
        found = []
        for seed in range(4):
            y, x = (np.mgrid[:320, :320] + 0.5) / STAINS.stain_density
            wide, tall = STAINS.noise_cells_m[number]
            tone = 1 + 0.2 * noise(x / wide, y / tall, seed)
            found.append(
                wall_brightness_deviations(
                    (120 * tone).round().astype(np.uint8), np.ones(tone.shape, bool), STAINS.stain_density
                )
            )
        assert np.mean(found, axis=0) / 0.2 == pytest.approx(gives, rel=0.2)


def test_stains_are_below_windows_and_at_the_foot() -> None:
    labels = np.full((240, 320), FacadeClass.WALL, np.uint8)
    labels[80:120, 100:160] = FacadeClass.WINDOW
    strengths = stain_strengths(labels, (120, 160))
    assert strengths[62, 65] > 1.5 * strengths[62, 20], "below the window, and beside it"
    assert strengths[-1, 20] > 1.5 * strengths[60, 20]
    assert strengths.max() <= STAINS.max_strength


def test_stains_go_on_where_the_next_wall_begins() -> None:
    even, labels = np.full((160, 320, 3), 150, np.uint8), np.full((160, 320), FacadeClass.WALL, np.uint8)
    whole = stain_tones(even, labels, 16.0, (0.0, 0.0), seed=4)
    right = stain_tones(even[:, 160:], labels[:, 160:], 16.0, (10.0, 0.0), seed=4)
    np.testing.assert_array_equal(whole[:, 80:], right)


def test_light_is_laid_over_as_numpy_does() -> None:
    rng = np.random.default_rng(3)
    colour = rng.integers(0, 256, (12, 17, 3)).astype(np.uint8)
    made, wall = rng.random((2, 12, 17)) < 0.7
    sunlight, sun = rng.random((12, 17)).astype(np.float32), np.array([2.0, 1.5, 1.0])
    ambient = rng.uniform(0.2, 1, (3, 4, 3)).astype(np.float32)
    tones = rng.uniform(0.8, 1.2, (6, 9)).astype(np.float32)

    def between(grid: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        across = np.array([np.interp(x, np.arange(grid.shape[1]), row) for row in grid])
        return np.array([np.interp(y, np.arange(grid.shape[0]), column) for column in across.T]).T

    y, x = ((np.arange(n) + 0.5) / n for n in made.shape)
    light = np.stack([between(ambient[..., band], y * 2, x * 3) for band in range(3)], axis=2)
    light = np.sqrt(light + sun * sunlight[..., None])
    tone = np.where(wall, between(tones, y * 6 - 0.5, x * 9 - 0.5), 1)[..., None]
    wanted = np.where(made[..., None], camera_tones(colour * tone * light), colour)
    whole = colour.copy()
    apply_light(whole, made, np.array([12, 17, 0, 0]), ambient, sunlight, sun, tones, wall)
    assert np.abs(wanted - whole).max() <= 0.5 + 1e-3
    part = colour[4:, 5:].copy()
    apply_light(part, made[4:, 5:], np.array([12, 17, 4, 5]), ambient, sunlight, sun, NO_TONES, wall[4:, 5:])
    plain = np.where(made[..., None], camera_tones(colour * light), colour)[4:, 5:]
    assert np.abs(plain - part).max() <= 0.5 + 1e-3


def test_tones_are_inverted_and_have_blacks_and_whites() -> None:
    exposures = np.arange(12, 236)[:, None] * np.array([1.1, 1.0, 0.8])
    colours = camera_tones(exposures)
    assert np.abs(invert_tones(np.round(colours).astype(np.uint8)) - exposures).max() < 4
    assert colours[0].max() < 0.5 * exposures[0].max(), "blacks"
    assert (np.diff(colours[:, 1]) > 0.25).all()
    assert camera_tones(np.full(3, 400.0)).max() < 254, "white walls in the sun keep their texture"
    assert (np.ptp(colours, axis=1) > np.ptp(colours, axis=1)[0]).sum() > 200, "and their colour"


def test_what_is_a_picture_has_its_own_light_and_windows_have_no_stains(scene: Scene) -> None:
    materials, chart = MaterialField(scene, [STREET], seed=1), side(scene, 1, 1)
    size = scene.placement.shape(chart)
    labels = np.full(size, FacadeClass.WALL, np.uint8)
    labels[40:80, 100:140] = FacadeClass.WINDOW
    colour = np.full((*size, 3), 150, np.uint8)

    def finished(rank: int) -> np.ndarray:
        def read(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
            return colour[rows, columns], np.full(size, rank, np.uint8)[rows, columns]

        known = KnownTexture(read, ())
        light = ChartLight(SceneLight(scene, materials.reflectance, NOON), labels)
        return finish_chart(scene, materials.without_light(), chart, known, light=light)[0]

    np.testing.assert_array_equal(finished(Provenance.SYNTHESISED + 1), colour)
    made = finished(Provenance.SYNTHESISED).astype(float)
    window, wall = made[45:75, 105:135, 0], made[45:75, 145:175, 0]
    assert wall.std() > 3 * window.std()
    np.testing.assert_array_equal(finished(Provenance.SYNTHESISED), finished(Provenance.SYNTHESISED))
