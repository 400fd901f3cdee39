"""Shells, roofs and terrain into the charts of a block."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh

from facade_core.core.errors import GeometryError
from facade_core.core.types import Building, BuildingShell, ElevationRaster, Roof, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.buildings.roof_shapes import build_shell_with_roof
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.ground.terrain import build_terrain

BOX = Building("a", shapely.box(0, 0, 20, 10), 12.0, "height")
STREET = Street("s", None, shapely.LineString([(-30, -8), (50, -8)]))
SLOPE = ElevationRaster(-200.0, 200.0, 10.0, np.add.outer(np.zeros(41), np.arange(41)).astype(np.float32))


def surfaces(buildings, streets=(), elevation=None, largest=100.0) -> tuple[Charts, Mesh]:
    terrain = build_terrain(buildings, elevation)
    charts, mesh, refused = build_block_surfaces(buildings, streets, terrain=terrain, ground_margin=20, largest=largest)
    assert refused == ()
    return charts, mesh


def shares(mesh: Mesh, which: np.ndarray) -> float:
    """Area of some triangles."""
    corners = mesh.vertices[mesh.triangles[which]]
    return float(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    )


def test_a_level_block_does_not_change_with_its_height() -> None:
    low, low_mesh = surfaces([BOX], [STREET])
    high, high_mesh = surfaces([replace(BOX, base=40.0)], [STREET])
    np.testing.assert_array_equal(low.kind, high.kind)
    np.testing.assert_array_equal(low.size, high.size)
    np.testing.assert_array_equal(low_mesh.triangles, high_mesh.triangles)
    np.testing.assert_allclose(high_mesh.vertices - low_mesh.vertices, np.tile([0, 0, 40], (len(low_mesh.vertices), 1)))
    assert set(low_mesh.vertices[:, 2]) == {0.0, 12.0}


def test_what_begins_above_the_ground_is_closed_below_and_the_ground_goes_on() -> None:
    on_ground = replace(BOX, height=6.0, footprint=shapely.box(0, 0, 10, 10))
    bridge = replace(BOX, id="b", footprint=shapely.box(10, 0, 20, 10), raised=4.0, part_of="a")
    charts, mesh = surfaces([on_ground, bridge], [STREET], SLOPE)
    own = mesh.triangles[charts.building[mesh.chart] == 1]
    solid = trimesh.Trimesh(mesh.vertices, own)
    solid.merge_vertices(digits_vertex=6)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(10 * 10 * 8)
    low = mesh.vertices[own][..., 2].min()
    assert low == pytest.approx(20.0 + 4.0), "from the lowest ground of both"
    ceiling = (charts.kind == ChartKind.CEILING) & (charts.building == 1)
    np.testing.assert_allclose(charts.normals()[ceiling], [[0, 0, -1]])
    under = mesh.vertices[mesh.triangles[charts.kind[mesh.chart] == ChartKind.GROUND]][..., :2]
    covered = shapely.union_all(shapely.polygons(under), grid_size=1e-6)
    assert covered.covers(shapely.box(12, 2, 18, 8))
    assert not covered.intersects(shapely.box(2, 2, 8, 8))


def test_ground_follows_the_terrain_and_stays_closed() -> None:
    charts, mesh = surfaces([BOX], [STREET], SLOPE)
    ground = charts.kind == ChartKind.GROUND
    own = ground[mesh.vertex_chart]
    x = mesh.vertices[own, 0]
    np.testing.assert_allclose(mesh.vertices[own, 2], 0.1 * (x + 200), atol=1e-5)
    assert len(set(charts.surface[ground])) == 1
    assert (charts.normals()[ground, 2] > 0.99).all()
    plan = shapely.union_all(
        [shapely.Polygon(t) for t in mesh.vertices[mesh.triangles[ground[mesh.chart]]][..., :2]], grid_size=1e-6
    )
    assert plan.geom_type == "Polygon"
    assert plan.intersection(BOX.footprint).area < 1e-3


def test_uneven_ground_is_cut_finer() -> None:
    rough = replace(SLOPE, heights=np.random.default_rng(0).uniform(0, 3, (41, 41)).astype(np.float32))
    level = surfaces([BOX], [STREET])[0]
    uneven = surfaces([BOX], [STREET], rough)[0]
    assert (
        level.size[level.kind == ChartKind.GROUND].max(),
        uneven.size[uneven.kind == ChartKind.GROUND].max() < 13,
    ) == (32, True)


def test_a_building_stands_on_the_lowest_ground_and_a_higher_one_has_a_skirt() -> None:
    charts, mesh = surfaces([BOX], [STREET], SLOPE)
    walls = charts.kind == ChartKind.WALL
    assert walls.sum() == 4
    assert mesh.vertices[walls[mesh.vertex_chart], 2].min() == pytest.approx(20)
    charts, mesh = surfaces([replace(BOX, base=23.0)], [STREET], SLOPE)
    walls = charts.kind == ChartKind.WALL
    assert walls.sum() == 8
    assert (charts.kind[:5] == [ChartKind.WALL] * 4 + [ChartKind.ROOF]).all()
    skirt = walls & (np.arange(len(charts)) >= 5)
    assert mesh.vertices[skirt[mesh.vertex_chart], 2].max() == pytest.approx(23)
    assert mesh.vertices[skirt[mesh.vertex_chart], 2].min() == pytest.approx(20)


def test_walls_reach_down_to_ground_that_is_a_little_lower() -> None:
    shell = build_shell_with_roof(replace(BOX, roof=Roof("gabled", 3.0)), 20.6)
    assert shell is not None
    painted = replace(shell, texture=np.zeros_like(shell.texture))
    for house, count in ((BOX, 4), (replace(BOX, shell=shell), 6), (replace(BOX, roof=Roof("gabled", 3.0)), 6)):
        charts, mesh = surfaces([replace(house, base=20.6)], [STREET], SLOPE)
        walls = np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.size[:, 0] > 9))
        assert len(walls) == count, "no strip below, walls and gables alone"
        main = walls[charts.size[walls, 1] > 10]
        foot = charts.points_at_shares(main, np.array([[0.0, 1.0], [1.0, 1.0]]))[..., 2]
        np.testing.assert_allclose(foot, 20.0, atol=1e-6)
        np.testing.assert_allclose(charts.origin[main, 2].min(), 20.6 + 12)
    charts, mesh = surfaces([replace(BOX, shell=painted, base=20.6)], [STREET], SLOPE)
    assert (charts.kind == ChartKind.WALL).sum() > 6, "pictures of its own are not drawn out"
    own = mesh.triangles[(charts.building[mesh.chart] == 0) & (mesh.texture >= 0)]
    assert mesh.vertices[own][..., 2].min() == pytest.approx(20.6)


def test_a_roofed_building_is_closed_down_to_the_slope() -> None:
    far = replace(STREET, line=shapely.affinity.translate(STREET.line, 0, 500))  # eaves stand out where they are seen
    roofed = replace(BOX, roof=Roof("gabled", 4.0), base=23.0)
    charts, mesh = surfaces([roofed], [far], SLOPE)
    assert (charts.kind == ChartKind.ROOF).sum() == 2
    walls = (charts.kind == ChartKind.WALL)[mesh.chart]
    # 60 m around at 12 m, two gables, and the skirt down to the lowest ground under each wall
    assert shares(mesh, walls) == pytest.approx(60 * 12 + 40 + 3 * 10 + 1 * 10 + 2 * 3 * 20, abs=1e-3)
    flat = surfaces([replace(roofed, roof=None)], [far], SLOPE)[0]
    assert (charts.size[:4] == flat.size[:4]).all(), "walls end at the eaves: facades are what they are without a roof"
    whole = trimesh.Trimesh(mesh.vertices, mesh.triangles[charts.building[mesh.chart] == 0])
    edges = trimesh.grouping.group_rows(whole.edges_sorted, require_count=1)
    assert (whole.vertices[whole.edges[edges]][..., 2] < 23 + 1e-6).all(), "open below only"
    normals = charts.normals()[charts.kind == ChartKind.ROOF]
    assert sorted(np.sign(normals[:, 1]).tolist()) == [-1, 1]


def test_a_shell_keeps_its_texture_and_long_facets_are_cut() -> None:
    long = replace(BOX, footprint=shapely.box(5, 0, 155, 10), roof=Roof("gabled", 4.0))
    shell = build_shell_with_roof(long, 7.0)
    assert shell is not None
    rng = np.random.default_rng(0)
    painted = BuildingShell(shell.vertices, shell.triangles, shell.semantic, np.full(len(shell.triangles), 3, np.int32),
                    rng.random((len(shell.triangles), 3, 2)).astype(np.float32))  # fmt: skip
    charts, mesh = surfaces([replace(long, roof=None, shell=painted)])
    assert (charts.kind == ChartKind.WALL).sum() + (charts.kind == ChartKind.ROOF).sum() == len(charts)
    assert charts.size.max() < 56
    assert len(set(charts.surface)) == 8
    assert (mesh.texture == 3).all()
    assert mesh.uv.min() >= 0
    assert mesh.uv.max() > 0.5
    assert mesh.vertices[:, 2].min() == 7.0
    assert shares(mesh, np.ones(len(mesh.triangles), bool)) == pytest.approx(
        2 * 160 * 12 + 40 + 2 * 150 * np.hypot(5, 4), rel=1e-6
    )


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        (replace(BOX, height=0.0), "height"),
        (replace(BOX, height=float("nan")), "height"),
        (replace(BOX, footprint=shapely.Polygon([(0, 0), (10, 10), (10, 0), (0, 10)])), "area|itself"),
        (replace(BOX, shell=BuildingShell(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros(0, np.uint8),
                                  np.zeros(0, np.int32), np.zeros((0, 3, 2), np.float32))), "no surface"),
    ],
)  # fmt: skip
def test_a_building_without_surfaces_is_left_out_by_name(broken: Building, reason: str) -> None:
    beside = replace(BOX, id="b", footprint=shapely.box(100, 0, 120, 10))
    buildings = [broken, beside]
    charts, _, refused = build_block_surfaces(
        buildings, [STREET], terrain=build_terrain([beside], None), ground_margin=20, largest=100
    )
    assert set(charts.building.tolist()) == {-1, 1}
    ((id, why),) = refused
    assert id == "a"
    assert re.search(reason, why)
    with pytest.raises(GeometryError, match="a: "):
        build_block_surfaces([broken], [], terrain=build_terrain([], None), ground_margin=20, largest=100)


def test_the_ground_goes_on_under_a_canopy() -> None:
    house = build_shell_with_roof(replace(BOX, roof=Roof("gabled", 3.0)), 0.0)
    assert house is not None
    z = house.vertices[house.triangles][..., 2]
    canopy = BuildingShell(
        house.vertices, *(getattr(house, n)[z.min(axis=1) > 1] for n in ("triangles", "semantic", "texture", "uv"))
    )

    def under(shell: BuildingShell) -> bool:
        charts, mesh = surfaces([replace(BOX, shell=shell, base=0.0)], [STREET])
        ground = mesh.triangles[charts.kind[mesh.chart] == ChartKind.GROUND]
        plan = shapely.union_all(shapely.polygons(mesh.vertices[ground][..., :2]))
        return bool(shapely.contains_xy(plan, 10.1, 5.1))

    assert under(canopy)
    assert not under(house)


def test_a_shell_begins_at_the_ground_that_it_states() -> None:
    """As in models whose walls go down to height 0, whatever the ground's."""
    shell = build_shell_with_roof(replace(BOX, roof=Roof("gabled", 3.0)), 0.0)
    assert shell is not None
    charts, mesh = surfaces([replace(BOX, shell=shell, base=3.4)], [STREET])
    own = trimesh.Trimesh(mesh.vertices, mesh.triangles[charts.building[mesh.chart] == 0])
    own.merge_vertices(digits_vertex=6)
    assert own.bounds[0, 2] == pytest.approx(3.4)
    assert own.bounds[1, 2] == pytest.approx(shell.vertices[:, 2].max())
    whole = trimesh.Trimesh(shell.vertices, shell.triangles)
    assert own.area == pytest.approx(whole.area - BOX.footprint.area - 3.4 * BOX.footprint.length)
    deeper = replace(shell, texture=np.zeros_like(shell.texture))
    assert surfaces([replace(BOX, shell=deeper, base=3.4)], [STREET])[1].vertices[:, 2].min() == pytest.approx(0.0)


def test_a_shell_may_stand_in_two_parts() -> None:
    halves = [
        build_shell_with_roof(replace(BOX, footprint=shapely.box(x, 0, x + 8, 10), roof=Roof("gabled", 3.0)), 0.0)
        for x in (0, 20)
    ]
    one, two = (half for half in halves if half is not None)
    both = BuildingShell(
        np.concatenate([one.vertices, two.vertices]),
        np.concatenate([one.triangles, two.triangles + len(one.vertices)]),
        *(np.concatenate([getattr(one, name), getattr(two, name)]) for name in ("semantic", "texture", "uv")),
    )
    house = replace(BOX, footprint=shapely.box(0, 0, 8, 10).union(shapely.box(20, 0, 28, 10)), shell=both, base=0.0)
    charts, _ = surfaces([house], [STREET])
    middle = charts.origin + (charts.axis_u * charts.size[:, :1] + charts.axis_v * charts.size[:, 1:]) / 2
    wall = charts.kind == ChartKind.WALL
    assert wall.sum() == 12, "eight walls and four gables"
    outside = shapely.points((middle + 0.5 * charts.normals())[wall, :2])
    assert not shapely.intersects(house.footprint, outside).any(), "walls of both parts face outward"


def test_lyon_roofs_face_up_and_walls_stand_up(data: Path) -> None:
    """The first surfaces of Lyon as one model: every chart's triangles face as it does, none lies below its neighbours."""
    with np.load(data / "city" / "lyon" / "lod2.npz") as packed:
        corners = packed["triangles"][:4000].astype(np.float64)
    vertices, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    outline = shapely.union_all(shapely.make_valid(shapely.polygons(corners[..., :2])), grid_size=0.01)
    n = len(corners)
    shell = BuildingShell(vertices, index.reshape(-1, 3).astype(np.int32), np.full(n, 6, np.uint8), np.full(n, -1, np.int32),
                  np.zeros((n, 3, 2), np.float32))  # fmt: skip
    charts, mesh = surfaces([replace(BOX, footprint=outline.convex_hull, shell=shell)])
    normal = charts.normals()
    assert (normal[charts.kind == ChartKind.ROOF, 2] > 0).all()
    assert (np.abs(normal[charts.kind == ChartKind.WALL, 2]) < 0.7).all()
    tri = mesh.vertices[mesh.triangles]
    facing = np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0])
    assert (np.einsum("ij,ij->i", facing, normal[mesh.chart]) > -1e-9).all()
    assert np.isfinite(charts.origin).all()


def test_only_the_ground_that_is_uneven_is_cut_finer_and_meets_what_is_beside_it() -> None:
    """A bump at one end of the street: the piece under it is cut, no other, and no border has a corner of one side alone."""
    heights = np.tile(np.linspace(0, 1, 41, dtype=np.float32), (41, 1))
    bumped = heights.copy()
    bumped[22, 24] += 2
    sizes = {}
    for name, raster in (("slope", heights), ("bump", bumped)):
        charts, mesh = surfaces([BOX], [STREET], replace(SLOPE, heights=raster))
        ground = np.flatnonzero(charts.kind == ChartKind.GROUND)
        sizes[name] = {tuple(np.round(charts.origin[c, :2], 6)): float(charts.size[c].max()) for c in ground.tolist()}
    assert max(sizes["bump"].values()) > 30
    assert min(sizes["bump"].values()) < 13
    whole = [place for place, size in sizes["slope"].items() if sizes["bump"].get(place) == size]
    assert len(whole) > len(sizes["slope"]) / 2
    assert_meets(mesh, (charts.kind == ChartKind.GROUND)[mesh.chart])


def assert_meets(mesh: Mesh, chosen: np.ndarray) -> None:
    """No corner of a triangle lies within an edge of another."""
    triangles = mesh.vertices[mesh.triangles[chosen]]
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    lines = shapely.linestrings(edges[..., :2])
    edge, corner = shapely.STRtree(shapely.points(corners[:, :2])).query(lines, predicate="dwithin", distance=1e-9)
    ends = np.linalg.norm(edges[edge][..., :2] - corners[corner][:, None, :2], axis=2).min(axis=1)
    assert (ends < 1e-9).all()
