"""Contact sheets: pages of small pictures with a few lines of text below each."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from facade_core.core.arrays import UInt8Array
from facade_core.core.resizing import resize_image
from facade_core.export.pictures.settings import CONTACT_SHEETS


def draw_contact_sheets(entries: Sequence[tuple[UInt8Array, str]]) -> Iterator[UInt8Array]:
    """Draw pictures with their texts, some rows on a page.

    Parameters
    ----------
    entries : pictures (h, w, 3) uint8, each with its text.

    Returns
    -------
    Pages (H, W, 3) uint8.
    """
    import numpy as np
    from PIL import Image, ImageDraw

    cell_height = (
        CONTACT_SHEETS.picture_size_px[0] + CONTACT_SHEETS.text_lines * CONTACT_SHEETS.line_px + CONTACT_SHEETS.gap_px
    )
    cell_width = CONTACT_SHEETS.picture_size_px[1] + CONTACT_SHEETS.gap_px
    for first in range(0, len(entries), CONTACT_SHEETS.columns * CONTACT_SHEETS.rows):
        page_entries = entries[first : first + CONTACT_SHEETS.columns * CONTACT_SHEETS.rows]
        rows = -(-len(page_entries) // CONTACT_SHEETS.columns)
        page = Image.new("RGB", (CONTACT_SHEETS.columns * cell_width, rows * cell_height), "white")
        pen = ImageDraw.Draw(page)
        for place, (picture, text) in enumerate(page_entries):
            row, column = divmod(place, CONTACT_SHEETS.columns)
            left, top = column * cell_width, row * cell_height
            factor = min(
                1.0,
                CONTACT_SHEETS.picture_size_px[0] / picture.shape[0],
                CONTACT_SHEETS.picture_size_px[1] / picture.shape[1],
            )
            size = max(1, round(picture.shape[0] * factor)), max(1, round(picture.shape[1] * factor))
            page.paste(Image.fromarray(resize_image(picture, size)), (left, top))
            lines = [part for line in text.splitlines() for part in textwrap.wrap(line, CONTACT_SHEETS.line_letters)][
                : CONTACT_SHEETS.text_lines
            ]
            for number, line in enumerate(lines):
                pen.text((left, top + size[0] + 2 + number * CONTACT_SHEETS.line_px), line, fill="black")
        yield np.asarray(page)
