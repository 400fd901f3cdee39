"""When a city's run ends by the clock."""

from __future__ import annotations

from datetime import datetime

import pytest

from facade_core.core.errors import InputError
from flows.city_options import CityOptions, next_time_of_day


@pytest.mark.parametrize(
    ("now", "then"), [("2026-11-23 22:00", "2026-11-24 06:00"), ("2026-11-24 05:59", "2026-11-24 06:00")]
)
def test_the_time_that_is_next(now: str, then: str) -> None:
    assert next_time_of_day("06:00", datetime.fromisoformat(now)) == datetime.fromisoformat(then)


def test_what_is_no_time_is_refused() -> None:
    with pytest.raises(InputError, match="no time of day"):
        next_time_of_day("6 o'clock", datetime(2026, 11, 23))


def test_what_is_asked_of_a_block() -> None:
    assert CityOptions(workers=3).block_arguments() == ["--workers", "3"]
    assert CityOptions(restyle=True).block_arguments() == ["--workers", "2", "--restyle"]
    assert CityOptions(dask="tcp://127.0.0.1:8786", keep=2).block_arguments() == [
        "--dask",
        "tcp://127.0.0.1:8786",
        "--keep",
        "2",
    ]
