"""The ground by squares: what it is at places that are known, edges that are shared, and what it depends on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from facade_core.core.types import GroundArea, GroundWay, MappedGround
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.ground.layers import PAVEMENT_LAYER, ground_layers, join_carriageways
from facade_core.geometry.ground.marks import GroundMarkKind, ground_marks
from facade_core.geometry.ground.settings import MARKS, SHAPES
from facade_core.geometry.ground.shapes import GroundTiles
from facade_core.street.materials.grain_file import load_shipped_grain_tables
from facade_core.street.materials.ground_kernels import ground_colour
from facade_core.street.materials.pictured_ground import learn_pictured_ground
from facade_core.street.materials.procedural import SURFACE_COLOURS, GroundSurface

MAIN = GroundWay("main", shapely.LineString([(-200, 10), (300, 14)]), "road", 8.0, "setts", pavement=(3.0, 3.0), rank=5)
SIDE = GroundWay(
    "side", shapely.LineString([(20, 11.76), (24, 150)]), "road", 6.0, "asphalt", pavement=(3.0, 0.0), rank=1
)
PARK = GroundArea("park", shapely.box(-60, -60, 60, 2), "grass")
GROUND_OF = MappedGround((MAIN, SIDE), (PARK,))


def squares(ground: MappedGround, *places: tuple[int, int]) -> GroundTiles:
    """Ground charts that are whole squares of the world grid."""
    count = len(places)
    own = np.arange(count, dtype=np.int32)
    origin = np.array([(x * SHAPES.ground_tile_m, (y + 1) * SHAPES.ground_tile_m, 0.0) for x, y in places])
    east, south = (np.tile(axis, (count, 1)) for axis in ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0]))
    size = np.full((count, 2), SHAPES.ground_tile_m)
    return GroundTiles(
        ground, Charts(np.full(count, ChartKind.GROUND, np.uint8), own, own * 0 - 1, origin, east, south, size)
    )


def colours(ground: MappedGround, x: np.ndarray, y: np.ndarray, side: float, square: tuple[int, int]) -> np.ndarray:
    out = np.empty((len(x), 3), np.uint8)
    ground_colour(
        0,
        x,
        y,
        np.full(len(x), side),
        squares(ground, square).build_arrays([0]),
        load_shipped_grain_tables(),
        learn_pictured_ground([], len(SURFACE_COLOURS)),
        1,
        np.ones(len(x)),
        1.0,
        out,
    )
    return out.astype(float)


@pytest.mark.long
def test_ground_is_what_the_map_says() -> None:
    """A park is green to its edge, a kerb is lighter than the carriageway beside it and runs round the corner."""
    x = np.linspace(2, 12, 200)
    park = colours(GROUND_OF, x, np.full(200, 1.0), 0.05, (0, 0)).mean(axis=0)
    grass = SURFACE_COLOURS[GroundSurface.GRASS]
    assert park[1] / park[0] > 0.9 * grass[1] / grass[0]
    edge = shapely.offset_curve(MAIN.line, -4.0 - 0.09)
    points = shapely.get_coordinates(shapely.line_interpolate_point(edge, np.linspace(205, 215, 200)))
    kerb = colours(GROUND_OF, points[:, 0], points[:, 1], 0.05, (0, 0))
    road = colours(GROUND_OF, points[:, 0], points[:, 1] + 1.0, 0.05, (0, 0))
    assert kerb.mean() > road.mean() + 20
    # the corner between the two roads is carriageway, not a pavement with a point
    asphalt = MappedGround((replace(MAIN, surface="asphalt"), SIDE))
    inner, outer = colours(asphalt, np.array([23.9, 27.0]), np.array([16.4, 19.5]), 0.3, (0, 0)).mean(axis=1)
    assert inner < 115 < 125 < outer


def test_squares_meet_and_a_far_footprint_is_the_mean_of_near_ones() -> None:
    y = np.linspace(1, 31, 300)
    left, right = (colours(GROUND_OF, np.full(300, 32.0 + off), y, 0.1, (n, 0)) for n, off in ((0, -1e-9), (1, 1e-9)))
    assert np.abs(left - right).max() <= 1
    whole = colours(GROUND_OF, np.array([10.0]), np.array([11.0]), 1.0, (0, 0))[0]
    offset = (np.arange(20) + 0.5) / 20 - 0.5
    fine = [colours(GROUND_OF, 10.0 + offset, np.full(20, 11.0 + dy), 0.05, (0, 0)).mean(axis=0) for dy in offset]
    assert np.abs(whole - np.mean(fine, axis=0)).max() < 8


def test_the_ground_depends_on_what_lies_near_it_alone() -> None:
    """Another surface of a road, or an area more, is told where it may be seen and nowhere else."""
    places = [(0, 0), (0, 6), (12, 0)]
    before = squares(GROUND_OF, *places)
    other = squares(replace(GROUND_OF, ways=(MAIN, replace(SIDE, surface="setts"))), *places)
    assert [before.digest(c) == other.digest(c) for c in range(3)] == [False, True, True]
    more = squares(
        replace(GROUND_OF, areas=(PARK, GroundArea("pond", shapely.box(10, 200, 20, 210), "water"))), *places
    )
    assert [before.digest(c) == more.digest(c) for c in range(3)] == [True, False, True]
    renamed = squares(replace(GROUND_OF, ways=(replace(MAIN, id="other"), SIDE)), *places)
    assert all(before.digest(c) == renamed.digest(c) for c in range(3))


def test_a_line_that_is_cut_elsewhere_is_drawn_the_same() -> None:
    """Dashes and slabs count from the world's origin, not from where a line begins."""
    marked = replace(MAIN, surface="asphalt", lanes=2)
    shorter = replace(marked, line=shapely.LineString([(-100, 10.8), (300, 14)]))
    x, y = np.meshgrid(np.linspace(0.5, 31.5, 60), np.linspace(4, 20, 60))
    first, second = (colours(MappedGround((way,)), x.ravel(), y.ravel(), 0.1, (0, 0)) for way in (marked, shorter))
    assert np.abs(first - second).mean() < 0.5


def test_a_road_between_places_for_cars_has_its_line_in_the_middle() -> None:
    """Its offset is what rounding leaves of nothing: 4.4e-16 of these widths, by which GEOS fails."""
    bent = shapely.LineString([(0, 0), (14, 8), (22, 12), (63, 35)])
    way = GroundWay("b", bent, "road", 10.2, "asphalt", lanes=2, parking=(2.1, 2.1))
    line = ground_marks((way,), bent.buffer(way.width / 2), shapely.Point())[:, :4]
    line = line[[bent.distance(shapely.LineString(row.reshape(2, 2))) < 1e-6 for row in line]]
    assert 0 < np.hypot(*(line[:, 2:] - line[:, :2]).T).sum() < bent.length


LARGE = GroundWay(
    "l", shapely.LineString([(0, 0), (120, 0)]), "road", 13.0, "asphalt", lanes=4, pavement=(3.0, 3.0), rank=7
)


def painted(
    ways: tuple[GroundWay, ...], half: float, carriageway: shapely.Geometry | None = None
) -> list[shapely.LineString]:
    """Painted lines of half a width."""
    place = carriageway or shapely.union_all([way.line.buffer(way.width / 2, cap_style="flat") for way in ways])
    rows = ground_marks(ways, place, shapely.Point())
    return [
        shapely.LineString(row[:4].reshape(2, 2)) for row in rows if row[5] == GroundMarkKind.PAINT and row[4] == half
    ]


def test_large_roads_and_those_without_a_pavement_have_lines_along_their_edges() -> None:
    def edges(way: GroundWay) -> list[int]:
        away = way.width / 2 - MARKS.edge_line_offset_m
        lines = [one for one in painted((way,), MARKS.line_half_width_m) if abs(abs(one.centroid.y) - away) < 1e-6]
        return sorted(int(np.sign(one.centroid.y)) for one in lines)

    assert edges(LARGE) == [-1, 1]
    assert edges(replace(LARGE, parking=(0.0, 2.1))) == [1]
    assert edges(replace(LARGE, rank=5)) == []
    assert edges(replace(LARGE, rank=5, pavement=(0.0, 3.0))) == [1]
    assert edges(replace(LARGE, lanes=0)) == edges(replace(LARGE, surface="setts")) == []


def test_cars_stop_on_their_own_half_before_a_crossing_and_before_a_road_of_higher_rank() -> None:
    crossing = GroundWay("c", shapely.LineString([(60, -8), (60, 8)]), "crossing", 3.0, "asphalt")
    lines = sorted(painted((LARGE, crossing), MARKS.stop_line_half_width_m), key=lambda line: line.centroid.x)
    assert [round(line.centroid.x, 1) for line in lines] == [57.1, 62.9]
    assert [line.centroid.y < 0 for line in lines] == [True, False]  # who goes east keeps to the south
    assert all(4.5 < line.length < 6.5 for line in lines)
    one_way = painted((replace(LARGE, oneway=True), crossing), MARKS.stop_line_half_width_m)
    assert [round(line.centroid.x, 1) for line in one_way] == [57.1]
    assert one_way[0].length > 11
    assert painted((replace(LARGE, rank=3, lanes=0), crossing), MARKS.stop_line_half_width_m) == []
    side = replace(LARGE, id="s", line=shapely.LineString([(30, -60), (30, 0)]), width=7.0, lanes=2, rank=4)
    line = painted((LARGE, side), MARKS.stop_line_half_width_m)
    assert [(round(one.centroid.y, 1), one.centroid.x > 30) for one in line] == [(-8.0, True)]
    beside = replace(side, lanes=0, rank=3)
    chosen = [
        len(
            painted(
                (LARGE, replace(beside, line=shapely.affinity.translate(beside.line, 1.3 * i))),
                MARKS.stop_line_half_width_m,
            )
        )
        for i in range(40)
    ]
    assert 4 < sum(chosen) < 36


def test_the_pavement_of_a_ring_lies_along_all_of_it_on_both_sides() -> None:
    ring = shapely.LineString(shapely.Point(0, 0).buffer(30).exterior.coords)
    way = GroundWay("ring", ring, "road", 7.0, "asphalt", pavement=(5.0, 2.0))
    for line, out, into in ((ring, 2.0, 5.0), (ring.reverse(), 5.0, 2.0)):
        layers = ground_layers([], [replace(way, line=line)], join_carriageways([replace(way, line=line)])[0])
        inner, outer = 26.5 - out, 33.5 + into
        assert layers[PAVEMENT_LAYER].area == pytest.approx(np.pi * (outer**2 - inner**2), rel=0.01)
