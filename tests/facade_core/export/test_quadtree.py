"""Tiles of a grid hold everything once, within their bound, and stay when something comes elsewhere."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from facade_core.export.models.textured_mesh import TexturedMesh
from facade_core.export.tiles.quadtree import GridLeaf, QuadtreeMembers, collect_members, divide_grid
from facade_core.export.tiles.settings import TILE_GRIDS

coordinates = st.floats(-3000, 3000, allow_subnormal=False)
places = st.lists(st.tuples(coordinates, coordinates, st.integers(1, 100)), min_size=1, max_size=40)


def members(things: list[tuple[float, float, int]]) -> QuadtreeMembers:
    """Half of the things are buildings, the rest ground."""
    half = len(things) // 2
    points = np.array([thing[:2] for thing in things])
    weight = np.array([thing[2] for thing in things])
    return QuadtreeMembers(np.arange(half), 500 + np.arange(len(things) - half), points, weight)


def held(leaf: GridLeaf, of: QuadtreeMembers) -> list[int]:
    return [*leaf.buildings.tolist(), *(len(of.buildings) + leaf.ground - 500).tolist()]


@settings(max_examples=60)
@given(places, st.integers(1, 300))
def test_everything_lies_in_one_leaf_within_the_bound(things: list[tuple[float, float, int]], most: int) -> None:
    of = members(things)
    leaves = divide_grid(of, most)
    assert sorted(one for leaf in leaves for one in held(leaf, of)) == list(range(len(things)))
    assert [leaf.path for leaf in leaves] == sorted({leaf.path for leaf in leaves})
    for leaf in leaves:
        mine = held(leaf, of)
        side = TILE_GRIDS.max_cell_m / 2 ** len(leaf.path.partition("_")[2].partition("_")[2])
        assert of.texel_counts[mine].sum() <= most or len(mine) == 1 or side <= 1
        assert (of.points[mine] >= leaf.corner).all()
        assert (of.points[mine] < leaf.corner + side).all()
        assert (leaf.corner % side == 0).all(), "the grid is the frame's"


@settings(max_examples=60)
@given(places, st.integers(1, 300), places)
def test_cells_without_a_change_stay_as_they_were(
    things: list[tuple[float, float, int]], most: int, others: list[tuple[float, float, int]]
) -> None:
    """What comes lies east of all that was there."""
    others = [(x + 3 * TILE_GRIDS.max_cell_m + 6000, y, weight) for x, y, weight in others]
    before, after = members(things), members(things)
    more = QuadtreeMembers(
        before.buildings,
        np.append(before.ground, 9000 + np.arange(len(others))),
        np.concatenate([before.points, [other[:2] for other in others]]),
        np.append(before.texel_counts, [other[2] for other in others]),
    )
    kept = {leaf.path: held(leaf, after) for leaf in divide_grid(more, most) if not (leaf.ground >= 9000).any()}
    assert kept == {leaf.path: held(leaf, before) for leaf in divide_grid(before, most)}


def test_members_are_buildings_and_pieces_of_ground(coloured: TexturedMesh) -> None:
    charts = coloured.charts
    drawn = np.unique(coloured.mesh.chart)
    texels = coloured.texels.prod(axis=1)
    of = collect_members(charts, texels, drawn)
    assert of.buildings.tolist() == [0, 1]
    assert of.ground.tolist() == drawn[charts.building[drawn] < 0].tolist()
    assert of.texel_counts.sum() == texels[drawn].sum()
    np.testing.assert_allclose(of.points[0], [386010, 6671995], atol=0.5)
    np.testing.assert_allclose(of.points[1], [386026, 6671995], atol=0.5)
