"""Search for a raster of the ground among the files of a map."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from catalogs.block.geometry import buildings_extent_with_margin
from catalogs.block.reader import Block
from catalogs.block.terrain_checks import note_terrain_doubts
from catalogs.readers.pictures.elevation import read_elevation
from facade_core.core.errors import InputError

# Suffixes of rasters of heights; pictures have others too.
_SUFFIXES = frozenset((".tif", ".tiff", ".asc", ".img", ".jp2", ".dt0", ".dt1", ".dt2", ".hgt", ".vrt"))


def find_terrain(folders: Iterable[Path], block: Block) -> Path | None:
    """Find the raster in some folders that has the ground of a block, without roofs: of several, the finest.

    Pictures, rasters of other places and all that `note_terrain_doubts` doubts are left out.
    """
    extent = buildings_extent_with_margin(block.buildings)
    found = []
    for path in sorted({path for folder in folders for path in folder.iterdir() if path.suffix.lower() in _SUFFIXES}):
        with suppress(InputError, OSError):
            terrain = read_elevation(path, block.crs, extent)
            if not note_terrain_doubts(terrain, block.buildings, path.name):
                found.append((terrain.step, path.name, path))
    return min(found)[2] if found else None
