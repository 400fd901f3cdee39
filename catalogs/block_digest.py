"""Digests of what determines a block's result: of everything, and of single files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.block_keys import BlockKeys
from catalogs.buildings import Buildings

if TYPE_CHECKING:
    from pyproj import CRS

    from catalogs.readers.panoramas import PosedPanorama


# Keys that name single files, the pictures of facades aside.
FILES = ("buildings.path", "streets.path", "terrain.path", "imagery.aerial.path", "texture.roof_material.path")


def block_digest(
    keys: BlockKeys,
    crs: CRS,
    files: Mapping[str, tuple[Path, ...]],
    built: Buildings,
    exemplars: Iterable[Path],
    photos: Mapping[str, Path],
    panoramas: Iterable[PosedPanorama],
) -> str:
    """The sha256 of settings and contents of files: not of their places or dates."""
    settings = {
        "name": keys.name,
        "crs": crs.to_string(),
        "area": keys.area,
        "buildings": keys.buildings.model_dump(exclude={"path"}),
        "streets": keys.streets and [keys.streets.crs, sorted(keys.streets.names or [])],
        "texture": asdict(replace(keys.texture, roof_material=None)),
        "roof_material": keys.texture.roof_material and keys.texture.roof_material.metres_per_pixel,
        "aerial": keys.imagery.aerial and keys.imagery.aerial.crs,
        "storey": keys.storey,
        "geoid_separation": keys.geoid_separation,
        "seed": keys.seed,
        "geometry": [[key, *map(file_digest, files.get(key, ()))] for key in FILES],
        "rectified": keys.imagery.photos is None or keys.imagery.photos.rectified,
        "images": [
            [(path.name, file_digest(path)) for path in folder]
            for folder in (exemplars, photos.values(), built.textures)
        ],
        "panoramas": [(p.id, asdict(p.pose), file_digest(p.path)) for p in panoramas],
    }
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()


def file_digest(path: Path) -> str:
    """The sha256 of a file's content; read once as long as its size and date stay."""
    state = path.stat()
    return _content_digest(path, state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=65536)
def _content_digest(path: Path, size: int, modified: int) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
