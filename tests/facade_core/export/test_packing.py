"""Pieces of any outline lie on pages of powers of two, apart from each other, and in each other's notches."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.export.models.page_packing import (
    CELL_TEXELS,
    MAX_PAGE_TEXELS,
    pack_pages,
    rasterise_cells,
    shrink_for_border,
)


def test_pieces_lie_apart_on_few_pages() -> None:
    rng = np.random.default_rng(5)
    size = rng.integers(3, 300, (60, 2))
    masks = []
    for width, height in size.tolist():
        corners = [[0, 0], [width, 0], [0, height]], [[width, height], [width, 0], [0, height]]
        # every second one is a triangle
        masks.append(rasterise_cells(np.array(corners[: 1 + len(masks) % 2], float), (width, height)))
    layout = pack_pages(masks, size)
    assert (np.log2(layout.pages) % 1 == 0).all()
    taken = [np.zeros((height // CELL_TEXELS, width // CELL_TEXELS), int) for width, height in layout.pages.tolist()]
    for i, mask in enumerate(masks):
        top, left = layout.y[i] // CELL_TEXELS - 1, layout.x[i] // CELL_TEXELS - 1
        taken[layout.page[i]][top : top + mask.shape[0], left : left + mask.shape[1]] += mask
    assert max(int(page.max()) for page in taken) == 1, "no cell has two"
    assert sum(int(page.sum()) for page in taken) == sum(int(mask.sum()) for mask in masks), (
        "and none lies beyond its page"
    )
    assert sum(int(page.sum()) for page in taken) > 0.75 * sum(page.size for page in taken)


def test_a_mask_holds_its_triangles_and_a_border() -> None:
    mask = rasterise_cells(np.array([[[0, 0], [40, 0], [0, 40.0]]]), (40, 40))
    assert mask.shape == (12, 12)
    assert mask[:10, 0].all()
    assert not mask[-4:, -4:].any()
    for x, y in ((0.5, 0.5), (38, 1), (1, 38), (19.5, 19.5)):
        at = (
            slice(int(y) // CELL_TEXELS, int(y) // CELL_TEXELS + 3),
            slice(int(x) // CELL_TEXELS, int(x) // CELL_TEXELS + 3),
        )
        assert mask[at].all(), "the cell of a place, and those around it"


def test_a_side_that_just_fits_a_page_makes_room_for_its_border() -> None:
    assert shrink_for_border(np.array([[1024, 1016], [1020, 30], [12, 4096]])).tolist() == [
        [1016, 1016],
        [1016, 30],
        [12, 4088],
    ]


def test_what_is_larger_than_a_page_is_refused() -> None:
    with pytest.raises(ValueError, match="larger than a page"):
        pack_pages([np.ones((3, MAX_PAGE_TEXELS // CELL_TEXELS + 1), bool)], np.array([[MAX_PAGE_TEXELS, 4]]))


def test_nothing_takes_no_page() -> None:
    assert len(pack_pages([], np.zeros((0, 2), int)).pages) == 0


def test_what_fills_a_page_whole_has_no_other_beside_it() -> None:
    layout = pack_pages([np.ones((16, 32), bool)], np.array([[120, 56]]))
    assert layout.pages.tolist() == [[128, 64]]
    assert layout.page.tolist() == [0]
