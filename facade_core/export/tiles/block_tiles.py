"""Plan of a block's tiles: the leaves of a grid quadtree over its buildings and ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Int64Array
from facade_core.export.models.settings import TEXTURED_MESHES
from facade_core.export.models.textured_mesh import triangle_areas
from facade_core.export.tiles.quadtree import collect_members, divide_grid
from facade_core.export.tiles.settings import TILE_GRIDS
from facade_core.plan.plan import Plan


@dataclass(frozen=True)
class BlockTile:
    """Planned tile of a block: its buildings, charts and origin.

    Attributes
    ----------
    path : path in the grid.
    buildings : (b,) building indices, ascending.
    charts : (k,) chart ids with those of the ground, ascending.
    origin : corner of the grid at the height of the lowest point, world metres, whole numbers.
    """

    path: str
    buildings: Int64Array
    charts: Int64Array
    origin: tuple[float, float, float]


def plan_block_tiles(plan: Plan) -> list[BlockTile]:
    """Plan the tiles of a block, sorted by path."""
    scene = plan.scene
    charts, mesh = scene.charts, scene.mesh
    drawn = np.unique(mesh.chart[triangle_areas(mesh) > TEXTURED_MESHES.min_triangle_m2])
    drawn = drawn[plan.in_core[drawn]]
    lowest = np.full(len(charts), np.inf)
    np.minimum.at(lowest, mesh.vertex_chart, mesh.vertices[:, 2])
    tiles = []
    leaf_of_building = {}
    max_texels = int(TILE_GRIDS.max_tile_bytes / TILE_GRIDS.bytes_per_texel)
    leaves = divide_grid(collect_members(charts, plan.texel_counts(), drawn), max_texels)
    for number, leaf in enumerate(leaves):
        leaf_of_building.update(dict.fromkeys(leaf.buildings.tolist(), number))
    own: list[list[int]] = [leaf.ground.tolist() for leaf in leaves]
    for chart in drawn[charts.building[drawn] >= 0].tolist():
        own[leaf_of_building[int(charts.building[chart])]].append(chart)
    for leaf, held in zip(leaves, own, strict=True):
        mine = np.sort(np.array(held, np.int64))
        corner = np.floor(leaf.corner / TILE_GRIDS.max_cell_m) * TILE_GRIDS.max_cell_m
        origin = (*corner.tolist(), float(np.floor(lowest[mine].min())))
        tiles.append(BlockTile(leaf.path, leaf.buildings, mine, origin))
    return tiles
