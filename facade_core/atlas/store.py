"""Store of a block: Icechunk repository with tables, pages, panoramas and journal."""

from __future__ import annotations

import shlex
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from itertools import islice
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, cast

import icechunk

from facade_core.atlas.arrays import STORE_FORMAT
from facade_core.atlas.journal_cache import update_cached_journals
from facade_core.atlas.store_location import StoreLocation
from facade_core.core.errors import (
    BUCKET_UNAVAILABLE,
    BucketUnavailableError,
    LostStoreError,
    MachineError,
    StoreError,
    StoreFormatError,
)
from facade_core.core.zarr_types import COMPRESSORS, StoreGroup, is_bucket_unavailable

if TYPE_CHECKING:
    import xarray as xr

BRANCH = "main"
# Metadata of a commit: a number of its own, by which it is known again.
TOKEN = "commit"

# Icechunk warns at every opening that local folders are unsafe for concurrent commits; here one process commits, behind
# a lock.
icechunk.set_logs_filter("off")

# A commit rewrites the manifests that it touches, and its snapshot has a line for every manifest (docs/decisions/0045).
UNITS_PER_MANIFEST = 64
PAGES_PER_MANIFEST = 4
# What a process keeps of the metadata that it read: about ten snapshots of a large store, as each counts its arrays and groups,
# and some hundred manifests. By default all snapshots of a run stay, which is half a gigabyte when history is expired.
CACHED_SNAPSHOT_NODES = 10_000
CACHED_CHUNK_REFERENCES = 1_000_000

# What Icechunk says where the clock was set back since the last commit.
CLOCK_ERROR = "invalid snapshot timestamp ordering"

# The local file system has no compare-and-swap: if two threads move a branch at once, one commit is lost without an
# error. A bucket has it; there the lock saves retries within a process.
_commit_lock = Lock()
# Called before each commit to a store.
_commit_guards: dict[StoreLocation, Callable[[], None]] = {}


class Repository(icechunk.Repository):
    """Icechunk repository in a local folder or a bucket.

    Its sessions know it, so that `commit` can check that the commit arrived. Sessions are only of readable snapshots;
    Icechunk would return an empty one. Both raise StoreError.
    """

    path: StoreLocation

    def writable_session(self, branch: str) -> icechunk.Session:
        """Open a session for writing at the tip of a branch.

        Raises
        ------
        StoreError
            The tip cannot be read.
        """
        return self._readable(super().writable_session(branch))

    def readonly_session(
        self,
        branch: str | None = None,
        *,
        tag: str | None = None,
        snapshot_id: str | None = None,
        as_of: datetime | None = None,
    ) -> icechunk.Session:
        """Open a session for reading.

        Raises
        ------
        StoreError
            The snapshot cannot be read.
        """
        return self._readable(super().readonly_session(branch, tag=tag, snapshot_id=snapshot_id, as_of=as_of))

    def _readable(self, session: icechunk.Session) -> icechunk.Session:
        try:
            self.lookup_snapshot(session.snapshot_id)
        except icechunk.IcechunkError as error:
            _raise_if_unavailable(self.path, error)
            raise StoreError(
                f"{self.path}: snapshot {session.snapshot_id} cannot be read ({str(error).splitlines()[0].strip(' x')}); "
                f"`streetloom run BLOCK.yaml --out {shlex.quote(str(self.path.parent))}` goes on from one that can"
            ) from error
        session.repository = self  # type: ignore[attr-defined]
        return session


def repository_config() -> icechunk.RepositoryConfig:
    """Return the Icechunk configuration for manifests of UNITS_PER_MANIFEST or PAGES_PER_MANIFEST each.

    The configuration is passed at every opening and not stored: a stored one would be one more file that the store
    depends on. Manifests with another split stay readable; the first commit that touches them rewrites them.
    """
    condition, dimension = icechunk.ManifestSplitCondition, icechunk.ManifestSplitDimCondition
    splitting: icechunk.SplitSizesDict = {
        condition.path_matches("^/(journal|panoramas)/"): {dimension.Axis(0): UNITS_PER_MANIFEST},
        condition.AnyArray(): {dimension.DimensionName("page"): PAGES_PER_MANIFEST},
    }
    # Icechunk preloads small manifests, which takes longer than a commit; a session needs few of them
    preload = icechunk.ManifestPreloadConfig(max_total_refs=0, preload_if=icechunk.ManifestPreloadCondition.false())
    manifests = icechunk.ManifestConfig(
        preload=preload, splitting=icechunk.ManifestSplittingConfig.from_dict(splitting)
    )
    caching = icechunk.CachingConfig(num_snapshot_nodes=CACHED_SNAPSHOT_NODES, num_chunk_refs=CACHED_CHUNK_REFERENCES)
    return icechunk.RepositoryConfig(caching=caching, manifest=manifests)


def open_repository(path: StoreLocation, *, create: bool = False) -> Repository:
    """Open the repository in a folder.

    Parameters
    ----------
    path : folder of the store.
    create : creates the repository if there is none.

    Raises
    ------
    StoreError
        There is no repository.
    LostStoreError
        It cannot be opened.
    """
    if not create and not path.is_dir():  # the storage would create one, which a run would take for a lost store
        raise StoreError(f"{path}: there is no store; run the block first")
    if isinstance(path, Path):
        if (path.exists() or path.is_symlink()) and not path.is_dir():  # Icechunk panics
            raise LostStoreError(f"{path}: is no folder; mount what it links to, or name another folder with --out")
        storage = icechunk.local_filesystem_storage(str(path))
    else:
        storage = path.icechunk_storage()
    try:
        if create:
            _create_if_missing(storage)
        repository = Repository.open(storage, repository_config())
    except icechunk.IcechunkError as error:
        _raise_if_unavailable(path, error)
        reason = str(error).splitlines()[0].strip(" x")
        if "repository doesn't exist" in reason:
            raise StoreError(f"{path}: holds no store; give the folder of a run") from error
        raise LostStoreError(
            f"{path}: cannot be opened ({reason}); see to its disk or network; `streetloom doctor "
            f"{shlex.quote(str(path.parent))}` says whether it is damaged"
        ) from error
    repository.path = path
    return repository


def _create_if_missing(storage: icechunk.Storage) -> None:
    """Create a repository; one whose creation a bucket answered too late is there."""
    try:
        Repository.open_or_create(storage)
    except icechunk.IcechunkError:
        if not Repository.exists(storage):
            raise


def _raise_if_unavailable(path: StoreLocation, error: icechunk.IcechunkError) -> None:
    if is_bucket_unavailable(error):
        raise BucketUnavailableError(f"{path}: {BUCKET_UNAVAILABLE}") from error


def open_root(session: icechunk.Session) -> StoreGroup:
    """Open the root group of a store, writable if the session is.

    Raises
    ------
    FormatError
        The store has another format; an empty store has any.
    """
    group = open_root_of_any_format(session)
    found_format = read_format(group)
    if found_format != STORE_FORMAT and dict(group.attrs):
        repository = getattr(session, "repository", None)
        where, out = (repository.path, repository.path.parent) if repository else ("the store", "OUT")
        raise StoreFormatError(
            f"{where}: is of format {found_format or 'unknown'}, and this version of Streetloom reads {STORE_FORMAT}; "
            f"`streetloom run BLOCK.yaml --out {shlex.quote(str(out))}` makes it anew, or install the version that made it"
        )
    return group


def open_root_of_any_format(session: icechunk.Session) -> StoreGroup:
    """Open the root group of a store of any format; a writable session creates a missing one."""
    import zarr

    store = session.store  # a new object at every access
    if (repository := getattr(session, "repository", None)) is not None:  # forks have none
        store.folder = repository.path  # type: ignore[attr-defined]
    return cast(StoreGroup, zarr.open_group(store, mode="r" if session.read_only else "a"))


def create_root(session: icechunk.Session) -> StoreGroup:
    """Create an empty root group in place of the store's content."""
    import zarr

    return cast(StoreGroup, zarr.group(store=session.store, overwrite=True))


def read_format(group: StoreGroup) -> int | None:
    """Return the format of a store; None where it is not stated."""
    store_format = group.attrs.get("format")
    return store_format if isinstance(store_format, int) else None


def write_table(session: icechunk.Session, group: str, table: xr.Dataset) -> None:
    """Write a table, a Dataset with one dimension per kind of row, over a group."""
    encoding = {name: {"compressors": COMPRESSORS} for name in table.variables}
    table.to_zarr(session.store, group=group, mode="w", encoding=encoding, consolidated=False)


def open_table(session: icechunk.Session, group: str) -> xr.Dataset:
    """Open a table as a Dataset without Dask."""
    import xarray as xr

    table: xr.Dataset = xr.open_zarr(session.store, group=group, consolidated=False, chunks=None)
    return table


def commit(session: icechunk.Session, message: str) -> str:
    """Commit a session of `open_repository` on top of all commits since it began.

    Commits of one process are serialised. Between processes the run's lock decides, which `check_before_commits` checks.

    Returns
    -------
    The id of the snapshot.

    Raises
    ------
    StoreError
        Another commit wrote the same chunk, or the branch does not name this commit afterwards.
    """
    branch = session.branch or BRANCH  # a committed session has none
    repository: Repository = session.repository  # type: ignore[attr-defined]
    changes, token = session.status(), uuid.uuid4().hex
    with _commit_lock:
        if (still := _commit_guards.get(repository.path)) is not None:
            still()
        try:
            # moves the branch if its tip is the session's base, else rebases the session onto the tip and retries
            snapshot = session.commit(message, {TOKEN: token}, rebase_with=icechunk.ConflictDetector())
        except (icechunk.IcechunkError, icechunk.RebaseFailedError) as error:
            if (made := _find_commit(repository, branch, token)) is None:
                if isinstance(error, icechunk.RebaseFailedError):
                    raise StoreError(
                        f"{message}: another unit wrote the same chunk ({error}); units must not share one"
                    ) from error
                if CLOCK_ERROR in str(error):
                    times = str(error).partition(CLOCK_ERROR)[2].splitlines()[0]
                    raise MachineError(
                        f"{repository.path}: the clock of this machine is behind the last commit ({times.strip('. ')}); "
                        "set the clock, and run again: finished work is kept"
                    ) from None
                raise
            snapshot = made
        tip = repository.lookup_branch(branch)
        update_cached_journals(repository.path, repository.lookup_snapshot(snapshot).parent_id, snapshot, changes)
    if tip != snapshot:
        raise StoreError(
            f"{message}: the commit {snapshot} is lost, {branch} is at {tip}: another process writes into this store; end it, "
            "and run again"
        )
    return snapshot


def _find_commit(repository: Repository, branch: str, token: str) -> str | None:
    """Return the tip of a branch if it is the commit with this token: a bucket may lose the answer to a write that it did."""
    try:
        tip = repository.lookup_branch(branch)
        return tip if repository.lookup_snapshot(tip).metadata.get(TOKEN) == token else None
    except icechunk.IcechunkError:
        return None


@contextmanager
def check_before_commits(store: StoreLocation, check: Callable[[], None]) -> Iterator[None]:
    """Call `check` before each commit to a store within a `with` block.

    Parameters
    ----------
    store : folder of the store.
    check : raises if this process may no longer commit.
    """
    _commit_guards[store] = check
    try:
        yield
    finally:
        del _commit_guards[store]


def expire_snapshots(repository: icechunk.Repository, min_age: timedelta = timedelta()) -> None:
    """Remove old snapshots and the data that only they use.

    Keeps the newest snapshot, its parent, tagged snapshots and those younger than `min_age`. The parent is the fallback
    if the newest cannot be read. Nobody else may write meanwhile: the data of an open session would count as garbage.
    """
    with _commit_lock:
        *_, before = islice(repository.ancestry(branch=BRANCH), 2)
        cutoff = datetime.now(UTC) - min_age
        repository.expire_snapshots(min(before.written_at, cutoff))
        repository.garbage_collect(cutoff)
