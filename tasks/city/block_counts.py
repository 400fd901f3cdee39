"""Size of blocks, counted on a map or on plans before any unit runs: the input of a cost estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import shapely

from catalogs.block.part import MAX_PICTURE_DISTANCE_M
from catalogs.block.reader import Block
from catalogs.features import safe_file_stem
from facade_core.core.arrays import Float64Array, Int64Array, ObjectArray
from facade_core.core.types import Street
from facade_core.geometry.settings import BLOCK_SURFACES, FACADE_WALLS, TEXEL_DENSITY
from facade_core.geometry.texel_density import min_texel_density
from facade_core.plan.settings import PLANNED_FACADES
from tasks.city.picture_counts import count_exemplars, photo_megapixels
from tasks.stages.ingest.planning import count_planned_units

# Step of the ground grid, metres.
GROUND_CELL_M = 32.0
# Width of the ground around buildings without a street nearby, metres.
GROUND_MARGIN_M = 22.0


@dataclass(frozen=True)
class BlockCounts:
    """Number of units and pixels of one block or of several.

    Attributes
    ----------
    facades : facades, all free walls.
    viewpoints : viewpoints on streets.
    ground : ground tiles.
    exemplars : exemplars.
    megatexels : millions of texels.
    blocks : blocks.
    megapixels : millions of panorama pixels.
    photos : photos of single facades.
    panoramas : panoramas with a pose, counted once for each block.
    exemplar_megapixels : millions of pixels of exemplars without a label map, which are parsed.
    photo_megapixels : millions of pixels of photos.
    """

    facades: float
    viewpoints: float
    ground: float
    exemplars: float
    megatexels: float
    blocks: float = 1.0
    megapixels: float = 0.0
    photos: float = 0.0
    panoramas: float = 0.0
    exemplar_megapixels: float = 0.0
    photo_megapixels: float = 0.0

    def __add__(self, other: BlockCounts) -> BlockCounts:
        return BlockCounts(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))

    def multiply(self, factors: BlockCounts) -> BlockCounts:
        """Multiply each count by the factor of the same name."""
        return BlockCounts(*(getattr(self, f.name) * getattr(factors, f.name) for f in fields(self)))


def share_exemplars(blocks: Sequence[BlockCounts]) -> list[BlockCounts]:
    """Count exemplars in the first block only: the blocks of a city prepare them once."""
    return [*blocks[:1], *(replace(one, exemplars=0.0, exemplar_megapixels=0.0) for one in blocks[1:])]


NO_COUNTS = BlockCounts(0, 0, 0, 0, 0, 0)


def block_counts_from_map(block: Block) -> BlockCounts:
    """Estimate the counts of a block's core from its outlines, centrelines and pictures, without a plan."""
    part = block.part
    core = {b.id for b in block.buildings} if part is None else set(part.buildings)
    walked = {s.id for s in block.streets} if part is None else set(part.streets)
    buildings = np.array([0 if building.id in core else -1 for building in block.buildings], np.int64)
    streets = np.array([0 if street.id in walked else -1 for street in block.streets], np.int64)
    return MapCounts(block, block.streets).sum_by_block(buildings, streets, 1)[0]


def block_counts_from_plan(block: Block) -> dict[str, float]:
    """Count the facades, viewpoints, ground tiles, texels and panorama pixels of a block by its plan, without views."""
    planned, width = count_planned_units(block), block.texture.panorama_width
    return {
        "facades": planned.facades,
        "viewpoints": planned.viewpoints,
        "ground": planned.ground,
        "megatexels": planned.texels / 1e6,
        "megapixels": planned.viewpoints * width * (width // 2) / 1e6,
    }


class MapCounts:
    """Counts of a map by building, street and ground cell, which add up to those of any partition.

    Parameters
    ----------
    block : the map.
    streets : its streets, or the segments that they are cut into.
    """

    def __init__(self, block: Block, streets: Sequence[Street]) -> None:
        self._block, self._texture = block, block.texture
        self._footprints = np.array([building.footprint for building in block.buildings], object)
        self._lines = np.array([street.line for street in streets], object)
        self._lines_tree = shapely.STRtree(self._lines)
        self._coarsest = min_texel_density(self._texture.texels_per_metre)
        self._facades, self._texels = self._count_walls()
        self._texels += shapely.area(self._footprints) * self._coarsest**2  # no street sees roofs
        spacing = self._texture.viewpoint_spacing
        self._viewpoints = np.maximum(1, np.ceil((shapely.length(self._lines) - spacing / 2) / spacing))
        self._cell_objects, self._cell_texels = self._count_ground()

    def sum_by_block(self, building_blocks: Int64Array, street_blocks: Int64Array, count: int) -> list[BlockCounts]:
        """Add up the counts of each block of a partition.

        Parameters
        ----------
        building_blocks, street_blocks : block of each building and of each street; -1 for those of no block.
        count : number of blocks.
        """

        def add_up(owner: Int64Array, values: Float64Array) -> Float64Array:
            return np.bincount(owner[owner >= 0], values[owner >= 0], minlength=count).astype(np.float64)

        cells = np.concatenate([building_blocks, street_blocks])[self._cell_objects]
        width = self._texture.panorama_width
        viewpoints = add_up(street_blocks, self._viewpoints)
        columns = (
            add_up(building_blocks, self._facades),
            viewpoints,
            add_up(cells, np.ones(len(cells))),
            (add_up(building_blocks, self._texels) + add_up(cells, self._cell_texels)) / 1e6,
            viewpoints * width * (width // 2) / 1e6,
            *self._count_pictures(building_blocks, count),
        )
        exemplars = count_exemplars(self._block.exemplars)
        return [
            BlockCounts(
                facades=facades,
                viewpoints=walked,
                ground=ground,
                exemplars=exemplars.pictures,
                megatexels=megatexels,
                megapixels=megapixels,
                photos=photos,
                panoramas=panoramas,
                exemplar_megapixels=exemplars.parsed_megapixels,
                photo_megapixels=photo_pixels,
            )
            for facades, walked, ground, megatexels, megapixels, photos, photo_pixels, panoramas in np.column_stack(
                columns
            ).tolist()
        ]

    def _count_walls(self) -> tuple[Float64Array, Float64Array]:
        """Count the free walls of each building, and the texels of all its walls."""
        rings, owner = shapely.get_rings(
            shapely.simplify(self._footprints, BLOCK_SURFACES.collinear_tolerance_m), return_index=True
        )
        corners, ring = shapely.get_coordinates(rings, return_index=True)
        same = ring[:-1] == ring[1:]
        edges: ObjectArray = shapely.linestrings(np.stack([corners[:-1], corners[1:]], axis=1)[same])
        of, length = owner[ring[:-1][same]], shapely.length(edges)
        edge, near = shapely.STRtree(self._footprints).query(
            edges, predicate="dwithin", distance=FACADE_WALLS.max_joint_m
        )
        edge, near = edge[near != of[edge]], near[near != of[edge]]
        height = np.nan_to_num([building.height for building in self._block.buildings])
        # walls hide walls: a part of a building is not hidden by the outline that it stands in
        walls = shapely.buffer(shapely.boundary(self._footprints), FACADE_WALLS.max_joint_m)
        against = shapely.length(shapely.intersection(edges[edge], walls[near]))
        against *= np.minimum(height[near] / np.maximum(height[of[edge]], 1e-9), 1.0)
        free = 1 - np.minimum(np.bincount(edge, against, minlength=len(edges)) / np.maximum(length, 1e-9), 1.0)
        density = np.where(free > TEXEL_DENSITY.max_party_wall_share, self._texels_per_m2(edges), self._coarsest**2)
        count = len(self._footprints)
        is_facade = (
            (free >= PLANNED_FACADES.min_free_share)
            & (length >= FACADE_WALLS.min_wall_m)
            & (height[of] >= PLANNED_FACADES.min_facade_height_m)
        )
        return (
            np.bincount(of, is_facade, minlength=count).astype(np.float64),
            np.bincount(of, length * height[of] * density, minlength=count).astype(np.float64),
        )

    def _count_ground(self) -> tuple[Int64Array, Float64Array]:
        """Find the nearest building or street of each ground cell, and count the texels of each cell."""
        shapes = np.concatenate([self._footprints, self._lines])
        if not len(shapes):
            return np.zeros(0, np.int64), np.zeros(0)
        low, high = np.reshape(shapely.total_bounds(shapes), (2, 2))
        reach = self._texture.visibility_range
        x, y = (
            np.arange(np.floor((a - reach) / GROUND_CELL_M), np.ceil((b + reach) / GROUND_CELL_M)) * GROUND_CELL_M
            for a, b in zip(low, high, strict=True)
        )
        corners = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        cell, near = shapely.STRtree(shapes).query_nearest(
            shapely.points(corners + GROUND_CELL_M / 2), max_distance=max(reach, GROUND_MARGIN_M), all_matches=False
        )
        x, y = corners[cell].T
        squares = shapely.box(x, y, x + GROUND_CELL_M, y + GROUND_CELL_M)
        return near.astype(np.int64), self._texels_per_m2(squares) * GROUND_CELL_M**2

    def _count_pictures(
        self, building_blocks: Int64Array, count: int
    ) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Count the photos, their megapixels and the panoramas of each block."""
        block = self._block
        owners = {
            name: owner
            for building, owner in zip(block.buildings, building_blocks.tolist(), strict=True)
            for name in (building.id, safe_file_stem(building.id))
        }
        own = [(owners.get(facade.rpartition("-")[0], -1), path) for facade, path in block.photos.items()]
        photos, megapixels = np.zeros(count), np.zeros(count)
        for owner, path in own:
            if owner >= 0:
                photos[owner] += 1
                megapixels[owner] += photo_megapixels(path)
        places = shapely.points(np.array([(one.pose.x, one.pose.y) for one in block.panoramas]).reshape(-1, 2))
        panorama, building = shapely.STRtree(self._footprints).query(
            places, predicate="dwithin", distance=MAX_PICTURE_DISTANCE_M
        )
        pairs = np.unique(np.column_stack([panorama, building_blocks[building]]), axis=0)
        return photos, megapixels, np.bincount(pairs[pairs[:, 1] >= 0, 1], minlength=count).astype(np.float64)

    def _texels_per_m2(self, shapes: ObjectArray) -> Float64Array:
        """Return the texels of a square metre above shapes on the map: by the nearest street, without occlusion."""
        away = np.full(len(shapes), np.inf)
        if len(self._lines) and len(shapes):
            (shape, _), metres = self._lines_tree.query_nearest(
                shapes, max_distance=TEXEL_DENSITY.half_density_m, return_distance=True, all_matches=False
            )
            away[shape] = metres
        halved = (away > TEXEL_DENSITY.full_density_m).astype(int) + (away > TEXEL_DENSITY.half_density_m)
        return np.maximum(self._texture.texels_per_metre / 2.0**halved, self._coarsest) ** 2
