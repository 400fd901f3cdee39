"""The text by which ways enter the digests of the ground."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from typing import Any

import pytest
import shapely

from facade_core.core.types import GroundWay
from facade_core.geometry.ground.shapes import WAY_FORMAT, serialise_way_look

WAY = GroundWay(
    "w", shapely.LineString([(0, 0), (9, 0)]), "road", 7.5, "asphalt", False, 2, True, (2.0, 0.0), (0.0, 2.2), 4
)
OTHER_VALUES: dict[str, Any] = {
    "kind": "path",
    "width": 8.0,
    "surface": "setts",
    "assumed": True,
    "lanes": 3,
    "oneway": False,
    "pavement": (2.0, 1.0),
    "parking": (0.5, 2.2),
    "rank": 5,
}


def test_text_is_pinned_and_starts_with_its_version() -> None:
    text = serialise_way_look(WAY)
    assert text == '[1, "road", 7.5, "asphalt", false, 2, true, [2.0, 0.0], [0.0, 2.2], 4]'
    assert json.loads(text)[0] == WAY_FORMAT


def test_id_and_line_are_left_out() -> None:
    assert serialise_way_look(replace(WAY, id="other", line=shapely.LineString())) == serialise_way_look(WAY)


@pytest.mark.parametrize("name", [field.name for field in fields(GroundWay) if field.name not in ("id", "line")])
def test_every_other_field_changes_the_text(name: str) -> None:
    assert serialise_way_look(replace(WAY, **{name: OTHER_VALUES[name]})) != serialise_way_look(WAY)
