"""Quadtrees over buildings and ground charts: of a block's own extent, or of a fixed grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array
from facade_core.core.grouping import group_rows
from facade_core.export.tiles.settings import TILE_GRIDS
from facade_core.geometry.charts import Charts


@dataclass(frozen=True)
class QuadtreeMembers:
    """Buildings and ground charts with their positions.

    Attributes
    ----------
    buildings : (b,) building indices, ascending.
    ground : (g,) ground charts, ascending.
    points : (b + g, 2) centres, metres.
    texel_counts : (b + g,) texels of their charts.
    """

    buildings: Int64Array
    ground: Int32Array
    points: Float64Array
    texel_counts: Int64Array

    def split(self, chosen: Int64Array) -> tuple[Int64Array, Int32Array]:
        """Split members (k,) into buildings and ground charts."""
        n = len(self.buildings)
        return self.buildings[chosen[chosen < n]], self.ground[chosen[chosen >= n] - n]


class GridLeaf(NamedTuple):
    """Leaf of the grid.

    Attributes
    ----------
    path : column and row of the largest cell and the quadrants in it, as "375_6514_031".
    corner : (2,) south-western corner, metres.
    buildings : building indices, ascending.
    ground : ground charts, ascending.
    """

    path: str
    corner: Float64Array
    buildings: Int64Array
    ground: Int32Array


def collect_members(charts: Charts, texels: Int64Array, drawn: Int32Array) -> QuadtreeMembers:
    """Collect the members that own some charts.

    Parameters
    ----------
    charts : charts of the block.
    texels : (charts,) texels of every chart.
    drawn : (k,) chart ids, ascending.
    """
    centres = charts.points(np.arange(len(charts)), *charts.size.T / 2)[:, :2]
    by_building = group_rows(charts.building[drawn])
    ground = drawn[by_building.pop(-1, np.zeros(0, np.int64))]
    owner = np.array(sorted(by_building), np.int64)
    own = [drawn[by_building[building]] for building in owner.tolist()]
    middle = np.array([centres[mine].mean(axis=0) for mine in own]).reshape(-1, 2)
    size = np.array([texels[mine].sum() for mine in own], np.int64)
    return QuadtreeMembers(
        owner, ground, np.concatenate([middle, centres[ground]]), np.concatenate([size, texels[ground]])
    )


def split_quadrants(points: Float64Array, corner: Float64Array, side: float) -> dict[int, Int64Array]:
    """Group points by quadrant of a cell; bit 0 is east, bit 1 is north.

    Parameters
    ----------
    points : (n, 2) metres.
    corner : (2,) south-western corner of the cell.
    side : side of the cell, metres.
    """
    return group_rows((points >= corner + side / 2) @ [1, 2])


def quadrant_corner(quadrant: int, corner: Float64Array, side: float) -> Float64Array:
    """Return the south-western corner (2,) of a quadrant."""
    return corner + side / 2 * np.array([quadrant & 1, quadrant >> 1])


def divide_grid(members: QuadtreeMembers, max_texels: int) -> list[GridLeaf]:
    """Divide members by cells of a fixed grid until a cell fits `max_texels` or holds one member; sorted by path.

    A cell depends only on its own members, so changes elsewhere leave it unchanged.
    """
    leaves: list[GridLeaf] = []

    def divide(path: str, inside: Int64Array, corner: Float64Array, side: float) -> None:
        if int(members.texel_counts[inside].sum()) <= max_texels or len(inside) == 1 or side <= TILE_GRIDS.min_cell_m:
            leaves.append(GridLeaf(path, corner, *members.split(inside)))
            return
        below = path if path.count("_") == 2 else f"{path}_"
        for quadrant, mine in split_quadrants(members.points[inside], corner, side).items():
            divide(f"{below}{quadrant}", inside[mine], quadrant_corner(quadrant, corner, side), side / 2)

    cells, of = np.unique(
        np.floor(members.points / TILE_GRIDS.max_cell_m).astype(np.int64), axis=0, return_inverse=True
    )
    by_cell = group_rows(of.reshape(-1))
    for number, (column, row) in enumerate(cells.tolist()):
        divide(
            f"{column}_{row}", by_cell[number], np.array([column, row]) * TILE_GRIDS.max_cell_m, TILE_GRIDS.max_cell_m
        )
    return sorted(leaves, key=lambda leaf: leaf.path)
