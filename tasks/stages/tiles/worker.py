"""Worker of `tiles`: encode the model of a tile, and coarse rasters for distant views."""

from __future__ import annotations

import time
from functools import lru_cache

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record, read_records
from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.atlas.store import open_root
from facade_core.atlas.stored_files import (
    digest_stored_file,
    read_stored_file,
    read_verified_array,
    tile_paths,
    write_stored_file,
)
from facade_core.core.arrays import Int64Array, UInt8Array
from facade_core.core.errors import StoreError
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.models.textured_mesh import TexturedMesh, build_textured_mesh
from facade_core.export.tiles.tile_model import EarlierTile, build_tile_model
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.run import Run
from tasks.engine.unit import Unit, UnitGroup
from tasks.stages.tiles.record import TileRecord


def process_tile(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Write the model of one tile and its coarse rasters through the fork; returns the fork and the record."""
    start = time.time()
    (unit,) = units
    charts, digests, shape, origin = unit.arguments
    plan = load_run_plan(run)
    placement = plan.scene.placement
    group = open_root(fork)

    def rasters(chosen: Int64Array) -> dict[int, UInt8Array]:
        held = TexelLayout.of_charts(placement, chosen)
        flat = read_rasters(group["atlas/colour"], placement, held)
        return {
            chart: flat[held.texel_slice(placement, chart)].reshape(
                int(placement.height[chart]), int(placement.width[chart]), 3
            )
            for chart in chosen.tolist()
        }

    names = dict(enumerate(plan.scene.names))
    earlier = _earlier_tile(group, unit, shape)
    extras = {"origin": list(origin), "crs": run.crs}
    tile = build_tile_model(_textured_scene(run), charts, digests, names, rasters, extras, earlier)
    model, coarse = tile_paths(unit.name)
    write_stored_file(group, model, tile.glb, f"tile {unit.name}, GLB")
    group.create_array(
        coarse,
        data=tile.coarse,
        chunks=tile.coarse.shape,
        dimension_names=(f"texel_of_{unit.name}", "band"),
        attributes={"long_name": f"charts of tile {unit.name} made smaller, one after the other"},
        overwrite=True,
    )
    record: TileRecord = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "charts": len(charts),
        "shape": shape,
        "made_of": list(tile.picture_digests),
        "bytes": len(tile.glb),
        "digest": digest_stored_file(tile.glb),
        "box": tile.box.round(3).tolist(),
        "coarse": digest_stored_file(tile.coarse.tobytes()),
        "worker": current_worker_name(),
        "started": start,
        "seconds": {"tile": round(time.time() - start, 4)},
    }
    return fork, {unit.index: record}


def _earlier_tile(group: StoreGroup, unit: Unit, shape: str) -> EarlierTile | None:
    """Return the stored tile if it has the same shape and is complete."""
    (record,) = read_records(group, "tiles", np.array([unit.index]), TileRecord)
    if record is None or record["status"] != "done" or record.get("shape") != shape:
        return None
    model, path = tile_paths(unit.name)
    try:
        glb = read_stored_file(group, model, record["digest"])
        coarse = read_verified_array(group, path, record["coarse"])
    except StoreError:
        return None
    return EarlierTile(glb, coarse, tuple(record["made_of"]))


@lru_cache(maxsize=1)
def _textured_scene(run: Run) -> TexturedMesh:
    """Return the textured scene of the block, without pages."""

    def nothing(page: int) -> UInt8Array:
        raise StoreError(f"page {page} is not read as a whole")

    return build_textured_mesh(load_run_plan(run).scene, nothing)
