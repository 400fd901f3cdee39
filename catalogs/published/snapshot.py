"""Published snapshot: the pointer `current`, paths of its files, and its lock."""

from __future__ import annotations

import fcntl
import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, cast

from catalogs.published import object_store
from catalogs.published.file_list import has_other_content
from catalogs.published.folders import F, Folder
from catalogs.published.runs import publish_hint
from catalogs.published.s3 import S3Path
from facade_core.core.errors import InputError, MachineError, StoreError
from facade_core.core.json_types import JsonObject

if TYPE_CHECKING:
    import icechunk


# Link to the folder of the current snapshot, beside `current`.
LATEST_LINK_NAME = "latest"


@dataclass(frozen=True)
class SnapshotFolder(Generic[F]):
    """Folder OUT/published/ID of a snapshot, or the folder in which it is being written: paths, locks and store."""

    folder: F

    @property
    def id(self) -> str:
        """Return the id of the snapshot, which is the folder's name."""
        return self.folder.name

    @property
    def out(self) -> F:
        """Return the folder of the run."""
        return cast(F, self.folder.parent.parent)

    @property
    def items(self) -> F:
        """Return the path of the catalogue items.parquet."""
        return self._file("items.parquet")

    @property
    def model(self) -> F:
        """Return the path of the block's full model."""
        return self._file("block.glb")

    @property
    def overview(self) -> F:
        """Return the path of the block's small model."""
        return self._file("overview.glb")

    @property
    def surroundings(self) -> F:
        """Return the path of the model of street objects, which a block without any lacks."""
        return self._file("surroundings.glb")

    @property
    def tiles(self) -> F:
        """Return the path of the list of tiles."""
        return cast(F, self._file("tiles") / "index.json")

    def tile(self, path: str) -> F:
        """Return the path of a tile's model, by the path of its cell."""
        return cast(F, self._file("tiles") / f"{path}.glb")

    @property
    def report(self) -> F:
        """Return the report's folder, with index.html and images/."""
        return self._file("report")

    @property
    def summary(self) -> F:
        """Return the path of summary.json."""
        return self._file("summary.json")

    @property
    def mask_file(self) -> F:
        """Return the path of masked.json, which lists the occluded regions of facades."""
        return self._file("masked.json")

    @property
    def stac(self) -> F:
        """Return the folder of the STAC files."""
        return self._file("stac")

    def page(self, number: int) -> F:
        """Return the path of a filled page of the atlas."""
        return cast(F, self._file("pages") / f"{number:04}.jpg")

    def _file(self, name: str) -> F:
        return cast(F, self.folder / name)

    @contextmanager
    def hold_for_reading(self) -> Iterator[SnapshotFolder[F]]:
        """Hold a shared lock that keeps the folder from being pruned, at most until the process ends."""
        if isinstance(self.folder, S3Path):
            yield self
            return
        try:
            handle = os.open(self.folder, os.O_RDONLY)
        except OSError:  # the reader will report the missing folder
            yield self
            return
        with suppress(OSError):  # being removed, or no support for locks
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        try:
            yield self
        finally:
            os.close(handle)

    @contextmanager
    def lock_exclusively(self) -> Iterator[bool]:
        """Yield whether nobody reads the folder, and keep readers out meanwhile.

        Readers of a bucket are unknown.
        """
        if isinstance(self.folder, S3Path):
            yield True
            return
        handle = os.open(str(self.folder), os.O_RDONLY)
        try:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                yield False
            else:
                yield True
        finally:
            os.close(handle)

    def open_session(self) -> icechunk.Session:
        """Open the run's store at this snapshot. Raises StoreError if the store does not hold it."""
        import icechunk

        icechunk.set_logs_filter("off")  # it warns of writers at every opening
        store: Folder = self.out / "store"
        if isinstance(store, Path) and not store.is_dir():  # Icechunk would make it
            raise self.store_error("there is none")
        try:
            if isinstance(store, S3Path):
                repository = icechunk.Repository.open(store.icechunk_storage())
            else:
                repository = icechunk.Repository.open(icechunk.local_filesystem_storage(str(store)))
            return repository.readonly_session(snapshot_id=self.id)
        except (icechunk.IcechunkError, OSError, ValueError) as error:
            raise self.store_error(error) from error

    def store_error(self, error: object) -> StoreError:
        """Return the error for a store that cannot be read at this snapshot."""
        why = " ".join(str(error).split())[:120]
        return StoreError(
            f"{self.out}: its store does not hold snapshot {self.id} as this version writes it ({why}); {self.remedy}"
        )

    @property
    def remedy(self) -> str:
        """Return the remedy for a damaged folder."""
        return publish_hint(self.out, "publishes again")

    def read_run_summary(self) -> JsonObject:
        """Return the summary with the paths of the outputs; the small model if the whole one is missing."""
        model = self.overview if self.overview.is_file() and not self.model.is_file() else self.model
        summary: JsonObject = json.loads(self.summary.read_text())
        return summary | {
            "outputs": {
                "glb": [str(model)],
                "report": str(self.report / "index.html"),
                "items": str(self.items),
            },
        }


def snapshot_folder(out: F, id: str) -> SnapshotFolder[F]:
    """Return the folder of a run's snapshot by its id."""
    return SnapshotFolder(cast(F, out / "published" / id))


def current_snapshot(out: F) -> SnapshotFolder[F]:
    """Return the snapshot that `current` of a run names.

    Raises
    ------
    InputError : it names none that exists, or its catalogue is damaged.
    """
    snapshot = _read_pointer(out)
    if not snapshot.items.is_file():
        raise InputError(f"{snapshot.items} is missing; {snapshot.remedy}")
    if has_other_content(snapshot.items):
        raise InputError(f"{snapshot.items} is not as it was written; {snapshot.remedy}")
    return snapshot


def find_current_snapshot(out: F) -> SnapshotFolder[F] | None:
    """Return the current snapshot, or None if there is none or its pointer is damaged."""
    try:
        snapshot = _read_pointer(out)
    except InputError:
        return None
    return snapshot if snapshot.summary.is_file() else None


def current_pointer_etag(out: Folder) -> str | None:
    """Return the ETag of the object `current` of a run in a bucket; None without it.

    None on this machine, where the run's lock suffices.
    """
    found = object_store.download_object(f"{out.path}/current") if isinstance(out, S3Path) else None
    return found[1] if found else None


def set_current_snapshot(snapshot: SnapshotFolder[F], expected_tag: str | None = None) -> None:
    """Set `current` to a snapshot, atomically.

    Parameters
    ----------
    expected_tag : in a bucket, the version of `current` that is replaced, from `current_pointer_etag`.

    Raises
    ------
    MachineError : another run has changed `current` meanwhile.
    """
    if isinstance(snapshot.out, S3Path):
        if (
            object_store.upload_if_unchanged(f"{snapshot.out.path}/current", f"{snapshot.id}\n".encode(), expected_tag)
            is None
        ):
            raise MachineError(f"{snapshot.out}: another run published meanwhile; let it end, and run again")
        return
    pointer = snapshot.out / ".current.tmp"
    pointer.write_text(snapshot.id + "\n")
    os.replace(pointer, snapshot.out / "current")
    link_latest(snapshot)


def link_latest(snapshot: SnapshotFolder[F]) -> None:
    """Point OUT/latest to a snapshot for people; nothing reads it. Buckets and some file systems have no links."""
    out, target = snapshot.out, Path("published") / snapshot.id
    if isinstance(out, S3Path):
        return
    link, new = out / LATEST_LINK_NAME, out / f".{LATEST_LINK_NAME}.tmp"
    if link.exists() and not link.is_symlink():
        return
    with suppress(OSError):
        if link.is_symlink() and link.readlink() == target:
            return
        new.unlink(missing_ok=True)
        new.symlink_to(target, target_is_directory=True)
        os.replace(new, link)


def _read_pointer(out: F) -> SnapshotFolder[F]:
    pointer = out / "current"
    try:
        name = pointer.read_text(encoding="utf-8", errors="replace").strip()
    except OSError as error:
        raise InputError(f"{pointer} cannot be read: {error.strerror}; `streetloom run` writes it") from error
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise InputError(f"{pointer} does not hold a snapshot id; {publish_hint(out, 'publishes again')}")
    return snapshot_folder(out, name)
