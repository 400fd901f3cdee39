"""What the report says of a block's facades."""

from __future__ import annotations

from catalogs.published.report import facades_to_review


def test_the_most_doubtful_facades_come_first_and_an_assumed_height_is_no_doubt() -> None:
    rows = [
        {"id": "a", "quality": "good", "occluded": 0.9},
        {"id": "b", "quality": "height-assumed", "occluded": 0.9},
        {"id": "c", "quality": "floors-differ, height-assumed", "occluded": None},
        {"id": "d", "quality": "garbled-inpainting", "occluded": 0.6},
        {"id": "e", "quality": None, "occluded": None},
        {"id": "f", "quality": "foreign-parts", "occluded": 0.1},
        {"id": "g"},
    ]
    assert [row["id"] for row in facades_to_review(rows)] == ["c", "d", "f"]
