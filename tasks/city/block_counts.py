"""Size of a block, counted on its map before any unit runs: the input of a cost estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import shapely

from catalogs.block.reader import Block
from facade_core.core.arrays import ObjectArray
from facade_core.core.types import Building
from facade_core.geometry.texel_density import FULL_DENSITY_M, HALF_DENSITY_M, MAX_PARTY_WALL_SHARE, min_texel_density
from facade_core.geometry.walls import MAX_JOINT_M, MIN_WALL_M
from facade_core.plan.facades import MIN_FREE_SHARE
from tasks.stages.ingest.planning import make_plan

# Step of the ground grid, metres.
GROUND_CELL_M = 32.0
# Width of the ground around buildings without a street nearby, metres.
GROUND_MARGIN_M = 22.0


@dataclass(frozen=True)
class BlockCounts:
    """Number of units and pixels of one block or of several.

    Attributes
    ----------
    facades : facades at streets.
    viewpoints : viewpoints on streets.
    ground : ground tiles.
    exemplars : exemplars, counted once for each block.
    megatexels : millions of texels.
    blocks : blocks.
    megapixels : millions of panorama pixels.
    """

    facades: float
    viewpoints: float
    ground: float
    exemplars: float
    megatexels: float
    blocks: float = 1.0
    megapixels: float = 0.0

    def __add__(self, other: BlockCounts) -> BlockCounts:
        return BlockCounts(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))

    def multiply(self, factors: BlockCounts) -> BlockCounts:
        """Multiply each count by the factor of the same name."""
        return BlockCounts(*(getattr(self, f.name) * getattr(factors, f.name) for f in fields(self)))


NO_COUNTS = BlockCounts(0, 0, 0, 0, 0, 0)


def block_counts_from_map(block: Block) -> BlockCounts:
    """Estimate the counts of a block's core from its outlines and centrelines, without a plan."""
    part = block.part
    core = {b.id for b in block.buildings} if part is None else set(part.buildings)
    walked = {s.id for s in block.streets} if part is None else set(part.streets)
    mine = [building for building in block.buildings if building.id in core]
    lines = [street.line for street in block.streets if street.id in walked]
    spacing, width = block.texture.viewpoint_spacing, block.texture.panorama_width
    viewpoints = sum(max(1, int(np.ceil((line.length - spacing / 2) / spacing))) for line in lines)
    cells = _ground_cells(block, core, walked)
    exemplars = len(block.exemplars) if block.texture.walls == "exemplar" else 0
    density = _TexelDensity(block)
    texels = sum(
        density.texels_per_m2(shapely.box(x, y, x + GROUND_CELL_M, y + GROUND_CELL_M)) * GROUND_CELL_M**2
        for x, y in cells
    )
    texels += sum(building.footprint.area for building in mine) * density.coarsest**2  # no street sees roofs
    free, wall_texels = _count_walls(block, mine, density)
    return BlockCounts(
        facades=free,
        viewpoints=viewpoints,
        ground=len(cells),
        exemplars=exemplars,
        megatexels=(texels + wall_texels) / 1e6,
        megapixels=viewpoints * width * (width // 2) / 1e6,
    )


def block_counts_from_plan(block: Block) -> dict[str, float]:
    """Count the facades and megatexels of a block from its plan, which takes seconds to make."""
    plan = make_plan(block)
    placement = plan.scene.placement
    texels = (placement.width.astype(float) * placement.height)[plan.in_core].sum()
    return {"facades": len(plan.facades), "megatexels": float(texels) / 1e6}


class _TexelDensity:
    """Texel density from the distance to the nearest street, without occlusion and wall direction."""

    def __init__(self, block: Block) -> None:
        self._full = block.texture.texels_per_metre
        self.coarsest = min_texel_density(self._full)
        self._streets = shapely.STRtree([street.line for street in block.streets])

    def texels_per_m2(self, shape: shapely.Geometry) -> float:
        """Return the texels of a square metre of surface above a shape on the map."""
        halved = 2
        if len(near := self._streets.query(shape, "dwithin", distance=HALF_DENSITY_M)):
            halved = int(shapely.distance(self._streets.geometries[near], shape).min() > FULL_DENSITY_M)
        return float(max(self._full / 2**halved, self.coarsest)) ** 2


def _count_walls(block: Block, mine: Sequence[Building], density: _TexelDensity) -> tuple[int, float]:
    """Count the free walls of some buildings, and the texels of all their walls."""
    outlines = [building.footprint for building in block.buildings]
    tree, count, texels = shapely.STRtree(outlines), 0, 0.0
    for building in mine:
        rings = [part.exterior for part in shapely.get_parts(building.footprint)]
        edges = np.concatenate([_edges(ring) for ring in rings])
        near = [
            i
            for i in tree.query(building.footprint, "dwithin", distance=MAX_JOINT_M)
            if block.buildings[i] is not building
        ]
        against = shapely.union_all([outlines[i] for i in near]).buffer(MAX_JOINT_M)
        lengths = shapely.length(edges)
        left = shapely.length(shapely.difference(edges, against)) / np.maximum(lengths, 1e-9)
        count += int(((left >= MIN_FREE_SHARE) & (lengths >= MIN_WALL_M)).sum())
        for edge, metres, free in zip(edges, lengths.tolist(), left.tolist(), strict=True):
            texels += (
                metres
                * building.height
                * (density.texels_per_m2(edge) if free > MAX_PARTY_WALL_SHARE else density.coarsest**2)
            )
    return count, texels


def _edges(ring: shapely.LinearRing) -> ObjectArray:
    points = shapely.get_coordinates(ring)
    edges: ObjectArray = shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1))
    return edges


def _ground_cells(block: Block, buildings: set[str], streets: set[str]) -> list[tuple[float, float]]:
    """List south-western corners of the ground cells whose centres are nearest to the block's core."""
    shapes = [*(b.footprint for b in block.buildings), *(s.line for s in block.streets)]
    in_core = np.array([*(b.id in buildings for b in block.buildings), *(s.id in streets for s in block.streets)])
    low, high = np.reshape(shapely.total_bounds(np.array(shapes, object)[in_core]), (2, 2))
    reach = block.texture.visibility_range
    first, last = (
        np.floor((low - reach) / GROUND_CELL_M).astype(int),
        np.ceil((high + reach) / GROUND_CELL_M).astype(int),
    )
    x, y = (np.arange(a, b) * GROUND_CELL_M + GROUND_CELL_M / 2 for a, b in zip(first, last, strict=True))
    middles = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    cell, near = shapely.STRtree(shapes).query_nearest(
        shapely.points(middles), max_distance=max(reach, GROUND_MARGIN_M), all_matches=False
    )
    return [(x, y) for x, y in (middles[cell[in_core[near]]] - GROUND_CELL_M / 2).tolist()]
