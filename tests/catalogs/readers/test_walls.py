"""Wall rectangles into bodies."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from shapely import box

from catalogs.readers.settings import MODELS
from catalogs.readers.walls import read_footprints_from_walls
from facade_core.core.errors import InputError


def wall(x0: float, y0: float, x1: float, y1: float, low: float = 0.5, high: float = 20.5) -> list[list[float]]:
    return [[x0, y0, high], [x1, y1, high], [x1, y1, low], [x0, y0, low]]


def write(folder: Path, walls: object) -> Path:
    path = folder / "walls.json"
    path.write_text(json.dumps({"crs": "EPSG:28992", "walls": walls}))
    return path


def test_walls_that_meet_are_closed_and_single_ones_get_a_body_behind_them(tmp_path: Path) -> None:
    found = read_footprints_from_walls(
        write(
            tmp_path,
            {
                "three": {"a": wall(0, 0, 20, 0), "b": wall(20, 0, 20, 10), "c": wall(20, 10, 0, 10)},
                "one": {"front": wall(100, 0, 100, 30)},
                "corner": {"a": wall(200, 0, 220, 0), "b": wall(220, 0, 220, 30)},
            },
        )
    )
    assert found.crs == "EPSG:28992"
    three, one, corner = found.items
    assert three.outline.equals(box(0, 0, 20, 10))
    assert one.outline.equals(box(100 - MODELS.assumed_depth_m, 0, 100, 30)), (
        "going north, the inside is to the left: west"
    )
    assert corner.outline.equals(
        box(200, 0, 220, MODELS.assumed_depth_m).union(box(220 - MODELS.assumed_depth_m, 0, 220, 30))
    )
    assert (three.height, three.base) == (20.0, 0.5)
    assert three.roof is not None
    assert (three.roof.shape, three.roof.height) == ("flat", 0.0), "walls end where stated"


@pytest.mark.parametrize(
    ("walls", "words"),
    [
        ({}, "has no wall"),
        ([], "has no wall"),
        ({"a": [[0, 0, 1], [1, float("nan"), 1], [1, 1, 0]]}, "wall a is no list of three or more"),
        ({"a": "north"}, "wall a is no list"),
        ({"a": [[0, 0, 0], [0, 0, 5], [0, 0, 9]]}, "wall a has no area"),
        ({"a": [[0, 0, 0], [10, 0, 0], [10, 5, 9], [0, 5, 9]]}, "wall a does not stand upright"),
    ],
)
def test_broken_walls_set_their_building_aside(tmp_path: Path, walls: object, words: str) -> None:
    found = read_footprints_from_walls(write(tmp_path, {"bad": walls, "good": {"a": wall(0, 0, 20, 0)}}))
    assert [item.id for item in found.items] == ["good"]
    (fault,) = found.faults
    assert fault.id == "bad"
    assert words in fault.reason


@pytest.mark.parametrize("text", ["{", '{"crs": 3, "walls": {}}', '{"crs": "EPSG:28992"}', "[]"])
def test_files_of_another_kind_are_refused_in_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "walls.json").write_text(text)
    with pytest.raises(InputError, match=r"walls\.json") as error:
        read_footprints_from_walls(tmp_path / "walls.json")
    assert "\n" not in str(error.value)
