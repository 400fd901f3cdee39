"""The tiles of a block: the leaves of a quadtree over its buildings and pieces of ground, by texels."""

from __future__ import annotations

from collections.abc import Mapping

from catalogs.block import Block
from facade_core.atlas.journal import latest_digests, read_journal
from facade_core.atlas.stored_files import COARSE, forget_encoded
from facade_core.atlas.stored_files import TILES as FOLDER
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.tiles.block_tiles import tiles_of
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Change, Records, Stage, same_name
from tasks.engine.unit import Unit
from tasks.stages.shared.memory import tile_memory
from tasks.stages.shared.published_keys import tile_key, tile_shape
from tasks.stages.tiles.worker import tile_unit


def tile_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    digests = latest_digests(read_journal(group, "surfaces"), [])
    texels = plan.texels()
    return [
        Unit(
            index,
            tile.path,
            (tile_key(run, plan, tile.charts, tile.buildings, tile.origin, digests),),
            (
                tile.charts,
                [digests.get(f"{number:016x}") for number in plan.ids[tile.charts].tolist()],
                tile_shape(plan, tile.charts),
                tile.origin,
            ),
            tile_memory(int(texels[tile.charts].sum())),
        )
        for index, tile in enumerate(tiles_of(plan))
    ]


def _moved(change: Change, again: Mapping[int, int], records: Records) -> Records:
    """Files are named by the paths of their tiles, and stay where they are; those of tiles that are gone do not."""
    kept = {tile.path for tile in tiles_of(change.after)}
    for folder in (FOLDER, COARSE):
        forget_encoded(change.group, folder, kept)
    return records


TILES = Stage(
    "tiles",
    "tile",
    count=lambda block, plan: len(tiles_of(plan)),
    match_previous=lambda change: same_name(change.records["tiles"], [tile.path for tile in tiles_of(change.after)]),
    units=tile_units,
    function=tile_unit,
    reads=("surfaces",),
    in_every_block=True,
    relocate=_moved,
    derived_only=True,
)
