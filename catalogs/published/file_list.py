"""List of the files of a published snapshot with size and digest, to detect damage."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias, TypedDict

from catalogs.published.folders import Folder, file_sizes, join_path, write_atomically

FILE_LIST_NAME = "files.json"
# Files compared by content at every check; others are compared by size.
HASHED_FILES = ("items.parquet", "summary.json")

# Size of a file in bytes, and its digest.
SizeAndDigest: TypeAlias = tuple[int, str]


class FileList(TypedDict):
    """Content of the list.

    Attributes
    ----------
    predecessor : snapshot that was published before.
    files : path -> size and digest.
    made : path -> digest of what a file is made from.
    failed : what could not be published -> why.
    """

    predecessor: str | None
    files: dict[str, SizeAndDigest]
    made: dict[str, str]
    failed: dict[str, str]


def write_file_list(
    folder: Path,
    predecessor: str | None,
    *,
    source_digests: Mapping[str, str] | None = None,
    known: Mapping[str, SizeAndDigest] | None = None,
    failures: Mapping[str, str] | None = None,
) -> None:
    """Write the list of the files of a complete snapshot.

    Parameters
    ----------
    predecessor : snapshot that was published before.
    source_digests : path -> digest of what a file is made from, so that a later snapshot may link it.
    known : path -> size and digest of files that need not be read.
    failures : what could not be published -> why.
    """
    paths = {path.relative_to(folder).as_posix(): path for path in sorted(folder.rglob("*")) if path.is_file()}
    listed = {
        name: (known or {}).get(name) or (path.stat().st_size, file_content_digest(path))
        for name, path in paths.items()
    }
    content: FileList = {
        "predecessor": predecessor,
        "files": listed,
        "made": dict(source_digests or {}),
        "failed": dict(failures or {}),
    }
    _write_json(folder, content)


def find_snapshot_damage(folder: Folder, *, thorough: bool = False) -> str | None:
    """Return the first damage of a published folder, such as "block.glb is missing", or None.

    Only the current snapshot is unchanged; older ones are marked as superseded.

    Parameters
    ----------
    thorough : whether to compare every file's digest, not only those in HASHED_FILES.
    """
    content = read_file_list(folder)
    if content is None:
        return f"{FILE_LIST_NAME} is missing or cannot be read"
    for what, why in content["failed"].items():
        return f"{what} could not be published: {why}"
    sizes = file_sizes(folder)
    for name, (size, digest) in content["files"].items():
        if name not in sizes:
            return f"{name} is missing"
        if sizes[name] != size:
            return f"{name} has {sizes[name]} bytes of {size}"
        try:
            if (thorough or name in HASHED_FILES) and file_content_digest(join_path(folder, name)) != digest:
                return f"{name} is not as it was written"
        except OSError as error:
            return f"{name}: {error.strerror}"
    return None


def has_other_content(path: Folder) -> bool:
    """Return whether a file's digest differs from that in the list of its folder; False if the list lacks it.

    False in a bucket, whose service compares digests itself. Most damage of a Parquet file gives other values, no error.
    """
    content = read_file_list(path.parent) if isinstance(path, Path) else None
    listed = content["files"].get(path.name) if content else None
    return listed is not None and file_content_digest(path) != listed[1]


def replace_files(folder: Folder, contents: Mapping[str, bytes]) -> None:
    """Replace files of a published folder, by path. The list comes first: repeated after a kill, both agree."""
    if (content := read_file_list(folder)) is not None:
        digests = {name: (len(data), _content_digest(data).hexdigest()) for name, data in contents.items()}
        content["files"].update(digests)
        _write_json(folder, content)
    for name, data in contents.items():
        write_atomically(join_path(folder, name), data)


def read_predecessor(folder: Folder) -> str | None:
    """Return the id of the snapshot that was published before, or None if unknown."""
    content = read_file_list(folder)
    return content["predecessor"] if content else None


def read_file_list(folder: Folder) -> FileList | None:
    """Read the list of a published folder; None if it cannot be read."""
    try:
        content = json.loads((folder / FILE_LIST_NAME).read_text())
        return {
            "predecessor": content["predecessor"],
            "files": {str(name): (int(size), str(digest)) for name, (size, digest) in content["files"].items()},
            "made": {str(name): str(digest) for name, digest in content["made"].items()},
            "failed": {str(what): str(why) for what, why in content["failed"].items()},
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _write_json(folder: Folder, content: FileList) -> None:
    write_atomically(folder / FILE_LIST_NAME, json.dumps(content, indent=1).encode())


def file_content_digest(path: Folder) -> str:
    """Return the hexadecimal digest of a file's bytes."""
    if not isinstance(path, Path):
        return _content_digest(path.read_bytes()).hexdigest()
    with path.open("rb") as file:
        return hashlib.file_digest(file, _content_digest).hexdigest()


def _content_digest(data: bytes = b"") -> hashlib.blake2b:
    return hashlib.blake2b(data, digest_size=8)
