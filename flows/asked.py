"""What is asked of a city's run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Asked:
    """How a city is run: the parameters of the flow `flows.city.city`, which says what each means."""

    workers: int = 2
    dask: str | None = None
    at_once: int = 1
    until: str | None = None
    keep: int | None = None
    tiles: bool = True

    def of_a_block(self) -> list[str]:
        """The command line's options of the run of one block."""
        where = ("--dask", self.dask) if self.dask else ("--workers", str(self.workers))
        return [*where, *(("--keep", str(self.keep)) if self.keep else ())]
