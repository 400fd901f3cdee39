"""Materials are a field: the same at a place however it is asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from facade_core.atlas import AtlasSpec
from facade_core.geometry import CEILING, DOOR, GROUND, ROOF, WALL, WINDOW, Charts, block_surfaces, pack, terrain_of
from facade_core.street import Materials, Scene
from facade_core.types import Building, Roof, Street

STREET = Street("s", None, shapely.LineString([(-10, -8), (50, -8)]))
DENSITY = 10.0


@pytest.fixture(scope="module")
def scene() -> Scene:
    houses = [
        Building("flat", shapely.box(0, 0, 20, 10), 12.0, "height"),
        Building("gabled", shapely.box(0, 14, 20, 20), 6.0, "height", roof=Roof("gabled", 4.0)),
    ]
    charts, mesh, _ = block_surfaces(houses, [STREET], terrain=terrain_of([], None), ground_margin=20, largest=32)
    placement = pack(charts.texels(DENSITY), charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY, page=1024))


def of_kind(scene: Scene, kind: int) -> int:
    return int(np.flatnonzero(scene.charts.kind == kind)[0])


@pytest.mark.parametrize("kind", [GROUND, ROOF, WALL])
def test_points_texels_and_rasters_are_one_field(scene: Scene, kind: int) -> None:
    chart, rng = of_kind(scene, kind), np.random.default_rng(kind)
    whole = Materials(scene, [STREET], seed=1).raster(chart)
    assert whole.shape == (scene.placement.height[chart], scene.placement.width[chart], 3)
    assert whole.std() > 1
    rows, columns = rng.integers(0, whole.shape[0], 500), rng.integers(0, whole.shape[1], 500)
    other = Materials(scene, [STREET], seed=1)
    np.testing.assert_array_equal(other.texels(chart, rows, columns), whole[rows, columns])
    points = scene.charts.points(chart, (columns + 0.5) * (1 / DENSITY), (rows + 0.5) * (1 / DENSITY))
    colour = other.colour(np.full(500, chart), points, np.full(500, 1 / DENSITY))
    np.testing.assert_array_equal(colour, whole[rows, columns])


def test_there_is_a_material_for_every_kind_of_surface_and_dirt_starts_at_the_foot_of_the_walls() -> None:
    """A roofed house on a hill: tiles run along the slope, walls are darker at their foot, 30 m up."""
    house = Building("h", shapely.box(0, 0, 20, 10), 6.0, "height", base=30.0, roof=Roof("gabled", 4.0))
    charts, mesh, _ = block_surfaces(
        [house], [STREET], terrain=terrain_of([house], None), ground_margin=20, largest=100
    )
    placement = pack(charts.texels(10), charts.building, page=1024, chunk=128, gutter=2)

    def materials(charts: Charts) -> Materials:
        return Materials(Scene(mesh, charts, placement, AtlasSpec(placement.pages, 10.0, page=1024)), [STREET], seed=1)

    wall = np.flatnonzero((charts.kind == WALL) & (charts.normal()[:, 1] < -0.9))[0]
    x = np.linspace(0.5, 19.5, 200)
    foot, high = (
        materials(charts).colour(np.full(200, wall), np.column_stack([x, 0 * x, 0 * x + z]), np.full(200, 0.1))
        for z in (30.1, 35.0)
    )
    assert foot.mean() < 0.93 * high.mean()
    roof = np.flatnonzero(charts.kind == ROOF)[0]
    down = np.linspace(0.01, 3.39, 400)
    column = charts.origin[roof] + 3.0 * charts.axis_u[roof] + down[:, None] * charts.axis_v[roof]
    rows = materials(charts).colour(np.full(400, roof), column, np.full(400, 0.01)).astype(int).sum(axis=1)
    assert 8 <= (np.diff((rows < np.quantile(rows, 0.12)).astype(int)) == 1).sum() <= 10  # ten tiles of 0.34 m
    middle = (charts.origin + 0.5 * charts.size[:, :1] * charts.axis_u + 0.5 * charts.size[:, 1:] * charts.axis_v)[wall]
    seen = set()
    for kind in (WALL, WINDOW, DOOR, CEILING):
        other = replace(charts, kind=np.full(len(charts), kind, np.uint8))
        colour = materials(other).colour(np.array([wall]), middle[None], np.full(1, 0.1))[0]
        assert colour.min() > 10
        seen.add(tuple(colour.tolist()))
    assert len(seen) == 4
