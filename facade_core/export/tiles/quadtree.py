"""Buildings and pieces of ground in the cells of quadtrees: of a block's own extent, or of a grid that never moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from facade_core.core.grouping import group_rows
from facade_core.geometry.charts import Charts

# Side of the largest cells, metres; more distant members never share a tile.
MAX_CELL_M = 1024.0
# Minimum side of a cell, metres.
MIN_CELL_M = 1.0


@dataclass(frozen=True)
class QuadtreeMembers:
    """What a quadtree is made over: buildings (b,) and pieces of ground (g,), ascending indices and chart ids; the middle of
    each, points (b + g, 2) metres, and the texels of its charts, weight (b + g,) int64."""

    buildings: np.ndarray
    ground: np.ndarray
    points: np.ndarray
    texel_counts: np.ndarray

    def split(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The buildings and the pieces of ground among some members (k,)."""
        n = len(self.buildings)
        return self.buildings[chosen[chosen < n]], self.ground[chosen[chosen >= n] - n]


class GridLeaf(NamedTuple):
    """A cell of the grid that is not divided: its path, `375_6514_031` for column and row of the largest cell and the quadrants
    in it, west to east and then northwards; its south-western corner (2,) metres; its buildings, and pieces of ground by their
    charts, both ascending."""

    path: str
    corner: np.ndarray
    buildings: np.ndarray
    ground: np.ndarray


def collect_members(charts: Charts, texels: np.ndarray, drawn: np.ndarray) -> QuadtreeMembers:
    """The members with some charts, `drawn` (k,) ascending; texels (charts,) of every chart."""
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


def split_quadrants(points: np.ndarray, corner: np.ndarray, side: float) -> dict[int, np.ndarray]:
    """The points (n, 2) in each quadrant of a cell, by their indices: 1 is east, 2 is north, 3 is both."""
    return group_rows((points >= corner + side / 2) @ [1, 2])


def quadrant_corner(quadrant: int, corner: np.ndarray, side: float) -> np.ndarray:
    """The south-western corner (2,) of a quadrant of a cell."""
    return corner + side / 2 * np.array([quadrant & 1, quadrant >> 1])


def divide_grid(members: QuadtreeMembers, max_texels: int) -> list[GridLeaf]:
    """The members by cells of a grid of LARGEST_M, divided until a cell has at max_texels so many texels, or one member; by path.

    The grid is the frame's own and a cell is divided by what lies in it alone: what comes, goes or changes elsewhere leaves it
    as it was.
    """
    leaves: list[GridLeaf] = []

    def divide(path: str, inside: np.ndarray, corner: np.ndarray, side: float) -> None:
        if int(members.texel_counts[inside].sum()) <= max_texels or len(inside) == 1 or side <= MIN_CELL_M:
            leaves.append(GridLeaf(path, corner, *members.split(inside)))
            return
        below = path if path.count("_") == 2 else f"{path}_"
        for quadrant, mine in split_quadrants(members.points[inside], corner, side).items():
            divide(f"{below}{quadrant}", inside[mine], quadrant_corner(quadrant, corner, side), side / 2)

    cells, of = np.unique(np.floor(members.points / MAX_CELL_M).astype(np.int64), axis=0, return_inverse=True)
    by_cell = group_rows(of.reshape(-1))
    for number, (column, row) in enumerate(cells.tolist()):
        divide(f"{column}_{row}", by_cell[number], np.array([column, row]) * MAX_CELL_M, MAX_CELL_M)
    return sorted(leaves, key=lambda leaf: leaf.path)
