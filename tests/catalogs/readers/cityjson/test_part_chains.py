"""Chains and cycles of building parts."""

from __future__ import annotations

import time
from typing import Any

from catalogs.readers.cityjson.parts import group_building_objects


def chain(count: int, last: int | None = None) -> dict[str, dict[str, Any]]:
    """Return objects whose parent is the next one; `last`: parent of the last, None without."""
    objects: dict[str, dict[str, Any]] = {
        f"o{i}": {"type": "BuildingPart", "parents": [f"o{i + 1}"]} for i in range(count)
    }
    objects[f"o{count - 1}"] = (
        {"type": "Building"}
        if last is None
        else {
            "type": "BuildingPart",
            "parents": [f"o{last}"],
        }
    )
    return objects


def test_a_chain_of_parts_is_one_building_in_linear_time() -> None:
    start = time.perf_counter()
    ((root, ids),) = group_building_objects(chain(20_000))
    assert root == "o19999"
    assert len(ids) == 20_000
    (ring,) = group_building_objects(chain(20_000, last=10_000))
    assert len(ring[1]) == 20_000
    assert time.perf_counter() - start < 5.0


def test_a_cycle_is_one_building() -> None:
    assert list(group_building_objects(chain(3, last=0))) == [("o0", ["o0", "o1", "o2"])]
