"""Which exemplar a wall without pictures takes."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from facade_core.facade.exemplar_quality import ExemplarQuality
from facade_core.plan.exemplar_choice import ExemplarTargetWalls
from facade_core.plan.kept_choices import Wall
from tasks.stages.facades.exemplar_choices import StoredChoice, choose_building_exemplars
from tasks.stages.facades.imagery import ChosenExemplar


def test_a_picture_in_which_no_facade_was_found_is_used_last() -> None:
    one = np.ones(1)
    walls = ExemplarTargetWalls(
        12 * one, 10 * one, 3 * one, 7 * one.astype(int), one.astype(int), np.zeros((1, 2, 2)), -one
    )
    fits = {
        "status": "done",
        "key": "k",
        "width_m": 12.0,
        "height_m": 10.0,
        "floors": 3,
        "shop_width": 0.0,
        "front_m": 0.0,
        "quality_parts": dict.fromkeys(ExemplarQuality.__dataclass_fields__, 1.0),
    }
    smaller = fits | {"width_m": 10.0}
    records = [fits | {"unit": "a", "look": [0.0] * 9}, smaller | {"unit": "b", "look": [0.0] * 9}]
    assert choose_building_exemplars(walls, cast(Any, records), [], seed=1)[0] == {7: ChosenExemplar(0, "a", "k")}
    records[0]["cut_found"] = False
    assert choose_building_exemplars(walls, cast(Any, records), [], seed=1)[0] == {7: ChosenExemplar(1, "b", "k")}


def test_an_exemplar_with_a_hidden_ground_floor_names_another() -> None:
    whole = dict.fromkeys(ExemplarQuality.__dataclass_fields__, 1.0)
    records = [
        {
            "status": "done",
            "unit": name,
            "key": "k",
            "width_m": 12.0,
            "height_m": 10.0,
            "floors": 3,
            "shop_width": 0.0,
            "front_m": 0.0,
            "look": [0.0] * 9,
            "quality_parts": whole | {"foot": foot},
        }
        for name, foot in (("a", 0.3), ("b", 1.0))
    ]
    seen, hidden = ChosenExemplar(1, "b", "k"), ChosenExemplar(0, "a", "k")

    def choose(of: int) -> ChosenExemplar:
        floors = np.full(1, 3)
        walls = ExemplarTargetWalls(
            np.full(1, 12.0), np.full(1, 10.0), floors, np.full(1, 7), floors, np.zeros((1, 2, 2)), -floors
        )
        stored = [StoredChoice(7, (Wall(12.0, 10.0, 3, False),), "a", "", "b" if of == 2 else "")]
        return choose_building_exemplars(walls, cast(Any, records[:of]), stored, seed=1)[0][7]

    assert choose(2) == ChosenExemplar(0, "a", "k", seen)
    assert choose(2).names == "a, b"
    assert choose(2).digest_content() != hidden.digest_content()
    assert choose(1) == ChosenExemplar(0, "a", "k", "plain")
