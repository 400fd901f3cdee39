"""The block's store: an Icechunk repository with tables, atlas pages, panoramas and the journal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, cast

import icechunk
import numpy as np

from facade_core.atlas.journal import STAGES
from facade_core.atlas.spec import AtlasSpec
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.errors import LostStoreError, StoreError

if TYPE_CHECKING:
    import xarray as xr

BRANCH = "main"

# It warns at every opening that local folders are unsafe for concurrent commits; one process commits, behind a lock.
icechunk.set_logs_filter("off")

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


# The local file system has no compare-and-swap: of two threads that move a branch at once, one commit is lost without an error.
_committing = Lock()


class Repository(icechunk.Repository):
    """Icechunk's in a folder. Its sessions know it, so that whoever commits one can look whether the commit arrived; and they
    are of snapshots that can be read, where Icechunk's would hold nothing. Both raise StoreError."""

    path: Path

    def writable_session(self, branch: str) -> icechunk.Session:
        session = self._readable(super().writable_session(branch))
        session.repository = self  # type: ignore[attr-defined]
        return session

    def readonly_session(
        self, branch: str | None = None, *, tag: str | None = None, snapshot_id: str | None = None, **of: Any
    ) -> icechunk.Session:
        return self._readable(super().readonly_session(branch, tag=tag, snapshot_id=snapshot_id, **of))

    def _readable(self, session: icechunk.Session) -> icechunk.Session:
        try:
            self.lookup_snapshot(session.snapshot_id)
        except icechunk.IcechunkError as error:
            raise StoreError(
                f"{self.path}: snapshot {session.snapshot_id} cannot be read ({str(error).splitlines()[0].strip(' x')}); "
                f"`streetloom run BLOCK.yaml --out {self.path.parent}` goes on from one that can"
            ) from error
        return session


def open_repository(path: Path, *, create: bool = False) -> Repository:
    """The repository in folder `path`. Raises StoreError when there is none (and `create` is False) or it is damaged."""
    if not create and not path.is_dir():  # the storage would make one, which a run takes for a store that lost all
        raise StoreError(f"{path}: there is no store; run the block first")
    if (path.exists() or path.is_symlink()) and not path.is_dir():  # Icechunk panics
        raise LostStoreError(f"{path}: is no folder; remove it, and run again")
    storage = icechunk.local_filesystem_storage(str(path))
    try:
        repository = cast(Repository, Repository.open_or_create(storage) if create else Repository.open(storage))
    except icechunk.IcechunkError as error:
        raise StoreError(
            f"{path}: no usable store ({str(error).splitlines()[0]}); run the block first, or remove it"
        ) from error
    repository.path = path
    return repository


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
    """Commit a session of `open_repository` on top of whatever else was committed since it began. Returns the snapshot id.

    One at a time in this process, whoever calls; one process at a time is for the run's lock. Raises StoreError when another
    commit wrote the same chunk in the meantime, as one of the two writes would be lost, and when the branch is not where this
    commit put it.
    """
    branch = session.branch or BRANCH  # a committed session has none
    repository: Repository = session.repository  # type: ignore[attr-defined]
    with _committing:
        try:
            # moves the branch if its tip is the session's base; else rebases the session onto the tip, and tries again
            snapshot = session.commit(message, rebase_with=icechunk.ConflictDetector())
        except icechunk.RebaseFailedError as error:
            raise StoreError(
                f"{message}: another unit wrote the same chunk ({error}); units of a wave must not share one"
            ) from error
        tip = repository.lookup_branch(branch)
    if tip != snapshot:
        raise StoreError(
            f"{message}: the commit {snapshot} is lost, {branch} is at {tip}: another process writes into this store; end it, "
            "and run again"
        )
    return snapshot


def expire(repository: icechunk.Repository) -> None:
    """Forget every snapshot that is neither the newest, nor the one before it, nor tagged, and remove what only those held.

    The one before stays for the day on which the newest cannot be read. For a moment at which nobody else writes: what an open
    session wrote would be taken for garbage.
    """
    with _committing:
        *_, before = islice(repository.ancestry(branch=BRANCH), 2)
        repository.expire_snapshots(before.written_at)
        repository.garbage_collect(datetime.now(UTC))


def text_column(values: Sequence[str]) -> np.ndarray:
    """Strings as a column that zarr keeps with variable length."""
    return np.array(list(values), dtype=object) if len(values) else np.array([], dtype="U1")
