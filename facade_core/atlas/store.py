"""The block's store: an Icechunk repository with tables, atlas pages, panoramas and the journal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import icechunk
import numpy as np

from facade_core.atlas.journal import STAGES
from facade_core.atlas.spec import AtlasSpec
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.errors import StoreError

if TYPE_CHECKING:
    import xarray as xr

BRANCH = "main"

# It warns at every opening that local folders are unsafe for concurrent commits; one process commits, behind a lock.
icechunk.set_logs_filter("error")

# name -> (dtype, trailing dimension, meaning)
ATLAS_ARRAYS = {
    "seed": ("uint8", "band", "colour from the facade stages"),
    "seed_evidence": ("uint8", None, "provenance of seed, 0 where there is none"),
    "street": ("uint8", "band", "colour from the street stage, Eq. 1"),
    "street_views": ("uint16", None, "views blended into street"),
    "colour": ("uint8", "band", "resolved colour"),
    "provenance": ("uint8", None, "source of colour: 0 unseen, 1 translated, 2 synthesised, 3 inpainted, 4 photo"),
}
FACADE_ARRAYS = {
    "evidence": ("uint8", "band", "facade image before completion"),
    "labels": ("uint8", None, "class id as in facade_core.labels, 255 unknown"),
    "occluded": ("bool", None, "hidden in the facade image"),
    "confidence": ("uint8", None, "how well a picture shows it: 255 squarely at the atlas's resolution, 0 not at all"),
}


def open_repository(path: Path, *, create: bool = False) -> icechunk.Repository:
    """The repository in folder `path`. Raises StoreError when there is none (and `create` is False) or it is damaged."""
    storage = icechunk.local_filesystem_storage(str(path))
    try:
        return icechunk.Repository.open_or_create(storage) if create else icechunk.Repository.open(storage)
    except icechunk.IcechunkError as error:
        raise StoreError(
            f"{path}: no usable store ({str(error).splitlines()[0]}); run the block first, or remove it"
        ) from error


def create_arrays(
    group: StoreGroup,
    spec: AtlasSpec,
    *,
    crs: str,
    panorama_width: int,
    poses: int,
    exemplars: int,
    textures: int,
    facades: int,
    viewpoints: int,
    streets: int,
) -> None:
    """Empty atlas pages, facade maps, panoramas and journal, for so many units: metadata only, no chunk is written."""
    pages = (spec.pages, spec.page, spec.page)
    for folder, arrays in (("atlas", ATLAS_ARRAYS), ("facade_maps", FACADE_ARRAYS)):
        for name, (dtype, last, meaning) in arrays.items():
            group.create_array(
                f"{folder}/{name}",
                shape=(*pages, 3) if last else pages,
                chunks=(1, spec.chunk, spec.chunk, 3) if last else (1, spec.chunk, spec.chunk),
                dtype=dtype,
                dimension_names=("page", "y", "x", *([last] if last else [])),
                fill_value=0,
                attributes={"long_name": meaning},
                overwrite=True,
            )
        group[folder].attrs.update(crs=crs, texels_per_metre=spec.texels_per_metre, gutter=spec.gutter, units="texel")
    create_panoramas(group, crs=crs, width=panorama_width, viewpoints=viewpoints)
    for exemplar in range(exemplars):  # units that run side by side must not create the same group
        group.create_group(f"exemplars/{exemplar}", overwrite=True)
    group.create_array(
        "hierarchies/data",
        shape=(facades,),
        chunks=(1,),
        dtype=str,
        dimension_names=("facade",),
        attributes={"long_name": "variation hierarchy of each facade, base64 of its file"},
        overwrite=True,
    )
    for stage, units in zip(STAGES, (poses, exemplars, textures, facades, viewpoints, streets), strict=True):
        group.create_array(
            f"journal/{stage}",
            shape=(units,),
            chunks=(1,),
            dtype=str,
            dimension_names=(stage.removesuffix("s"),),
            attributes={"long_name": f"record of each unit of {stage}, JSON; empty until it is done"},
            overwrite=True,
        )


def create_panoramas(group: StoreGroup, *, crs: str, width: int, viewpoints: int) -> None:
    """An empty panorama for each viewpoint, `width` pixels wide."""
    group.create_array(
        "panoramas/rgb",
        shape=(viewpoints, width // 2, width, 3),
        chunks=(1, width // 2, width, 3),
        dtype="uint8",
        dimension_names=("viewpoint", "row", "column", "band"),
        fill_value=0,
        attributes={"long_name": "translated equirectangular panorama; the truth of street texturing"},
        overwrite=True,
    )
    group["panoramas"].attrs.update(crs=crs)


def resize_arrays(
    group: StoreGroup, spec: AtlasSpec, *, units: Mapping[str, int], panorama_width: int, exemplars: int
) -> None:
    """The arrays of `create_arrays` for other numbers of pages and of units by stage.

    What is in both keeps its content, but for panoramas of another width, which begin anew.
    """
    for folder in ("atlas", "facade_maps"):
        for _, array in group[folder].arrays():
            array.resize((spec.pages, *array.shape[1:]))
    for stage, count in units.items():
        group[f"journal/{stage}"].resize((count,))
    group["hierarchies/data"].resize((units["facades"],))
    panoramas = group["panoramas/rgb"]
    if panoramas.shape[2] == panorama_width:
        panoramas.resize((units["viewpoints"], *panoramas.shape[1:]))
    else:
        create_panoramas(
            group, crs=group["panoramas"].attrs["crs"], width=panorama_width, viewpoints=units["viewpoints"]
        )
    for exemplar in range(exemplars):
        group.require_group(f"exemplars/{exemplar}")


def write_table(session: icechunk.Session, group: str, table: xr.Dataset) -> None:
    """Write a table (a Dataset with one dimension per kind of row) over whatever the group held."""
    table.to_zarr(session.store, group=group, mode="w", consolidated=False)


def open_table(session: icechunk.Session, group: str) -> xr.Dataset:
    import xarray as xr

    return xr.open_zarr(session.store, group=group, consolidated=False, chunks=None)


def commit(session: icechunk.Session, message: str) -> str:
    """Commit a session on top of whatever else was committed since it began. Returns the snapshot id.

    Raises StoreError when another commit wrote the same chunk in the meantime: one of the two writes would be lost.
    """
    try:
        return session.commit(message, rebase_with=icechunk.ConflictDetector())
    except icechunk.RebaseFailedError as error:
        raise StoreError(
            f"{message}: another unit wrote the same chunk ({error}); units of a wave must not share one"
        ) from error


def expire(repository: icechunk.Repository) -> None:
    """Forget every snapshot that is neither the newest nor tagged, and remove what only those held.

    For a moment at which nobody else writes: what an open session wrote would be taken for garbage.
    """
    now = datetime.now(UTC)
    repository.expire_snapshots(now)
    repository.garbage_collect(now)


def text_column(values: Sequence[str]) -> np.ndarray:
    """Strings as a column that zarr keeps with variable length."""
    return np.array(list(values), dtype=object) if len(values) else np.array([], dtype="U1")
