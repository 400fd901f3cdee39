"""What a facade's row says of the panoramas that it is from."""

from __future__ import annotations

import pytest

from tasks.publish.item_rows import _facade_pose_columns

POSED = {
    name: dict(zip(("pose_residual_deg", "pose_apart_m", "pose_raised_m"), values, strict=True))
    for name, values in {
        "a.jpg": (0.4, None, 0.3),
        "Rue, north.jpg": (1.2, 0.02, -1.1),
        "b.jpg": (None, 0.05, 0.0),
    }.items()
}


@pytest.mark.parametrize(
    ("source", "told"),
    [
        ("a.jpg", (0.4, None, 0.3)),
        ("Rue, north.jpg", (1.2, 0.02, -1.1)),
        ("a.jpg, Rue, north.jpg, b.jpg", (1.2, 0.05, -1.1)),
        ("b.jpg", (None, 0.05, 0.0)),
        ("north.jpg", (None, None, None)),
        (None, (None, None, None)),
    ],
)
def test_the_largest_counts_whatever_commas_names_have(source: str | None, told: tuple[float | None, ...]) -> None:
    assert tuple(_facade_pose_columns({"source": source}, POSED).values()) == told
