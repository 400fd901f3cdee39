"""Files of a snapshot that is being published: what one published before has of the same is linked, not made again."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from catalogs.published.file_list import Listed, digest_of, listed_in
from catalogs.published.folders import Folder, at


@dataclass
class Made:
    """The files that are put into the folder of a snapshot, and what each is made of.

    earlier: the folder of a snapshot whose files may be linked, or fetched where it is in a bucket, None where there is none;
    doubted: whether they are to be read and compared with their digests before that, as sizes do not show everything.
    of: path -> what a file is made of, as a digest: the same, the same bytes. linked: size and digest of those that are linked.
    """

    folder: Path
    earlier: Folder | None = None
    doubted: bool = False
    of: dict[str, str] = field(default_factory=dict)
    linked: dict[str, Listed] = field(default_factory=dict)
    _before: dict[str, Listed] = field(init=False)
    _made_of: dict[str, str] = field(init=False)

    def __post_init__(self) -> None:
        held = listed_in(self.earlier) if self.earlier else None
        self._before, self._made_of = (held["files"], held["made"]) if held else ({}, {})

    def put(self, path: str, of: str, data: Callable[[], bytes]) -> Path:
        """Put a file in the folder: that of the earlier snapshot where it is made `of` the same, else one with this data."""
        return self.put_written(path, of, lambda file: file.write_bytes(data()))

    def put_written(self, path: str, of: str, write: Callable[[Path], object]) -> Path:
        """The same for a file that is not in memory as a whole: `write` writes it."""
        target = self.folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        if not self._link(path, of, target):
            write(target)
        self.of[path] = of
        return target

    def _link(self, path: str, of: str, target: Path) -> bool:
        if self.earlier is None or self._made_of.get(path) != of or path not in self._before:
            return False
        source, (size, digest) = at(self.earlier, path), self._before[path]
        try:
            if not isinstance(source, Path):
                target.write_bytes(source.read_bytes())
                if target.stat().st_size != size or digest_of(target) != digest:
                    return False
                self.linked[path] = (size, digest)
                return True
            if source.stat().st_size != size or (self.doubted and digest_of(source) != digest):
                return False
            os.link(source, target)
        except OSError:  # it is gone, or the file system knows no links: then it is written
            return False
        self.linked[path] = (size, digest)
        return True
