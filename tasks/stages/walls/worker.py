"""What panoramas show of a building's walls that are no facades, and of its roofs, into the atlas."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any, cast

import numpy as np

from facade_core.atlas.journal import Record
from facade_core.atlas.store import open_root
from facade_core.core.types import Pose
from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.occluder_masks import mask_building_occluders, mask_model_edges
from facade_core.imagery.cameras.walls import fuse_wall_view
from tasks.engine.context import current_worker, plan_of_run
from tasks.engine.outcome import describe_rejections
from tasks.engine.run import Run
from tasks.engine.unit import UnitGroup
from tasks.stages.shared.panorama_cameras import KEPT, camera_of, shown_in_turn, write_shown
from tasks.stages.shared.surface_panorama import PosedPanorama
from tasks.stages.walls.record import WallRecord


def wall_unit(run: Run, fork: Any, units: UnitGroup) -> tuple[Any, dict[int, Record]]:
    """Write what panoramas show of one building's walls and roofs through the fork; returns the fork and the journal record."""
    start = time.time()
    (unit,) = units
    charts, taken = unit.arguments
    plan = plan_of_run(run)
    refused: list[Exception] = []
    reading: list[float] = []

    def opened(one: PosedPanorama) -> PanoramaCamera | None:
        begun = time.time()
        camera = camera_of(one, mask_building_occluders, refused)
        if camera is not None:
            camera = replace(camera, occluded=camera.occluded | _beside_edges(run, one.pose, camera.occluded.shape))
        reading.append(time.time() - begun)
        return camera

    shown, used = shown_in_turn(dict(zip(charts, taken, strict=True)), opened, partial(fuse_wall_view, plan.scene))
    digests, told = write_shown(open_root(fork), plan, shown, used)
    read = sum(reading)
    record: WallRecord = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "digests": digests,
        "cameras": told,
        "worker": current_worker(),
        "started": start,
        "seconds": {"read": round(read, 4), "walls": round(time.time() - start - read, 4)},
    }
    record |= cast(WallRecord, describe_rejections(refused, "without it"))
    return fork, {unit.index: record}


def _beside_edges(run: Run, pose: Pose, shape: tuple[int, ...]) -> np.ndarray:
    """Of a panorama of so many pixels (H, W): bool."""
    rows, columns = shape
    bits = _edges_in_bits(run, pose, rows, columns)
    return np.unpackbits(bits, count=rows * columns).reshape(rows, columns).astype(bool)


@lru_cache(maxsize=KEPT)
def _edges_in_bits(run: Run, pose: Pose, rows: int, columns: int) -> np.ndarray:
    """Units side by side share them."""
    return np.packbits(mask_model_edges(plan_of_run(run).scene, pose, (rows, columns)))
