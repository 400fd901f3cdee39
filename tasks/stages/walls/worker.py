"""Worker of `walls`: write what panoramas show of a building's plain walls and roofs."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import lru_cache, partial
from typing import cast

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record
from facade_core.atlas.store import open_root
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.types import Pose
from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.occluder_masks import mask_building_occluders, mask_model_edges
from facade_core.imagery.cameras.walls import fuse_wall_view
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.outcome import rejection_record_fields
from tasks.engine.run import Run
from tasks.engine.unit import UnitGroup
from tasks.stages.shared.panorama_cameras import collect_chart_views, open_camera, write_fused_views
from tasks.stages.shared.surface_panorama import SurfacePanorama
from tasks.stages.walls.record import WallsAndRoofsRecord

# Panoramas of which the pixels beside edges of buildings are kept.
MAX_CACHED_EDGES = 8


def process_walls(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Write the walls and roofs of one building from panoramas through the fork; returns the fork and the record."""
    start = time.time()
    (unit,) = units
    charts, taken = unit.arguments
    plan = load_run_plan(run)
    refused: list[Exception] = []
    reading: list[float] = []

    def opened(one: SurfacePanorama) -> PanoramaCamera | None:
        begun = time.time()
        camera = open_camera(one, mask_building_occluders, refused)
        if camera is not None:
            camera = replace(camera, occluded=camera.occluded | _edge_mask(run, one.pose, camera.occluded.shape))
        reading.append(time.time() - begun)
        return camera

    shown, used = collect_chart_views(
        dict(zip(charts, taken, strict=True)), opened, partial(fuse_wall_view, plan.scene)
    )
    digests, told = write_fused_views(open_root(fork), plan, shown, used)
    read = sum(reading)
    record: WallsAndRoofsRecord = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "digests": digests,
        "cameras": told,
        "worker": current_worker_name(),
        "started": start,
        "seconds": {"read": round(read, 4), "walls": round(time.time() - start - read, 4)},
    }
    record |= cast(WallsAndRoofsRecord, rejection_record_fields(refused, "without it"))
    return fork, {unit.index: record}


def _edge_mask(run: Run, pose: Pose, shape: tuple[int, ...]) -> BoolArray:
    """Return the pixels (H, W) of a panorama beside edges of buildings."""
    rows, columns = shape
    bits = _edge_bits(run, pose, rows, columns)
    return np.unpackbits(bits, count=rows * columns).reshape(rows, columns).astype(bool)


@lru_cache(maxsize=MAX_CACHED_EDGES)
def _edge_bits(run: Run, pose: Pose, rows: int, columns: int) -> UInt8Array:
    """Return the same as bits; consecutive units share them."""
    return np.packbits(mask_model_edges(load_run_plan(run).scene, pose, (rows, columns)))
