"""The block's store: an Icechunk repository with tables, atlas pages, panoramas and the journal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from itertools import islice
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, cast

import icechunk

from facade_core.atlas.arrays import STORE_FORMAT
from facade_core.atlas.journal_cache import update_cached_journals
from facade_core.atlas.store_location import StoreLocation
from facade_core.core.errors import FormatError, LostStoreError, StoreError
from facade_core.core.zarr_types import StoreGroup

if TYPE_CHECKING:
    import xarray as xr

BRANCH = "main"

# It warns at every opening that local folders are unsafe for concurrent commits; one process commits, behind a lock.
icechunk.set_logs_filter("off")

# Units, and pages of the atlas, that one manifest lists: a commit writes those that it touches anew, and in its snapshot a line
# for each that there is (ADR 0045).
UNITS_PER_MANIFEST, PAGES_PER_MANIFEST = 64, 4

# The local file system has no compare-and-swap: of two threads that move a branch at once, one commit is lost without an error.
# A bucket has, and there this spares commits of the same process their second tries.
_commit_lock = Lock()
# What is asked before each commit into a store.
_commit_guards: dict[StoreLocation, Callable[[], None]] = {}


class Repository(icechunk.Repository):
    """Icechunk's in a folder, on this machine or in a bucket. Its sessions know it, so that whoever commits one can look
    whether the commit arrived; and they are of snapshots that can be read, where Icechunk's would hold nothing. Both raise
    StoreError."""

    path: StoreLocation

    def writable_session(self, branch: str) -> icechunk.Session:
        return self._readable(super().writable_session(branch))

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
        session.repository = self  # type: ignore[attr-defined]
        return session


def repository_config(units: int, pages: int) -> icechunk.RepositoryConfig:
    """How a store is opened whose manifests list so many units, or pages, each.

    It is given at every opening, and not kept in the store: there it would be one more file without which a store is lost. What
    was written otherwise is read as it is, and written so by the first commit that touches it.
    """
    array, along = icechunk.ManifestSplitCondition, icechunk.ManifestSplitDimCondition
    splitting: dict[icechunk.ManifestSplitCondition, Any] = {
        array.path_matches("^/(journal|panoramas)/"): {along.Axis(0): units},
        array.AnyArray(): {along.DimensionName("page"): pages},
    }
    # Icechunk reads small manifests ahead, of which a session needs few: for that it takes longer than for a commit
    ahead = icechunk.ManifestPreloadConfig(max_total_refs=0, preload_if=icechunk.ManifestPreloadCondition.false())
    manifests = icechunk.ManifestConfig(preload=ahead, splitting=icechunk.ManifestSplittingConfig.from_dict(splitting))
    return icechunk.RepositoryConfig(manifest=manifests)


def open_repository(path: StoreLocation, *, create: bool = False) -> Repository:
    """The repository in folder `path`. Raises StoreError when there is none (and `create` is False) or it is damaged."""
    if not create and not path.is_dir():  # the storage would make one, which a run takes for a store that lost all
        raise StoreError(f"{path}: there is no store; run the block first")
    if isinstance(path, Path):
        if (path.exists() or path.is_symlink()) and not path.is_dir():  # Icechunk panics
            raise LostStoreError(f"{path}: is no folder; remove it, and run again")
        storage = icechunk.local_filesystem_storage(str(path))
    else:
        storage = path.icechunk_storage()
    try:
        if create:
            Repository.open_or_create(storage)
        config = repository_config(UNITS_PER_MANIFEST, PAGES_PER_MANIFEST)
        repository = cast(Repository, Repository.open(storage, config))
    except icechunk.IcechunkError as error:
        raise StoreError(
            f"{path}: no usable store ({str(error).splitlines()[0]}); run the block first, or remove it"
        ) from error
    repository.path = path
    return repository


def open_root(session: icechunk.Session) -> StoreGroup:
    """The root group of a store, to be written to where the session is. Raises FormatError where it is of another format;
    a store to which nothing was written yet is of any.
    """
    group = open_root_of_any_format(session)
    found = read_format(group)
    if found != STORE_FORMAT and dict(group.attrs):
        repository = getattr(session, "repository", None)
        where, out = (repository.path, repository.path.parent) if repository else ("the store", "OUT")
        raise FormatError(
            f"{where}: is of format {found or 'unknown'}, and this version of Streetloom reads {STORE_FORMAT}; `streetloom run "
            f"BLOCK.yaml --out {out}` makes it anew, or install the version that made it"
        )
    return group


def open_root_of_any_format(session: icechunk.Session) -> StoreGroup:
    """The root group of a store, whoever wrote it; where the session is to be written to, it is made if there is none."""
    import zarr

    store: Any = session.store
    if (repository := getattr(session, "repository", None)) is not None:  # a fork has none
        store.folder = repository.path
    return cast(StoreGroup, zarr.open_group(store, mode="r" if session.read_only else "a"))


def create_root(session: icechunk.Session) -> StoreGroup:
    """An empty root group in place of whatever the store held."""
    import zarr

    return cast(StoreGroup, zarr.group(store=session.store, overwrite=True))


def read_format(group: StoreGroup) -> int | None:
    """The format of a store. Those made before it had an attribute of its own say it of what they were made for."""
    made_for = group.attrs.get("made_for")
    found = group.attrs.get("format", made_for.get("format") if isinstance(made_for, dict) else None)
    return found if isinstance(found, int) else None


def write_table(session: icechunk.Session, group: str, table: xr.Dataset) -> None:
    """Write a table (a Dataset with one dimension per kind of row) over whatever the group held."""
    table.to_zarr(session.store, group=group, mode="w", consolidated=False)


def open_table(session: icechunk.Session, group: str) -> xr.Dataset:
    import xarray as xr

    return xr.open_zarr(session.store, group=group, consolidated=False, chunks=None)


def commit(session: icechunk.Session, message: str) -> str:
    """Commit a session of `open_repository` on top of whatever else was committed since it began. Returns the snapshot id.

    One at a time in this process, whoever calls; one process at a time is for the run's lock, of which `guarded` asks. Raises
    StoreError when another commit wrote the same chunk in the meantime, as one of the two writes would be lost, and when the
    branch is not where this commit put it.
    """
    branch = session.branch or BRANCH  # a committed session has none
    repository: Repository = session.repository  # type: ignore[attr-defined]
    changes = session.status()
    with _commit_lock:
        if (still := _commit_guards.get(repository.path)) is not None:
            still()
        try:
            # moves the branch if its tip is the session's base; else rebases the session onto the tip, and tries again
            snapshot = session.commit(message, rebase_with=icechunk.ConflictDetector())
        except icechunk.RebaseFailedError as error:
            raise StoreError(
                f"{message}: another unit wrote the same chunk ({error}); units of a wave must not share one"
            ) from error
        tip = repository.lookup_branch(branch)
        update_cached_journals(repository.path, repository.lookup_snapshot(snapshot).parent_id, snapshot, changes)
    if tip != snapshot:
        raise StoreError(
            f"{message}: the commit {snapshot} is lost, {branch} is at {tip}: another process writes into this store; end it, "
            "and run again"
        )
    return snapshot


@contextmanager
def guard_commits(store: StoreLocation, check: Callable[[], None]) -> Iterator[None]:
    """While this lasts, `still` is asked before each commit into a store: it raises where this process may commit no more."""
    _commit_guards[store] = check
    try:
        yield
    finally:
        del _commit_guards[store]


def expire_snapshots(repository: icechunk.Repository, min_age: timedelta = timedelta()) -> None:
    """Forget every snapshot that is neither the newest, nor the one before it, nor tagged, nor younger than that, and remove
    what only those held.

    The one before stays for the day on which the newest cannot be read. For a moment at which nobody else writes: what an open
    session wrote would be taken for garbage.
    """
    with _commit_lock:
        *_, before = islice(repository.ancestry(branch=BRANCH), 2)
        left = datetime.now(UTC) - min_age
        repository.expire_snapshots(min(before.written_at, left))
        repository.garbage_collect(left)
