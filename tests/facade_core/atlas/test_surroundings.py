"""Pieces of one surface lie in one raster as they do in the world."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.atlas.surroundings import coplanar_pieces, read_chart_with_surroundings
from facade_core.core.levelling import level_seam_colours
from facade_core.core.types import Building, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.ground.terrain import build_terrain

DENSITY = 10.0


@pytest.fixture(scope="module")
def charts() -> Charts:
    """A long house cut every 8 m, askew to the grid of the cuts, and a lower one that leans on its end."""
    house = shapely.affinity.rotate(shapely.box(0, 0, 30, 8), 20, origin=(0, 0))
    lean = shapely.affinity.rotate(shapely.box(30, 0, 36, 8), 20, origin=(0, 0))
    street = Street("s", None, shapely.LineString([(0, -9), (30, -9)]))
    houses = [Building("a", house, 7.0, "height"), Building("b", lean, 5.0, "height")]
    return build_block_surfaces(
        houses, [street], terrain=build_terrain([], None), ground_margin=9, largest=8.1, grid=8
    )[0]


def painted(charts: Charts, chart: int) -> tuple[np.ndarray, np.ndarray]:
    """A chart whose colour is a function of the place in the world, wholly known."""
    width, height = charts.texels(DENSITY)[chart]
    x, y = (np.arange(width) + 0.5) / DENSITY, (np.arange(height) + 0.5) / DENSITY
    points = charts.origin[chart] + x[None, :, None] * charts.axis_u[chart] + y[:, None, None] * charts.axis_v[chart]
    return np.round(128 + 4 * points).astype(np.uint8), np.full((height, width), 1 + chart % 4, np.uint8)


def reader(charts: Charts):
    def read(chart: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        colour, provenance = painted(charts, chart)
        return colour[rows, columns], provenance[rows, columns]

    return read


@pytest.mark.parametrize("kind", [ChartKind.WALL, ChartKind.ROOF])
def test_what_is_around_lies_where_it_is(charts: Charts, kind: int) -> None:
    margin = 25
    checked = 0
    for chart in np.flatnonzero((charts.kind == kind) & (charts.building == 0)).tolist():
        width, height = charts.texels(DENSITY)[chart]
        colour, provenance = read_chart_with_surroundings(
            charts, np.full(len(charts), DENSITY), chart, (height, width), margin, reader(charts)
        )
        x = (np.arange(width + 2 * margin) + 0.5 - margin) / DENSITY
        y = (np.arange(height + 2 * margin) + 0.5 - margin) / DENSITY
        points = charts.origin[chart] + x[None, :, None] * charts.axis_u[chart]
        points = points + y[:, None, None] * charts.axis_v[chart]
        known = provenance > 0
        # within the texel by which two rasters may lie apart
        assert np.abs(colour[known] - (128 + 4 * points[known])).max() < 1.6
        assert known[margin:-margin, margin:-margin].all()
        around = coplanar_pieces(charts, chart, margin / DENSITY)
        assert (charts.building[around] == 0).all()
        checked += int(known.sum() > known[margin:-margin, margin:-margin].size and len(around) > 0)
    assert checked >= 3


def test_another_surface_is_not_around(charts: Charts) -> None:
    alone = np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.building == 1))
    assert len(alone) > 0
    for chart in alone.tolist():
        assert (charts.surface[coplanar_pieces(charts, chart, 5.0)] == charts.surface[chart]).all()


def test_a_seam_at_the_border_of_two_charts_goes(charts: Charts) -> None:
    """One piece is known, the one beside it was guessed darker: both pieces' facing columns meet."""
    fronts = np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.building == 0) & (charts.size[:, 0] > 5)).tolist()
    chart, other = next((c, int(o)) for c in fronts for o in coplanar_pieces(charts, c, 1.0) if int(o) in fronts)
    along = (charts.origin[other] - charts.origin[chart]) @ charts.axis_u[chart]

    def read(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        shape = tuple(charts.texels(DENSITY)[one][::-1])
        value, rank = {chart: (90, 1), other: (130, 4)}.get(one, (0, 0))
        colour = np.full((*shape, 3), value, np.uint8)
        return colour[rows, columns], np.full(shape, rank, np.uint8)[rows, columns]

    width, height = charts.texels(DENSITY)[chart]
    margin = 40
    colour, provenance = read_chart_with_surroundings(
        charts, np.full(len(charts), DENSITY), chart, (height, width), margin, read
    )
    levelled = level_seam_colours(colour, provenance == 4, provenance == 1, reach=20)[
        margin:-margin, margin:-margin
    ].astype(int)
    edge, far = (levelled[:, -1], levelled[:, 0]) if along > 0 else (levelled[:, 0], levelled[:, -1])
    assert abs(edge.mean() - 130) < 4
    assert far.mean() < 130 - 15
