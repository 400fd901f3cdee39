"""What every task and unit of one run needs to know; small, frozen and picklable."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tasks.keys.stage_code import stage_code

if TYPE_CHECKING:
    from catalogs.block import Block, Material
    from catalogs.readers.pictures.aerial import Aerial

VERSION = "0.1.0"


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


def run_of(block: Block, out: Path) -> Run:
    """The run that textures `block` into folder `out`."""
    key = hashlib.sha256(f"{block.digest}/{stage_code('ingest')}".encode()).hexdigest()
    texture = block.texture
    return Run(
        out=str(out.resolve()),  # workers may have been started elsewhere
        block=block.name,
        key=key,
        crs=block.crs.to_string(),
        seed=block.seed,
        texels_per_metre=texture.texels_per_metre,
        panorama_width=texture.panorama_width,
        storey=block.storey,
        failed_limit=block.failed_limit,
        walls=texture.walls,
        levelling=texture.levelling,
        aerial=block.aerial,
        roof_material=block.roof_material,
        translator=texture.translator,
    )
