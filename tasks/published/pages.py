"""Every page of the atlas, with what no viewpoint saw filled."""

from __future__ import annotations

import io
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from catalogs.published.snapshot import Snapshot
from facade_core.export import Picture, fill_unseen
from facade_core.street.translate import Swatches
from tasks.published.stored import StoredBlock
from tasks.run import Run
from tasks.units.roofs import roof_material, sampler

# Pages that are in memory at once, and threads that fill them.
AT_ONCE, THREADS = 4, 2


def write_pages(snapshot: Snapshot[Path], run: Run, block: StoredBlock, views: Collection[Picture]) -> dict[int, bytes]:
    """Write pages/; returns them as the model has them, as JPEG, and paints each on the views while it is in memory."""
    group, scene = block.group, block.plan.scene
    swatches = Swatches(scene, block.plan.streets, seed=run.seed, roof_material=roof_material(run))
    above = sampler(run)
    snapshot.page(0).parent.mkdir()

    def texels(chart: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        """Of any chart, as they are in the store."""
        x, y = int(scene.placement.x[chart]), int(scene.placement.y[chart])
        part = (
            int(scene.placement.page[chart]),
            slice(y + rows.start, y + rows.stop),
            slice(x + columns.start, x + columns.stop),
        )
        return group["atlas/colour"][part], group["atlas/provenance"][part]

    def page_of(page: int) -> tuple[int, np.ndarray, bytes]:
        colour, provenance = group["atlas/colour"][page], group["atlas/provenance"][page]
        filled = fill_unseen(
            scene, swatches, page, colour, provenance, levelling=run.texture.levelling, read=texels, aerial=above
        )
        # exports cut their pictures from these pages: as little as can be is lost to being encoded twice
        snapshot.page(page).write_bytes(jpeg(filled, 95, subsampling=0))
        return page, filled, jpeg(filled, 90)

    pages: dict[int, bytes] = {}
    with ThreadPoolExecutor(THREADS) as threads:
        for start in range(0, scene.spec.pages, AT_ONCE):
            for page, filled, data in threads.map(page_of, range(start, min(start + AT_ONCE, scene.spec.pages))):
                pages[page] = data
                for view in views:
                    view.paint(page, filled)
    return pages


def jpeg(rgb: np.ndarray, quality: int, **options: int) -> bytes:
    """A picture (h, w, 3) uint8 as a JPEG file."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(rgb).save(buffer, "JPEG", quality=quality, **options)
    return buffer.getvalue()
