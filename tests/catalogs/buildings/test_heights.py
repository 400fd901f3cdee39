"""Heights that are assumed: by what is known near, in whole storeys, the same for a building whatever else is in the file."""

from __future__ import annotations

from collections import Counter

from pyproj import CRS
from shapely import box

from catalogs.buildings.assembly import assemble_buildings
from catalogs.features import Footprint, Footprints

RD = CRS.from_epsg(28992)
STOREY = 3.0


def house(
    id: str, x: float, y: float, levels: int | None = None, side: float = 15.0, kind: str | None = None
) -> Footprint:
    return Footprint(id, box(x, y, x + side, y + side), None, levels, None, use=kind)


def storeys(*footprints: Footprint, area: object = None) -> dict[str, float]:
    built = assemble_buildings([Footprints("EPSG:28992", footprints)], RD, area=area, floor_height=STOREY)  # type: ignore[arg-type]
    return {building.id: building.height / STOREY for building in built.items}


def test_neighbours_tell_and_one_storey_is_left_to_the_id() -> None:
    low = [house(f"l{i}", 30.0 * i, 0, 2) for i in range(6)]
    high = [house(f"h{i}", 30.0 * i, 2000, 6) for i in range(6)]
    asked = [house(f"a{i}", 30.0 * i, 30) for i in range(60)] + [house(f"b{i}", 30.0 * i, 2030) for i in range(60)]
    found = storeys(*low, *high, *asked)
    near_low = Counter(found[f"a{i}"] for i in range(6))
    near_high = [found[f"b{i}"] for i in range(60)]
    assert set(near_low) <= {1, 2, 3}
    assert set(near_high[:12]) <= {5, 6, 7}
    counts = Counter(near_high)
    assert counts[6] > counts[5] > 0
    assert counts[6] > counts[7] > 0


def test_sheds_have_one_storey() -> None:
    high = [house(f"h{i}", 30.0 * i, 0, 6) for i in range(4)]
    found = storeys(
        *high, house("small", 0, 40, side=6), house("free", 40, 40, side=9), house("g", 80, 40, kind="garages")
    )
    assert [found[id] for id in ("small", "free", "g")] == [1, 1, 1]


def test_what_lies_around_the_area_is_known_too() -> None:
    inside = house("a", 0, 0)
    area = box(-10, -10, 40, 40)
    around = [house(f"h{i}", 60.0 + 30 * i, 0, 8) for i in range(4)]
    found = storeys(inside, *around, area=area)
    assert list(found) == ["a"]
    assert abs(found["a"] - 8) <= 1
    far = [house(f"h{i}", 3000.0 + 30 * i, 0, 8) for i in range(4)]
    assert abs(storeys(inside, *far, area=area)["a"] - 4) <= 1
