"""Charts keep their places in the atlas from one ingest to the next."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.geometry.chart_packing import ChartPlacements, PreviousChartPlacements, pack_charts

PAGE, CHUNK, GUTTER = 512, 128, 2


def place(
    texels: list[tuple[int, int]], owner: list[int], ids: list[int], last: PreviousChartPlacements | None = None
) -> PreviousChartPlacements:
    numbers = np.array(ids, np.uint64)
    sizes = np.array(texels, np.int64).reshape(-1, 2)
    found = pack_charts(sizes, 1.0, np.array(owner), page=PAGE, chunk=CHUNK, gutter=GUTTER, ids=numbers, previous=last)
    return PreviousChartPlacements(numbers, found)


def spots(places: PreviousChartPlacements) -> dict[int, tuple[int, int, int]]:
    placement = places.placement
    rows = zip(placement.page.tolist(), placement.x.tolist(), placement.y.tolist(), strict=True)
    return dict(zip(places.ids.tolist(), rows, strict=True))


def cells(placement: ChartPlacements) -> list[set[tuple[int, ...]]]:
    return [set(map(tuple, placement.chunks(c, CHUNK, GUTTER).tolist())) for c in range(len(placement.page))]


TEXELS = [(200, 100), (30, 40), (50, 20), (120, 120), (300, 200), (20, 20)]
OWNER = [0, 0, 0, 1, 1, 2]
IDS = [11, 12, 13, 21, 22, 31]


def test_with_nothing_changed_nothing_moves() -> None:
    first = place(TEXELS, OWNER, IDS)
    assert spots(place(TEXELS, OWNER, IDS, first)) == spots(first)


def test_others_stay_when_one_owner_goes_and_its_place_is_taken_again() -> None:
    first = place(TEXELS, OWNER, IDS)
    without = place(TEXELS[3:], [0, 0, 1], IDS[3:], first)
    assert spots(without) == {i: spot for i, spot in spots(first).items() if i in IDS[3:]}
    # the new chart is as large as the one that went
    again = place([*TEXELS[3:], (200, 100)], [0, 0, 1, 2], [*IDS[3:], 41], without)
    assert spots(again)[41] == spots(first)[11]
    assert {i: spots(again)[i] for i in IDS[3:]} == spots(without)


def test_an_order_that_changed_changes_no_place() -> None:
    first = place(TEXELS, OWNER, IDS)
    turned = place([*TEXELS[3:], *TEXELS[:3]], [0, 0, 1, 2, 2, 2], [*IDS[3:], *IDS[:3]], first)
    assert spots(turned) == spots(first)


def test_small_charts_of_one_owner_share_a_chunk_still_when_one_is_new() -> None:
    first = place(TEXELS, OWNER, IDS)
    grown = place([TEXELS[0], (30, 40), (60, 20), *TEXELS[3:]], OWNER, [11, 12, 14, 21, 22, 31], first)
    assert {i: spots(grown)[i] for i in (11, 21, 22, 31)} == {i: spots(first)[i] for i in (11, 21, 22, 31)}
    shared = cells(grown.placement)
    assert shared[1] == shared[2]  # the two small charts of one building
    for one in range(6):
        for other in range(one):
            assert {one, other} == {1, 2} or not shared[one] & shared[other]


@pytest.mark.parametrize("seed", range(5))
def test_no_chunk_has_two_owners_after_many_changes(seed: int) -> None:
    random = np.random.default_rng(seed)
    held = {i: tuple(random.integers(8, 260, 2).tolist()) for i in range(1, 40)}
    last = None
    for step in range(6):
        for gone in random.choice(sorted(held), 6, replace=False).tolist():
            del held[gone]
        held |= {100 * (step + 1) + i: tuple(random.integers(8, 260, 2).tolist()) for i in range(6)}
        ids = sorted(held)
        last = place([held[i] for i in ids], [i // 3 for i in ids], ids, last)
        taken: dict[tuple[int, ...], int] = {}
        for i, own in zip(ids, cells(last.placement), strict=True):
            for cell in own:
                assert taken.setdefault(cell, i // 3) == i // 3
        assert last.placement.pages == last.placement.page.max() + 1
