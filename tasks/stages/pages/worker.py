"""Worker of `pages`: fill a page between its charts, and encode it."""

from __future__ import annotations

import io
from dataclasses import dataclass, field

import numpy as np

from facade_core.atlas.stored_files import digest_stored_file, page_picture_path, write_stored_file
from facade_core.export.models.pages import fill_between_charts
from tasks.engine.atlas import Atlas
from tasks.engine.inputs import INPUTS_PENDING, input_field
from tasks.engine.unit import Unit
from tasks.stages.shared.scene_view import StoredCharts

# Exports cut their pictures from published pages: as little as can be is lost to being encoded twice.
JPEG_QUALITY = 95


@dataclass(frozen=True)
class PageInputs:
    """Inputs of a page of the atlas.

    Attributes
    ----------
    charts : its charts, with their places, sizes and texels.
    page : its number.
    """

    charts: StoredCharts = input_field(INPUTS_PENDING)
    page: int = field(default=0)


def compute_page(inputs: PageInputs) -> bytes:
    """Fill a page between its charts, and encode it as JPEG."""
    from PIL import Image

    colour = np.asarray(inputs.charts.store["atlas/colour"][inputs.page])
    buffer = io.BytesIO()
    filled = fill_between_charts(inputs.charts.scene, inputs.page, colour)
    Image.fromarray(filled).save(buffer, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    return buffer.getvalue()


def write_page(atlas: Atlas, unit: Unit[PageInputs], data: bytes) -> dict[str, object]:
    """Write the JPEG of a page; returns the fields of its record."""
    page, digest = unit.inputs.page, digest_stored_file(data)
    path = page_picture_path(page)
    write_stored_file(atlas.group, path, data, f"page {page} of the atlas, JPEG")
    return {"bytes": len(data), "digest": digest, "files": {path: digest}}
