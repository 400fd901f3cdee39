"""What a facade's row says of the panoramas that it is from."""

from __future__ import annotations

import pytest

from tasks.published.rows import _residual

RESIDUALS = {"a.jpg": 0.4, "Rue, north.jpg": 1.2, "b.jpg": None}


@pytest.mark.parametrize(
    ("source", "residual"),
    [
        ("a.jpg", 0.4),
        ("Rue, north.jpg", 1.2),
        ("a.jpg, Rue, north.jpg, b.jpg", 1.2),
        ("b.jpg", None),
        ("north.jpg", None),
        (None, None),
    ],
)
def test_the_largest_residual_counts_whatever_commas_names_have(source: str | None, residual: float | None) -> None:
    assert _residual({"source": source}, RESIDUALS) == residual
