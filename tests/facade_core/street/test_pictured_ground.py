"""Ground after pictures: their plain ground continues, things that lie on it do not."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.core.types import GroundWay, MappedGround
from facade_core.geometry.scene import Scene
from facade_core.street.materials.field import MaterialField
from facade_core.street.materials.grain import learn_grain
from facade_core.street.materials.grain_file import load_grain_tables
from facade_core.street.materials.pictured_ground import (
    GroundPicture,
    PicturedGround,
    add_pictured_ground,
    learn_pictured_ground,
)
from facade_core.street.materials.procedural import GroundSurface
from tests.facade_core.street.test_surfaces import ground, scene  # noqa: F401

SURFACE = int(GroundSurface.GRAVEL)
COLOUR = np.array([150.0, 120.0, 90.0])


def pavement(side: int = 200, seed: int = 0) -> np.ndarray:
    """Grain about one colour, lighter to the east, with a white line and a dark thing on it."""
    rng = np.random.default_rng(seed)
    light = np.linspace(0.95, 1.05, side)[None, :, None]
    rgb = COLOUR * (1 + rng.normal(0, 0.04, (side, side, 1))) * light
    rgb[:, 60:63] = 250
    rgb[20:60, 120:160] = 20
    return np.clip(rgb, 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def learnt() -> PicturedGround:
    rgb = pavement()
    return learn_pictured_ground(
        [GroundPicture(rgb, np.ones(rgb.shape[:2], bool), np.full(rgb.shape[:2], SURFACE, np.uint8), 20.0)], 8
    )


def paint_ground(learnt: PicturedGround, x: np.ndarray, y: np.ndarray, side: float) -> np.ndarray:
    total = np.zeros((len(x), 3))
    add_pictured_ground(SURFACE, x, y, np.full(len(x), side), learnt, 7, np.ones(len(x)), total)
    return total


def square(start: float = 1000.0) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(start + np.arange(300) / 20, -start + np.arange(300) / 20)
    return x.ravel(), y.ravel()


def test_plain_ground_continues_with_its_grain_and_without_what_lies_on_it(learnt: PicturedGround) -> None:
    tone = paint_ground(learnt, *square(), 0.05)
    assert tone.mean(axis=0) == pytest.approx(COLOUR, rel=0.02)
    assert tone.std(axis=0) == pytest.approx(0.04 * COLOUR, rel=0.25)
    assert tone.min() > 0.75 * COLOUR.min(), "the dark thing"
    assert tone.max() < 1.3 * COLOUR.max(), "the white line"


def test_a_point_has_one_colour_and_places_differ(learnt: PicturedGround) -> None:
    x, y = square()
    whole, part = paint_ground(learnt, x, y, 0.05), paint_ground(learnt, x[5000:5300], y[5000:5300], 0.05)
    assert (whole[5000:5300] == part).all()
    rasters = whole.reshape(300, 300, 3)[..., 0]
    for shift in (20, 48, 96):
        assert np.corrcoef(rasters[:, :-shift].ravel(), rasters[:, shift:].ravel())[0, 1] < 0.2


def test_a_far_footprint_has_the_mean_colour(learnt: PicturedGround) -> None:
    assert paint_ground(learnt, *square(), 1.0) == pytest.approx(np.broadcast_to(learnt.colour[SURFACE], (90000, 3)))


@pytest.mark.parametrize("seen", ["little", "nothing"])
def test_a_surface_that_pictures_hardly_show_keeps_its_material(seen: str) -> None:
    rgb = pavement()
    is_seen = np.zeros(rgb.shape[:2], bool)
    is_seen[: 20 if seen == "little" else 0] = True
    learnt = learn_pictured_ground([GroundPicture(rgb, is_seen, np.zeros(rgb.shape[:2], np.uint8), 20.0)], 8)
    assert learnt.start.tolist() == [0] * 9


def test_ground_of_a_block_looks_as_its_pictures_do_and_a_stated_material_stays(scene: Scene) -> None:  # noqa: F811
    way = GroundWay("road", shapely.LineString([(-10, -8), (50, -8)]), "road", 6.0, "asphalt")
    own = load_grain_tables({"gravel": learn_grain(pavement(256), 2.0)})
    chart = ground(scene)
    size = scene.placement.shape(chart)
    rgb = pavement(max(size))[: size[0], : size[1]]
    for grains, changes in ((None, True), (own, False)):
        before = MaterialField(scene, [], seed=1, ground=MappedGround((way,)), grains=grains)
        after = before.with_pictured_ground({chart: (rgb, np.ones(size, bool))})
        bare, painted = (field.chart_raster(chart).astype(float) for field in (before, after))
        open_ground = before.ground_kinds(chart, 0) == 0
        assert (np.abs(painted - bare)[open_ground].mean() > 5) == changes
        mean = painted[open_ground].mean(axis=0)
        assert not changes or mean / mean[0] == pytest.approx(COLOUR / COLOUR[0], rel=0.03)


def test_a_carriageway_shows_its_own_surface_and_none_where_roads_differ(scene: Scene) -> None:  # noqa: F811
    lines = shapely.LineString([(-10, -8), (50, -8)]), shapely.LineString([(5, -20), (5, -2)])
    chart = ground(scene)
    for surfaces, expected in ((("setts", "setts"), {GroundSurface.SETTS}), (("setts", "asphalt"), set())):
        ways = [
            GroundWay(str(number), line, "road", 6.0, surface)
            for number, (line, surface) in enumerate(zip(lines, surfaces, strict=True))
        ]
        field = MaterialField(scene, [], seed=1, ground=MappedGround(tuple(ways)))
        is_road = field.ground_kinds(chart, 0) > 0
        shown = field.with_pictured_ground(
            {chart: (pavement(max(is_road.shape))[: len(is_road), : is_road.shape[1]], is_road)}
        )
        assert set(np.flatnonzero(np.diff(shown.arrays.pictured.start)).tolist()) == expected
