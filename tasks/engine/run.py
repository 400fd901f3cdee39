"""What every task and unit of one run needs to know; small, frozen and picklable."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.published.folders import Folder, local_folder
from catalogs.published.s3 import folder_at
from facade_core.core.types import SHIPPED_MODELS, ModelFiles, Privacy

if TYPE_CHECKING:
    from catalogs.block.reader import Material, TextureSettings
    from catalogs.readers.pictures.aerial import Aerial
    from catalogs.readers.pictures.materials import MaterialPicture


@dataclass(frozen=True)
class Run:
    """One run of a block into `out`: an absolute folder, or s3://bucket/prefix.

    block: the block's name.
    key: of its ingest, a digest of the block's inputs and settings and of the code that ingests them.
    texture: the block's settings; what they name as files is read: roof_material, materials.
    privacy: what is kept of things in front of facades.
    models: those that the block names in place of what is shipped.
    failed_limit: the share of units that may fail for what is published to become current.
    ingested: when the store's plan was written, 0 before: a process that serves many runs keeps what it read of one plan from
        the next.
    """

    out: str
    block: str
    key: str
    crs: str
    seed: int
    storey: float
    texture: TextureSettings
    privacy: Privacy = "blur"
    aerial: Aerial | None = None
    roof_material: Material | None = None
    materials: tuple[MaterialPicture, ...] = ()
    models: ModelFiles = SHIPPED_MODELS
    failed_limit: float = 0.2
    ingested: float = 0.0

    @property
    def folder(self) -> Folder:
        return folder_at(self.out)

    @property
    def local(self) -> Path:
        """What of it lies on this machine in any case."""
        return local_folder(self.folder)

    @property
    def store(self) -> Folder:
        return self.folder / "store"
