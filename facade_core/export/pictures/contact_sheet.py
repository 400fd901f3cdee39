"""Contact sheets: pages of small pictures with a few lines of text below each."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from facade_core.core.arrays import UInt8Array
from facade_core.core.resizing import resize_image

# Columns and rows of a page, and the largest size of a picture in pixels.
COLUMNS = 5
ROWS = 6
PICTURE_SIZE_PX = (230, 260)
# Height of a line of text, lines below a picture, letters of a line, and space between pictures.
LINE_PX = 13
TEXT_LINES = 4
LINE_LETTERS = 40
GAP_PX = 10


def draw_contact_sheets(entries: Sequence[tuple[UInt8Array, str]]) -> Iterator[UInt8Array]:
    """Draw pictures with their texts, COLUMNS x ROWS on a page.

    Parameters
    ----------
    entries : pictures (h, w, 3) uint8, each with its text.

    Returns
    -------
    Pages (H, W, 3) uint8.
    """
    import numpy as np
    from PIL import Image, ImageDraw

    cell_height = PICTURE_SIZE_PX[0] + TEXT_LINES * LINE_PX + GAP_PX
    cell_width = PICTURE_SIZE_PX[1] + GAP_PX
    for first in range(0, len(entries), COLUMNS * ROWS):
        page_entries = entries[first : first + COLUMNS * ROWS]
        rows = -(-len(page_entries) // COLUMNS)
        page = Image.new("RGB", (COLUMNS * cell_width, rows * cell_height), "white")
        pen = ImageDraw.Draw(page)
        for place, (picture, text) in enumerate(page_entries):
            row, column = divmod(place, COLUMNS)
            left, top = column * cell_width, row * cell_height
            factor = min(1.0, PICTURE_SIZE_PX[0] / picture.shape[0], PICTURE_SIZE_PX[1] / picture.shape[1])
            size = max(1, round(picture.shape[0] * factor)), max(1, round(picture.shape[1] * factor))
            page.paste(Image.fromarray(resize_image(picture, size)), (left, top))
            lines = [part for line in text.splitlines() for part in textwrap.wrap(line, LINE_LETTERS)][:TEXT_LINES]
            for number, line in enumerate(lines):
                pen.text((left, top + size[0] + 2 + number * LINE_PX), line, fill="black")
        yield np.asarray(page)
