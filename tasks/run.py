"""What every task and unit of one run needs to know; small, frozen and picklable."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catalogs.block import Material
    from catalogs.readers.pictures.aerial import Aerial


@dataclass(frozen=True)
class Run:
    """One run of a block into the absolute folder `out`.

    `key` is the ingest key: digest of the block's inputs and settings and of the code that ingests them. ingested is when the
    store's plan was written, 0 before: a process that serves many runs keeps what it read of one plan from the next.
    """

    out: str
    block: str
    key: str
    crs: str
    seed: int
    texels_per_metre: float
    panorama_width: int
    storey: float
    walls: str
    levelling: bool = True
    aerial: Aerial | None = None
    roof_material: Material | None = None
    translator: str = "exemplar"
    failed_limit: float = 0.2
    ingested: float = 0.0

    @property
    def store(self) -> Path:
        return Path(self.out) / "store"
