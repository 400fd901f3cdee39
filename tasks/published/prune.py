"""Removes what older snapshots of a run left: published folders, tags, chunks that only they hold, and leftovers of kills."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from catalogs.published.files import note_changed, predecessor_of, tags_of
from catalogs.published.snapshot import Snapshot, current_if_any
from catalogs.stac.versions import forget_versions
from facade_core.atlas.check import is_whole
from facade_core.atlas.store import BRANCH, expire, open_repository, open_root
from facade_core.errors import FacadeError, InputError
from tasks.store.commits import standing_tags

# What a process that was killed leaves in a run's folder; nothing but a run, which the caller holds off, makes any.
LEFTOVERS = (
    "published/.*.tmp",
    ".current.tmp",
    ".catalog.json.*.tmp",
    ".seen-*",
    ".doctor-*.tmp",
    "store/refs/*/.ref.tmp",
)


def prune(out: Path, keep: int) -> list[str]:
    """Keep the `keep` newest published snapshots of the run in folder `out`, and what `current` names or a reader holds; lines
    that say what was removed and what is held. The caller holds the run's lock.

    Raises InputError where nothing is published, or the store is damaged: what it holds is not known then.
    """
    current = current_if_any(out)
    if current is None:
        raise InputError(f"{out}: nothing is published; `streetloom run BLOCK.yaml --out {out}` publishes")
    repository = open_repository(out / "store")
    if not is_whole(repository, out / "store"):
        raise InputError(f"{out / 'store'}: is damaged; `streetloom run BLOCK.yaml --out {out}` mends it first")
    said = []
    size = _size(out)
    leftovers = [path for pattern in LEFTOVERS for path in out.glob(pattern)]
    for path in leftovers:
        _remove(path)
    published = out / "published"
    gone, readers = 0, []
    for name in _newest_first(published, current.id)[keep:]:
        with Snapshot(published / name).alone() as nobody:
            if not nobody:
                readers.append(name)
                continue
            # in one step out of sight, then file by file
            os.replace(published / name, published / f".{name}.gone.tmp")
            _remove(published / f".{name}.gone.tmp")
            gone += 1
    for name, paths in forget_versions(published).items():
        note_changed(published / name, paths)
    kept = {tag for name in _newest_first(published, current.id) for tag in tags_of(published / name)}
    kept |= standing_tags(open_root(repository.readonly_session(BRANCH)))
    tags = sorted(set(repository.list_tags()) - kept)
    for tag in tags:
        repository.delete_tag(tag)
    expire(repository)
    freed = (size - _size(out)) / (1 << 20)
    said.append(
        f"{out}: removed {gone} published snapshots, {len(tags)} tags and {len(leftovers)} leftovers, {max(freed, 0):.1f} MB"
    )
    if readers:
        said.append(f"{out}: kept {', '.join(readers)}, which somebody reads")
    return said


def pruned(out: Path, keep: int) -> list[str]:
    """`prune` at the end of a run, which is none the worse where something could not be removed."""
    try:
        return prune(out, keep)
    except (FacadeError, OSError) as error:
        return [f"nothing more is pruned: {' '.join(str(error).split())}"]


def _newest_first(published: Path, current: str) -> list[str]:
    """The published snapshots, each before its predecessor, those that no other leads to last."""
    folders = {path.name: path for path in published.iterdir() if path.is_dir() and not path.name.startswith(".")}
    order = [current]
    while (before := predecessor_of(published / order[-1])) in folders and before not in order:
        order.append(str(before))
    return order + sorted(folders.keys() - set(order), key=lambda name: -folders[name].stat().st_mtime)


def _size(out: Path) -> int:
    """What a run's folder takes; a file that several snapshots have is there once."""
    found = (entry.stat() for folder in ("store", "published") for entry in _files(out / folder))
    return sum({(one.st_dev, one.st_ino): one.st_size for one in found}.values())


def _files(folder: Path) -> Iterator[os.DirEntry[str]]:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                yield from _files(Path(entry.path))
            else:
                yield entry


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
