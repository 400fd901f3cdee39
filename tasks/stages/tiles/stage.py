"""Stage `tiles`: the leaves of a quadtree over the buildings and ground of a block, by texels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.journal import latest_chart_digests, read_journal, unit_key
from facade_core.core.arrays import IntArray
from facade_core.core.types import Element
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.bodies.settings import MAX_OUTWARD_M
from facade_core.export.models.pages import MAX_SHELF_PAGE_TEXELS
from facade_core.export.tiles.block_tiles import BlockTile, plan_block_tiles
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Stage, UnitOutline
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit import Unit
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.shared.chart_elements import elements_by_chart
from tasks.stages.shared.memory import LIBRARY_BYTES
from tasks.stages.shared.scene_view import SceneView, store_charts
from tasks.stages.tiles.worker import TileInputs, compute_tile, write_tile

# Bytes per texel of a tile's picture: the rasters of its charts, the picture, and the free part of it.
PICTURE_TEXEL = 16
# Bytes per texel of a tile's encoded pictures and model.
TILE_TEXEL = 1


def list_tile_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[TileInputs]]:
    """List the units of stage `tiles`: one for each tile of the block."""
    digests = latest_chart_digests(read_journal(group, "surfaces"))
    texels = plan.texel_counts()
    elements = (
        elements_by_chart(plan, read_journal(group, "facades", FacadeRecord))
        if run.texture.relief == "elements"
        else {}
    )
    return [
        Unit(
            index,
            tile.path,
            tile_inputs(run, plan, index, tile, digests, elements),
            tile_memory(int(texels[tile.charts].sum())),
        )
        for index, tile in enumerate(plan_block_tiles(plan))
    ]


def tile_memory(texels: int) -> int:
    """Return the bytes that encoding a tile takes at most."""
    return LIBRARY_BYTES + MAX_SHELF_PAGE_TEXELS**2 * PICTURE_TEXEL + texels * TILE_TEXEL


def tile_inputs(
    run: Run,
    plan: Plan,
    index: int,
    tile: BlockTile,
    digests: Mapping[str, str],
    elements: Mapping[int, Sequence[Element]],
) -> TileInputs:
    """Return the inputs of a tile.

    Parameters
    ----------
    digests : digest of each chart, by id.
    elements : elements that are built in depth, metres, by chart.
    """
    layouts = [(place, tuple(elements[c])) for place, c in enumerate(tile.charts.tolist()) if elements.get(c)]
    # a balcony needs room before other buildings
    _, near = plan.scene.charts.pairs_within(tile.charts[[place for place, _ in layouts]], MAX_OUTWARD_M)
    near = near[plan.scene.charts.building[near] >= 0]
    things = np.unique(plan.scene_objects.chart_object[np.concatenate([tile.charts, near])])
    objects = tuple(f"{digest:016x}" for digest in plan.scene_objects.digest[things].tolist())
    return TileInputs(
        objects=SceneView(run, (), objects),
        charts=store_charts(run, plan, tile.charts.tolist(), digests),
        names=tuple(plan.scene.names[building] for building in tile.buildings.tolist()),
        origin=tuple(tile.origin),
        crs=run.crs,
        elements=tuple(layouts),
        buildings=tuple(tile.buildings.tolist()),
        layout=tile_layout_digest(plan, tile.charts),
        path=tile.path,
        index=index,
    )


def tile_layout_digest(plan: Plan, charts: IntArray) -> str:
    """Return a digest of the layout of a tile's pictures: its charts (k,), their texels, and the code."""
    placement = plan.scene.placement
    sides = (placement.width[charts].tolist(), placement.height[charts].tolist())
    return unit_key(stage_code_digest("tiles"), plan.ids[charts].tolist(), *sides)


TILES = Stage(
    "tiles",
    "tile",
    outline=lambda block, plan: [UnitOutline(tile.path) for tile in plan_block_tiles(plan)],
    inputs=list_tile_units,
    compute=compute_tile,
    write=write_tile,
    forecast=None,
)
