"""Shells that close: corners that are one, T-junctions, curtains, planes; and the room behind openings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import shapely

from facade_core.core.grouping import group_rows
from facade_core.core.types import Building, Roof, Street
from facade_core.export.bodies.building_body import build_body
from facade_core.export.bodies.patches import (
    MeshPolygon,
    PolygonMesh,
    is_closed,
    open_edges,
    polygon_components,
    triangulate_nonplanar_polygons,
    weld_polygons,
)
from facade_core.export.bodies.recess import WallSpace, intersects_box, recess_opening
from facade_core.export.models.textured_mesh import TexturedMesh
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.terrain import build_terrain

ORIGIN = np.array([386000.0, 6671900.0, 0.0])


def of(polygons: Sequence[Sequence[Sequence[float]]]) -> PolygonMesh:
    rings = [[ORIGIN + np.array(polygon, float)] for polygon in polygons]
    return weld_polygons(rings, [0] * len(rings), [0] * len(rings), ORIGIN)


def test_corners_that_pass_by_millimetres_are_one_and_edges_have_the_corners_on_them() -> None:
    # the hip of a roof meets the eaves twice, 4 mm apart; the wall below has no corner there
    roof = [[0.0, 0, 3], [10, 0, 3], [10.004, 0, 3], [5, 5, 6]]
    left = [[0.0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]]
    right = [[4.0, 0, 0], [10, 0, 0], [10, 0, 3], [4, 0, 3]]
    found = of([roof, left, right])
    assert [len(patch.rings[0]) for patch in found.patches] == [4, 4, 4], "three corners, and one where the walls meet"
    seam = {tuple(found.points[c] - ORIGIN) for c in found.patches[0].rings[0]}
    assert (4.0, 0.0, 3.0) in seam
    inner = {(a, b) for patch in found.patches for a, b in patch.edges()} - set(open_edges(found.patches))
    assert len(inner) == 6, "two edges under the roof, one between the walls, both ways"


def test_rings_that_fall_together_are_dropped() -> None:
    sliver = [[0.0, 0, 0], [4, 0, 0], [4, 0, 0.004], [0, 0, 0.004]]
    assert of([sliver]).patches == ()
    spike = [[0.0, 0, 0], [4, 0, 0], [4, 0, 4], [2, 0, 4], [2, 0, 6], [2, 0, 4], [0, 0, 4]]
    assert len(of([spike]).patches[0].rings[0]) == 5


def test_what_is_not_planar_is_cut_into_triangles_and_stays_closed() -> None:
    top = [[0.0, 0, 3], [4, 0, 3], [4, 4, 3.2], [0, 4, 3]]
    foot = [[0.0, 0, 0], [0, 4, 0], [4, 4, 0], [4, 0, 0]]
    sides = [[foot[(k + 1) % 4], foot[k], top[-k], top[-k - 1]] for k in range(4)]
    body = of([top, foot, *sides])
    assert is_closed(body.patches)
    flat = triangulate_nonplanar_polygons(body)
    assert is_closed(flat.patches)
    assert len(flat.patches) == len(body.patches) + 1


@pytest.mark.parametrize("shape", ["flat", "gabled", "hipped", "mansard", "skillion"])
def test_what_is_extruded_here_closes_and_what_stands_out_is_beside(shape: str) -> None:
    x, y = ORIGIN[:2]
    outline = shapely.Polygon([(x, y), (x + 30, y), (x + 30, y + 12), (x + 14, y + 12), (x + 14, y + 30), (x, y + 30)])
    roof = Roof(shape, 4.0, confidence=0.5)
    buildings = [Building("a", outline, 12.0, "height", roof=roof)]
    street = Street("s", None, shapely.LineString([(x - 20, y - 10), (x + 60, y - 10)]))
    charts, mesh, _ = build_block_surfaces(
        buildings, [street], terrain=build_terrain([], None), ground_margin=10, largest=20
    )
    source = TexturedMesh(charts, mesh, charts.size, np.ones((len(charts), 2), np.int64), lambda chart: np.zeros(0))
    triangles = group_rows(charts.building[mesh.chart])[0]
    semantics = dict.fromkeys(np.unique(mesh.chart[triangles]).tolist(), 0)
    body = build_body(source, triangles, semantics, 1, ORIGIN)
    assert body.is_closed
    assert is_closed(body.shell.patches)
    assert len(polygon_components(body.shell.patches)) == 1
    down = [patch for patch in body.shell.patches if patch.semantic == 1]
    area = sum(float(body.shell.area_vector(patch)[2]) for patch in down)
    assert area == pytest.approx(-outline.area, abs=0.1), "the ground below, facing down"
    assert body.attachments, "eaves or a parapet"


def test_openings_are_as_deep_as_there_is_room(coloured: TexturedMesh) -> None:
    charts = coloured.charts
    chart = int(np.flatnonzero((charts.building == 0) & (charts.kind == ChartKind.WALL))[0])
    wall = charts.points_at_shares(np.array([chart]), np.array([[0.0, 0], [0, 1], [1, 1], [1, 0]]))[0]
    opening = shapely.orient_polygons(shapely.box(1, 2, 2.5, 4), exterior_cw=True)
    out = charts.normals()[chart]
    for gap, depth in ((0.3, 0.15), (0.1, 0.05), (0.04, 0.0)):
        behind = wall - gap * out
        triangles = behind[[[0, 1, 2], [0, 2, 3]]]
        found = recess_opening(opening, 0.15, WallSpace(charts, chart, wall, [triangles]))
        assert found.depth == depth
        np.testing.assert_allclose((wall[0] - found.pane_ring) @ out, depth, atol=1e-9)
        assert len(found.reveals()) == (4 if depth else 0)


def test_triangles_meet_a_box_or_pass_it() -> None:
    triangles = np.array(
        [
            [[-5.0, -5, 0], [5, -5, 0], [0, 5, 0]],  # through the middle
            [[3.0, 0, 0], [0, 3, 0], [3, 3, 0]],  # its box meets, it passes the corner
            [[0.2, 0.2, 0.2], [0.3, 0.2, 0.2], [0.2, 0.3, 0.2]],  # inside
            [[2.0, 2, 2], [3, 2, 2], [2, 3, 2]],
        ]
    )
    assert intersects_box(triangles, np.zeros(3), np.ones(3)).tolist() == [True, False, True, False]


def test_pieces_hang_together_over_edges() -> None:
    patches = [
        MeshPolygon(((0, 1, 2),)),
        MeshPolygon(((5, 6, 7),)),
        MeshPolygon(((2, 1, 3),)),
        MeshPolygon(((3, 8, 9),)),
    ]
    assert polygon_components(patches) == [[0, 2], [1], [3]]
    assert polygon_components([]) == []
