"""What a facade's row says of the panoramas that it is from."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from catalogs.published.facade_values import FacadeSource, PanoramaPose, largest_pose_value

POSES = {
    "a.jpg": PanoramaPose(0.4, None, 0.3),
    "Rue, north.jpg": PanoramaPose(1.2, 0.02, -1.1),
    "b.jpg": PanoramaPose(None, 0.05, 0.0),
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
    facade = cast(FacadeSource, SimpleNamespace(record={"source": source}, poses=POSES))
    assert tuple(largest_pose_value(name)(facade) for name in PanoramaPose._fields) == told
