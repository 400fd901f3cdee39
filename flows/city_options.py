"""Options of a city's run."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from facade_core.core.errors import InputError


@dataclass(frozen=True)
class CityOptions:
    """Parameters of the flow `flows.city.city`, whose docstring explains them."""

    workers: int = 2
    dask: str | None = None
    at_once: int = 2
    until: str | None = None
    keep: int | None = None
    tiles: bool = True
    restyle: bool = False

    def block_arguments(self) -> list[str]:
        """Return the command line options of the run of one block."""
        where = ("--dask", self.dask) if self.dask else ("--workers", str(self.workers))
        keep = ("--keep", str(self.keep)) if self.keep else ()
        return [*where, *keep, *(("--restyle",) if self.restyle else ())]


def next_time_of_day(until: str, now: datetime) -> datetime:
    """Compute the next occurrence of a local time of day such as 06:00.

    Raises
    ------
    InputError
        `until` is not a time of day.
    """
    try:
        at = datetime.strptime(until, "%H:%M")
    except ValueError:
        raise InputError(f"--until {until}: is no time of day; write it such as 06:00") from None
    today = now.replace(hour=at.hour, minute=at.minute, second=0, microsecond=0)
    return today if today > now else today + timedelta(days=1)
