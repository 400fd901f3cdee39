"""Stage `tiles`: the leaves of a quadtree over the buildings and ground of a block, by texels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.journal import latest_chart_digests, read_journal, unit_key
from facade_core.atlas.stored_files import COARSE, delete_stored_files_except
from facade_core.atlas.stored_files import TILES as FOLDER
from facade_core.core.arrays import IntArray
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.models.pages import MAX_SHELF_PAGE_TEXELS
from facade_core.export.tiles.block_tiles import plan_block_tiles
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Records, ReingestContext, Stage, match_units_by_name
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit import Unit
from tasks.engine.unit_key import join_key_parts
from tasks.stages.shared.memory import LIBRARY_BYTES
from tasks.stages.tiles.record import tile_file_digests
from tasks.stages.tiles.worker import process_tile

# Bytes per texel of a tile's picture: the rasters of its charts, the picture, and the free part of it.
PICTURE_TEXEL = 16
# Bytes per texel of a tile's encoded pictures and model.
TILE_TEXEL = 1


def list_tile_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    """List the units of stage `tiles`: one for each tile of the block."""
    digests = latest_chart_digests(read_journal(group, "surfaces"), [])
    texels = plan.texel_counts()
    return [
        Unit(
            index,
            tile.path,
            (tile_key(run, plan, tile.charts, tile.buildings, tile.origin, digests),),
            (
                tile.charts,
                [digests.get(f"{number:016x}") for number in plan.ids[tile.charts].tolist()],
                tile_layout_digest(plan, tile.charts),
                tile.origin,
            ),
            tile_memory(int(texels[tile.charts].sum())),
        )
        for index, tile in enumerate(plan_block_tiles(plan))
    ]


def _relocate(change: ReingestContext, again: Mapping[int, int], records: Records) -> Records:
    """Delete the files of tiles that are gone; the others keep their names, the paths of the tiles."""
    kept = {tile.path for tile in plan_block_tiles(change.after)}
    for folder in (FOLDER, COARSE):
        delete_stored_files_except(change.group, folder, kept)
    return records


def tile_memory(texels: int) -> int:
    """Return the bytes that encoding a tile takes at most."""
    return LIBRARY_BYTES + MAX_SHELF_PAGE_TEXELS**2 * PICTURE_TEXEL + texels * TILE_TEXEL


def tile_key(
    run: Run,
    plan: Plan,
    charts: IntArray,
    buildings: IntArray,
    origin: tuple[float, ...],
    digests: Mapping[str, str],
) -> str:
    """Return the key of a tile.

    Parameters
    ----------
    charts : (k,) its charts.
    buildings : (b,) its buildings.
    origin : origin of its model in the world.
    digests : digest of each chart, by id.
    """
    things = np.unique(plan.scene_objects.chart_object[charts])
    ids = [f"{number:016x}" for number in plan.ids[charts].tolist()]
    return join_key_parts(
        stage_code_digest("tiles"),
        settings=[run.crs, run.texture.texels_per_metre, list(origin)],
        geometry=[f"{digest:016x}" for digest in plan.scene_objects.digest[things].tolist()],
        names=[plan.scene.names[building] for building in buildings.tolist()],
        charts=[[name, digests.get(name)] for name in ids],
    )


def tile_layout_digest(plan: Plan, charts: IntArray) -> str:
    """Return a digest of the layout of a tile's pictures: its charts (k,), their texels, and the code."""
    placement = plan.scene.placement
    sides = (placement.width[charts].tolist(), placement.height[charts].tolist())
    return unit_key(stage_code_digest("tiles"), plan.ids[charts].tolist(), *sides)


TILES = Stage(
    "tiles",
    "tile",
    count=lambda block, plan: len(plan_block_tiles(plan)),
    match_previous=lambda change: match_units_by_name(
        change.records["tiles"], [tile.path for tile in plan_block_tiles(change.after)]
    ),
    units=list_tile_units,
    function=process_tile,
    reads=("surfaces",),
    in_every_block=True,
    relocate=_relocate,
    derived_only=True,
    files=tile_file_digests,
)
