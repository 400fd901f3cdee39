"""Materials are a field: the same at a place however it is asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Building, BuildingFinish, GroundWay, MappedGround, Roof, Street
from facade_core.facade.wall_material import WallMaterial
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene
from facade_core.street.materials.field import MATERIAL_GRAINS, MaterialField
from facade_core.street.materials.field_kernels import (
    SurfaceMaterial,
    compute_point_colours,
)

STREET = Street("s", None, shapely.LineString([(-10, -8), (50, -8)]))
DENSITY = 10.0


@pytest.fixture(scope="module")
def scene() -> Scene:
    houses = [
        Building("flat", shapely.box(0, 0, 20, 10), 12.0, "height"),
        Building("gabled", shapely.box(0, 14, 20, 20), 6.0, "height", roof=Roof("gabled", 4.0)),
    ]
    charts, mesh, _ = build_block_surfaces(
        houses, [STREET], terrain=build_terrain([], None), ground_margin=20, largest=32
    )
    placement = pack_charts(charts.size, DENSITY, charts.building, page=1024, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY, page=1024))


def of_kind(scene: Scene, kind: int) -> int:
    return int(np.flatnonzero(scene.charts.kind == kind)[0])


@pytest.mark.parametrize("kind", [ChartKind.GROUND, ChartKind.ROOF, ChartKind.WALL])
def test_points_texels_and_rasters_are_one_field(scene: Scene, kind: int) -> None:
    chart, rng = of_kind(scene, kind), np.random.default_rng(kind)
    whole = MaterialField(scene, [STREET], seed=1).chart_raster(chart)
    assert whole.shape == (scene.placement.height[chart], scene.placement.width[chart], 3)
    assert whole.std() > 1
    rows, columns = rng.integers(0, whole.shape[0], 500), rng.integers(0, whole.shape[1], 500)
    other = MaterialField(scene, [STREET], seed=1)
    np.testing.assert_array_equal(other.texel_colours(chart, rows, columns), whole[rows, columns])
    points = scene.charts.points(chart, (columns + 0.5) * (1 / DENSITY), (rows + 0.5) * (1 / DENSITY))
    coloured = other.colour(np.full(500, chart), points, np.full(500, 1 / DENSITY))
    np.testing.assert_array_equal(coloured, whole[rows, columns])


def test_a_roof_as_steep_as_a_wall_is_of_what_its_walls_are(scene: Scene) -> None:
    chart = of_kind(scene, ChartKind.WALL)
    kinds = scene.charts.kind.copy()
    kinds[chart] = ChartKind.ROOF
    called_roof = replace(scene, charts=replace(scene.charts, kind=kinds))
    of_wall, of_roof = (MaterialField(one, [STREET], seed=1).arrays.charts for one in (scene, called_roof))
    assert of_roof.material[chart] == of_wall.material[chart] != of_wall.material[of_kind(scene, ChartKind.ROOF)]
    np.testing.assert_array_equal(of_roof.tint[chart], of_wall.tint[chart])


def test_texels_that_lie_otherwise_in_memory_are_painted_by_the_same_kernel(scene: Scene) -> None:
    chart, materials = of_kind(scene, ChartKind.WALL), MaterialField(scene, [STREET], seed=1)
    whole = materials.chart_raster(chart)
    kernels = set(compute_point_colours.signatures)
    chosen = np.zeros(whole.shape[:2], bool)
    chosen[::7, ::5] = True
    np.testing.assert_array_equal(materials.texel_colours(chart, *np.nonzero(chosen)), whole[chosen])
    assert set(compute_point_colours.signatures) == kernels


def test_what_is_stated_of_colours_is_seen(scene: Scene) -> None:
    stated = BuildingFinish((40, 60, 200), (200, 40, 30))
    painted = replace(scene, finishes=(BuildingFinish(), stated))
    for kind, place in ((ChartKind.ROOF, 0), (ChartKind.WALL, 2)):
        for building in (0, 1):
            chart = int(np.flatnonzero((scene.charts.kind == kind) & (scene.charts.building == building))[0])
            bare, tinted = (
                MaterialField(one, [STREET], seed=1).chart_raster(chart).astype(float) for one in (scene, painted)
            )
            if building == 0:
                np.testing.assert_array_equal(bare, tinted)
            else:
                assert np.argmax(tinted.mean(axis=(0, 1))) == place


def test_a_roof_is_of_what_is_stated(scene: Scene) -> None:
    gabled = int(np.flatnonzero((scene.charts.kind == ChartKind.ROOF) & (scene.charts.building == 1))[0])

    def made(finish: BuildingFinish) -> int:
        return int(
            MaterialField(replace(scene, finishes=(BuildingFinish(), finish)), [STREET], seed=1).arrays.charts.material[
                gabled
            ]
        )

    stated = {
        "slate": SurfaceMaterial.SLATE,
        "metal": SurfaceMaterial.SHEET_METAL,
        "zinc": SurfaceMaterial.SHEET_METAL,
        "roof_tiles": SurfaceMaterial.ROOF_TILE,
        "tar_paper": SurfaceMaterial.FELT,
        "thatch": SurfaceMaterial.ROOF_TILE,
    }
    assert {name: made(BuildingFinish(roof_material=name)) for name in stated} == stated
    assert made(BuildingFinish(roof_colour=(122, 156, 138))) == SurfaceMaterial.SHEET_METAL
    assert made(BuildingFinish(roof_colour=(158, 66, 50))) == SurfaceMaterial.ROOF_TILE
    metal = replace(scene, finishes=(BuildingFinish(), BuildingFinish(roof_material="metal")))
    raster = MaterialField(metal, [STREET], seed=1).chart_raster(gabled).astype(float).mean(axis=2)
    across, down = (np.abs(np.diff(raster.mean(axis=axis))).mean() for axis in (0, 1))
    assert across > 2 * down, "seams run down the slope"
    looks = set()
    for name in ("slate", "metal", "roof_tiles", "tar_paper"):
        painted = replace(
            scene, finishes=(BuildingFinish(), BuildingFinish(roof_colour=(120, 120, 120), roof_material=name))
        )
        raster = MaterialField(painted, [STREET], seed=1).chart_raster(gabled)
        assert 50 < raster.mean() < 130
        looks.add(raster.tobytes())
    assert len(looks) == 4


def test_a_level_roof_is_of_felt_or_under_gravel_as_a_rule(scene: Scene) -> None:
    level, leaning = (
        int(np.flatnonzero((scene.charts.kind == ChartKind.ROOF) & (scene.charts.building == building))[0])
        for building in (0, 1)
    )
    made = [MaterialField(scene, [STREET], seed=seed).arrays.charts.material for seed in range(60)]
    counts = [
        sum(one[level] == of for one in made)
        for of in (SurfaceMaterial.FELT, SurfaceMaterial.ROOF_GRAVEL, SurfaceMaterial.SHEET_METAL)
    ]
    assert counts[0] > counts[1] > counts[2] > 0 == 60 - sum(counts)
    assert {int(one[leaning]) for one in made} == {SurfaceMaterial.ROOF_TILE}
    stated = replace(scene, finishes=(BuildingFinish(roof_material="gravel"), BuildingFinish()))
    assert MaterialField(stated, [STREET], seed=1).arrays.charts.material[level] == SurfaceMaterial.ROOF_GRAVEL


@pytest.mark.parametrize("brick", [False, True])
def test_an_own_wall_is_as_if_it_were_all_charts(scene: Scene, brick: bool) -> None:
    """What a building alone knows of its walls changes no other chart, and costs no copy of the tables of all."""
    plain = MaterialField(scene, [STREET], seed=1)
    surfaces, charts = plain.arrays.charts, np.flatnonzero(scene.charts.building == 1).tolist()
    facade = next(one for one in charts if scene.charts.kind[one] == ChartKind.WALL)
    wall = WallMaterial(np.array([150.0, 90.0, 70.0]), brick)
    changed = plain.with_facade_material(charts, wall, facade)
    own = changed.arrays.override.charts
    assert own.tolist() == [one for one in charts if scene.charts.kind[one] == ChartKind.WALL]
    assert changed.arrays.charts is surfaces
    made, tint, example = (part.copy() for part in (surfaces.material, surfaces.tint, surfaces.grain))
    tint[own] = wall.colour / surfaces.grey[facade] * surfaces.grey[own, None]
    if brick:
        made[own], example[own] = SurfaceMaterial.BRICK, MATERIAL_GRAINS[SurfaceMaterial.BRICK]
    whole = MaterialField(scene, [STREET], seed=1)
    whole.arrays = whole.arrays._replace(charts=surfaces._replace(material=made, tint=tint, grain=example))
    for chart in (facade, of_kind(scene, ChartKind.WALL), of_kind(scene, ChartKind.ROOF)):
        np.testing.assert_array_equal(changed.chart_raster(chart), whole.chart_raster(chart))
    assert (changed.chart_raster(facade) != plain.chart_raster(facade)).any()


def test_the_order_in_which_charts_are_asked_for_changes_nothing(scene: Scene) -> None:
    rng = np.random.default_rng(0)
    chart = rng.integers(0, len(scene.charts), 3000)
    points = scene.charts.points(chart, *(rng.uniform(0, 1, (2, 3000)) * scene.charts.size[chart].T))
    footprint = rng.uniform(0.02, 2.0, 3000)
    found = MaterialField(scene, [STREET], seed=1).colour(chart, points, footprint)
    turned = rng.permutation(3000)
    alone = Scene(scene.mesh, scene.charts, scene.placement, scene.spec)  # its light is computed anew, in another order
    other = MaterialField(alone, [STREET], seed=1)
    for one in rng.permutation(len(scene.charts)).tolist():
        mine = np.flatnonzero(chart == one)
        np.testing.assert_array_equal(other.colour(chart[mine], points[mine], footprint[mine]), found[mine])
    again = other.colour(chart[turned], points[turned], footprint[turned])
    np.testing.assert_array_equal(again, found[turned])


@pytest.mark.parametrize("density", [8.0, 16.0, 32.0])
def test_ground_does_not_step_at_its_edges(density: float) -> None:
    """A street at an angle, dashes on it: kerbs, marks and slabs are their means over each texel, as 8 x 8 points have it."""
    line = shapely.LineString([(-30, -11), (50, 9)])
    ways = (
        GroundWay("s", line, "road", 7.0, "asphalt", lanes=2, pavement=(4.0, 0.0)),
        GroundWay("t", line, "tram", 1.0, "asphalt"),
        GroundWay("c", shapely.LineString([(10, 10), (10, -12)]), "crossing", 3.0, "asphalt"),
    )
    charts, mesh, _ = build_block_surfaces(
        [], [Street("s", None, line)], terrain=build_terrain([], None), ground_margin=9, largest=8
    )
    placement = pack_charts(charts.size, density, charts.building, page=2048, chunk=128, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, density, page=2048))
    middle = charts.points(np.arange(len(charts)), charts.size[:, 0] / 2, charts.size[:, 1] / 2)
    chart = int(np.argmin(shapely.distance(line, shapely.points(middle[:, :2]))))
    rng = np.random.default_rng(0)
    rows, columns = (rng.integers(0, side[chart], 1500) for side in (placement.height, placement.width))
    materials = MaterialField(scene, [], seed=1, ground=MappedGround(ways))
    found = materials.texel_colours(chart, rows, columns).astype(float)

    def points(right: float, down: float) -> np.ndarray:
        places = charts.points(chart, (columns + 0.5 + right) / density, (rows + 0.5 + down) / density)
        return materials.colour(np.full(len(places), chart), places, np.full(len(places), 1e-3)).astype(float)

    offset = (np.arange(8) + 0.5) / 8 - 0.5
    truth = np.mean([points(right, down) for right in offset for down in offset], axis=0)
    wrong, stepping = (np.sqrt(np.mean((tone - truth) ** 2)) for tone in (found, points(0, 0)))
    assert found.std() > 10
    assert wrong < 0.5 * stepping


def test_leaves_lie_by_kerbs_and_few() -> None:
    ways = (GroundWay("s", shapely.LineString([(-30, 0), (50, 0)]), "road", 7.0, "asphalt", pavement=(4.0, 4.0)),)
    charts, mesh, _ = build_block_surfaces(
        [], [Street("s", None, ways[0].line)], terrain=build_terrain([], None), ground_margin=9, largest=100
    )
    placement = pack_charts(charts.size, DENSITY, charts.building, page=2048, chunk=128, gutter=2)
    materials = MaterialField(
        Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY, page=2048)),
        [],
        seed=1,
        ground=MappedGround(ways),
    )

    rng, away, brown = np.random.default_rng(0), [], []
    for chart in range(len(charts)):
        places = charts.points(chart, *(rng.uniform(0, 1, (2, 4000)) * charts.size[chart][:, None]))
        colour = materials.colour(np.full(4000, chart), places, np.full(4000, 0.02)).astype(float)
        away.append(np.where(np.abs(places[:, 0] - 10) < 35, np.abs(places[:, 1]), np.inf))
        brown.append(colour[:, 0] > 1.5 * colour[:, 2])
    metres, leaf = np.concatenate(away), np.concatenate(brown)
    kerb = (metres > 3.1) & (metres < 3.45)
    assert 0.002 < leaf[kerb].mean() < 0.06
    assert not leaf[(metres < 2.9) | ((metres > 4.3) & (metres < 6))].any()


def test_rain_leaves_streaks_under_the_upper_edge_of_a_wall(scene: Scene) -> None:
    wall = of_kind(scene, ChartKind.WALL)
    whole = MaterialField(scene, [STREET], seed=1).chart_raster(wall).astype(float).mean(axis=2)
    top, middle = (whole[rows].mean(axis=0) for rows in (slice(0, 12), slice(60, 72)))
    assert top.std() > 1.5 * middle.std()


def test_a_courtyard_is_darker_than_a_square_and_its_corners_darkest() -> None:
    court = shapely.box(0, 0, 30, 30).difference(shapely.box(9, 9, 21, 21))
    house = Building("court", court, 15.0, "height")
    charts, mesh, _ = build_block_surfaces(
        [house], [STREET], terrain=build_terrain([], None), ground_margin=20, largest=32
    )
    placement = pack_charts(charts.size, DENSITY, charts.building, page=1024, chunk=128, gutter=2)
    materials = MaterialField(
        Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY, page=1024)), [STREET], seed=1
    )
    rng = np.random.default_rng(0)

    def brightness(low: tuple[float, float], high: tuple[float, float]) -> float:
        places = np.column_stack([rng.uniform(low, high, (400, 2)), np.zeros(400)])
        owner = [
            next(
                c
                for c in np.flatnonzero(charts.kind == ChartKind.GROUND).tolist()
                if (((at := charts.coordinates(np.array([c]), place[None])[0]) >= 0) & (at <= charts.size[c])).all()
            )
            for place in places
        ]
        return float(materials.colour(np.array(owner), places, np.full(400, 0.5)).mean())

    square, middle = brightness((48, -4), (54, 2)), brightness((13, 13), (17, 17))
    corner, outside = brightness((9.2, 9.2), (10.2, 10.2)), brightness((8, -3), (22, -2))
    assert 0.5 * square < corner < 0.93 * middle
    assert middle < 0.92 * square
    assert middle < outside < square  # below the house it is dark, and none of that comes out


def test_there_is_a_material_for_every_kind_of_surface_and_dirt_starts_at_the_foot_of_the_walls() -> None:
    """A roofed house on a hill: tiles run along the slope, walls are darker at their foot, 30 m up."""
    house = Building("h", shapely.box(0, 0, 20, 10), 6.0, "height", base=30.0, roof=Roof("gabled", 4.0))
    charts, mesh, _ = build_block_surfaces(
        [house], [STREET], terrain=build_terrain([house], None), ground_margin=20, largest=100
    )
    placement = pack_charts(charts.size, 10, charts.building, page=1024, chunk=128, gutter=2)

    def materials(charts: Charts) -> MaterialField:
        return MaterialField(
            Scene(mesh, charts, placement, AtlasSpec(placement.pages, 10.0, page=1024)), [STREET], seed=1
        )

    wall = np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.normals()[:, 1] < -0.9))[0]
    x = np.linspace(0.5, 19.5, 200)
    foot, high = (
        materials(charts).colour(np.full(200, wall), np.column_stack([x, 0 * x, 0 * x + z]), np.full(200, 0.1))
        for z in (30.1, 35.0)
    )
    assert foot.mean() < 0.93 * high.mean()
    roof = np.flatnonzero(charts.kind == ChartKind.ROOF)[0]
    down = np.linspace(0.01, 3.39, 400)
    rows = np.zeros(400, int)
    for right in np.linspace(2.0, 6.0, 25):  # means over several columns, of which each has its grain
        column = charts.origin[roof] + right * charts.axis_u[roof] + down[:, None] * charts.axis_v[roof]
        rows += materials(charts).colour(np.full(400, roof), column, np.full(400, 0.01)).astype(int).sum(axis=1)
    assert 8 <= (np.diff((rows < np.quantile(rows, 0.12)).astype(int)) == 1).sum() <= 10  # ten tiles of 0.34 m
    middle = (charts.origin + 0.5 * charts.size[:, :1] * charts.axis_u + 0.5 * charts.size[:, 1:] * charts.axis_v)[wall]
    seen = set()
    for kind in (ChartKind.WALL, ChartKind.WINDOW, ChartKind.DOOR, ChartKind.CEILING):
        other = replace(charts, kind=np.full(len(charts), kind, np.uint8))
        colour = materials(other).colour(np.array([wall]), middle[None], np.full(1, 0.1))[0]
        assert colour.min() > 10
        seen.add(tuple(colour.tolist()))
    assert len(seen) == 4
