"""Streets of a class that has shops get few where the map has none; others get none."""

from __future__ import annotations

import shapely

from catalogs.block.likely_shops import likely_shop_positions
from facade_core.core.types import Building, GroundWay


def street(rank: int) -> list[GroundWay]:
    return [GroundWay("w", shapely.LineString([(-50, 0), (2100, 0)]), "road", 8.0, "asphalt", rank=rank)]


def house(number: int, y: float = 8.0, height: float = 15.0) -> Building:
    return Building(f"w{number}", shapely.box(20 * number, y, 20 * number + 18, y + 12), height, "levels")


HOUSES = [house(number) for number in range(100)]


def test_some_houses_of_a_road_of_a_high_class_have_one_in_the_middle_of_their_front() -> None:
    counts = {rank: len(likely_shop_positions(HOUSES, street(rank), [])) for rank in (3, 5, 7)}
    assert counts[3] == 0
    assert 5 < counts[5] < counts[7] < 60
    for x, y in likely_shop_positions(HOUSES, street(7), []):
        assert (x % 20, y) == (9.0, 8.0)


def test_what_a_house_has_depends_on_no_other() -> None:
    every = likely_shop_positions(HOUSES, street(7), [])
    assert [place for one in HOUSES for place in likely_shop_positions([one], street(7), [])] == every


def test_none_where_the_map_has_one_and_none_far_from_the_road_or_on_what_is_low() -> None:
    (x, y), *_ = likely_shop_positions(HOUSES, street(7), [])
    left = likely_shop_positions(HOUSES, street(7), [(x, y - 1)])
    assert (x, y) not in left
    number = int(x // 20)
    assert likely_shop_positions([house(number)], street(7), [])
    assert not likely_shop_positions([house(number, y=30.0)], street(7), [])
    assert not likely_shop_positions([house(number, height=4.0)], street(7), [])
