"""The tiles of a block, before they are made: the leaves of a grid's quadtree over its buildings and pieces of ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.export.models.textured_mesh import SMALLEST_M2, shown_area
from facade_core.export.tiles.quadtree import LARGEST_M, grid_leaves, members_of
from facade_core.plan.plan import Plan

# Encoded bytes of a texel, gutters and what lies between charts included: 0.12 in the demo; photographed walls take twice that.
TEXEL_BYTES = 0.25
# What a tile is to take at most.
TILE_BYTES = 32_000_000
TILE_TEXELS = int(TILE_BYTES / TEXEL_BYTES)


@dataclass(frozen=True)
class Tile:
    """A tile before it is made: its path; buildings (b,) and charts (k,), ascending, those of the ground among them; origin,
    world metres: a corner of the grid at the height of its lowest point, in whole metres."""

    path: str
    buildings: np.ndarray
    charts: np.ndarray
    origin: tuple[float, float, float]


def tiles_of(plan: Plan) -> list[Tile]:
    """The tiles of a block, by path."""
    scene = plan.scene
    charts, mesh = scene.charts, scene.mesh
    drawn = np.unique(mesh.chart[shown_area(mesh) > SMALLEST_M2])
    drawn = drawn[plan.own[drawn]]
    lowest = np.full(len(charts), np.inf)
    np.minimum.at(lowest, mesh.vertex_chart, mesh.vertices[:, 2])
    tiles = []
    leaf_of_building = {}
    leaves = grid_leaves(members_of(charts, plan.texels(), drawn), TILE_TEXELS)
    for number, leaf in enumerate(leaves):
        leaf_of_building.update(dict.fromkeys(leaf.buildings.tolist(), number))
    own: list[list[int]] = [leaf.ground.tolist() for leaf in leaves]
    for chart in drawn[charts.building[drawn] >= 0].tolist():
        own[leaf_of_building[int(charts.building[chart])]].append(chart)
    for leaf, held in zip(leaves, own, strict=True):
        mine = np.sort(np.array(held, np.int64))
        corner = np.floor(leaf.corner / LARGEST_M) * LARGEST_M
        origin = (*corner.tolist(), float(np.floor(lowest[mine].min())))
        tiles.append(Tile(leaf.path, leaf.buildings, mine, origin))
    return tiles
