"""A published snapshot, opened: which one `current` names, where its files lie, and that it stays while somebody reads it."""

from __future__ import annotations

import fcntl
import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, cast

from catalogs.published import object_store
from catalogs.published.folders import F, Folder
from catalogs.published.runs import publishes
from catalogs.published.s3 import S3Folder
from facade_core.core.errors import InputError, MachineError, StoreError

if TYPE_CHECKING:
    import icechunk


@dataclass(frozen=True)
class Snapshot(Generic[F]):
    """A snapshot in its folder OUT/published/ID, on this machine or in a bucket, or in the one in which it is being written."""

    folder: F

    @property
    def id(self) -> str:
        return self.folder.name

    @property
    def out(self) -> F:
        """The folder of the run."""
        return cast(F, self.folder.parent.parent)

    @property
    def items(self) -> F:
        return self._file("items.parquet")

    @property
    def model(self) -> F:
        return self._file("block.glb")

    @property
    def overview(self) -> F:
        """The small model of the block."""
        return self._file("overview.glb")

    @property
    def tiles(self) -> F:
        """The list of the block's tiles."""
        return cast(F, self._file("tiles") / "index.json")

    def tile(self, path: str) -> F:
        """The model of a tile, by the path of its cell."""
        return cast(F, self._file("tiles") / f"{path}.glb")

    @property
    def report(self) -> F:
        """The report's folder, in which index.html and images/ are."""
        return self._file("report")

    @property
    def summary(self) -> F:
        return self._file("summary.json")

    @property
    def masked(self) -> F:
        return self._file("masked.json")

    @property
    def stac(self) -> F:
        return self._file("stac")

    def page(self, number: int) -> F:
        """A page of the atlas, filled."""
        return cast(F, self._file("pages") / f"{number:04}.jpg")

    def _file(self, name: str) -> F:
        return cast(F, self.folder / name)

    @contextmanager
    def being_read(self) -> Iterator[Snapshot[F]]:
        """Keep the folder from being pruned, until the process ends, however it does; any number may."""
        if isinstance(self.folder, S3Folder):
            yield self
            return
        try:
            handle = os.open(self.folder, os.O_RDONLY)
        except OSError:  # whoever reads will say what is missing
            yield self
            return
        with suppress(OSError):  # it is being removed, or the file system knows no locks
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        try:
            yield self
        finally:
            os.close(handle)

    @contextmanager
    def alone(self) -> Iterator[bool]:
        """Whether nobody reads the folder, and nobody can as long as the block lasts. Who reads a bucket is not known there."""
        if isinstance(self.folder, S3Folder):
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

    def session(self) -> icechunk.Session:
        """The run's store as it was at this snapshot. Raises StoreError where it does not hold that."""
        import icechunk

        icechunk.set_logs_filter("off")  # it warns of writers at every opening
        store: Folder = self.out / "store"
        if isinstance(store, Path) and not store.is_dir():  # Icechunk would make it
            raise self.unreadable("there is none")
        try:
            if isinstance(store, S3Folder):
                repository = icechunk.Repository.open(store.icechunk_storage())
            else:
                repository = icechunk.Repository.open(icechunk.local_filesystem_storage(str(store)))
            return repository.readonly_session(snapshot_id=self.id)
        except (icechunk.IcechunkError, OSError, ValueError) as error:
            raise self.unreadable(error) from error

    def unreadable(self, error: object) -> StoreError:
        """What to say where the store cannot be read as it was at this snapshot."""
        why = " ".join(str(error).split())[:120]
        return StoreError(
            f"{self.out}: its store does not hold snapshot {self.id} as this version writes it ({why}); {self.remedy}"
        )

    @property
    def remedy(self) -> str:
        """What to do where the folder is damaged."""
        return publishes(self.out, "publishes again")

    def outcome(self) -> dict[str, Any]:
        """The summary, with the paths of the outputs: of models the whole one where there is one, else the small one."""
        model = self.overview if self.overview.is_file() and not self.model.is_file() else self.model
        return json.loads(self.summary.read_text()) | {
            "outputs": {
                "glb": [str(model)],
                "report": str(self.report / "index.html"),
                "items": str(self.items),
            },
        }


def snapshot_in(out: F, id: str) -> Snapshot[F]:
    """A snapshot of the run in folder `out`."""
    return Snapshot(cast(F, out / "published" / id))


def current(out: F) -> Snapshot[F]:
    """The snapshot that the run in folder `out` published last: `current` there names it. Raises InputError where it names none
    that is there."""
    snapshot = _named(out)
    if not snapshot.items.is_file():
        raise InputError(f"{snapshot.items} is missing; {snapshot.remedy}")
    return snapshot


def current_if_any(out: F) -> Snapshot[F] | None:
    """The same for who goes on without, also where what it holds is damaged."""
    try:
        snapshot = _named(out)
    except InputError:
        return None
    return snapshot if snapshot.summary.is_file() else None


def pointer_tag(out: Folder) -> str | None:
    """Which version of `current` a bucket holds; None on this machine, where the run's lock is enough, and where none is."""
    found = object_store.get(f"{out.path}/current") if isinstance(out, S3Folder) else None
    return found[1] if found else None


def make_current(snapshot: Snapshot, over: str | None = None) -> None:
    """Have `current` name a snapshot, in one step: a reader sees the one before or this one.

    over: in a bucket the version that it is written over, by `pointer_tag`. Raises MachineError where another is there.
    """
    if isinstance(snapshot.out, S3Folder):
        if object_store.put_if(f"{snapshot.out.path}/current", f"{snapshot.id}\n".encode(), over) is None:
            raise MachineError(f"{snapshot.out}: another run published meanwhile; let it end, and run again")
        return
    pointer = snapshot.out / ".current.tmp"
    pointer.write_text(snapshot.id + "\n")
    os.replace(pointer, snapshot.out / "current")


def _named(out: F) -> Snapshot[F]:
    pointer = out / "current"
    try:
        name = pointer.read_text(encoding="utf-8", errors="replace").strip()
    except OSError as error:
        raise InputError(f"{pointer} cannot be read: {error.strerror}; `streetloom run` writes it") from error
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise InputError(f"{pointer} does not hold a snapshot id; {publishes(out, 'publishes again')}")
    return snapshot_in(out, name)
