"""Completions that the editor offers: what they keep, what they replace, and what is refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from facade_core.core.errors import InputError
from facade_core.core.provenance import Provenance
from facade_core.core.types import SHIPPED_MODELS
from facade_core.geometry.walls import WallRole
from tasks.viewing.facade_completions import COMPLETION_COUNT, EditorBoxes, complete_facade, parse_editor_boxes

WIDTH, HEIGHT = 160, 120
VISIBLE = 80
COLUMNS = (10, 30, 50)
ROWS = (12, 45, 80)


def view_of_wall() -> Any:
    """Return a view of one wall whose right half no photo shows."""
    evidence = np.full((HEIGHT, WIDTH), Provenance.PHOTO, np.uint8)
    evidence[:, VISIBLE:] = Provenance.INPAINTED
    image = np.full((HEIGHT, WIDTH, 3), 190, np.uint8)
    for y in ROWS:
        for x in COLUMNS:
            image[y : y + 18, x : x + 12] = 60
    rasters = {"atlas/seed_evidence": evidence, "atlas/seed": image}
    return SimpleNamespace(
        open_facade=lambda index: SimpleNamespace(read_raster=rasters.__getitem__),
        tables=SimpleNamespace(facades=SimpleNamespace(role=[WallRole.STREET])),
    )


def element_row(x: float, y: float, *, drawn: bool = False) -> list[object]:
    return ["window", x / WIDTH, y / HEIGHT, (x + 12) / WIDTH, (y + 18) / HEIGHT, drawn]


def test_seen_and_drawn_boxes_stay_and_guesses_are_replaced() -> None:
    seen = [element_row(x, y) for y in ROWS for x in COLUMNS]
    guess, drawn = element_row(100, 60), element_row(130, 14, drawn=True)
    boxes = parse_editor_boxes({"facade": "a-0", "elements": [*seen, guess, drawn]})
    found = complete_facade(view_of_wall(), 0, boxes, SHIPPED_MODELS)
    assert found["kept"] == [*range(9), 10]
    completions = found["completions"]
    assert 1 < len(completions) <= COMPLETION_COUNT
    scores = [one["score"] for one in completions]
    assert scores == sorted(scores, reverse=True)
    first = completions[0]["elements"]
    assert {name for name, *_ in first} <= {"window", "door", "shop", "balcony"}
    assert all(x0 >= VISIBLE - 12 for _, x0, *_ in first)
    assert not any(abs(x0 - 130) < 6 and abs(y0 - 14) < 6 for _, x0, y0, *_ in first), "the drawn one is there already"


def test_what_the_user_hides_is_completed_too() -> None:
    boxes = parse_editor_boxes(
        {"facade": "a-0", "elements": [element_row(x, y) for y in ROWS for x in COLUMNS], "hide": [[0.29, 0, 0.5, 1]]}
    )
    assert complete_facade(view_of_wall(), 0, boxes, SHIPPED_MODELS)["kept"] == [0, 1, 3, 4, 6, 7]


def test_nothing_seen_and_nothing_drawn_is_refused() -> None:
    with pytest.raises(InputError, match=r"a-0: no element of it is seen or drawn; draw one box"):
        complete_facade(view_of_wall(), 0, parse_editor_boxes({"facade": "a-0", "elements": []}), SHIPPED_MODELS)


@pytest.mark.parametrize(
    "body",
    [
        None,
        [],
        {},
        {"facade": "a-0"},
        {"facade": "a-0", "elements": [1]},
        {"facade": "a-0", "elements": [[]]},
        {"facade": "a-0", "elements": [["window", 0, 0, 1, True]]},
        {"facade": "a-0", "elements": [["tree", 0, 0, 1, 1, True]]},
        {"facade": "a-0", "elements": [], "hide": [[1, 2]]},
    ],
)
def test_malformed_boxes_are_refused_in_one_line(body: object) -> None:
    with pytest.raises((ValueError, InputError)) as refused:
        parse_editor_boxes(body)
    assert "\n" not in str(refused.value)


def test_boxes_are_read() -> None:
    boxes = parse_editor_boxes({"facade": "a-0", "elements": [["door", 0.1, 0.5, 0.2, 1, True]], "hide": None})
    assert boxes == EditorBoxes("a-0", (("door", 0.1, 0.5, 0.2, 1.0),), (True,), ())
