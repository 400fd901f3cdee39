"""Choices of exemplars that stay while other buildings and exemplars change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from facade_core.facade.exemplar_quality import ExemplarQuality
from facade_core.plan.exemplar_choice import ExemplarTargetWalls
from tasks.stages.facades.exemplar_choices import StoredChoice, choose_building_exemplars

HOUSES = 24


def street(heights: Mapping[int, float] | None = None, *, houses: Sequence[int] = range(HOUSES)) -> ExemplarTargetWalls:
    """A row of houses, each with one wall 10 m wide at the street; `heights` are those of raised houses."""
    rows = np.array(houses)
    height = np.array([(heights or {}).get(house, 12.0) for house in houses])
    along = 11.0 * rows
    ends = np.stack([np.stack([along, 0 * along], 1), np.stack([along + 10, 0 * along], 1)], axis=1)
    floors = np.maximum(1, height // 3).astype(np.int32)
    return ExemplarTargetWalls(
        np.full(len(rows), 10.0), height, floors, 1000 + rows, np.ones(len(rows), int), ends, np.full(len(rows), -1)
    )


def exemplars(names: Sequence[str], feet: Mapping[str, float] | None = None) -> list[Any]:
    """Records of exemplars that look different."""
    whole = dict.fromkeys(ExemplarQuality.__dataclass_fields__, 1.0)
    return [
        {
            "status": "done",
            "unit": name,
            "key": f"code:c picture:{name}",
            "width_m": 12.0,
            "height_m": 9.0 + 2 * (ord(name) % 4),
            "floors": 3 + ord(name) % 4,
            "shop_width": 0.0,
            "look": [5.0 * (ord(name) - 97)] * 9,
            "quality_parts": whole | {"foot": (feet or {}).get(name, 1.0)},
        }
        for name in names
    ]


NAMES = "abcdefghij"


def choose(
    walls: ExemplarTargetWalls, records: Sequence[Any], stored: Sequence[StoredChoice] = ()
) -> tuple[dict[int, str], list[StoredChoice]]:
    chosen, choices = choose_building_exemplars(walls, cast(Any, records), stored, seed=3)
    return {number: one.names for number, one in chosen.items()}, choices


def restyled_houses(before: Mapping[int, str], after: Mapping[int, str]) -> set[int]:
    return {house - 1000 for house in before.keys() & after.keys() if before[house] != after[house]}


def test_a_raised_house_chooses_alone() -> None:
    first, stored = choose(street(), exemplars(NAMES))
    for house in range(HOUSES):
        raised = street({house: 24.0})
        assert restyled_houses(first, choose(raised, exemplars(NAMES), stored)[0]) <= {house}
    assert any(
        len(restyled_houses(first, choose(street({h: 24.0}), exemplars(NAMES))[0])) > 1 for h in range(HOUSES)
    ), "without its choices a block changes more than one house"


def test_choices_are_those_of_the_sequence_of_inputs() -> None:
    first, stored = choose(street(), exemplars(NAMES))
    assert choose(street(), exemplars(NAMES), stored) == (first, stored), "a second run changes nothing"
    raised, after = choose(street({5: 24.0}), exemplars(NAMES), stored)
    assert choose(street({5: 24.0}), exemplars(NAMES), after) == (raised, after)
    assert choose(street(), exemplars(NAMES), after)[0] == first, "a change that is undone brings the choice back"
    assert choose(street(), exemplars(NAMES), [])[0] == first, "restyled is as fresh"


def test_a_removed_exemplar_changes_its_own_walls() -> None:
    first, stored = choose(street(), exemplars(NAMES))
    for name in NAMES:
        others, _ = choose(street(), exemplars(NAMES.replace(name, "")), stored)
        assert restyled_houses(first, others) == {house - 1000 for house, one in first.items() if one == name}


def test_new_houses_and_exemplars_change_no_other() -> None:
    first, stored = choose(street(houses=range(1, HOUSES)), exemplars(NAMES))
    more, _ = choose(street(), exemplars(f"{NAMES}klm"), stored)
    assert restyled_houses(first, more) == set()
    assert more.keys() - first.keys() == {1000}
    assert more[1000] != more[1001], "the new house differs from its neighbour"


def test_a_ground_floor_stays_with_its_exemplar() -> None:
    def like_the_first(names: str) -> list[dict[str, Any]]:
        records = exemplars(names, {"a": 0.1})
        return [one | {"look": [0.1 * number] * 9} for number, one in enumerate(records)]

    first, stored = choose(street(), like_the_first("abcd"))
    assert any(one.startswith("a, ") for one in first.values())
    others, _ = choose(street(), like_the_first("abcdefgh"), stored)
    assert restyled_houses(first, others) == set()


def test_a_wall_that_a_neighbour_hides_leaves_the_choice() -> None:
    def with_gable(houses: Sequence[int], height: float = 12.0) -> ExemplarTargetWalls:
        row, gables = street({0: height}), street(houses=houses)
        joined = {
            name: np.concatenate([getattr(row, name), getattr(gables, name)])
            for name in ExemplarTargetWalls.__dataclass_fields__
        }
        joined["width"][HOUSES:] = 9.0
        return ExemplarTargetWalls(**joined)

    first, stored = choose(with_gable([3, 7]), exemplars(NAMES))
    assert restyled_houses(first, choose(with_gable([7]), exemplars(NAMES), stored)[0]) == set()
