"""Every page of the atlas as a picture."""

from __future__ import annotations

import io
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from catalogs.published.snapshot import Snapshot
from facade_core.export import Picture
from facade_core.export.pages import between_charts
from tasks.published.stored import StoredBlock

# Pages that are in memory at once, and threads that fill them.
AT_ONCE, THREADS = 4, 2


def write_pages(snapshot: Snapshot[Path], block: StoredBlock, views: Collection[Picture]) -> dict[int, bytes]:
    """Write pages/; returns them as the model has them, as JPEG, and paints each on the views while it is in memory."""
    group, scene = block.group, block.plan.scene
    snapshot.page(0).parent.mkdir()

    def page_of(page: int) -> tuple[int, np.ndarray, bytes]:
        filled = between_charts(scene, page, np.asarray(group["atlas/colour"][page]))
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
