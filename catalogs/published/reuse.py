"""Reuse of an earlier snapshot's files: equal inputs are linked instead of written again."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from catalogs.published.file_list import SizeAndDigest, file_content_digest, read_file_list
from catalogs.published.folders import Folder, join_path


@dataclass
class SnapshotFileWriter:
    """Writer of the files of a snapshot that is being published; files with unchanged inputs are linked.

    A file is linked only if its digest is that of the list: a damaged one is written again.

    Attributes
    ----------
    folder : folder of the snapshot.
    earlier : folder of a snapshot to link from, or to copy from in a bucket; None if there is none.
    source_digests : path -> digest of the inputs of a file; equal digests mean equal bytes.
    linked : path -> size and digest of files that were linked.
    """

    folder: Path
    earlier: Folder | None = None
    source_digests: dict[str, str] = field(default_factory=dict)
    linked: dict[str, SizeAndDigest] = field(default_factory=dict)
    _earlier_files: dict[str, SizeAndDigest] = field(init=False)
    _earlier_digests: dict[str, str] = field(init=False)

    def __post_init__(self) -> None:
        content = read_file_list(self.earlier) if self.earlier else None
        self._earlier_files, self._earlier_digests = (content["files"], content["made"]) if content else ({}, {})

    def add_file(self, path: str, source_digest: str, data: Callable[[], bytes]) -> Path:
        """Add a file: link the earlier one if its inputs are the same, otherwise write `data()`."""
        return self.add_file_with_writer(path, source_digest, lambda file: file.write_bytes(data()))

    def add_file_with_writer(self, path: str, source_digest: str, write: Callable[[Path], object]) -> Path:
        """Add a file like `add_file`, written by `write` instead of from memory."""
        target = self.folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        if not self._link(path, source_digest, target):
            write(target)
        self.source_digests[path] = source_digest
        return target

    def _link(self, path: str, source_digest: str, target: Path) -> bool:
        if self.earlier is None or self._earlier_digests.get(path) != source_digest or path not in self._earlier_files:
            return False
        source, (size, digest) = join_path(self.earlier, path), self._earlier_files[path]
        try:
            if isinstance(source, Path):
                is_equal = file_content_digest(source) == digest
                if is_equal:
                    os.link(source, target)
            else:
                target.write_bytes(source.read_bytes())
                is_equal = file_content_digest(target) == digest
        except OSError:  # missing, or no support for links: the file is written instead
            return False
        if is_equal:
            self.linked[path] = (size, digest)
        return is_equal
