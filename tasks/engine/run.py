"""Settings of a run that every task and unit needs; small, frozen and picklable."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from catalogs.block.settings import WithSettings
from catalogs.published.folders import Folder, local_run_folder
from catalogs.published.s3 import folder_at
from catalogs.readers.pictures.aerial import Orthophoto
from catalogs.readers.pictures.materials import MaterialPicture, RoofPicture
from facade_core.core.types import SHIPPED_MODELS, TrainedModelFiles


@dataclass(frozen=True, kw_only=True)
class Run(WithSettings):
    """One run of a block into a folder.

    Attributes
    ----------
    out : absolute folder, or s3://bucket/prefix.
    block : name of the block.
    key : digest of the block's inputs and settings, and of the code that ingests them.
    settings : settings of the block; of files that they name, `roof_material`, `materials` and `models` are read instead.
    models : models that the block names in place of the shipped ones.
    shared : folder of work that the blocks of a city share; empty outside a city.
    ingested : when the store's plan was written, 0 before; tells a process that serves many runs which plan it cached.
    """

    out: str
    block: str
    key: str
    crs: str
    aerial: Orthophoto | None = None
    roof_material: RoofPicture | None = None
    materials: tuple[MaterialPicture, ...] = ()
    models: TrainedModelFiles = SHIPPED_MODELS
    shared: str = ""
    ingested: float = 0.0

    @property
    def folder(self) -> Folder:
        """Return the folder of the run."""
        return folder_at(self.out)

    @property
    def local(self) -> Path:
        """Return the folder on this machine."""
        return local_run_folder(self.folder)

    @property
    def store(self) -> Folder:
        """Return the folder of the store."""
        return self.folder / "store"
