"""Buildings and ground around a block, as plans and pictures have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from facade_core.core.street_objects import NO_OBJECTS
from facade_core.core.surrounding_mesh import NO_SURROUNDINGS, SurroundingMaterial
from facade_core.core.types import SURFACES, Building, BuildingFinish, GroundArea, MappedGround
from facade_core.export.pictures.surroundings import SurroundingView
from facade_core.export.surroundings.colours import surrounding_colours
from facade_core.geometry.charts import ChartBuilder
from facade_core.geometry.ground.ground_charts import add_ground_charts
from facade_core.geometry.ground.terrain import Terrain
from facade_core.plan.settings import SURROUNDINGS
from facade_core.plan.surroundings import build_surroundings

LEVEL = Terrain(0.0, 0.0, 1.0, np.array([[2.0]]))
BLOCK = shapely.box(0, 0, 60, 40)
NEIGHBOUR = Building("n", shapely.box(80, 0, 100, 20), 12.0, "height", base=2.0, finish=BuildingFinish((200, 10, 10)))
LAWN = GroundArea("g", shapely.multipolygons([shapely.box(-50, 60, 50, 90)]), "grass")


def surroundings(*neighbours: Building):  # type: ignore[no-untyped-def]
    pieces = ChartBuilder()
    add_ground_charts(pieces, [BLOCK], LEVEL, 32.0)
    return build_surroundings(neighbours, MappedGround(areas=(LAWN,)), pieces.build(), [], LEVEL)


def material_area(mesh, material: int) -> float:  # type: ignore[no-untyped-def]
    corners = mesh.vertices[mesh.triangles[mesh.material[mesh.triangles[:, 0]] == material]][..., :2]
    return float(shapely.area(shapely.polygons(corners)).sum())


def test_the_ground_goes_on_around_the_block_and_the_neighbours() -> None:
    mesh = surroundings(NEIGHBOUR)
    ring = BLOCK.buffer(SURROUNDINGS.distance_m, join_style="mitre").area - BLOCK.area - NEIGHBOUR.footprint.area
    assert abs(sum(material_area(mesh, k) for k in range(len(SURFACES))) - ring) < 1.0
    assert abs(material_area(mesh, SURFACES.index("grass")) - LAWN.outline.area) < 1.0
    assert abs(material_area(mesh, SurroundingMaterial.ROOF) - 400.0) < 1.0
    walls = mesh.vertices[mesh.material == SurroundingMaterial.WALL]
    assert (walls[:, 2].min(), walls[:, 2].max()) == (2.0, 14.0)


def test_ground_of_a_surface_that_is_a_sliver_is_left_out_on_a_slope() -> None:
    pieces = ChartBuilder()
    slope = Terrain(-300.0, -300.0, 600.0, np.array([[0.0, 9.0], [0.0, 9.0]]))
    add_ground_charts(pieces, [BLOCK], slope, 32.0)
    sliver = GroundArea("s", shapely.multipolygons([shapely.box(-50, 60, 50, 60.005)]), "grass")
    mesh = build_surroundings([NEIGHBOUR], MappedGround(areas=(sliver,)), pieces.build(), [], slope)
    assert material_area(mesh, SURFACES.index("grass")) == 0
    assert material_area(mesh, SURFACES.index("slabs")) > BLOCK.area


def test_stated_colours_are_shown_and_without_neighbours_there_is_nothing() -> None:
    mesh = surroundings(NEIGHBOUR)
    red = surrounding_colours(mesh)[mesh.material == SurroundingMaterial.WALL]
    assert (red[:, 0] > 2 * red[:, 1:].max(axis=1)).all()
    assert surroundings() is NO_SURROUNDINGS


def test_neighbours_have_a_window_for_each_bay_and_storey() -> None:
    def windows(*neighbours: Building) -> np.ndarray:
        mesh = surroundings(*neighbours)
        return mesh.vertices[mesh.material == SurroundingMaterial.WINDOW].reshape(-1, 4, 3)

    alone = windows(NEIGHBOUR)
    columns, storeys = int(20 / SURROUNDINGS.bay_m), round(12 / SURROUNDINGS.storey_m)
    assert len(alone) == 4 * columns * storeys
    assert (alone[..., 2].min() > 2) & (alone[..., 2].max() < 14)
    assert NEIGHBOUR.footprint.distance(shapely.multipoints(alone[:, 0, :2])) == pytest.approx(0.05)
    beside = replace(NEIGHBOUR, id="m", footprint=shapely.box(100, 0, 120, 20), height=6.0)
    # of two walls against each other, the higher one keeps the windows above the lower roof
    assert len(windows(NEIGHBOUR, beside)) == 3 * columns * (storeys + 2) + columns * (storeys - 2)
    assert not len(windows(replace(NEIGHBOUR, facade_style="warehouse")))
    raised = windows(replace(NEIGHBOUR, height=30.0, raised=20.0, levels=3))
    assert len(raised) == 4 * columns * 3, "levels of a raised part are its own"
    assert raised[..., 2].min() > 22
    assert not len(windows(replace(NEIGHBOUR, height=0.4))), "a step"


def test_a_view_shows_what_is_nearer_than_the_block() -> None:
    view = SurroundingView(NO_OBJECTS, surroundings(NEIGHBOUR))
    rays = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [1.0, 0.0, 0.0]])
    depth = np.array([np.inf, np.inf, 5.0], np.float32)
    chart, rgb = np.array([-1, -1, 3], np.int32), np.zeros((3, 3), np.uint8)
    covered = view.cover(np.array([30.0, 10.0, 4.0]), rays, depth, chart, rgb)
    assert covered.tolist() == [True, False, False]
    assert rgb[0, 0] > 1.5 * rgb[0, 1]
    assert chart.tolist() == [-1, -1, 3]
    assert not SurroundingView(NO_OBJECTS, NO_SURROUNDINGS).cover(np.zeros(3), rays, depth, chart, rgb).any()
