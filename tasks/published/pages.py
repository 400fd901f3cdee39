"""The pages of the atlas as their units encoded them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from catalogs.published.made import Made
from catalogs.published.snapshot import Snapshot
from facade_core.atlas.encoded import page_path, read_encoded
from tasks.published.aside import Aside
from tasks.published.stored import StoredBlock


def write_pages(snapshot: Snapshot[Path], block: StoredBlock, made: Made, aside: Aside) -> None:
    """Write pages/; one that cannot be read is set aside."""
    for number, record in enumerate(block.journals["pages"]):
        if record is None or record["status"] != "done":  # the journal says why
            continue
        path, digest = page_path(number), record["digest"]
        with aside.trying(f"page {record['unit']}"):
            made.put(
                snapshot.page(number).relative_to(snapshot.folder).as_posix(),
                digest,
                partial(read_encoded, block.group, path, digest),
            )


def rasters_on(
    snapshot: Snapshot[Path], block: StoredBlock, charts: Collection[int]
) -> Iterator[dict[int, np.ndarray]]:
    """The rasters (h, w, 3) of some charts as the published pages show them, by chart, a page at a time; none of pages that
    were set aside."""
    from PIL import Image

    place = block.plan.scene.placement
    chosen = np.array(sorted(charts), np.int64)
    for page in np.unique(place.page[chosen]).tolist():
        path = snapshot.page(page)
        if not path.is_file():
            continue
        with Image.open(path) as image:
            colour = np.asarray(image.convert("RGB"))
        yield {
            c: colour[place.y[c] : place.y[c] + place.height[c], place.x[c] : place.x[c] + place.width[c]]
            for c in chosen[place.page[chosen] == page].tolist()
        }
