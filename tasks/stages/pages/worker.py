"""Worker of `pages`: fill a page between its charts, and encode it."""

from __future__ import annotations

import io
import time

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record
from facade_core.atlas.store import open_root
from facade_core.atlas.stored_files import digest_stored_file, page_picture_path, write_stored_file
from facade_core.export.models.pages import fill_between_charts
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.run import Run
from tasks.engine.unit import UnitGroup
from tasks.stages.pages.record import PageRecord

# Exports cut their pictures from published pages: as little as can be is lost to being encoded twice.
JPEG_QUALITY = 95


def process_page(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Write the JPEG of one page through the fork; returns the fork and the record."""
    from PIL import Image

    start = time.time()
    (unit,) = units
    scene = load_run_plan(run).scene
    group = open_root(fork)
    colour = fill_between_charts(scene, unit.index, np.asarray(group["atlas/colour"][unit.index]))
    buffer = io.BytesIO()
    Image.fromarray(colour).save(buffer, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    data = buffer.getvalue()
    write_stored_file(group, page_picture_path(unit.index), data, f"page {unit.index} of the atlas, JPEG")
    record: PageRecord = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "bytes": len(data),
        "digest": digest_stored_file(data),
        "worker": current_worker_name(),
        "started": start,
        "seconds": {"page": round(time.time() - start, 4)},
    }
    return fork, {unit.index: record}
