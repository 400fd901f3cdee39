"""Parts of a city's export: where each block's files go, in a folder that a killed export leaves behind.

A part has a folder that stays in the export, a folder of pieces that are joined and removed, or both. Its marker is
written last, so that a part with a marker is finished.
"""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from catalogs.features import safe_file_stem
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from tasks.export.targets import REPLACED, find_changed_file, read_marker

# Folder of the blocks in the export, and of the pieces until they are joined.
BLOCKS_FOLDER = "blocks"
PIECES_FOLDER = ".pieces"


@dataclass(frozen=True)
class CityFacts:
    """What the parts of a city share.

    Attributes
    ----------
    name : name of the city.
    crs : coordinate reference system of all blocks.
    origin : (3,) origin of coordinates, world metres; that of the first block.
    has_unique_ids : the blocks are cut from one city, in which ids are unique.
    """

    name: str
    crs: str
    origin: Float64Array
    has_unique_ids: bool

    @property
    def stem(self) -> str:
        """Return the city's name as the stem of a file."""
        return safe_file_stem(self.name)


@dataclass(frozen=True)
class Part:
    """Part of a city's export.

    Attributes
    ----------
    block : name of the block in the city.
    stem : name of its folder.
    folder : its files in the export.
    pieces : its pieces.
    """

    block: str
    stem: str
    folder: Path
    pieces: Path

    @property
    def uri(self) -> str:
        """Return the path of the folder in the finished export."""
        return f"{BLOCKS_FOLDER}/{self.stem}"


class _ChangedError(Exception):
    """A file of a copied export is another than its marker states."""


@dataclass(frozen=True)
class Staging:
    """Folder in which an export of a city is made.

    Attributes
    ----------
    root : the folder, which becomes the export.
    keeps_folders : the format has a folder for each block.
    """

    root: Path
    keeps_folders: bool

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Create and lock the folder until the context ends.

        Raises
        ------
        InputError : another export to the same place is running.
        """
        self.root.mkdir(parents=True, exist_ok=True)
        handle = os.open(self.root, os.O_RDONLY)
        try:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise InputError(
                    f"{self.root}: another export to this place is running; wait for it, or name another with --to"
                ) from error
            shutil.rmtree(self.root.with_name(f"{self.root.name}{REPLACED}"), ignore_errors=True)  # of a killed export
            yield
        finally:
            os.close(handle)

    def part(self, block: str) -> Part:
        """Return the part of a block."""
        stem = safe_file_stem(block)
        return Part(block, stem, self.root / BLOCKS_FOLDER / stem, self.root / PIECES_FOLDER / stem)

    def read_part_marker(self, part: Part) -> JsonObject:
        """Read the marker of a finished part; empty if it is not finished."""
        if not part.pieces.is_dir():
            return {}
        return read_marker(self.marked_folder(part)) or {}

    @contextmanager
    def write_part(self, part: Part) -> Iterator[Part]:
        """Yield empty folders to write a part into; afterwards they become the part, in place of an older one."""
        shutil.rmtree(part.folder, ignore_errors=True)
        shutil.rmtree(part.pieces, ignore_errors=True)
        temporary = replace(part, folder=_temporary(part.folder), pieces=_temporary(part.pieces))
        for folder in (temporary.folder, temporary.pieces):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
        yield temporary
        if self.keeps_folders:
            os.replace(temporary.folder, part.folder)
        else:
            shutil.rmtree(temporary.folder)
        os.replace(temporary.pieces, part.pieces)

    def copy_part(self, part: Part, source: Path, key: str) -> bool:
        """Copy an unchanged export of a block with the same key as a part; return whether there is one."""
        about = read_marker(source)
        if about is None or about.get("key") != key:
            return False
        with suppress(_ChangedError), self.write_part(part) as temporary:
            shutil.copytree(source, temporary.folder, dirs_exist_ok=True)
            if find_changed_file(temporary.folder, about) is not None:
                raise _ChangedError
        return part.pieces.is_dir()

    def remove_other_parts(self, parts: Sequence[Part]) -> None:
        """Remove the folders of blocks that take no part any more, and what a killed export left."""
        known = {part.stem for part in parts}
        for folder in (self.root / BLOCKS_FOLDER, self.root / PIECES_FOLDER):
            for one in list(folder.iterdir()) if folder.is_dir() else ():
                if one.name not in known:
                    shutil.rmtree(one)

    def finish(self) -> None:
        """Remove the pieces, and the folder of blocks if the format has none."""
        shutil.rmtree(self.root / PIECES_FOLDER, ignore_errors=True)
        if not self.keeps_folders:
            shutil.rmtree(self.root / BLOCKS_FOLDER, ignore_errors=True)

    def marked_folder(self, part: Part) -> Path:
        """Return the folder of a part that has the marker."""
        return part.folder if self.keeps_folders else part.pieces


def _temporary(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.tmp")
