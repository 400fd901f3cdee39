"""Worker of `grounds`: write what panoramas show of a piece of ground."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import cast

from icechunk import ForkSession

from facade_core.atlas.journal import Record
from facade_core.atlas.store import open_root
from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.ground import fuse_ground_view
from facade_core.imagery.cameras.occluder_masks import mask_ground_occluders
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.outcome import rejection_record_fields
from tasks.engine.run import Run
from tasks.engine.unit import UnitGroup
from tasks.stages.grounds.record import GroundRecord
from tasks.stages.shared.panorama_cameras import open_camera, write_fused_views
from tasks.stages.shared.surface_panorama import SurfacePanorama


def process_ground(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Write one piece of ground from panoramas through the fork; returns the fork and the record."""
    start = time.time()
    (unit,) = units
    chart, taken = unit.arguments
    plan = load_run_plan(run)
    refused: list[Exception] = []
    used: list[SurfacePanorama] = []
    reading: list[float] = []

    def cameras() -> Iterator[PanoramaCamera]:
        for one in taken:
            begun = time.time()
            camera = open_camera(one, mask_ground_occluders, refused)
            reading.append(time.time() - begun)
            if camera is not None:
                used.append(one)
                yield camera

    found = fuse_ground_view(plan.scene, chart, cameras())
    read = sum(reading)
    digests, told = write_fused_views(open_root(fork), plan, {} if found is None else {chart: found}, {chart: used})
    record: GroundRecord = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "digests": digests,
        "cameras": told,
        "worker": current_worker_name(),
        "started": start,
        "seconds": {"read": round(read, 4), "ground": round(time.time() - start - read, 4)},
    }
    record |= cast(GroundRecord, rejection_record_fields(refused, "without it"))
    return fork, {unit.index: record}
